"""What can go wrong, and how it is said.

Every error a user can cause is a `LidarcheckError`; the command line prints `line()` and exits with `exit_code`.

- `UsageError`: the command's arguments do not fit together.
- `InputError`: a file is not what it should be. Carries the file and, where there is one, the line.
- `NotThereError`: a file is sound, and what is looked for is not in it.
- `ConfigError`: a TOML, INI or JSON configuration has wrong keys or values; holds all of them, a line each.
- `ExternalModelError`: somebody else's sensor model failed, timed out or wrote nothing usable.
- `GoldenError`: a golden file is damaged, edited by hand or belongs to another scenario.
- `WorkerError`: a process or a cluster that shares the work cannot be used, or was lost.

A programming mistake is not one of these and keeps its traceback. A KPI that fell out is not an error but a verdict:
`lidarcheck check` then exits with 1. All errors here exit with 2, "could not run".
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any

from lidarcheck.printable import printable

__all__ = [
    "ConfigError",
    "ExternalModelError",
    "GoldenError",
    "InputError",
    "LidarcheckError",
    "NotThereError",
    "UsageError",
    "WorkerError",
]


class LidarcheckError(Exception):
    """What is wrong, where, and what to do about it.

    `what`: the fault, in plain words, with the value that was found and the allowed range.
    `file`, `line`: where it stands, the line counted from 1.
    `fix`: what the user can do. All parts are single lines.
    """

    exit_code = 2

    def __init__(
        self, what: str, *, file: str | PathLike[str] | None = None, line: int | None = None, fix: str = ""
    ) -> None:
        super().__init__(what)
        self.what = what
        self.file = None if file is None else str(file)
        self.line = line
        self.fix = fix

    def __reduce__(self) -> tuple[Any, ...]:
        # Errors cross process borders; arguments by keyword would be lost on the way.
        return _rebuilt, (type(self), self.what, self.file, self.line, self.fix)

    def lines(self) -> list[str]:
        """One `error: FILE:LINE: what is wrong; what to do` per fault."""
        where = "" if self.file is None else self.file
        if where and self.line is not None:
            where = f"{where}:{self.line}"
        text = f"error: {where}: {self.what}" if where else f"error: {self.what}"
        if self.fix:
            text = f"{text}; {self.fix}"
        return [printable(" ".join(text.splitlines()))]

    def __str__(self) -> str:
        return "\n".join(self.lines())


def _rebuilt(kind: type[LidarcheckError], what: str, file: str | None, line: int | None, fix: str) -> LidarcheckError:
    return kind(what, file=file, line=line, fix=fix)


class UsageError(LidarcheckError):
    """The arguments of a call or a command do not fit together."""


class InputError(LidarcheckError):
    """A file is missing, damaged or not what it should be."""


class NotThereError(InputError):
    """A file is sound, and what is looked for is not in it: nothing has failed."""


class ConfigError(LidarcheckError):
    """A configuration file has faults; all of them at once, one `InputError` each."""

    def __init__(self, faults: Sequence[InputError]) -> None:
        first = faults[0]
        super().__init__(first.what, file=first.file, line=first.line, fix=first.fix)
        self.faults = tuple(faults)

    def __reduce__(self) -> tuple[type[ConfigError], tuple[tuple[InputError, ...]]]:
        return type(self), (self.faults,)

    def lines(self) -> list[str]:
        """The faults in the order of the file."""
        return [text for fault in self.faults for text in fault.lines()]


class ExternalModelError(LidarcheckError):
    """An external sensor model failed, timed out or wrote nothing usable."""


class GoldenError(LidarcheckError):
    """A golden is damaged, was edited by hand or belongs to another scenario."""


class WorkerError(LidarcheckError):
    """A process or a cluster that shares the work cannot be used, or was lost."""
