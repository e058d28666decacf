"""What goes to somebody else's model and comes back, through files: an ideal scan, settings, echoes."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lidarcheck.errors import ExternalModelError, LidarcheckError, UsageError
from lidarcheck.formats.table import Table
from lidarcheck.model.external.process import failure
from lidarcheck.model.spec import External
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["ALWAYS_SENT", "Request", "Run", "echoes_in", "placed", "sent"]

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


def placed(request: Request, external: External, directory: Path, named: Collection[str], number: int = 0) -> Run:
    """Write what the model is given; `named`: which parameters it gets by the command or the request itself.

    `InputError` for an ideal scan that no file may hold, `ExternalModelError` where there is no room.
    """
    from lidarcheck.formats.text import as_text

    run = Run(*(directory / f"{word}{number or ''}.{suffix}" for word, suffix in _FILES))
    settings = _settings(request, external, {k: v for k, v in request.parameters.items() if k not in named})
    try:
        run.ideal.write_bytes(as_text(sent(request), run.ideal))
        if settings is not None:
            run.ini.write_text(settings, encoding="utf-8")
    except OSError as error:
        what = f"cannot be given its ideal scan: {error.strerror or error}"
        raise failure(what, external, "", "free some space, or set TMPDIR") from error
    return run if settings is not None or external.ini is None else Run(run.ideal, external.ini, run.scan)


_FILES = (("ideal", "txt"), ("settings", "ini"), ("scan", "txt"))


def _settings(request: Request, external: External, parameters: Mapping[str, float]) -> str | None:
    """The text of the settings file; None for the model's own as it is."""
    if external.ini is None:
        own = "".join(f"{name} = {value!r}\n" for name, value in parameters.items())
        return f"PostPro.Seed = {request.seed}\n{own}"
    if not parameters:
        return None
    try:
        text = external.ini.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise failure(f"has settings that cannot be read: {error}", external, "", f"look at {external.ini}") from error
    for name, value in parameters.items():
        key = rf"(?mi)^([ \t]*{re.escape(name)}[ \t]*=[ \t]*)[^\r\n;#]*"
        text, found = re.subn(key, rf"\g<1>{float(value)!r}", text)
        if not found:
            fix = f"write {name} = NUMBER there, or {{{name}}} in the command"
            raise UsageError(f"the parameter {name} is no key of {external.ini}", fix=fix)
    return text


def echoes_in(run: Run, external: External, sensor: Sensor | None, said: str) -> Scan:
    """The echoes that the model wrote; `said`: its last words. `ExternalModelError` where there are none to read."""
    from lidarcheck.formats import load_scan

    if not run.scan.is_file() or run.scan.stat().st_size == 0:
        what = "wrote an empty scan" if run.scan.exists() else "wrote no scan"
        raise failure(what, external, said, "let it write its echoes to {scan}")
    try:
        return load_scan(run.scan, sensor=sensor)
    except LidarcheckError as error:
        raise _malformed(error, external, said) from error


def _malformed(error: LidarcheckError, external: External, said: str) -> ExternalModelError:
    where = f" at line {error.line}" if error.line else ""
    return failure(f"wrote a malformed scan: {error.what}{where}", external, said, error.fix)
