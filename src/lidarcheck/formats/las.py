"""LAS and its compressed form LAZ: X Y Z as scaled integers, every other column as an extra dimension.

Written as LAS 1.4, point format 6. The scale is 1e-6 m and the offset 0 where all coordinates lie within ±2147 m;
beyond, the offset is the middle of the extent in whole metres and the scale the finest power of ten that fits, down to
0.1 mm: one row far away must not coarsen all others. Reading gives back X, Y and Z within half a scale step; all other
columns are exact. `EchoNumber` also fills `return_number`,
for viewers. The extremes of X, Y, Z in the header are checked when such a file is read again: LAZ has no checksum.

Reading takes any LAS 1.0 to 1.4 file: X, Y, Z and the extra dimensions always; a standard dimension (`intensity`,
`gps_time`, ...) where it is not zero throughout, as `standard_intensity` where an extra dimension has its name;
`return_number` becomes `EchoNumber` in files without one.

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
from lidarcheck.formats.las_layout import HEADER_BYTES, check_claims, check_layout
from lidarcheck.formats.limits import scan_bytes
from lidarcheck.formats.panics import panics_unsaid
from lidarcheck.formats.records import writable
from lidarcheck.formats.source import first_bytes, read_source, size_of
from lidarcheck.formats.table import Table, check_names

__all__ = ["read_las", "write_las"]

logger = logging.getLogger(__name__)
logging.getLogger("laspy").addHandler(logging.NullHandler())  # damage is said once, by this module

Column = npt.NDArray[Any]
AXES = ("X", "Y", "Z")
FINEST_SCALE_M = 1e-6
COARSEST_SCALE = -4
"""As a power of ten of a metre: below what any reader of ranges can tell, and 214 km to either side."""
LARGEST_STEPS = 2**31 - 1
NAME_BYTES = 32
PIECE_POINTS, PIECE_BYTES = 65_536, 16 << 20
MOST_EXTRA = 65_535 // 192  # their descriptions share one record of 16-bit length
DAMAGED_FIX = "the file is damaged or cut off: write it again"
ECHO_NUMBER = "EchoNumber"
RETURNS = ("return_number", "number_of_returns")
STANDARD = " (standard)"
SOFTWARE = "lidarcheck"
EXTREMES_NOTED = 0b110  # laspy notes the first point's value as the least and greatest: note none


def read_las(path: str | Path) -> Table:
    """The points of a LAS or LAZ file, told apart by content.

    X, Y, Z in float64 [m]; other columns in the file's own types. `InputError` for a damaged header, records that the
    file is too short for, and compressed chunks that do not unpack.
    """
    file = Path(path)
    check_claims(first_bytes(file, HEADER_BYTES), size_of(file), file)
    content = read_source(file, most=scan_bytes())
    layout = check_layout(content, file)
    with _damage_reported(file), panics_unsaid(layout.compressed):
        columns, header, points = _columns(content, file)
    if points != layout.points:
        what = f"the header says {layout.points} points, the file holds {points}"
        raise InputError(what, file=file, fix=DAMAGED_FIX)
    check_names(columns, file)
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


def _columns(content: bytes, path: Path) -> tuple[dict[str, Column], Any, int]:
    """The columns, the header, and the number of points: read in pieces, so that a false count costs no more than one.

    X, Y and Z in metres, then the standard dimensions that say something, then the extra ones.
    """
    import laspy

    reader = laspy.open(io.BytesIO(content), laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False, closefd=False)
    header = reader.header
    check_names(header.point_format.extra_dimension_names, path)
    pieces: dict[str, list[Column | None]] = {}
    sizes: list[int] = []
    for piece in _pieces(reader):
        sizes.append(len(piece))
        for name, column in _piece_columns(piece, header).items():
            pieces.setdefault(name, []).append(column)
    if not sizes:
        empty = laspy.PackedPointRecord(np.zeros(0, header.point_format.dtype()), header.point_format)
        pieces, sizes = {name: [column] for name, column in _piece_columns(empty, header).items()}, [0]
    columns = {}
    for name in list(pieces):
        column = _joined(pieces.pop(name), sizes)
        if column is not None:
            columns[name] = column
    return _renamed(columns), header, sum(sizes)


def _pieces(reader: Any) -> Iterator[Any]:
    left = reader.header.point_count
    most = max(min(PIECE_POINTS, PIECE_BYTES // reader.header.point_format.size), 1)
    while left > 0:
        piece = reader.read_points(min(left, most))
        if not len(piece):
            return
        left -= len(piece)
        yield piece


def _piece_columns(points: Any, header: Any) -> dict[str, Column | None]:
    """The dimensions of some points by their names, standard ones in brackets; None for one that is zero throughout."""
    columns: dict[str, Column | None] = {}
    with np.errstate(all="ignore"):
        for axis, scale, offset in zip(AXES, header.scales, header.offsets, strict=True):
            columns[axis] = _metres(np.asarray(points.array[axis]), float(scale)) + offset
        for name in points.point_format.standard_dimension_names:
            if name not in AXES:
                column = np.asarray(points[name])
                columns[f"{name}{STANDARD}"] = np.array(column) if column.any() else None
        columns |= _extra_columns(points, points.point_format)
    return columns


def _joined(pieces: list[Column | None], sizes: list[int]) -> Column | None:
    """The pieces as one column, zeros for those that say nothing; None where none says anything."""
    kind = next((piece.dtype for piece in pieces if piece is not None), None)
    if kind is None:
        return None
    whole = [np.zeros(n, kind) if piece is None else piece for piece, n in zip(pieces, sizes, strict=True)]
    return whole[0] if len(whole) == 1 else np.concatenate(whole)


def _renamed(columns: dict[str, Column]) -> dict[str, Column]:
    """Standard dimensions by their own names, where no extra one has it; `return_number` as `EchoNumber`."""
    taken = {name.casefold() for name in columns}
    echoes = next((column for name, column in columns.items() if name.casefold() == ECHO_NUMBER.casefold()), None)
    named: dict[str, Column] = {}
    for key, column in columns.items():
        name = key.removesuffix(STANDARD)
        if name == key:
            named[name] = column
        elif name in RETURNS and echoes is not None:
            if name == RETURNS[0] and not np.array_equal(column, _return_number(echoes)):
                named[name] = column
        else:
            own = ECHO_NUMBER if name == RETURNS[0] else name
            named[f"standard_{own}" if own.casefold() in taken else own] = column
    return named


def _metres(steps: Column, scale: float) -> npt.NDArray[np.float64]:
    """Steps times the scale; by dividing where the scale is one over a whole number, so that 8174200 gives 8.1742."""
    whole = float(np.rint(1.0 / scale)) if 1e-12 < abs(scale) <= 1.0 else 0.0
    if whole and abs(whole * scale - 1.0) < 1e-12:
        return steps.astype(np.float64) / whole
    return steps.astype(np.float64) * scale


def _extra_columns(points: Any, point_format: Any) -> dict[str, Column | None]:
    """The extra dimensions; one of several numbers becomes `name_0`, `name_1`, ..."""
    columns: dict[str, Column | None] = {}
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
    metres: npt.NDArray[np.float64] = values.astype(np.float64)
    if not np.isfinite(metres).all():
        row = int(np.argmin(np.isfinite(metres)))
        what = f"row {row + 1}: {axis} is {metres[row]}, and LAS holds positions alone"
        raise InputError(what, file=path, fix="leave out the rows without a return, or write another format")
    return metres


def _scale_and_offset(values: npt.NDArray[np.float64], axis: str, path: Path) -> tuple[float, float]:
    """The finest power of ten, from 1e-6 m on, in which all values are 32-bit numbers of steps; and the offset."""
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    if max(-low, high) <= LARGEST_STEPS * FINEST_SCALE_M:
        return FINEST_SCALE_M, 0.0
    offset = float(np.rint(low / 2 + high / 2))
    for exponent in range(-6, COARSEST_SCALE + 1):
        scale = float(f"1e{exponent}")
        if max(offset - low, high - offset) <= LARGEST_STEPS * scale:
            return scale, offset
    row = int(np.argmax(np.abs(values - np.median(values))))
    what = (
        f"row {row + 1}: {axis} is {values[row]:.9g} m, so far away that LAS would round all rows to more than 0.1 mm"
    )
    raise InputError(what, file=path, fix="remove the row if it is no position, or write another format")


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
    number = _return_number(echo)
    if layer is None or point is None:
        return dict.fromkeys(RETURNS, number)
    with np.errstate(invalid="ignore"):  # what no beam can be is for others to refuse
        beams = layer.astype(np.int64) * 2**32 + point.astype(np.int64)
    _, beam = np.unique(beams, return_inverse=True)
    total = np.zeros(len(table), dtype=np.int64)
    np.maximum.at(total, beam, number)
    return dict(zip(RETURNS, (number, total[beam]), strict=True))


def _return_number(echo: Column) -> npt.NDArray[np.int64]:
    """The number that LAS notes of an echo: 1 to 15."""
    with np.errstate(invalid="ignore"):
        near: npt.NDArray[np.float64] = np.clip(np.nan_to_num(np.rint(echo.astype(np.float64)), nan=1), 1, 15)
    return near.astype(np.int64)


def _write(data: Any, path: Path) -> None:
    import laspy

    compress = path.suffix.lower() == ".laz"
    buffer = io.BytesIO()
    data.write(buffer, do_compress=compress, laz_backend=laspy.LazBackend.Lazrs)
    with atomic_write(path) as stream:
        stream.write(buffer.getbuffer())
