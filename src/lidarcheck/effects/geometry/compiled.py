"""What rays meet among small planes, ray by ray in compiled code.

Sums of three products are taken in the order in which numpy's `einsum` takes them, so that what other code works out
for many rays at once is the same to the last bit. Imported by need alone, since compilers take a while to load.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.elementary.compiled import angle_of
from lidarcheck.jit import inlined, kernel

__all__ = [
    "Lines",
    "Rows",
    "along",
    "incidence_deg",
    "most_agreed",
    "nearest_cells",
    "shared_cells",
    "slopes",
    "spread_of",
]

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
    material: IntArray,
    number: IntArray,
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


class Rows(NamedTuple):
    """What each row of a scan lies in: `layer`, `point` and `slot`, its rank there, (n,); and the rows of each cell.

    `first`, `counts` (cells,), `order` (n,): as `BeamGrid` has them.
    """

    layer: IntArray
    point: IntArray
    slot: IntArray
    first: IndexArray
    counts: IndexArray
    order: IndexArray


@inlined
def _beside(i: int, layers: int, points: int, rows: Rows, lines: Lines) -> Any:
    """The row of equal rank that many strides up and to the left; -1: there is none."""
    layer = np.int64(rows.layer[i]) + layers * lines.stride[0]
    point = np.int64(rows.point[i]) + points * lines.stride[1]
    if lines.round:
        point %= lines.counts[1]
    if not (0 <= layer < lines.counts[0] and 0 <= point < lines.counts[1]):
        return np.int64(-1)
    cell = layer * lines.counts[1] + point
    if rows.slot[i] >= rows.counts[cell]:
        return np.int64(-1)
    return rows.order[rows.first[cell] + rows.slot[i]]


@kernel
def slopes(
    q: FloatArray,
    label: IntArray,
    rows: Rows,
    lines: Lines,
    vertical: bool,
    step: tuple[float, float],
    limits: tuple[float, float, float],
    value: FloatArray,
    side: FloatArray,
    known: BoolArray,
) -> None:
    """dq/dangle, to which side it was taken, -1, 0 or 1, and whether it is known; (n,) each: `planes._slopes`.

    Of the two one-sided slopes and the central one it is the one along which q bends least. `step`: sine and cosine of
    the angle from a row to the next; `limits`: of the bend, of itself and of its step, and of two rows alone.
    """
    sine, cosine = step
    for i in range(len(q)):
        value[i], side[i], known[i] = 0.0, 0.0, False
        if q[i] == 0.0:
            continue
        up, left = (1, 0) if vertical else (0, 1)
        after, behind = _beside(i, up, left, rows, lines), _beside(i, -up, -left, rows, lines)
        second, third = _beside(i, 2 * up, 2 * left, rows, lines), _beside(i, -2 * up, -2 * left, rows, lines)
        near = after >= 0 and q[after] > 0.0 and label[after] == label[i]
        back = behind >= 0 and q[behind] > 0.0 and label[behind] == label[i]
        next_ = near and second >= 0 and q[second] > 0.0 and label[second] == label[i]
        last = back and third >= 0 and q[third] > 0.0 and label[third] == label[i]
        forward, backward = q[after] - q[i], q[i] - q[behind]
        best, at, bend = math.inf, 0.0, 0.0
        if near and back:
            bend, change = 0.5 * abs(forward - backward), 0.5 * (forward + backward)
            if bend <= max(limits[0] * q[i], limits[1] * abs(change)):
                best = bend
        if next_:
            bend = abs(q[second] - q[after] - forward)
            if bend < best and bend <= max(limits[0] * q[i], limits[1] * abs(forward)):
                best, at = bend, 1.0
        if last:
            bend = abs(backward - q[behind] + q[third])
            if bend < best and bend <= max(limits[0] * q[i], limits[1] * abs(backward)):
                best, at = bend, -1.0
        if not (next_ or last or (near and back)):
            if near and abs(forward) <= limits[2] * q[i]:
                best, at = 0.0, 1.0
            if back and abs(backward) <= limits[2] * q[i]:
                best, at = 0.0, -1.0
        if best == math.inf:
            continue
        known[i], side[i] = True, at
        if at > 0.0:
            value[i] = (q[after] - q[i] * cosine) / sine
        elif at < 0.0:
            value[i] = (q[i] * cosine - q[behind]) / sine
        else:
            value[i] = 0.5 * (forward + backward) / sine


@inlined
def _agreeing(left: float, up: float, used: BoolArray, lines: Any, allowed: FloatArray, off: FloatArray) -> Any:
    """How many of 8 lie on the plane with those slopes, and how far they are off together, as numpy adds up 8."""
    a, b, change = lines
    number = 0
    for k in range(8):
        apart = abs(left * a[k] + up * b[k] - change[k])
        on = used[k] and apart <= allowed[k]
        off[k] = apart if on else 0.0
        number += 1 if on else 0
    return number, ((off[0] + off[1]) + (off[2] + off[3])) + ((off[4] + off[5]) + (off[6] + off[7]))


@kernel
def most_agreed(
    used: BoolArray,
    lines: tuple[FloatArray, FloatArray, FloatArray],
    allowed: FloatArray,
    ridge: float,
    off: FloatArray,
    best: BoolArray,
) -> None:
    """Of the planes through each row and two of the 8 beside it those that lie on the one that most do, into `best`.

    Shapes (n, 8): whether one beside is `used`; `lines`: how far it lies to the left, up, and the change of q to there;
    how far that may be off. Of planes on which as many lie the one that they are off least in all. `off`: room for 8.
    """
    for row in range(len(used)):
        a, b, change = lines[0][row], lines[1][row], lines[2][row]
        count, rest = 0, math.inf
        best[row, :] = False
        for i in range(7):
            for j in range(i + 1, 8):
                if not (used[row, i] and used[row, j]):
                    continue
                aa, bb, ab = a[i] * a[i] + a[j] * a[j], b[i] * b[i] + b[j] * b[j], a[i] * b[i] + a[j] * b[j]
                ac, bc = a[i] * change[i] + a[j] * change[j], b[i] * change[i] + b[j] * change[j]
                middle = 0.5 * (aa + bb)
                aa, bb = aa + ridge * middle, bb + ridge * middle
                whole = aa * bb - ab * ab if middle > 0.0 else 1.0
                left, up = (ac * bb - bc * ab) / whole, (bc * aa - ac * ab) / whole
                number, together = _agreeing(left, up, used[row], (a, b, change), allowed[row], off)
                if number > count or (number == count and together < rest):
                    count, rest = number, together
                    for k in range(8):
                        best[row, k] = used[row, k] and abs(left * a[k] + up * b[k] - change[k]) <= allowed[row, k]
