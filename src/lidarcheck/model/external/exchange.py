"""What goes to somebody else's model and comes back, through files: an ideal scan, settings, echoes."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lidarcheck.errors import UsageError
from lidarcheck.formats.table import Table
from lidarcheck.model.external.process import failure
from lidarcheck.model.spec import External
from lidarcheck.scan import IdealScan

__all__ = ["ALWAYS_SENT", "Request", "Run", "sent", "write_ideal", "write_settings"]

ALWAYS_SENT = ("Layer", "Point", "Distance", "MaterialID", "IncidenceAngle")
"""The columns of an ideal scan that every external model gets."""


@dataclass(frozen=True)
class Request:
    """One run of an external model: an ideal scan, a seed, a frame, and values of the model's own parameters.

    `columns`: which of the ideal scan's columns are sent beyond `ALWAYS_SENT`, by their names in files.
    """

    ideal: IdealScan
    seed: int = 0
    frame: int = 0
    parameters: Mapping[str, float] = field(default_factory=dict)
    columns: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Run:
    """The files of a run."""

    ideal: Path
    ini: Path
    scan: Path


def sent(request: Request) -> Table:
    """The ideal scan's columns as the model gets them, in the order of files."""
    from lidarcheck.formats.ideals import table_from_ideal

    table = table_from_ideal(request.ideal)
    names = (*ALWAYS_SENT, *request.columns)
    return Table({name: column for name, column in table.columns.items() if name in names})


def write_ideal(request: Request, path: Path, external: External) -> None:
    """Write the ideal scan as the model gets it.

    `InputError` for one that no file may hold, `ExternalModelError` where there is no room.
    """
    from lidarcheck.formats.text import as_text

    with _room_for(external):
        path.write_bytes(as_text(sent(request), path))


def write_settings(request: Request, path: Path, external: External, named: Collection[str]) -> Path:
    """The settings file of a run: the model's own where nothing in it is to be another, else one that is written.

    `named`: which parameters the model gets by its command or the request itself; the others are keys of the settings,
    and `UsageError` is raised for one that the model's own settings lack.
    """
    parameters = {name: value for name, value in request.parameters.items() if name not in named}
    if external.ini is not None and not parameters:
        return external.ini
    if external.ini is None:
        own = "".join(f"{name} = {value!r}\n" for name, value in parameters.items())
        text = f"PostPro.Seed = {request.seed}\n{own}"
    else:
        text = _edited(external.ini, parameters, external)
    with _room_for(external):
        path.write_text(text, encoding="utf-8")
    return path


@contextlib.contextmanager
def _room_for(external: External) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        what = f"cannot be given its ideal scan: {error.strerror or error}"
        raise failure(what, external, "", "free some space, or set TMPDIR") from error


def _edited(ini: Path, parameters: Mapping[str, float], external: External) -> str:
    """The text of the model's own settings with other values."""
    try:
        text = ini.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise failure(f"has settings that cannot be read: {error}", external, "", f"look at {ini}") from error
    for name, value in parameters.items():
        key = rf"(?mi)^([ \t]*{re.escape(name)}[ \t]*=[ \t]*)[^\r\n;#]*"
        text, found = re.subn(key, rf"\g<1>{float(value)!r}", text)
        if not found:
            fix = f"write {name} = NUMBER there, or {{{name}}} in the command"
            raise UsageError(f"the parameter {name} is no key of {ini}", fix=fix)
    return text
