"""A scan's columns in a file: what they say of each beam, and what stands in for those that the file lacks."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.beams import Fired
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.columns import (
    INT32_MAX,
    LENGTH_MAX_M,
    extra_columns,
    found_columns,
    missing,
    real_column,
    whole_column,
)
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.geometry.reader import checked_geometry
from lidarcheck.formats.own_directions import beams_of_echoes
from lidarcheck.formats.return_kinds import RETURN_KINDS, kinds_by_range, livox_numbers, return_kinds
from lidarcheck.formats.returns import Beams, Numbering, fired_of, no_returns, numbered
from lidarcheck.formats.sensor_columns import (
    features_of,
    histogram_feature,
    histogram_names,
    histograms_of,
    numbered_beams,
    right_handed,
    spellings,
)
from lidarcheck.formats.table import Column, Table, counted
from lidarcheck.formats.times import frame_of
from lidarcheck.scan import Scan, beams_of
from lidarcheck.sensor import Beams as SensorBeams
from lidarcheck.sensor import Sensor, reference_beams

__all__ = [
    "FEATURES",
    "SCAN_COLUMNS",
    "RowCounts",
    "numbers_as_written",
    "positions_of",
    "read_scan",
    "scan_from_table",
]

SCAN_COLUMNS = {
    "X": "x_m",
    "Y": "y_m",
    "Z": "z_m",
    "PEAK": "peak",
    "AREA": "area",
    "WIDTH": "width_ns",
    "EchoNumber": "echo_number",
    "Layer": "layer",
    "Point": "point",
}
"""A file's name of each field of a `Scan`, in the order that files are written in."""

NUMBER_AS_WRITTEN = "EchoNumberRaw"
"""The extra column of the numbers that the source has, where they are not those of the echoes in order of range."""
RETURN_TYPE = "ReturnType"

_IDENTICAL = RETURN_KINDS["identical"]
_ONLY_IDEAL = ("Distance", "MaterialID", "IncidenceAngle")
FEATURES = ("WIDTH", "AREA", "PEAK")
_STAND_INS = ("INTENSITY", "SIGNAL", "REFLECTIVITY")
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RowCounts:
    """How many rows of a file are no echoes of their own, and how many beams' echoes are numbered otherwise there.

    `no_return`: rows that say that a beam had no echo; `unplaced`: those of them that do not say which beam.
    """

    no_return: int = 0
    unplaced: int = 0
    copies: int = 0
    renumbered: int = 0


def scan_from_table(table: Table, placement: Placement = AS_IT_IS, sensor: Sensor | None = None) -> Scan:
    """The echoes that a table's columns describe, once X, Y, Z are placed as declared and agree with their beams.

    Needed are X, Y, Z, or Layer, Point, RANGE. `sensor`: what measured, a built-in one where None; its features are
    read by its names and aliases. Other missing columns are logged and defaulted:
    Layer and Point to the nearest beam (-1 outside the field of view), EchoNumber to the order of range where the file
    names the beams and 1 elsewhere, the features to 0. Rows without a return are no echoes; where the file has a row
    for each of its beams they say which were fired. Echoes are numbered by range within their beam, beam by beam, and
    copies are left out. Unknown columns, and RANGE beside X, Y, Z, become `extra`. `InputError` when the columns do not
    suffice or hold what they must not, a missing value of a feature among it.
    """
    return read_scan(table, placement, missing_features=False, sensor=sensor)[0]


def read_scan(
    table: Table, placement: Placement = AS_IT_IS, *, missing_features: bool = True, sensor: Sensor | None = None
) -> tuple[Scan, RowCounts]:
    """`scan_from_table`, and how many rows were no echoes of their own.

    `missing_features`: features may have rows without a value, which are NaN. `sensor`: what measured, a built-in one
    where None.
    """
    _check_position(table)
    table, own = (
        numbered_beams(right_handed(table, sensor), sensor),
        reference_beams() if sensor is None else sensor.beams,
    )
    empty = no_returns(table)
    as_read = table if empty is None else table.take(np.flatnonzero(~empty))
    echoes = placement.applied(as_read)
    x_m, y_m, z_m = _positions(echoes, own)
    if own.lattice:
        beams = _beams(echoes, x_m, y_m, z_m, own, sensor)
    else:
        own, beams = beams_of_echoes(echoes, np.column_stack([x_m, y_m, z_m]), own)
    fired, unplaced = (None, 0) if empty is None else _fired(beams, table.take(np.flatnonzero(empty)))
    features = {name: _feature(echoes, name, missing_ok=missing_features) for name in FEATURES}
    others = features_of(echoes, sensor, missing_ok=missing_features)
    extra = _extra(echoes, sensor) if missing_features else _with_values(echoes, _extra(echoes, sensor))
    numbering, extra = _numbered(echoes, beams, (x_m, y_m, z_m), extra, sensor)
    scan = Scan(
        x_m=x_m,
        y_m=y_m,
        z_m=z_m,
        layer=beams.layer,
        point=beams.point,
        echo_number=numbering.number,
        width_ns=_or_zeros(features["WIDTH"], len(echoes)),
        area=_or_zeros(features["AREA"], len(echoes)),
        peak=_or_zeros(features["PEAK"], len(echoes)),
        extra=extra,
        fired=fired,
        features=others,
        histograms=histograms_of(table, sensor),
        beams=_of_frame(own, beams, np.column_stack([x_m, y_m, z_m])),
    )
    lacking = [name for name, column in features.items() if column is None]
    expected = lacking if sensor is None else [f.name for f in sensor.features if f.name in lacking]
    defaulted = (*_log_defaults(echoes, scan, expected, told=beams.told), *(n for n in lacking if n not in expected))
    scan = replace(scan, defaulted=defaulted, geometry=checked_geometry(scan, as_read, placement, sensor))
    counts = RowCounts(len(table) - len(echoes), unplaced, numbering.copies, numbering.renumbered)
    _log_counts(table, counts)
    return scan if numbering.kept is None else scan.take(numbering.kept), counts


def numbers_as_written(scan: Scan) -> Column:
    """The number of each echo as its source has it, shape (n,); its place in order of range where that has none."""
    return scan.extra.get(NUMBER_AS_WRITTEN, scan.echo_number)


def _check_position(table: Table) -> None:
    from_position, from_range = missing(table, ["X", "Y", "Z"]), missing(table, ["Layer", "Point", "RANGE"])
    if from_position and from_range:
        what = f"no column {', '.join(from_position)}, nor {', '.join(from_range)} in their place{found_columns(table)}"
        if not missing(table, ["Layer", "Point", "Distance"]):
            raise InputError(f"this is an ideal scan, not echoes: {what}", file=table.path, fix="simulate it first")
        line = None if table.layout is None else 1
        lacking = missing(table, ["Layer", "Point", "Distance", "MaterialID"])
        ideal = len(missing(table, _ONLY_IDEAL)) < len(_ONLY_IDEAL)
        if ideal and len(from_position) == 3:
            what = f"this looks like an ideal scan without {', '.join(lacking)}{found_columns(table)}"
            fix = "an ideal scan needs Layer, Point, Distance, MaterialID"
            raise InputError(what, file=table.path, line=line, fix=fix)
        raise InputError(what, file=table.path, line=line, fix="a scan needs X, Y, Z, or Layer, Point, RANGE")


def _positions(table: Table, beams: SensorBeams) -> tuple[Column, Column, Column]:
    if not missing(table, ["X", "Y", "Z"]):
        x_m, y_m, z_m = (real_column(table, name, -LENGTH_MAX_M, LENGTH_MAX_M, "m") for name in ("X", "Y", "Z"))
        return x_m, y_m, z_m
    layer = whole_column(table, "Layer", 0, beams.layers - 1)
    point = whole_column(table, "Point", 0, beams.points - 1)
    xyz = beams.positions_m(layer, point, real_column(table, "RANGE", 0.0, LENGTH_MAX_M, "m"))
    return xyz[:, 0], xyz[:, 1], xyz[:, 2]


def positions_of(
    table: Table, empty: BoolArray | None = None, beams: SensorBeams | None = None
) -> tuple[Column, Column, Column]:
    """X, Y, Z of each row, (n,) each, 0 where the row has no return. `beams`: the built-in sensors' where None."""
    beams = reference_beams() if beams is None else beams
    if empty is None:
        return _positions(table, beams)
    xyz = np.zeros((3, len(table)))
    xyz[:, ~empty] = _positions(table.take(np.flatnonzero(~empty)), beams)
    return xyz[0], xyz[1], xyz[2]


def _beams(table: Table, x_m: Column, y_m: Column, z_m: Column, own: SensorBeams, sensor: Sensor | None) -> Beams:
    """Layer and Point, the missing ones from rings, times and directions, or from the positions alone."""
    given = [name for name in ("Layer", "Point") if table.spelling(name)]
    if sensor is not None and len(given) < 2 and len(table) and frame_of(table.columns) is None:
        return _assigned(table, np.stack([x_m, y_m, z_m], axis=-1), sensor)
    columns = {name: whole_column(table, name, 0, INT32_MAX) for name in given}
    if len(given) < 2:
        layer, point = beams_of(x_m, y_m, z_m, own)
        columns = {"Layer": layer, "Point": point, **columns}
    return Beams(columns["Layer"], columns["Point"], frame_of(table.columns), told=len(given) == 2)


def _assigned(table: Table, xyz: FloatArray, sensor: Sensor) -> Beams:
    """The beam of each row of one frame, by whatever the file says of it, in the order of trust."""
    from lidarcheck.formats.assign.cloud import clouds_of
    from lidarcheck.formats.assign.of_sensor import assigned_to

    try:
        found = assigned_to(sensor, clouds_of(table)[0], xyz)
    except UsageError as error:
        raise InputError(error.what, file=table.path, fix=error.fix) from None
    return Beams(found.layer.astype(np.int32), found.point.astype(np.int32), None, told=found.layers_told)


def _fired(echoes: Beams, empty: Table) -> tuple[Fired | None, int]:
    """The beams that were fired, by the rows without a return, and how many of those rows do not say which beam."""
    columns = [empty.get(name) for name in ("Layer", "Point")]
    known = np.ones(len(empty), dtype=np.bool_)
    for column in columns:
        whole = np.zeros(len(empty), dtype=np.bool_) if column is None else (column >= 0) & (column <= INT32_MAX)
        known &= whole if column is None or column.dtype.kind != "f" else whole & (column == np.rint(column))
    if not known.all() or not echoes.told:
        return None, int(np.count_nonzero(~known))
    layer, point = (np.asarray(column).astype(np.int32) for column in columns)
    return fired_of(echoes, Beams(layer, point, frame_of(empty.columns), told=True)), 0


def _feature(table: Table, name: str, *, missing_ok: bool) -> Column | None:
    """A feature, NaN where its value is missing, if that may be; None where it has no value at all."""
    column = table.get(name)
    if column is None or (column.dtype.kind == "f" and len(column) and np.isnan(column[0]) and np.isnan(column).all()):
        return None
    return real_column(table, name, missing_ok=missing_ok)


def _with_values(table: Table, extra: dict[str, Column]) -> dict[str, Column]:
    """The extra columns, without features that have no value at all; `InputError` for one that lacks some."""
    for name in _STAND_INS:
        own = table.spelling(name)
        if own in extra and _feature(table, name, missing_ok=False) is None:
            _log.warning("%s: the column %s is left out: it has no value", table.path, own)
            extra = {other: column for other, column in extra.items() if other != own}
    return extra


def _or_zeros(column: Column | None, rows: int) -> Column:
    return np.zeros(rows) if column is None else column


def _of_frame(own: SensorBeams, beams: Beams, xyz: FloatArray) -> SensorBeams:
    """The beams as this frame fires them: where columns do not repeat, Point 0 looks where its echoes say."""
    if own.repeats or not beams.told or not len(xyz):
        return own
    known = own.has(beams.layer, beams.point)
    return own.with_phase(own.phase_of(beams.layer[known], beams.point[known], xyz[known]))


def _extra(table: Table, sensor: Sensor | None) -> dict[str, Column]:
    """The columns without a field of their own, and the kind of each return where they tell it."""
    known = [*SCAN_COLUMNS, "RANGE"] if missing(table, ["X", "Y", "Z"]) else [*SCAN_COLUMNS]
    known += spellings(table, sensor).values()
    known += histogram_names(table) if histogram_feature(sensor) is not None else []
    extra = extra_columns(table, known)
    kinds = None if table.spelling(RETURN_TYPE) else return_kinds(table.columns)
    return extra if kinds is None else {**extra, RETURN_TYPE: kinds}


def _numbered(
    table: Table, beams: Beams, xyz: Sequence[Column], extra: dict[str, Column], sensor: Sensor | None
) -> tuple[Numbering, dict[str, Column]]:
    """Which echo of its beam each row is; and the extra columns with the numbers and kinds as they came out."""
    written, kinds = _numbers(table), extra.get(RETURN_TYPE)
    names = dict.fromkeys((*FEATURES, *_STAND_INS, *spellings(table, sensor).values()))
    equal = [column for name in names if (column := table.get(name)) is not None]
    # What this package wrote has the sensor's own numbers beside those in order of range.
    own = table.get(NUMBER_AS_WRITTEN)
    apart = [column for column in (written if own is None else own, kinds) if column is not None]
    found = numbered(beams, written, apart, xyz, equal)
    if found.renumbered and own is None and written is not None:
        extra = {**extra, NUMBER_AS_WRITTEN: written}
    if kinds is not None:
        kinds = kinds_by_range(kinds, extra, beams, found)
        extra = {**extra, RETURN_TYPE: kinds if found.twins is None else np.where(found.twins, _IDENTICAL, kinds)}
    return found, extra


def _numbers(table: Table) -> Column | None:
    """The echoes' numbers as the file has them: whole, from 0, or missing."""
    numbers = table.get("EchoNumber")
    if numbers is None:
        return livox_numbers(table.columns)
    if numbers.dtype.kind == "f" and np.isnan(numbers).any():
        whole_column(table, "EchoNumber", 0, INT32_MAX, where=~np.isnan(numbers))
        return numbers
    return whole_column(table, "EchoNumber", 0, INT32_MAX)


def _log_counts(table: Table, counts: RowCounts) -> None:
    if counts.no_return:
        _log.info("%s: %s without a return", table.path, counted(counts.no_return, "row"))
    if counts.copies:
        _log.warning("%s: %s left out", table.path, counted(counts.copies, "copy of an echo", "copies of echoes"))
    if counts.renumbered:
        what = "the numbers of the echoes of %s are not 1, 2, ... in order of range, and were made so"
        _log.warning("%s: " + what, table.path, counted(counts.renumbered, "beam"))


def _log_defaults(table: Table, scan: Scan, features: list[str], *, told: bool) -> tuple[str, ...]:
    """The standard columns that are missing and not made from RANGE; one line of log says what stands in."""
    unseen = int(np.count_nonzero((scan.layer < 0) | (scan.point < 0)))
    beams = missing(table, ["Layer", "Point"])
    echo = missing(table, ["EchoNumber"])
    said = []
    if missing(table, ["X", "Y", "Z"]):
        said.append("X, Y, Z from Layer, Point, RANGE")
    if beams:
        outside = f" ({unseen} of {len(table)} outside the field of view)" if unseen else ""
        said.append(f"{', '.join(beams)} from X, Y, Z{outside}")
    if echo:
        several = told and bool((scan.echo_number > 1).any())
        said.append("EchoNumber from the order of range" if several else "EchoNumber is 1")
    if features:
        said.append(f"{', '.join(features)} {'is' if len(features) == 1 else 'are'} 0")
    if said:
        _log.warning("%s: missing columns were filled in: %s", table.path, "; ".join(said))
    return (*beams, *echo, *features)
