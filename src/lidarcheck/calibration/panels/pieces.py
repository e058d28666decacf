"""Flat pieces in a beam image: connected beams on one plane, without their stands, of one brightness."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.panels.image import BeamImage
from lidarcheck.calibration.panels.masks import FEWEST, closed, opened, parted_at_lines, parts_of
from lidarcheck.calibration.panels.planes import FittedPlane, fit_plane, planes_of, spread_of

__all__ = ["Piece", "pieces_of"]

STEP_M = {True: 0.03, False: 0.15}
"""Range step that parts two beams on a surface facing the sensor: of an ideal scan, of a measured one."""
TILT = {True: 3.0, False: 1.0}
"""Range step per width of a beam that a tilted surface is allowed: tan 72°, tan 45°."""
SMOOTHED_LAYERS = 2
STAND_M = 0.16
"""What is narrower than this belongs to a stand."""
EXPECTED = 4.0
"""A layer or point of a surface without one echo, where this many are expected, is a gap."""
MOST_OFF = 0.4
ELSEWHERE_M = 0.4
"""Neighbouring beams this far from a plane see another surface through a hole in it."""
CLOSED = (7, 3)
"""Losses at a piece's border up to this many layers and points are no part of its form."""
LEAST_CONTRAST = 0.02
LEAST_STEP_M = 0.06


@dataclass(frozen=True)
class Piece:
    """Beams on one plane: `mask` (rows, columns) over `layers` x `points` of the image.

    `split`: only its brightness parts it from its neighbour.
    """

    plane: FittedPlane
    layers: slice
    points: slice
    mask: BoolArray
    key: int
    tolerance_m: float
    split: bool = False

    @property
    def beams(self) -> int:
        """How many beams lie on it."""
        return int(np.count_nonzero(self.mask))

    @property
    def centre(self) -> tuple[int, int]:
        """Layer and point of its middle."""
        rows, columns = np.nonzero(self.mask)
        return self.layers.start + int(np.median(rows)), self.points.start + int(np.median(columns))


def pieces_of(image: BeamImage, taking_part: BoolArray) -> list[Piece]:
    """Every flat piece of at least a dozen beams among those that take part, (layers, points)."""
    range_m = np.where(taking_part, image.range_m, np.nan)
    if not image.ideal:
        range_m = _smoothed(range_m)
    label = _connected(image, range_m)
    dead = _dead(image)
    found: list[Piece] = []
    groups = _groups(label, np.isfinite(range_m))
    whole = groups if image.ideal else (part for group in groups for part in _parted_at_steps(image, *group))
    for rows, columns in whole:
        for plane, mask, corner, tolerance in _flat_parts(image, range_m, rows, columns):
            for part in _parted_at_gaps(image, mask, corner, dead):
                for body in _bodies(image, part, corner, plane):
                    shades = list(_by_brightness(image, body, corner, plane))
                    found.extend(_piece(image, range_m, at, corner, tolerance, len(shades) > 1) for at in shades)
    return found


def _piece(
    image: BeamImage, range_m: FloatArray, mask: BoolArray, corner: tuple[int, int], tolerance_m: float, split: bool
) -> Piece:
    """The piece with a plane of its own, fitted to its own beams, in the smallest patch."""
    rows, columns = np.nonzero(mask)
    at = (rows + corner[0], columns + corner[1])
    seen = np.isfinite(range_m[at])
    plane = fit_plane(image.direction[at][seen], range_m[at][seen])
    box = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    top, left = corner[0] + int(rows.min()), corner[1] + int(columns.min())
    height, width = mask[box].shape
    key = int(image.key[at[0][0], at[1][0]])
    return Piece(plane, slice(top, top + height), slice(left, left + width), mask[box], key, tolerance_m, split)


def _smoothed(range_m: FloatArray) -> FloatArray:
    """Median along five layers, which also fills up to three lost beams between two that echo; then single points."""
    rows, columns = range_m.shape
    padded = np.full((rows + 2 * SMOOTHED_LAYERS, columns), np.nan, dtype=np.float32)
    padded[SMOOTHED_LAYERS:-SMOOTHED_LAYERS] = range_m
    stack = np.stack([padded[i : i + rows] for i in range(2 * SMOOTHED_LAYERS + 1)])
    seen = np.isfinite(stack)
    below, above = seen[:SMOOTHED_LAYERS].any(axis=0), seen[SMOOTHED_LAYERS + 1 :].any(axis=0)
    stack.sort(axis=0)
    middle = np.maximum(seen.sum(axis=0) - 1, 0) // 2
    smooth = np.take_along_axis(stack, middle[None], axis=0)[0].astype(np.float64)
    smooth[~(seen[SMOOTHED_LAYERS] | (below & above))] = np.nan
    left, right = np.roll(smooth, 1, axis=1), np.roll(smooth, -1, axis=1)
    gap = np.isnan(smooth) & (np.abs(left - right) < STEP_M[False])
    gap[:, [0, -1]] = False
    return np.asarray(np.where(gap, 0.5 * (left + right), smooth), dtype=np.float64)


def _connected(image: BeamImage, range_m: FloatArray) -> IndexArray:
    """A number for each group of neighbours without a step in range and of one key, shape of the image."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    index = np.arange(range_m.size).reshape(range_m.shape)
    ends = []
    for axis, angle in ((0, image.layer_step_rad), (1, image.point_step_rad)):
        here, there = (slice(None, -1), slice(1, None)) if axis == 0 else (np.s_[:, :-1], np.s_[:, 1:])
        near = np.fmin(range_m[here], range_m[there])
        step = np.abs(range_m[here] - range_m[there])
        joined = step <= STEP_M[image.ideal] + TILT[image.ideal] * angle * near
        joined &= image.key[here] == image.key[there]
        ends.append((index[here][joined], index[there][joined]))
    i, j = (np.concatenate(parts) for parts in zip(*ends, strict=True))
    graph = coo_matrix((np.ones(len(i), dtype=np.bool_), (i, j)), shape=(range_m.size, range_m.size))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64).reshape(range_m.shape)


def _groups(label: IndexArray, valid: BoolArray) -> Iterator[tuple[IndexArray, IndexArray]]:
    """Rows and columns of the beams of each label that has enough of them."""
    flat = np.flatnonzero(valid)
    order = flat[np.argsort(label.ravel()[flat], kind="stable")]
    if not order.size:
        return
    name = label.ravel()[order]
    cuts = np.flatnonzero(np.append(True, name[1:] != name[:-1]))
    for start, end in zip(cuts, np.append(cuts[1:], len(order)), strict=True):
        if end - start >= FEWEST:
            yield np.divmod(order[start:end], label.shape[1])


def _parted_at_steps(
    image: BeamImage, rows: IndexArray, columns: IndexArray
) -> Iterator[tuple[IndexArray, IndexArray]]:
    """A connected group, cut where the range steps along a whole line between two layers or two points.

    A plane could be laid askew through two panels side by side, one half a metre farther; the line between them tells.
    """
    top, left = int(rows.min()), int(columns.min())
    mask = np.zeros((int(rows.max()) + 1 - top, int(columns.max()) + 1 - left), dtype=np.bool_)
    mask[rows - top, columns - left] = True
    here = (slice(top, top + mask.shape[0]), slice(left, left + mask.shape[1]))
    # As measured: smoothing would make neighbours alike, and chance look like a step.
    range_m = np.where(mask, image.range_m[here], np.nan)
    seen = range_m[np.isfinite(range_m)]
    for part in parted_at_lines(image, range_m, mask, float(np.median(seen)) if seen.size else 0.0, LEAST_STEP_M):
        at = np.nonzero(part)
        yield at[0] + top, at[1] + left


def _dead(image: BeamImage) -> tuple[BoolArray, BoolArray]:
    """Layers and points that echo far less than their neighbours, across the whole view."""
    seen, out = np.isfinite(image.range_m), []
    for axis in (1, 0):
        rate = np.count_nonzero(seen, axis=axis) / np.maximum(np.count_nonzero(image.fired, axis=axis), 1)
        padded = np.pad(rate, 5, mode="edge")
        around = np.median(np.stack([padded[i : i + len(rate)] for i in range(11)]), axis=0)
        out.append(rate < 0.2 * around)
    return out[0], out[1]


def _flat_parts(
    image: BeamImage, range_m: FloatArray, rows: IndexArray, columns: IndexArray
) -> Iterator[tuple[FittedPlane, BoolArray, tuple[int, int], float]]:
    """Planes of a connected group, each with its mask, the patch's first layer and point, and the tolerance."""
    direction, r = image.direction[rows, columns], range_m[rows, columns]
    tolerance = _tolerance(image, range_m, rows, columns)
    top, left = max(int(rows.min()) - 1, 0), max(int(columns.min()) - 1, 0)
    bottom, right = (min(int(index.max()) + 2, n) for index, n in zip((rows, columns), image.shape, strict=True))
    shape = (bottom - top, right - left)

    def patch(chosen: IndexArray | BoolArray) -> BoolArray:
        mask = np.zeros(shape, dtype=np.bool_)
        mask[rows[chosen] - top, columns[chosen] - left] = True
        return mask

    single = fit_plane(direction, r)
    off = np.abs(r - single.range_m(direction)) > tolerance
    # A saturated echo may split, and lie 0.3 m nearer; such beams are scattered, those of a second surface together.
    together = np.count_nonzero(opened(patch(off), (4, 2)))
    if np.mean(off) <= MOST_OFF and together < max(FEWEST, 0.05 * len(r)):
        yield single, patch(np.ones(len(r), dtype=np.bool_)), (top, left), tolerance
        return
    for plane, on in planes_of(direction, r, tolerance, FEWEST):
        yield plane, patch(on), (top, left), tolerance


def _tolerance(image: BeamImage, range_m: FloatArray, rows: IndexArray, columns: IndexArray) -> float:
    """Three standard deviations of the noise between neighbouring layers, 12 to 25 cm; 2 cm in an ideal scan.

    Not less, since near panels look uneven: where the echo saturates, its range depends on where in a bin it begins.
    """
    if image.ideal:
        return 0.02
    raw = image.range_m
    below = np.minimum(rows + 1, raw.shape[0] - 1)
    step = raw[below, columns] - raw[rows, columns]
    step = step[np.isfinite(step) & np.isfinite(range_m[below, columns])]
    return float(np.clip(3.0 * spread_of(step) / np.sqrt(2.0), 0.12, 0.25))


def _parted_at_gaps(
    image: BeamImage, mask: BoolArray, corner: tuple[int, int], dead: tuple[BoolArray, BoolArray]
) -> Iterator[BoolArray]:
    """The connected parts of a mask once layers and points without echoes, where some are expected, are cut out."""
    here = (slice(corner[0], corner[0] + mask.shape[0]), slice(corner[1], corner[1] + mask.shape[1]))
    seen = mask & np.isfinite(image.range_m[here])
    rate = int(np.count_nonzero(seen)) / max(int(np.count_nonzero(mask)), 1)
    cut = mask.copy()
    for axis, lost in ((1, dead[0][here[0]]), (0, dead[1][here[1]])):
        empty = ~seen.any(axis=axis) & (np.count_nonzero(mask, axis=axis) * rate >= EXPECTED) & ~lost
        cut &= ~(empty[:, None] if axis == 1 else empty[None, :])
    yield from parts_of(cut)


def _bodies(image: BeamImage, mask: BoolArray, corner: tuple[int, int], plane: FittedPlane) -> Iterator[BoolArray]:
    """A part without what is as narrow as a stand."""
    from scipy.ndimage import binary_fill_holes

    rows, columns = np.nonzero(mask)
    middle = image.direction[corner[0] + int(np.median(rows)), corner[1] + int(np.median(columns))]
    range_m = float(plane.range_m(middle))
    if not np.isfinite(range_m):
        return
    size = tuple(
        int(np.clip(np.ceil(STAND_M / (range_m * angle)), 2, max(int(np.ptp(index)) // 2, 1)))
        for index, angle in ((rows, image.layer_step_rad), (columns, image.point_step_rad))
    )
    here = (slice(corner[0], corner[0] + mask.shape[0]), slice(corner[1], corner[1] + mask.shape[1]))
    off = np.abs(image.range_m[here] - plane.range_m(image.direction[here])) > ELSEWHERE_M
    whole = np.asarray(binary_fill_holes(closed(mask, CLOSED))) & ~opened(off, (2, 2))
    yield from parts_of(opened(whole, size))


def _by_brightness(
    image: BeamImage, mask: BoolArray, corner: tuple[int, int], plane: FittedPlane
) -> Iterator[BoolArray]:
    """Panels side by side on one plane differ in brightness only: the parts between lines along which it steps."""
    here = (slice(corner[0], corner[0] + mask.shape[0]), slice(corner[1], corner[1] + mask.shape[1]))
    rows, columns = np.nonzero(mask)
    box = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    bright = np.where(mask, image.log_area[here], np.nan)
    range_m = float(np.median(plane.range_m(image.direction[here][mask])))
    for part in parted_at_lines(image, bright[box], mask[box], range_m, LEAST_CONTRAST):
        whole = np.zeros_like(mask)
        whole[box] = part
        yield whole
