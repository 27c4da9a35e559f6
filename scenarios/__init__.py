"""The harness: scenario files, campaigns, scoring and the command line; the only package that knows the other three."""
