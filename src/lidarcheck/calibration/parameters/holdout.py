"""Which beams are fitted and which are held out, and how many take part: dealt before anything looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray
from lidarcheck.calibration.parameters.fit_data import FitData, seed_of
from lidarcheck.cases.frame import Frame
from lidarcheck.errors import InputError
from lidarcheck.inference.observed.beam_table import BeamTable, key_of
from lidarcheck.model.chain import simulate
from lidarcheck.model.spec import Model

__all__ = ["Holdout", "is_separable", "split_beams", "thinned"]


_BLOCK = 8
"""Layers and points of a block, where blocks of one frame's beams are held out: wide beside what one pulse spreads to,
narrow beside what is in view, so that both halves see the same."""
FEWEST_BEAMS = 200
"""Beams that meet a surface, on either side: with fewer hardly a bin has beams enough for a sum."""


@dataclass(frozen=True)
class Holdout:
    """The beams to fit and those that are held out, and how that was decided, in words."""

    fit: FitData
    held_out: FitData
    words: str


def split_beams(data: FitData, file: str) -> Holdout:
    """Every other frame, in order of their median distance, is held out; of one frame every other block of beams."""
    frames, beams = data.frames, data.beams
    if len(frames) > 1:
        order = sorted(range(len(frames)), key=lambda i: (frames[i].median_range_m, frames[i].number))
        fitted, left = sorted(order[::2]), sorted(order[1::2])
        words = f"fitted to {_numbers(frames, fitted)}; held out: {_numbers(frames, left)}"
        in_fit = np.isin(beams.frame, fitted)
        fit, left_out = data.restricted(in_fit), data.restricted(~in_fit)
    else:
        words = f"there is one frame: every other block of {_BLOCK} x {_BLOCK} beams is held out"
        in_fit = _blocks(beams)
        fit, left_out = (FitData(frames, beams, used, data.seed, data.pool) for used in (in_fit, ~in_fit))
    split = Holdout(fit, left_out, words)
    for one, what in ((split.fit, "fit"), (split.held_out, "hold out")):
        count = int(np.count_nonzero(one.used & (one.beams.distance_m > 0.0)))
        if count < FEWEST_BEAMS:
            fault = f"only {count} beams that meet a surface are left to {what}"
            raise InputError(fault, file=file, fix=f"measure more: it takes {FEWEST_BEAMS} to fit and as many to test")
    return split


def _blocks(beams: BeamTable) -> BoolArray:
    row, column = (np.unique(line, return_inverse=True)[1] // _BLOCK for line in (beams.layer, beams.point))
    return np.asarray((row + column) % 2 == 0)


def _numbers(frames: Sequence[Frame], rows: Sequence[int]) -> str:
    return f"{'frame' if len(rows) == 1 else 'frames'} {', '.join(str(frames[i].number) for i in rows)}"


def is_separable(data: FitData, model: Model) -> bool:
    """Whether a beam shows the same, bit by bit, where others are left out: no effect looks from beam to beam."""
    frame = data.frames[0]
    rng = np.random.default_rng(seed_of(data.seed, "separable"))
    keep = (data.beams.frame != 0) | (rng.random(len(data.beams)) < 0.5)
    fewer = data.restricted(keep).frames[0]
    whole, part = (
        simulate(f.ideal, model, seed=seed_of(data.seed, "separable", 1), frame=f.number) for f in (frame, fewer)
    )
    rows = np.isin(key_of(0, whole.layer, whole.point), key_of(0, fewer.ideal.layer, fewer.ideal.point))
    same = whole.take(np.flatnonzero(rows))
    return len(same) == len(part) and all(
        np.array_equal(getattr(same, name), getattr(part, name)) for name in ("layer", "range_m", "area", "width_ns")
    )


def thinned(data: FitData, most: int, purpose: str) -> FitData:
    """The frames with at most so many beams, drawn by chance; of every material as many as of others, if it has them.

    Sound where beams are independent: the sums that are fitted are over beams, and which of them are summed up was
    decided by what they meet and not by what was measured.
    """
    rng = np.random.default_rng(seed_of(data.seed, purpose))
    if np.count_nonzero(data.used) == len(data.beams) <= most:
        return data
    material = np.where(data.used, data.beams.material_id, -2)
    kinds, counts = np.unique(material[data.used], return_counts=True)
    keep = np.zeros(len(data.beams), dtype=bool)
    left = most
    for done, i in enumerate(np.argsort(counts, kind="stable")):
        quota = min(int(counts[i]), left // (len(kinds) - done))
        keep[rng.permutation(np.flatnonzero(material == kinds[i]))[:quota]] = True
        left -= quota
    return data.restricted(keep)
