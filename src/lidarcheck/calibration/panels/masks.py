"""Masks of beams: opened, closed, cut into connected parts and along lines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.calibration.panels.image import BeamImage
from lidarcheck.calibration.panels.planes import spread_of

__all__ = ["FEWEST", "closed", "opened", "parted_at_lines", "parts_of"]

FEWEST = 12
"""Beams of the smallest piece."""
CLEAR_STEP = 6.0
"""A step must be this many of its standard errors, and the least of range or of log amplitude."""
NARROWEST_M = 0.2
"""Lines at which surfaces are parted are no closer than this."""
QUARTILES_PER_SIGMA = 1.349
FEWEST_STEPS = 4


def parted_at_lines(
    image: BeamImage, values: FloatArray, mask: BoolArray, range_m: float, least: float
) -> Iterator[BoolArray]:
    """The parts of a mask between the lines along which the values step by at least `least`, each of its shape."""
    if not 0.0 < range_m < np.inf:
        yield mask
        return
    lines = [
        np.cumsum(np.append(False, _steps(patch, least, int(np.ceil(NARROWEST_M / (range_m * angle))))))
        for patch, angle in ((values.T, image.layer_step_rad), (values, image.point_step_rad))
    ]
    if not (lines[0][-1] or lines[1][-1]):
        yield mask
        return
    cell = lines[0][:, None] * (lines[1][-1] + 1) + lines[1][None, :]
    for number in np.unique(cell):
        yield from parts_of(mask & (cell == number))


def _steps(patch: FloatArray, least: float, apart: int) -> BoolArray:
    """Between which columns of a patch the values step, shape (columns - 1,): the median step stands out.

    Steps less than `apart` columns from each other or from the patch's edges are one, or none.
    """
    from scipy.ndimage import maximum_filter1d, median_filter

    columns = patch.shape[1]
    if columns < 2 * apart or columns < 3:
        return np.zeros(columns - 1, dtype=np.bool_)
    step = np.sort(np.diff(patch, axis=1), axis=0)  # NaN last
    count = np.count_nonzero(np.isfinite(step), axis=0)
    quarter, middle, upper = (
        np.take_along_axis(step, (np.maximum(count - 1, 0) * i // 4)[None], axis=0)[0] for i in (1, 2, 3)
    )
    known = count >= FEWEST_STEPS
    if not known.any():
        return np.zeros(columns - 1, dtype=np.bool_)
    middle = np.where(known, middle, np.median(middle[known]))
    jump = np.abs(middle - median_filter(middle, 7, mode="nearest"))
    # Of its own line where that is noisier: a weak panel beside a strong one.
    noise = np.fmax((upper - quarter) / QUARTILES_PER_SIGMA, spread_of(step[np.isfinite(step)]))
    clear = known & (jump > np.maximum(least, CLEAR_STEP * noise / np.sqrt(np.maximum(count, 1))))
    clear[: apart - 1] = clear[columns - apart :] = False
    clear &= jump >= maximum_filter1d(jump, 2 * apart - 1)
    return np.asarray(clear)


def parts_of(mask: BoolArray) -> Iterator[BoolArray]:
    """The connected parts of a mask that hold enough beams, each of the mask's shape."""
    from scipy.ndimage import label

    parts, _ = label(mask)
    for i in np.flatnonzero(np.bincount(parts.ravel()) >= FEWEST):
        if i:
            yield parts == i


def closed(mask: BoolArray, size: tuple[int, int]) -> BoolArray:
    """Morphological closing by a rectangle of odd sides: what is narrower is filled, at the border too."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    margin = tuple((length // 2, length // 2) for length in size)
    out = np.pad(mask, margin).astype(np.uint8)
    for axis, length in enumerate(size):
        out = maximum_filter1d(out, length, axis=axis, mode="constant", cval=0)
    for axis, length in enumerate(size):
        out = minimum_filter1d(out, length, axis=axis, mode="constant", cval=0)
    return np.asarray(out[margin[0][0] : out.shape[0] - margin[0][1], margin[1][0] : out.shape[1] - margin[1][1]] > 0)


def opened(mask: BoolArray, size: tuple[int, ...]) -> BoolArray:
    """Morphological opening by a rectangle: what no rectangle of that size fits into goes."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    out = mask.astype(np.uint8)
    for axis, length in enumerate(size):
        out = minimum_filter1d(out, length, axis=axis, mode="constant", cval=0)
    for axis, length in enumerate(size):
        # An even window reaches one beam farther down; its mirror image must reach one farther up.
        out = maximum_filter1d(out, length, axis=axis, mode="constant", cval=0, origin=-1 if length % 2 == 0 else 0)
    return out.astype(np.bool_) & mask
