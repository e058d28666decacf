"""Point clouds in messages: `sensor_msgs/PointCloud2` by its own list of fields, and Livox' CustomMsg."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.formats.field.cursor import Cursor
from lidarcheck.formats.limits import check_rows
from lidarcheck.formats.records import MAX_COLUMNS, Field
from lidarcheck.formats.table import check_names, quoted

__all__ = ["DATATYPES", "Cloud", "cloud_of", "custom_of"]

Column = npt.NDArray[Any]
DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Numbers of `sensor_msgs/PointField` and the types that they mean."""
_MOST_FIELDS = 1000
_CUSTOM = [("offset_time", "u4"), ("x", "f4"), ("y", "f4"), ("z", "f4"), ("reflectivity", "u1"), ("tag", "u1")]


@dataclass(frozen=True)
class Cloud:
    """A frame's columns (n,), `height` rows of an organised cloud, the message's time and the name of its frame."""

    columns: dict[str, Column]
    height: int
    stamp_ns: int
    frame: str


def cloud_of(content: bytes, encoding: str, path: Path) -> Cloud:
    """A PointCloud2. `InputError` where it contradicts itself or holds more rows than a file may."""
    cursor = Cursor(content, encoding, path)
    stamp_ns, frame = cursor.head()
    height, width = cursor.whole(), cursor.whole()
    fields = _fields(cursor)
    big = bool(cursor.whole("B"))
    point_step, row_step = cursor.whole(), cursor.whole()
    data = cursor.take(cursor.whole())
    rows = height * width
    check_rows(rows, sum(field.count for field, _ in fields), path, says="a message says that it holds")
    _check_layout(cursor, fields, (height, width, point_step, row_step, len(data)))
    order: Any = ">" if big else "<"
    record: np.dtype[Any] = np.dtype(
        {
            "names": [str(i) for i in range(len(fields))],
            "formats": [(field.dtype.newbyteorder(order), (field.count,)) for field, _ in fields],
            "offsets": [offset for _, offset in fields],
            "itemsize": point_step,
        }
    )
    step = row_step if height > 1 else width * point_step
    cells = np.ndarray((height, width), record, buffer=data, strides=(step, point_step)) if rows else None
    columns: dict[str, Column] = {}
    for i, (field, _) in enumerate(fields):
        for j, name in enumerate(field.names):
            own = np.zeros((0, 0), field.dtype) if cells is None else cells[str(i)][..., j]
            columns[name] = own.astype(field.dtype, order="C").ravel()
    return Cloud(columns, height if rows and height > 1 else 1, stamp_ns, frame)


def _fields(cursor: Cursor) -> list[tuple[Field, int]]:
    """The fields that have a name, and the byte of a point at which each stands."""
    count = cursor.whole()
    if count > _MOST_FIELDS:
        raise cursor.fault(f"it says that a point has {count} fields")
    found = []
    for _ in range(count):
        name, offset, kind, numbers = cursor.text(), cursor.whole(), cursor.whole("B"), cursor.whole()
        if kind not in DATATYPES:
            raise cursor.fault(f"the field {quoted(name)} has the type {kind}, which there is not")
        if name.strip("_ "):  # names without a letter stand for padding
            found.append((Field(name, np.dtype(DATATYPES[kind]), max(numbers, 1)), offset))
    if sum(field.count for field, _ in found) > MAX_COLUMNS:
        raise cursor.fault(f"a point has more than {MAX_COLUMNS} numbers")
    check_names((name for field, _ in found for name in field.names), cursor.path)
    return found


def _check_layout(cursor: Cursor, fields: list[tuple[Field, int]], sizes: tuple[int, int, int, int, int]) -> None:
    """Refuse fields beyond their point, points beyond their row, and rows beyond the data."""
    height, width, point_step, row_step, size = sizes
    for field, offset in fields:
        if offset + field.dtype.itemsize * field.count > point_step:
            raise cursor.fault(f"the field {quoted(field.name)} reaches beyond a point of {point_step} bytes")
    if not fields and height * width:
        raise cursor.fault("its points have no fields")
    step = row_step if height > 1 else width * point_step
    if height > 1 and row_step < width * point_step:
        raise cursor.fault(f"{width} points of {point_step} bytes in a row of {row_step}")
    if height and width and (height - 1) * step + width * point_step > size:
        raise cursor.fault(f"{height} x {width} points of {point_step} bytes in {size} bytes")


def custom_of(content: bytes, encoding: str, path: Path) -> Cloud:
    """A Livox CustomMsg, rows in the order of time; `offset_time` counts ns from its start."""
    cursor = Cursor(content, encoding, path)
    _, frame = cursor.head()
    base = cursor.whole("Q")
    cursor.values("IBBBB")  # a count, the lidar's number, three bytes reserved
    count = cursor.whole()
    check_rows(count, len(_CUSTOM) + 1, path, says="a message says that it holds")
    size = 19 if encoding == "ros1" else 20  # in CDR each begins at a multiple of four; the last has no rest
    need = count * size - (size - 19) if count else 0
    cursor.align(4)
    data = cursor.take(need) + bytes(size - 19)
    order: Any = cursor.order
    names = [*_CUSTOM, ("line", "u1")]
    offsets = [0, 4, 8, 12, 16, 17, 18]
    formats = [np.dtype(kind).newbyteorder(order) for _, kind in names]
    record = np.dtype({"names": [n for n, _ in names], "formats": formats, "offsets": offsets, "itemsize": size})
    rows = np.frombuffer(data, record, count)
    columns = {name: rows[name].astype(np.dtype(kind)) for name, kind in names}
    return Cloud(columns, 1, base, frame)
