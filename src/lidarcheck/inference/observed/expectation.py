"""What a model shows of each beam: how often it detects the surface, the features' means and their spreads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.inference.observed.beam_table import BeamTable
from lidarcheck.inference.observed.observations import Observations

__all__ = ["CLIP", "SCATTERS", "SPREAD_CLIP", "Expected", "across_steps", "expectation", "pose_weights"]

Partners = tuple[tuple[IndexArray, IndexArray], tuple[IndexArray, IndexArray]]

CLIP = 6.0
"""A residual counts at most so many standard deviations: single false echoes do not move a mean."""
SPREAD_CLIP = 16.0
"""The same of a squared difference of neighbours."""
SCATTERS = ((0, 0), (0, 1), (1, 0), (3, 0))
"""The features whose scatter is looked at, and between which neighbours: 0 along the column, 1 along the layer."""
_GROUPS = 40
"""Groups of beams about as bright, over which probabilities and spreads are smoothed."""
_RESOLVED = 0.5
"""A feature that scatters by less of its step shows the same whole number again and again."""
_MOST_WEIGHT = 5.0
"""No slope weighs more: at a grazing angle a single beam would outweigh all others."""


@dataclass(frozen=True)
class Expected:
    """What the model shows: detection probability (n,), mean and spread of each feature (n, 4); known (n,).

    `partner`: pairs of neighbours on one surface, along the column and along the layer, whose differences show
    scatter whatever the mean does; `square_mean`, `square_spread` (4,): of the scatter statistics. `at_edge` (n,):
    beams beside which there is another surface, or nothing.
    """

    probability: FloatArray
    mean: FloatArray
    spread: FloatArray
    known: npt.NDArray[np.bool_]
    square_mean: FloatArray
    square_spread: FloatArray
    at_edge: npt.NDArray[np.bool_]
    partner: Partners

    @property
    def log_area(self) -> FloatArray:
        """The mean ln AREA of each beam's surface, NaN where it is hardly seen, shape (n,)."""
        return np.where(self.known, self.mean[:, 1], np.nan)


def expectation(beams: BeamTable, base: Sequence[Observations]) -> Expected:
    """What a model shows of each beam, from what it shows with some seeds."""
    seen = np.array([s.detected for s in base])
    values = np.array([s.feature for s in base])
    count = seen.sum(axis=0)
    known = (count >= 2) & ~beams.crease
    mean = np.where(known[:, None], values.sum(axis=0) / np.maximum(count, 1)[:, None], 0.0)
    off = np.where(seen[..., None] & known[None, :, None], values - mean, 0.0)
    free = np.maximum(count - 1, 1)[:, None]
    own = (off**2).sum(axis=0) / free
    spread = _smooth_spread(mean[:, 1], own, known, np.maximum(count - 1, 0), beams.view.least_spread)
    spread[:, 1] = np.hypot(spread[:, 1], _rounding(beams, mean[:, 1], spread[:, 1]))
    probability = _smooth_probability(mean[:, 1], count, len(base), known, beams.distance_m > 0.0)
    partner = (_partners(beams, 0), _partners(beams, 1))
    square_mean, square_spread = _scatter(off / spread, seen & known[None, :], partner)
    own, beside = beams.distance_m[:, None], beams.neighbour_m
    apart = np.abs(own - beside) > 1.0 + 0.03 * np.maximum(own, beside)
    at_edge = np.asarray(np.any((beside >= 0.0) & apart, axis=1)) | beams.crease
    return Expected(probability, mean, spread, known, square_mean, square_spread, at_edge, partner)


def pose_weights(beams: BeamTable, expected: Expected) -> FloatArray:
    """Change of the range with the two angles in units of its spread, of order one; shape (n, 2)."""
    weight = beams.slope_m_per_deg / expected.spread[:, :1]
    scale = np.sqrt((weight**2).mean(axis=0)) + 1e-9
    return np.asarray(np.clip(weight / scale, -_MOST_WEIGHT, _MOST_WEIGHT))


def across_steps(beams: BeamTable, expected: Expected, drawn: Iterable[Observations]) -> Iterator[Observations]:
    """The draws with amplitudes anywhere within the step in which they are reported, where noise does not carry them
    across it: all beams of a layer that meet one surface cross together, however little its reflectance is off.
    """
    off = np.where(expected.known, _rounding(beams, expected.mean[:, 1], expected.spread[:, 1]), 0.0)
    if not off.any():
        yield from drawn
        return
    _, group = np.unique(np.column_stack([beams.frame, beams.layer, beams.material_id]), axis=0, return_inverse=True)
    for number, one in enumerate(drawn):
        rng = np.random.default_rng(np.random.SeedSequence([number, 78]))
        within = rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), int(group.max()) + 1)
        feature = one.feature.copy()
        feature[:, 1] += np.where(one.detected, off * within[group], 0.0)
        yield replace(one, feature=feature)


def _rounding(beams: BeamTable, amplitude: FloatArray, spread: FloatArray) -> FloatArray:
    """How far each beam's amplitude may be off by its step alone, as a standard deviation, shape (n,); 0 where noise
    carries it across. However many beams say the same, they know it no better."""
    slot = beams.view.slots[0]
    if not slot.name:
        return np.zeros(len(amplitude))
    step = slot.step / np.exp(np.clip(amplitude, 0.0, None)) if slot.log else np.full(len(amplitude), slot.step)
    return np.where(spread < _RESOLVED * step, step / np.sqrt(12.0), 0.0)


def _scatter(
    u: FloatArray,
    valid: npt.NDArray[np.bool_],
    partner: Partners,
) -> tuple[FloatArray, FloatArray]:
    """Mean and spread of the scatter statistics under the model."""
    centre, width = np.empty(4), np.empty(4)
    u = np.clip(u, -CLIP, CLIP)
    for j, (feature, axis) in enumerate(SCATTERS):
        mine, other = partner[axis]
        both = valid[:, mine] & valid[:, other]
        square = np.minimum(0.5 * (u[:, mine, feature] - u[:, other, feature]) ** 2, SPREAD_CLIP)[both]
        centre[j], width[j] = (square.mean(), square.std() + 1e-3) if len(square) else (1.0, 1.0)
    return centre, width


def _partners(beams: BeamTable, axis: int) -> tuple[IndexArray, IndexArray]:
    """Beams and their neighbours above (axis 0) or to the left (axis 1) on the same surface."""
    own, beside = beams.distance_m, beams.neighbour_m[:, 2 * axis]
    mine = np.flatnonzero((own > 0.0) & (beside > 0.0) & (np.abs(beside - own) < 0.06 * own))
    sort = np.lexsort((beams.layer, beams.point, beams.frame) if axis == 0 else (beams.point, beams.layer, beams.frame))
    following = np.empty(len(beams), dtype=np.int64)
    following[sort[:-1]] = sort[1:]
    following[sort[-1]] = sort[-1]
    return mine, following[mine]


def _smooth_probability(
    log_area: FloatArray, count: IndexArray, of: int, known: npt.NDArray[np.bool_], hit: npt.NDArray[np.bool_]
) -> FloatArray:
    """How often each beam's surface is detected: as often as in the simulations, and once more as often as beams alike.

    Of a thousand beams of bright surfaces that all see them, none is expected to be lost: a few that are say much.
    Beams that are hardly seen are alike; 0 where nothing is hit.
    """
    edges = _brightness_edges(log_area, known)
    group = np.where(known, np.searchsorted(edges, log_area), len(edges) + 1)
    seen = np.bincount(group, hit * (count + 0.5 / of))
    beside = seen / np.maximum(np.bincount(group, hit * (of + 1.0 / of)), 1e-9)
    return np.asarray(np.where(hit, (count + beside[group]) / (of + 1.0), 0.0))


def _brightness_edges(log_area: FloatArray, known: npt.NDArray[np.bool_]) -> FloatArray:
    """The edges between groups of beams about as bright."""
    shares = np.linspace(0.0, 1.0, _GROUPS + 1)[1:-1]
    return np.asarray(np.quantile(log_area[known], shares)) if known.any() else np.zeros(0)


def _smooth_spread(
    log_area: FloatArray,
    variance: FloatArray,
    known: npt.NDArray[np.bool_],
    free: IndexArray,
    least_spread: tuple[float, float, float, float],
) -> FloatArray:
    """Spread of each feature as a function of the amplitude, from beams alike; shape (n, 4)."""
    edges = _brightness_edges(log_area, known)
    place = np.searchsorted(edges, log_area)
    weight = np.bincount(place[known], free[known], len(edges) + 1)
    spread = np.empty_like(variance)
    for j, least in enumerate(least_spread):
        total = np.bincount(place[known], (variance[:, j] * free)[known], len(edges) + 1)
        spread[:, j] = np.sqrt(total / np.maximum(weight, 1.0) + least**2)[place]
    return spread
