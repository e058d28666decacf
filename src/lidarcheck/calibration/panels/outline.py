"""The outline of a flat piece: which beams must hit it, how large it is, and what stands around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.calibration.panels.image import BeamImage
from lidarcheck.calibration.panels.masks import opened
from lidarcheck.calibration.panels.pieces import Piece
from lidarcheck.calibration.panels.settings import PanelSettings

__all__ = ["STANDS_BACK_M", "Outline", "outline_of"]

STANDS_BACK_M = 0.12
"""What differs by more than this from the plane is another surface."""
MARGIN = 2
POST_LAYERS = 5
"""What hides part of a panel is at least this many layers high."""
LEVEL_COSINE = 0.8
FREE_SHARE, FREE_SHARE_SPLIT, LEAST_FREE_SHARE = 0.5, 0.25, 0.25
FULL_SHARE = 0.4
HANGING_SHARE = 0.5
MOST_ASPECT = 3.5
FLAT_SHARE = 0.6


@dataclass(frozen=True)
class Outline:
    """A piece over the patch `box` of the image: the beams `inside` its outline, and where its plane meets them.

    `middle` (3,): direction of its centre, at `range_m`. `free`, `joined`, `hidden`: lengths of its border [rad] with
    nothing or something farther behind, with a surface that goes on, behind something nearer. `hangs`: the share of its
    upper border that is joined, or may be. `full`: the share of its width times height that it fills; `flat`: of
    its beams that lie on the plane.
    """

    piece: Piece
    box: tuple[slice, slice]
    inside: BoolArray
    expected_m: FloatArray
    middle: FloatArray
    range_m: float
    width_m: float
    height_m: float
    free: float
    joined: float
    hidden: float
    hangs: float
    full: float
    flat: float

    @property
    def beams(self) -> int:
        """Beams inside."""
        return int(np.count_nonzero(self.inside))

    @property
    def incidence_deg(self) -> float:
        """Between the middle beam and the normal."""
        return self.piece.plane.incidence_deg(self.middle)

    def against(self, settings: PanelSettings) -> str:
        """Why this is no panel; empty where it is one."""
        least, most = settings.size_m
        near, far = settings.range_m
        wide, high = self.width_m, self.height_m
        if abs(float(self.piece.plane.normal[2])) > LEVEL_COSINE:
            return "lies flat, as a floor or a roof"
        if max(wide, high) > most:
            return f"larger than {most:g} m: a wall?"
        if min(wide, high) < least:
            return f"narrower than {least:g} m"
        if max(wide, high) > MOST_ASPECT * min(wide, high):
            return "long and narrow, as a pillar or a beam"
        if not near <= self.range_m <= far:
            return f"not within {near:g} to {far:g} m"
        if self.incidence_deg > settings.max_incidence_deg:
            return f"turned away by {self.incidence_deg:.0f} degrees"
        return self._against_shape()

    def _against_shape(self) -> str:
        if self.flat < FLAT_SHARE:
            return f"not flat: {100 * self.flat:.0f} % of its beams lie on one plane"
        if self.full < FULL_SHARE:
            return f"no rectangle: fills {100 * self.full:.0f} % of one"
        if self.hangs > HANGING_SHARE:
            return "goes on upward, to the roof or out of view: a pillar or part of a wall?"
        open_share = self.free / max(self.free + self.joined, 1e-12)
        if open_share < (FREE_SHARE_SPLIT if self.piece.split else FREE_SHARE):
            return "goes on into what is around it: part of a wall?"
        if self.free < LEAST_FREE_SHARE * (self.free + self.joined + self.hidden):
            return "seen between nearer things: part of a wall?"
        return ""

    def trimmed(self, image: BeamImage, settings: PanelSettings) -> BoolArray:
        """The inside without its four borders, shape of the patch."""
        from scipy.ndimage import minimum_filter1d

        out = self.inside.astype(np.uint8)
        sizes = ((settings.trim_layers, image.layer_step_rad), (settings.trim_points, image.point_step_rad))
        for axis, (beams, angle) in enumerate(sizes):
            cut = max(beams, int(np.ceil(settings.trim_m / (self.range_m * angle) - 1e-9)))
            out = minimum_filter1d(out, 2 * cut + 1, axis=axis, mode="constant", cval=0)
        return out.astype(np.bool_)


def outline_of(image: BeamImage, piece: Piece, taking_part: BoolArray) -> Outline:
    """The beams that geometry says must hit the piece, those without an echo too; `taking_part`: not floor or roof."""
    box = tuple(
        slice(max(side.start - MARGIN, 0), min(side.stop + MARGIN, n))
        for side, n in ((piece.layers, image.shape[0]), (piece.points, image.shape[1]))
    )
    mask = np.zeros((box[0].stop - box[0].start, box[1].stop - box[1].start), dtype=np.bool_)
    top, left = piece.layers.start - box[0].start, piece.points.start - box[1].start
    mask[top : top + piece.mask.shape[0], left : left + piece.mask.shape[1]] = piece.mask
    direction, range_m = image.direction[box], image.range_m[box]
    expected = piece.plane.range_m(direction)
    back = max(STANDS_BACK_M, 1.5 * piece.tolerance_m)
    nearer, farther = range_m < expected - back, range_m > expected + back
    hull = _filled(_filled(mask, 0), 1) & image.fired[box]
    # Scattered beams off the plane are the noise of this surface, not another one.
    hull &= ~opened(farther & hull, (2, 2))
    inside = hull & ~opened(nearer & hull, (POST_LAYERS, 1))
    if image.ideal:
        inside = hull & (image.key[box] == piece.key) & ~nearer & ~farther
    seen = hull & ~nearer & np.isfinite(range_m)
    flat = _share(seen & ~farther, seen)
    middle = direction[inside if inside.any() else mask].mean(axis=0)
    middle /= np.linalg.norm(middle)
    distance = float(piece.plane.range_m(middle))
    width, height = _extent(piece, direction[hull], expected[hull], image)
    cosine = max(float(piece.plane.normal @ middle), 0.05)
    beam_m2 = distance**2 * image.layer_step_rad * image.point_step_rad / cosine
    goes_on = ~(farther | np.isnan(range_m)) & (~nearer | ~taking_part[box])
    if image.ideal:
        goes_on &= (image.key[box] == piece.key) | ~taking_part[box]
    free, joined, hidden = _border(image, box, inside, goes_on, nearer & ~goes_on)
    above, below = (_shifted(inside, shift, 0) & ~inside for shift in (1, -1))
    onward = goes_on.copy()
    if _share(below & (goes_on | nearer), below) > HANGING_SHARE:
        onward |= nearer | ~image.fired[box]  # neither end shows: who knows how long it is
    hangs = _share(above & onward, above)
    full = np.count_nonzero(hull) * beam_m2 / (width * height)
    return Outline(
        piece,
        (box[0], box[1]),
        inside,
        expected,
        middle,
        distance,
        width,
        height,
        free,
        joined,
        hidden,
        hangs,
        full,
        flat,
    )


def _share(part: BoolArray, whole: BoolArray) -> float:
    return int(np.count_nonzero(part)) / max(int(np.count_nonzero(whole)), 1)


def _filled(mask: BoolArray, axis: int) -> BoolArray:
    """All between the first and the last beam of each row or column."""
    forward = np.maximum.accumulate(mask, axis=axis)
    backward = np.flip(np.maximum.accumulate(np.flip(mask, axis), axis=axis), axis)
    return np.asarray(forward & backward)


def _extent(piece: Piece, direction: FloatArray, expected: FloatArray, image: BeamImage) -> tuple[float, float]:
    """Width, level, and height on the plane, between the middles of the outermost beams and one beam more."""
    normal = piece.plane.normal
    level = np.array([-normal[1], normal[0], 0.0])
    level = level / np.linalg.norm(level) if np.linalg.norm(level) > 1e-6 else np.array([0.0, 1.0, 0.0])
    upward = np.cross(normal, level)
    if not np.all(np.isfinite(expected)):
        return float("nan"), float("nan")
    on_plane = direction * expected[:, None]
    sizes = []
    for axis, angle in ((level, image.point_step_rad), (upward, image.layer_step_rad)):
        place = on_plane @ axis
        step = float(np.median(expected)) * angle / max(float(np.median(direction @ normal)), 0.05)
        sizes.append(float(np.ptp(place)) + step)
    return sizes[0], sizes[1]


def _border(
    image: BeamImage, box: tuple[slice, ...], inside: BoolArray, goes_on: BoolArray, nearer: BoolArray
) -> tuple[float, float, float]:
    """Length of the border [rad] that is free, that is joined to more of it, that is hidden."""
    lengths = np.zeros(3)
    fired = image.fired[box]
    for axis, angle in ((0, image.point_step_rad), (1, image.layer_step_rad)):
        for shift in (1, -1):
            beyond = _shifted(inside, shift, axis) & ~inside & fired
            kinds = (beyond & ~goes_on & ~nearer, beyond & goes_on, beyond & nearer & ~goes_on)
            lengths += angle * np.array([np.count_nonzero(kind) for kind in kinds])
    return float(lengths[0]), float(lengths[1]), float(lengths[2])


def _shifted(mask: BoolArray, shift: int, axis: int) -> BoolArray:
    out = np.roll(mask, shift, axis=axis)
    edge = [slice(None), slice(None)]
    edge[axis] = slice(0, 1) if shift > 0 else slice(-1, None)
    out[tuple(edge)] = False
    return out
