"""The command line: one file a command, thin."""

from lidarcheck.cli.entry import main

__all__ = ["main"]
