"""The command line: one file a command, thin."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line, `sys.argv` by default, and return its exit code; see `lidarcheck.cli.core.entry`."""
    try:
        from lidarcheck.cli.core import entry
    except KeyboardInterrupt:  # an impatient one, while the interpreter is still loading
        return 130
    return entry.main(argv)
