"""What rays meet among small planes, ray by ray in compiled code.

Sums of three products are taken in the order in which numpy's `einsum` takes them, so that what other code works out
for many rays at once is the same to the last bit. Imported by need alone, since compilers take a while to load.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.elementary.compiled import angle_of
from lidarcheck.jit import inlined, kernel

__all__ = ["Lines", "along", "incidence_deg", "nearest_cells", "shared_cells", "spread_of"]

_SAME, _NUDGE = 1e-12, 1e-7
_DEG_PER_RAD = 180.0 / math.pi


@inlined
def _product(a: FloatArray, i: int, b: FloatArray, j: int) -> Any:
    return (a[i, 0] * b[j, 0] + a[i, 2] * b[j, 2]) + a[i, 1] * b[j, 1]


@inlined
def _alike(a: FloatArray, i: int, b: FloatArray, j: int) -> Any:
    return abs(a[i, 0] - b[j, 0]) < _SAME and abs(a[i, 1] - b[j, 1]) < _SAME and abs(a[i, 2] - b[j, 2]) < _SAME


@kernel
def along(
    rows: IndexArray,
    origin: FloatArray,
    direction: FloatArray,
    planes: tuple[FloatArray, FloatArray],
    point_m: FloatArray,
    own: tuple[FloatArray, FloatArray],
    own_distance_m: FloatArray,
    stretch: float,
    found: FloatArray,
) -> None:
    """Where rays (n, 3) meet the planes of those rows (n,), into `found` (n,): `LocalSurfaces.along`.

    `planes`: m . x = offset; `own`: origins and directions of the rows' own rays.
    """
    m, offset = planes
    own_origin, own_direction = own
    for i in range(len(rows)):
        row = rows[i]
        found[i] = 0.0
        if row < 0 or not own_distance_m[row] > 0.0:
            continue
        to_plane = offset[row] - _product(m, row, origin, i)
        if not to_plane > 0.0:
            continue
        if _alike(direction, i, own_direction, row) and _alike(origin, i, own_origin, row):
            found[i] = own_distance_m[row]
            continue
        toward = _product(m, row, direction, i)
        x, y, z = point_m[row, 0] - origin[i, 0], point_m[row, 1] - origin[i, 1], point_m[row, 2] - origin[i, 2]
        reach = math.sqrt((x * x + y * y) + z * z)
        distance = to_plane / toward if toward * reach > 1e-9 else math.inf
        found[i] = min(max(distance, reach / stretch), reach * stretch)


@kernel
def incidence_deg(
    rows: IndexArray,
    direction: FloatArray,
    m: FloatArray,
    own_deg: FloatArray,
    own_direction: FloatArray,
    stated_deg: FloatArray,
    found: FloatArray,
) -> None:
    """The incidence of rays (n, 3) on the planes of those rows (n,), into `found` (n,): `LocalSurfaces.incidence_deg`.

    A row below 0 is one from the end, as an index of numpy's.
    """
    for i in range(len(rows)):
        row = rows[i] if rows[i] >= 0 else rows[i] + len(m)
        change = 0.0
        if not _alike(direction, i, own_direction, row):
            length = math.sqrt((m[row, 0] * m[row, 0] + m[row, 1] * m[row, 1]) + m[row, 2] * m[row, 2])
            cosine = 1.0
            if length > 0.0:
                cosine = min(abs(_product(m, row, direction, i)) / length, 1.0)
            angle = angle_of(math.sqrt((1.0 - cosine) * (1.0 + cosine)), cosine)
            change = angle * _DEG_PER_RAD - own_deg[row]
        found[i] = min(max(stated_deg[row] + change, 0.0), 90.0)


class Lines(NamedTuple):
    """Layers and points as evenly spaced lines: `per_rad` and `first` of elevation and of azimuth.

    Azimuths lie within half a turn of `middle_rad`, where not `plain`. `counts`: layers and points; of these every
    `stride`-th from `offset` on was fired. `round`: whether the last fired points lie beside the first.
    """

    per_rad: tuple[float, float]
    first: tuple[float, float]
    middle_rad: float
    plain: bool
    counts: tuple[int, int]
    stride: tuple[int, int]
    offset: tuple[int, int]
    round: bool


@inlined
def _line_of(x: float, y: float, z: float, lines: Lines) -> Any:
    """Layer and point in whose direction a position lies, with fractions."""
    azimuth = angle_of(y, x)
    if not lines.plain:
        azimuth += 2.0 * math.pi * np.rint((lines.middle_rad - azimuth) / (2.0 * math.pi))
    elevation = angle_of(z, math.sqrt(x * x + y * y))
    return elevation * lines.per_rad[0] - lines.first[0], azimuth * lines.per_rad[1] - lines.first[1]


@kernel
def nearest_cells(position: FloatArray, lines: Lines, turns: bool, found: IndexArray) -> None:
    """The cell in whose direction each position (n, 3) lies, into `found` (n,): `BeamGrid.nearest_cell`."""
    layers, points = lines.counts
    for i in range(len(found)):
        line, column = _line_of(position[i, 0], position[i, 1], position[i, 2], lines)
        layer, point = int(np.rint(line)), int(np.rint(column))
        if turns:
            point %= points
        found[i] = min(max(layer, 0), layers - 1) * points + min(max(point, 0), points - 1)


@kernel
def shared_cells(
    position: FloatArray,
    lines: Lines,
    borders: tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]],
    found: IndexArray,
) -> None:
    """The cell whose surface reaches to the direction of each position (n, 3), into `found`: `BeamGrid.cells`.

    `borders`: where each cell ends upward and to the left, as parts of the way to the next.
    """
    layers, points = lines.counts
    s, t = lines.stride
    a, b = lines.offset
    last, columns = (layers - 1 - a) // s, points // t
    end = (points - 1 - b) // t
    up, aside = borders
    for k in range(len(found)):
        line, column = _line_of(position[k, 0], position[k, 1], position[k, 2], lines)
        line = min(max((line - a) / s + _NUDGE, 0.0), float(last))
        i = min(int(line), last)
        if lines.round:
            column = ((column - b) / t + _NUDGE) % columns
            j = min(int(column), columns - 1)
        else:
            column = min(max((column - b) / t + _NUDGE, 0.0), float(end))
            j = min(int(column), end)
        cell = (i * s + a) * points + j * t + b
        beyond = 1 if column - j > aside[cell] else 0
        over = 1 if line - i > up[cell] else 0
        j = (j + beyond) % columns if lines.round else j + beyond
        found[k] = (i * s + a + over * s) * points + j * t + b


@kernel
def spread_of(
    distance_m: FloatArray,
    material: npt.NDArray[np.int32],
    number: npt.NDArray[np.int32],
    least_m: float,
    found: BoolArray,
) -> None:
    """Whether rays (n, k) of each row meet more than one range or surface, into `found` (n,)."""
    for i in range(len(found)):
        low, high, other = distance_m[i, 0], distance_m[i, 0], False
        for j in range(1, distance_m.shape[1]):
            low, high = min(low, distance_m[i, j]), max(high, distance_m[i, j])
            other |= material[i, j] != material[i, 0] or number[i, j] != number[i, 0]
        found[i] = other or high - low > least_m or (low == 0.0 and high > 0.0)
