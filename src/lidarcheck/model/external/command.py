"""The command of somebody else's model: what its arguments may name in braces, and what these stand for."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from lidarcheck.config.words import nearest, printable
from lidarcheck.errors import UsageError

__all__ = ["PLACEHOLDERS", "check_command", "filled", "names_in"]

PLACEHOLDERS = ("ideal", "ini", "scan", "seed", "frame")
"""What a command may name in braces, besides its own parameters; `{{` and `}}` stand for the braces themselves."""

_BRACES = re.compile(r"\{\{|\}\}|\{(?P<name>[^{}]*)\}|[{}]")


def check_command(
    command: Sequence[str], parameters: Collection[str] = (), *, server: bool = False
) -> list[tuple[int | None, UsageError]]:
    """The faults of a command's placeholders, each with the argument's index, None for the whole command.

    `parameters`: names of numbers of its own that may stand in braces too. A server's command has no placeholders.
    """
    faults: list[tuple[int | None, UsageError]] = []
    known = () if server else (*PLACEHOLDERS, *parameters)
    for index, argument in enumerate(command):
        for match in _BRACES.finditer(argument):
            name = match["name"]
            if name is None and match.group() in "{}":
                faults.append((index, UsageError(f"a single brace in {argument!r}", fix="write {{ or }} for a brace")))
            elif name is not None and name not in known:
                faults.append((index, _unknown(name, known)))
        if "\0" in argument or (index == 0 and not argument.strip()):
            faults.append((index, UsageError(f"{argument!r} cannot be run", fix="name a program")))
    if not faults and not server and "scan" not in names_in(command):
        faults.append((None, UsageError("command has no {scan}", fix="add {scan}, the file that it must write")))
    return faults


def names_in(command: Sequence[str]) -> frozenset[str]:
    """What a command names in braces."""
    return frozenset(m["name"] for argument in command for m in _BRACES.finditer(argument) if m["name"] is not None)


def filled(argument: str, values: Mapping[str, object]) -> str:
    """An argument with values in the places of their names."""

    def replacement(match: re.Match[str]) -> str:
        return match.group()[0] if match["name"] is None else str(values[match["name"]])

    return _BRACES.sub(replacement, argument)


def _unknown(name: str, names: Sequence[str]) -> UsageError:
    if not names:
        fix = "take it out: each request names its files, seed and frame; write {{ for a brace"
        return UsageError(f"{{{printable(name)}}} in the command of a server", fix=fix)
    near = nearest(name, names)
    known = ", ".join(f"{{{one}}}" for one in names)
    fix = f"did you mean {{{near}}}?" if near else f"placeholders are {known}; write {{{{ for a brace"
    return UsageError(f"unknown placeholder {{{printable(name)}}}", fix=fix)
