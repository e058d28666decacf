"""What the parser and the help know of a command before its code is loaded."""

from __future__ import annotations

from contextvars import ContextVar
from keyword import iskeyword
from typing import NamedTuple

__all__ = ["ARGUMENTS", "Command"]

ARGUMENTS: ContextVar[tuple[str, ...]] = ContextVar("arguments", default=())
"""What the command line that is running was given; empty where the code is used without one."""


class Command(NamedTuple):
    """A command as `--help` shows it, of one word, or of a group's name and a verb as in `lut show`.

    `module`: the file below `lidarcheck.cli` that has its function, as `scans.info`.
    """

    name: str
    module: str
    arguments: str
    summary: str
    more: str
    examples: tuple[str, ...]

    @property
    def group(self) -> str:
        """The group that the command is in; empty for one of a single word."""
        return self.name.rpartition(" ")[0]

    @property
    def verb(self) -> str:
        """The last word."""
        return self.name.rpartition(" ")[2]

    @property
    def code(self) -> str:
        """Where its function is: `lidarcheck.cli.scans.info:info`, `lidarcheck.cli.sensor.from_:from_`; of a verb with
        hyphens with underscores."""
        name = f"{self.verb}_" if iskeyword(self.verb) else self.verb.replace("-", "_")
        return f"lidarcheck.cli.{self.module}:{name}"
