"""A table as a `sensor_msgs/PointCloud2`, serialised as CDR or as ROS 1 has it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.formats.field.clouds import DATATYPES
from lidarcheck.formats.records import writable
from lidarcheck.formats.table import Table

__all__ = ["cloud_message"]

_NUMBERS = {np.dtype(name): number for number, name in DATATYPES.items()}
_LOWER = {"X": "x", "Y": "y", "Z": "z", "INTENSITY": "intensity"}
"""Names as the field's programs expect them; readers of this package take either."""


def cloud_message(table: Table, encoding: str, stamp_ns: int, frame: str, path: Path) -> bytes:
    """The message; little-endian, without padding, organised where the table is. `encoding`: `cdr` or `ros1`.

    `InputError` where a column has a name that no field can have.
    """
    columns = {_LOWER.get(name, name): column for name, column in _fitting(table, path).items()}
    record = np.dtype([(name, column.dtype.newbyteorder("<")) for name, column in columns.items()])
    rows = np.empty(len(table), record)
    for name, column in columns.items():
        rows[name] = column
    height = table.height
    width = len(table) // height
    message = _Message(encoding)
    message.head(stamp_ns, frame)
    message.add("I", height, width, len(columns))
    for name, column in columns.items():
        assert record.fields is not None, "of named fields"
        message.text(name)
        message.add("I", int(record.fields[name][1]))
        message.add("B", _NUMBERS[column.dtype])
        message.add("I", 1)
    message.add("B", 0)
    message.add("I", record.itemsize, record.itemsize * width, rows.nbytes)
    message.content += rows.tobytes()
    x = columns.get("x")
    message.add("B", int(x is not None and bool(np.isfinite(x).all())))
    return bytes(message.content)


def _fitting(table: Table, path: Path) -> dict[str, Any]:
    """The columns in types that a field can have: of whole numbers those of at most 32 bits, else float64."""
    columns = writable(table, path, lambda name: name.isascii() and name.isprintable() and name.strip("_ ") != "")
    return {
        name: column.astype(np.float64) if column.dtype not in _NUMBERS else column for name, column in columns.items()
    }


class _Message:
    def __init__(self, encoding: str) -> None:
        self.cdr = encoding == "cdr"
        self.content = bytearray(b"\0\1\0\0" if self.cdr else b"")

    def add(self, kind: str, *values: int) -> None:
        """Whole numbers, aligned where the encoding is."""
        for value in values:
            if self.cdr:
                self.content += bytes(-(len(self.content) - 4) % struct.calcsize(kind))
            self.content += struct.pack(f"<{kind}", value)

    def text(self, text: str) -> None:
        own = text.encode() + (b"\0" if self.cdr else b"")
        self.add("I", len(own))
        self.content += own

    def head(self, stamp_ns: int, frame: str) -> None:
        if not self.cdr:
            self.add("I", 0)
        self.add("I", *divmod(stamp_ns, 10**9))
        self.text(frame)
