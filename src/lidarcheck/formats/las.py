"""LAS and its compressed form LAZ: X Y Z as scaled integers, every other column as an extra dimension.

Written as LAS 1.4, point format 6. The scale is 1e-6 m and the offset 0 where all coordinates lie within ±2147 m;
beyond, the offset is the middle of the extent in whole metres and the scale the finest power of ten that fits. Reading
gives back X, Y and Z within half a scale step; all other columns are exact. `EchoNumber` also fills `return_number`,
for viewers. The extremes of X, Y, Z in the header are checked when such a file is read again: LAZ has no checksum.

Reading takes any LAS 1.0 to 1.4 file: X, Y, Z and the extra dimensions always; a standard dimension (`intensity`,
`gps_time`, ...) where it is not zero throughout; `return_number` becomes `EchoNumber` in files without one.

Source: ASPRS, "LAS Specification 1.4 - R15".
"""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import atomic_write
from lidarcheck.formats.las_layout import check_layout
from lidarcheck.formats.records import check_finite, writable
from lidarcheck.formats.source import read_source
from lidarcheck.formats.table import Table, check_names

__all__ = ["read_las", "write_las"]

logger = logging.getLogger(__name__)
logging.getLogger("laspy").addHandler(logging.NullHandler())  # damage is said once, by this module

Column = npt.NDArray[Any]
AXES = ("X", "Y", "Z")
FINEST_SCALE_M = 1e-6
LARGEST_STEPS = 2**31 - 1
NAME_BYTES = 32
PIECE_POINTS = 250_000
MOST_EXTRA = 65_535 // 192  # their descriptions share one record of 16-bit length
DAMAGED_FIX = "the file is damaged or cut off: write it again"
ECHO_NUMBER = "EchoNumber"
RETURNS = ("return_number", "number_of_returns")
SOFTWARE = "lidarcheck"
EXTREMES_NOTED = 0b110  # laspy notes the first point's value as the least and greatest: note none


def read_las(path: str | Path) -> Table:
    """The points of a LAS or LAZ file, told apart by content.

    X, Y, Z in float64 [m]; other columns in the file's own types. `InputError` for a damaged header, records that the
    file is too short for, compressed chunks that do not unpack, and NaN, with its row.
    """
    file = Path(path)
    content = read_source(file)
    layout = check_layout(content, file)
    with _damage_reported(file):
        records, header = _records(content)
        check_names(header.point_format.extra_dimension_names, file)
        columns = _columns(records, header)
    if len(records) != layout.points:
        what = f"the header says {layout.points} points, the file holds {len(records)}"
        raise InputError(what, file=file, fix=DAMAGED_FIX)
    check_names(columns, file)
    check_finite(columns, file)
    _check_extremes(columns, header, file)
    return Table(columns, file)


def write_las(table: Table, path: str | Path) -> None:
    """Write LAS, or LAZ where `path` ends in `.laz`; whole or not at all.

    `InputError` without X, Y and Z, for a column name beyond 32 bytes, or coordinates beyond what integers can scale.
    """
    import laspy

    target = Path(path)
    columns = writable(table, target, _plain_name)
    axes = {axis: _axis(table, axis, target) for axis in AXES}
    others = {name: column for name, column in columns.items() if name.upper() not in AXES}
    header = laspy.LasHeader(version="1.4", point_format=6)
    standard = _fitting_standard(others, header.point_format)
    extra = {_free_name(name, header.point_format): c for name, c in others.items() if name not in standard}
    _describe(header, extra, target)
    steps = {}
    for i, (axis, values) in enumerate(axes.items()):
        header.scales[i], header.offsets[i] = _scale_and_offset(values, axis, target)
        steps[axis] = np.rint((values - header.offsets[i]) / header.scales[i]).astype(np.int32)
    points = laspy.ScaleAwarePointRecord.zeros(len(table), header=header)
    for name, column in {**_returns(table), **steps, **standard}.items():
        points[name] = column
    for name, column in extra.items():
        points.array[name] = column
    _write(laspy.LasData(header, points), target)


def _describe(header: Any, extra: dict[str, Column], path: Path) -> None:
    """Say in the header which extra dimensions there are, and who wrote them."""
    import laspy

    if len(extra) > MOST_EXTRA:
        what = f"LAS can name {MOST_EXTRA} columns beside X, Y, Z, these are {len(extra)}"
        raise InputError(what, file=path, fix="write Parquet instead")
    header.generating_software = SOFTWARE
    header.add_extra_dims([laspy.ExtraBytesParams(name, column.dtype) for name, column in extra.items()])
    for notes in header.vlrs.get("ExtraBytesVlr"):
        for dimension in notes.extra_bytes_structs:
            dimension.options &= ~EXTREMES_NOTED


@contextlib.contextmanager
def _damage_reported(path: Path) -> Iterator[None]:
    """Turn whatever the libraries raise over somebody else's bytes into an `InputError`."""
    try:
        yield
    except (InputError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic in the LAZ library is no Exception
        reason = " ".join(str(error).split())[:160]
        raise InputError(f"damaged LAS or LAZ data: {reason}", file=path, fix=DAMAGED_FIX) from error


def _records(content: bytes) -> tuple[Any, Any]:
    """All point records, and the header; read in pieces, so that a false count costs one piece and no more."""
    import laspy

    stream = io.BytesIO(content)
    reader = laspy.open(stream, laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False, closefd=False)
    pieces = [piece.array for piece in _pieces(reader)]
    point_format = reader.header.point_format
    records = np.concatenate(pieces) if pieces else np.zeros(0, point_format.dtype())
    return laspy.PackedPointRecord(records, point_format), reader.header


def _pieces(reader: Any) -> Iterator[Any]:
    left = reader.header.point_count
    while left > 0:
        piece = reader.read_points(min(left, PIECE_POINTS))
        if not len(piece):
            return
        left -= len(piece)
        yield piece


def _columns(records: Any, header: Any) -> dict[str, Column]:
    """X, Y and Z in metres, then the standard dimensions that say something, then the extra ones."""
    columns: dict[str, Column] = {}
    with np.errstate(all="ignore"):
        for axis, scale, offset in zip(AXES, header.scales, header.offsets, strict=True):
            columns[axis] = _metres(records[axis], float(scale)) + offset
        columns |= _standard_columns(records, header.point_format)
        columns |= _extra_columns(records, header.point_format)
    return columns


def _metres(steps: Column, scale: float) -> npt.NDArray[np.float64]:
    """Steps times the scale; by dividing where the scale is one over a whole number, so that 8174200 gives 8.1742."""
    whole = float(np.rint(1.0 / scale)) if 1e-12 < abs(scale) <= 1.0 else 0.0
    if whole and abs(whole * scale - 1.0) < 1e-12:
        return steps.astype(np.float64) / whole
    return steps.astype(np.float64) * scale


def _standard_columns(points: Any, point_format: Any) -> dict[str, Column]:
    """The dimensions that every LAS file has, where they say something; `return_number` as `EchoNumber`."""
    extra = {name.casefold() for name in point_format.extra_dimension_names}
    columns = {}
    for name in point_format.standard_dimension_names:
        column = np.asarray(points[name])
        if name in AXES or name.casefold() in extra or not column.any():
            continue
        if name in RETURNS and ECHO_NUMBER.casefold() in extra:
            continue
        columns[ECHO_NUMBER if name == "return_number" else name] = np.array(column)
    return columns


def _extra_columns(points: Any, point_format: Any) -> dict[str, Column]:
    """The extra dimensions; one of several numbers becomes `name_0`, `name_1`, ..."""
    columns: dict[str, Column] = {}
    for dimension in point_format.extra_dimensions:
        name = dimension.name
        values = np.asarray(points[name] if dimension.is_scaled else points.array[name])
        if values.ndim == 1:
            columns[name] = np.array(values)
        else:
            columns |= {f"{name}_{i}": np.array(values[:, i]) for i in range(values.shape[1])}
    return columns


def _check_extremes(columns: dict[str, Column], header: Any, path: Path) -> None:
    """Compare the coordinates of this package's own files with the extremes that the header notes.

    LAZ has no checksum: damage inside a chunk unpacks to other values. Programs that edit a file keep the notes true;
    files that others began are not held to them.
    """
    if header.generating_software != SOFTWARE or not len(columns["X"]):
        return
    for axis, low, high, step in zip(AXES, header.mins, header.maxs, header.scales, strict=True):
        found = columns[axis].min(), columns[axis].max()
        if not (abs(found[0] - low) <= step and abs(found[1] - high) <= step):
            what = f"{axis} spans {found[0]:.9g} ... {found[1]:.9g}, the header notes {low:.9g} ... {high:.9g}"
            raise InputError(what, file=path, fix=DAMAGED_FIX)


def _plain_name(name: str) -> bool:
    return name.isprintable() and 0 < len(name.encode("utf-8")) <= NAME_BYTES


def _axis(table: Table, axis: str, path: Path) -> npt.NDArray[np.float64]:
    values = table.get(axis)
    if values is None:
        raise InputError(f"LAS needs the column {axis}", file=path, fix="add X, Y and Z, or write another format")
    return values.astype(np.float64)


def _scale_and_offset(values: npt.NDArray[np.float64], axis: str, path: Path) -> tuple[float, float]:
    """The finest power of ten, from 1e-6 m on, in which all values are 32-bit numbers of steps; and the offset."""
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    if max(-low, high) <= LARGEST_STEPS * FINEST_SCALE_M:
        return FINEST_SCALE_M, 0.0
    offset = float(np.rint(low / 2 + high / 2))
    for exponent in range(-6, 1):
        scale = float(f"1e{exponent}")
        if max(offset - low, high - offset) <= LARGEST_STEPS * scale:
            return scale, offset
    what = f"{axis} spans {low:g} ... {high:g} m, more than LAS can hold to 1 m"
    raise InputError(what, file=path, fix="remove the rows that are no positions, or write another format")


def _fitting_standard(columns: dict[str, Column], point_format: Any) -> dict[str, Column]:
    """Columns that bear a standard dimension's name and whose values that dimension holds exactly."""
    fitting = {}
    for name, column in columns.items():
        if name not in point_format.standard_dimension_names or name in RETURNS or not column.any():
            continue
        dimension = point_format.dimension_by_name(name)
        if dimension.min <= column.min() and column.max() <= dimension.max and (column == np.rint(column)).all():
            fitting[name] = column.astype(np.int64)
        elif dimension.kind.name == "FloatingPoint":
            fitting[name] = column
    return fitting


def _free_name(name: str, point_format: Any) -> str:
    """The name, in capitals where a standard dimension bears it that is taken or cannot hold the values."""
    if name not in point_format.dimension_names:
        return name
    logger.warning("column %s is written as %s: the LAS dimension of that name does not hold it", name, name.upper())
    return name.upper()


def _returns(table: Table) -> dict[str, Column]:
    """The two dimensions of `RETURNS` from the echo numbers, within the 1 ... 15 that LAS knows; none without them."""
    echo, layer, point = (table.get(name) for name in (ECHO_NUMBER, "Layer", "Point"))
    if echo is None:
        return {}
    number = np.clip(np.rint(echo), 1, 15).astype(np.int64)
    if layer is None or point is None:
        return dict.fromkeys(RETURNS, number)
    with np.errstate(invalid="ignore"):  # what no beam can be is for others to refuse
        beams = layer.astype(np.int64) * 2**32 + point.astype(np.int64)
    _, beam = np.unique(beams, return_inverse=True)
    total = np.zeros(len(table), dtype=np.int64)
    np.maximum.at(total, beam, number)
    return dict(zip(RETURNS, (number, total[beam]), strict=True))


def _write(data: Any, path: Path) -> None:
    import laspy

    compress = path.suffix.lower() == ".laz"
    buffer = io.BytesIO()
    data.write(buffer, do_compress=compress, laz_backend=laspy.LazBackend.Lazrs)
    with atomic_write(path) as stream:
        stream.write(buffer.getbuffer())
