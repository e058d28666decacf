"""The columns of a scan that tell its beams, by whatever name a driver gives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.columns import INT32_MAX, LENGTH_MAX_M, missing, real_column, whole_column
from lidarcheck.formats.geometry.steps import coordinate_steps, direction_error_m
from lidarcheck.formats.returns import no_returns
from lidarcheck.formats.table import Table
from lidarcheck.formats.times import TIME_COLUMNS, frame_of

__all__ = ["RING_NAMES", "Cloud", "clouds_of"]

Column = npt.NDArray[Any]

RING_NAMES = ("ring", "channel", "line", "laser_id")
"""What drivers call the number of a row's laser."""
_AXES = ("X", "Y", "Z")
_KINDS = ("ReturnType", "return_type", "EchoNumber")


@dataclass(frozen=True)
class Cloud:
    """One frame's rows with an echo; columns of shape (n,), None where the file has none.

    `position` (n, 3), as in the file; `layer`, `point`; `ring` by whatever name; `column`; `time` as it is written;
    `range` as it is written; `kind`: return kind or echo number. `cell` (n,), `height`, `width`: the place in an
    organised cloud. `error`: how far rounding may have moved a point, in the position's unit. `stamp_s`: the frame's
    own time since 1970.
    """

    position: FloatArray
    layer: Column | None = None
    point: Column | None = None
    ring: Column | None = None
    column: Column | None = None
    time: Column | None = None
    range: FloatArray | None = None
    kind: Column | None = None
    cell: Column | None = None
    height: int = 1
    width: int = 0
    error: float = 0.0
    stamp_s: float | None = None

    def __len__(self) -> int:
        return len(self.position)


def clouds_of(table: Table, *, ring: str | None = None) -> list[Cloud]:
    """The frames of a table. `ring`: the column of the rings, where it has another name than drivers give it.

    Frames are told apart by a column `Frame`. `InputError` without X, Y, Z, or without that column.
    """
    if missing(table, _AXES):
        lacking = ", ".join(missing(table, _AXES))
        raise table.fault(f"no column {lacking}: the beams are checked by X, Y, Z", fix="give a scan with X, Y, Z")
    if ring is not None and table.get(ring) is None:
        raise table.fault(f"no column {ring!r} with the rings", fix=f"its columns are {', '.join(table.names)}")
    frame = frame_of(table.columns)
    rows = np.arange(len(table))
    parts = [rows] if frame is None else [rows[frame == one] for one in np.unique(frame)]
    found = [_cloud(table, part, ring) for part in parts]
    if not any(len(cloud) for cloud in found):
        raise table.fault("no row has an echo", fix="give a scan with echoes")
    return [cloud for cloud in found if len(cloud)]


def _cloud(table: Table, rows: npt.NDArray[np.intp], ring: str | None) -> Cloud:
    part = table if len(rows) == len(table) else table.take(rows)
    empty = no_returns(part)
    kept = np.arange(len(part)) if empty is None else np.flatnonzero(~empty)
    echoes = part if empty is None else part.take(kept)
    position = np.stack([_floats(echoes, name) for name in _AXES], axis=-1)
    layer, point = (_whole(echoes, name) for name in ("Layer", "Point"))
    told = layer is not None and point is not None and ring is None
    name = next((one for one in ((ring,) if ring else RING_NAMES) if echoes.get(one) is not None), None)
    column = echoes.get("column")
    ranges = echoes.get("RANGE")
    organised = part.height > 1
    return Cloud(
        position=position,
        layer=None if ring else layer,
        point=point,
        # What is surer makes these superfluous, whatever stands in them.
        ring=None if told or name is None else _whole(echoes, name),
        column=None if told or column is None or column.dtype.kind not in "iu" else column,
        time=_time(echoes),
        range=None if ranges is None else ranges.astype(np.float64),
        kind=_first(echoes, _KINDS),
        cell=kept if organised else None,
        height=part.height,
        width=len(part) // part.height,
        error=direction_error_m(coordinate_steps(list(position.T))),
        stamp_s=table.stamp_s,
    )


def _whole(table: Table, name: str) -> Column | None:
    """A column of whole numbers, -1 where a row has none; `InputError` for others."""
    return None if table.get(name) is None else whole_column(table, name, -1, INT32_MAX)


def _floats(table: Table, name: str) -> FloatArray:
    return np.asarray(real_column(table, name, -LENGTH_MAX_M, LENGTH_MAX_M, "m"), dtype=np.float64)


def _first(table: Table, names: Sequence[str]) -> Column | None:
    return next((column for name in names if (column := table.get(name)) is not None), None)


def _time(table: Table) -> Column | None:
    """The time of each row, whole numbers before others; none where every row has the same."""
    found = [column for name in TIME_COLUMNS if (column := table.get(name)) is not None and len(np.unique(column)) > 1]
    return min(found, key=lambda column: column.dtype.kind not in "iu") if found else None
