"""What the sensor calls each return: the first, the last, the strongest.

Sources: `tier4/nebula` (names and numbers), `valgur/velodyne_decoder` (`types.h`), Livox SDK (`tag`), user manuals of
Hesai (return mode).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import IntArray
from lidarcheck.formats.returns import Beams, Numbering

__all__ = ["RETURN_KINDS", "kinds_by_range", "livox_numbers", "return_kinds"]

Column = npt.NDArray[Any]

RETURN_KINDS = {
    "unknown": 0,
    "last": 1,
    "first": 2,
    "strongest": 3,
    "first weak": 4,
    "last weak": 5,
    "identical": 6,
    "second": 7,
    "second strongest": 8,
    "first strongest": 9,
    "last strongest": 10,
}
"""The numbers that the column `ReturnType` holds."""

_VELODYNE = {1: "strongest", 2: "last", 3: "last strongest"}
_LIVOX_SIGNS = ("line", "offset_time", "slot id", "lidar_id")
_HESAI_ONE = {0x37: "strongest", 0x38: "last"}
_HESAI_TWO = {0x39: ("strongest", "last"), 0x3B: ("first", "last"), 0x3C: ("first", "strongest")}
"""Two returns in order of range. What is strongest and not last lies nearer than the last, and so on."""
_HESAI_STRONGEST_TWO = 0x3E  # and the second strongest: in no order of range


def livox_numbers(columns: Mapping[str, Column]) -> Column | None:
    """Return numbers, from 1, out of a Livox `tag`, bits 4 and 5; None where there is none or it says nothing."""
    by_name = {name.casefold(): column for name, column in columns.items()}
    tag = by_name.get("tag")
    if tag is None or tag.dtype.kind not in "iu" or not any(name in by_name for name in _LIVOX_SIGNS):
        return None
    number = tag.astype(np.int64) >> 4 & 3
    return (number + 1).astype(np.int32) if number.any() else None


def return_kinds(columns: Mapping[str, Column]) -> IntArray | None:
    """What the sensor calls each return, as numbers of `RETURN_KINDS`, shape (n,); None where no column says it.

    Of two returns of a Hesai it is unknown; `kinds_by_range` tells them apart.
    """
    by_name = {name.casefold(): column for name, column in columns.items()}
    kind = by_name.get("return_type")
    if "returntype" in by_name:
        return by_name["returntype"].astype(np.int32) if by_name["returntype"].dtype.kind in "iu" else None
    livox = livox_numbers(columns)
    if livox is not None:
        return _coded(livox, {1: "first", 2: "second"})
    if kind is not None and kind.dtype.kind in "iu":
        if "channel" in by_name or "time_stamp" in by_name:  # nebula's own points
            return np.where((kind >= 0) & (kind <= max(RETURN_KINDS.values())), kind, 0).astype(np.int32)
        if "ring" in by_name and "column" in by_name:  # velodyne_decoder's
            return _coded(kind, _VELODYNE)
    mode = _hesai_mode(columns)
    return None if mode is None else _coded(mode, _HESAI_ONE)


def _coded(codes: Column, names: Mapping[int, str]) -> IntArray:
    kinds = np.zeros(len(codes), dtype=np.int32)
    for code, name in names.items():
        kinds[codes == code] = RETURN_KINDS[name]
    return kinds


def _hesai_mode(columns: Mapping[str, Column]) -> Column | None:
    """A Hesai's return mode, where the column holds its modes alone."""
    mode = next((column for name, column in columns.items() if name.casefold() == "return_mode"), None)
    known = (*_HESAI_ONE, *_HESAI_TWO, _HESAI_STRONGEST_TWO)
    return mode if mode is not None and mode.dtype.kind in "iu" and bool(np.isin(mode, known).all()) else None


def kinds_by_range(kinds: IntArray, columns: Mapping[str, Column], beams: Beams, numbering: Numbering) -> IntArray:
    """The kinds, shape (n,); of a Hesai's beam with two echoes by which of them is nearer."""
    mode = _hesai_mode(columns)
    if mode is None or not beams.told:
        return kinds
    kept = np.ones(len(kinds), dtype=np.bool_) if numbering.kept is None else numbering.kept
    keys = [beams.layer, beams.point, *([] if beams.frame is None else [beams.frame])]
    order = np.lexsort((numbering.number, *keys))
    order = order[kept[order]]
    count = np.diff(np.r_[np.flatnonzero(numbering.number[order] == 1), len(order)])
    two = np.zeros(len(kinds), dtype=np.bool_)
    two[order] = np.repeat(count == 2, count)
    kinds = kinds.copy()
    for code, names in _HESAI_TWO.items():
        for place, name in enumerate(names, start=1):
            kinds[two & (mode == code) & (numbering.number == place)] = RETURN_KINDS[name]
    return kinds
