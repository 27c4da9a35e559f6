"""Where the leaks are: estimators that see frames and a believed rig, never the scene or the truth."""
