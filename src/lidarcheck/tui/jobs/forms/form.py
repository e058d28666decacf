"""A form: fields with values, and the plan that these values make. Knows no terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from lidarcheck.errors import LidarcheckError, UsageError
from lidarcheck.session.project import Project
from lidarcheck.session.runs import Plan, line_of
from lidarcheck.tui.jobs.commands import permitted_options

__all__ = ["CommandForm", "Field", "Values", "as_argument", "chosen", "option", "text_of"]

Values = Mapping[str, tuple[str, ...]]
"""The values of a form's fields; of a field that takes one value a tuple of it."""


@dataclass(frozen=True)
class Field:
    """`options`: what it can be, empty where any text is taken; `several`: any number of them; `about`: its meaning."""

    name: str
    label: str
    options: tuple[str, ...] = ()
    several: bool = False
    about: str = ""


@dataclass
class CommandForm:
    """`make`: the plan for values and a directory for results, or an error that says what is missing; `reads`: the
    files that the command reads from the disk, so that edits of these, and of the tables that a model among them names,
    must be saved first; `copied`: those that it is handed with their edits.
    """

    title: str
    fields: Sequence[Field]
    values: dict[str, tuple[str, ...]]
    make: Callable[[Values, str], Plan]
    reads: Callable[[Values], Sequence[Path]] = field(default=lambda _values: ())
    copied: Sequence[Path] = ()

    def plan(self, directory: str) -> Plan:
        """What the values make, with what this process is permitted; `UsageError` where they make nothing."""
        plan, more = self.make(self.values, directory), tuple(permitted_options())
        return replace(plan, steps=tuple((*step, *more) for step in plan.steps))

    def line(self, directory: str) -> tuple[str, bool]:
        """(the command, or what is missing; whether it is a command)."""
        try:
            return line_of(self.plan(directory).steps), True
        except LidarcheckError as error:
            return error.lines()[0].removeprefix("error: "), False


def text_of(values: Values, name: str) -> str:
    """The value of a field that takes one; empty where it has none."""
    return next(iter(values.get(name, ())), "")


def chosen(values: Values, name: str, label: str) -> tuple[str, ...]:
    """The values of a field that must have some."""
    found = tuple(value for value in values.get(name, ()) if value)
    if not found:
        raise UsageError(f"{label} is not chosen", fix="choose it above")
    return found


def option(name: str, value: str) -> tuple[str, ...]:
    """An option with its value; nothing without one."""
    return (name, value) if value else ()


def as_argument(path: Path | str, project: Project) -> str:
    """A file as a command in the project's directory is given it."""
    text = str(path)
    if Path(text).is_absolute() and Path(text).is_relative_to(project.root.absolute()):
        text = Path(text).relative_to(project.root.absolute()).as_posix()
    elif Path(text).is_relative_to(project.root):
        text = Path(text).relative_to(project.root).as_posix()
    return f"./{text}" if text.startswith("-") else text
