"""`lidarcheck sensor from`: a sensor file from a vendor's calibration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import Quiet
from lidarcheck.cli.core.outputs import as_it_was, write_result
from lidarcheck.cli.core.terminal import emit, hush, note
from lidarcheck.cli.sensor.options import check_new, check_out, positive
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lidarcheck.formats.sensors import Imported

__all__ = ["from_"]


def from_(
    file: Annotated[Path, Parameter(help="The vendor's calibration file.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="The sensor file to write, TOML; printed without it.")] = None,
    rate: Annotated[
        float | None, Parameter(converter=positive, help="Frames a second [Hz], where the file does not say it.")
    ] = None,
    azimuth_step: Annotated[
        float | None, Parameter(converter=positive, help="From a column to the next [deg], where the file lacks it.")
    ] = None,
    model: Annotated[
        str | None, Parameter(help="The sensor's model, or which of several sensors in the file is meant.")
    ] = None,
    firetimes: Annotated[Path | None, Parameter(help="The fire-time CSV beside a Hesai angle CSV.")] = None,
    state: Annotated[
        str | None, Parameter(help="Which state of the fire times, as its header names it: even, loop0, or 0,1.")
    ] = None,
    pattern: Annotated[
        Path | None,
        Parameter(help="A table of Layer, Point, elevation_deg, azimuth_deg for a HELIOS++ scanner without channels."),
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Make a sensor file from a vendor's calibration."""
    hush(quiet)
    from lidarcheck.formats.sensors import Given, document_text, import_sensor, sensor_of_import

    if out is not None:
        check_out(out, (file, firetimes, pattern))
    imported = import_sensor(file, Given(model, rate, azimuth_step, firetimes, state, pattern))
    sensor_of_import(imported, file)
    if out is None:
        if imported.table:
            raise UsageError("the beams of this sensor are a table", fix="give --out SENSOR.toml; it is written beside")
        emit(document_text(imported))
    else:
        _write(imported, out, (file, firetimes, pattern))
    _note_lacking(imported, file)
    return 0


def _note_lacking(imported: Imported, file: Path) -> None:
    needed = [entry.key for entry in imported.lacking if entry.needed]
    others = [entry.key for entry in imported.lacking if not entry.needed]
    if needed:
        note(f"{file.name} does not say {' and '.join(needed)}: write it before the sensor file is used")
    if others:
        note(f"{file.name} does not say {', '.join(others)}: see the lines behind a hash")


def _write(imported: Imported, out: Path, inputs: Sequence[Path | None]) -> None:
    """The sensor file, and its table of beams beside it; both or none."""
    from lidarcheck.formats.sensors import document_text, table_text

    table = out.with_name(f"{out.stem}_beams.csv")
    if not imported.table:
        write_result(out, document_text(imported))
        note(f"{out}: written")
        return
    check_new(table, inputs)
    with as_it_was([table, out]):
        write_result(table, table_text(imported))
        write_result(out, document_text(imported, table_file=table.name))
    note(f"{out}: written, its beams in {table.name}")
