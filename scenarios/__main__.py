"""`python -m scenarios` is `leakloc`."""

from scenarios.cli import main

main(prog_name="leakloc")
