"""The likelihood of ghosts: what each beam of a sign shows, given strength and exponent, and what that leaves open."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.ghosts.data import SignBeams
from lidarcheck.calibration.ghosts.library import FaintPulseLibrary

__all__ = [
    "FARTHEST_OFF",
    "REFERENCE_M",
    "TOLD",
    "IntervalWidening",
    "Region",
    "best_setting",
    "doubt_of",
    "extra_scatter",
    "log_signal_of",
    "off_of",
    "region_of",
]

REFERENCE_M = 25.0
TOLD = 1.9599639845
"""Half an interval of 95 % in standard deviations."""
FARTHEST_OFF = 4.0
"""Standard deviations from which on an echo counts no more: a stray one does not move the fit."""
GRID, ROUNDS = 41, 4
OVERDISPERSED = 3.0
CHANCE_OF_SCATTER, FEWEST_TO_SCATTER = 4.0, 8
SLOPE_STEP = 0.02


@dataclass(frozen=True)
class Region:
    """Settings that these data allow, shapes (k,), the best one first: log strength, exponent."""

    log_strength: FloatArray
    exponent: FloatArray
    reaches_end: bool


class IntervalWidening(NamedTuple):
    """What widens intervals beyond what the likelihood says.

    `scatter`: spread of the ghosts' log AREA over what the sensor alone gives, 1 where that is by chance.
    `disagreement`: chi^2 of the datasets' means per degree of freedom (Birge's ratio squared), 1 where it is small.
    `factor`: on -2 ln L; the larger of the disagreement and of how much more beams scatter than the curvature of the
    likelihood says (its sandwich estimate).
    """

    scatter: float
    disagreement: float
    factor: float


def log_signal_of(b: SignBeams, log_strength: float, exponent: float) -> FloatArray:
    """ln S of the ghost on each beam; never above the sign's own."""
    log_ratio = log_strength + exponent * np.log(REFERENCE_M / b.range_m)
    return np.asarray(np.minimum(log_ratio, 0.0) + np.log(b.unit_signal))


def _misfit(
    beams: Sequence[SignBeams], libraries: Sequence[FaintPulseLibrary], log_strength: float, exponent: float
) -> float:
    """-2 ln likelihood of what each beam shows: a ghost or none, and the ghost's log AREA."""
    return float(np.sum(_misfits(beams, libraries, log_strength, exponent)))


def _misfits(
    beams: Sequence[SignBeams], libraries: Sequence[FaintPulseLibrary], log_strength: float, exponent: float
) -> FloatArray:
    """The same beam by beam, those of all datasets one after the other."""
    parts = []
    for b, lib in zip(beams, libraries, strict=True):
        log_signal = log_signal_of(b, log_strength, exponent)
        probability = lib.at(lib.probability, log_signal)
        part = -2.0 * np.log(np.where(b.detected, probability, 1.0 - probability))
        seen = log_signal[b.detected]
        spread = lib.at(lib.log_area_spread, seen)
        off = (np.log(b.area[b.detected]) - lib.at(lib.log_area, seen)) / spread
        part[b.detected] += np.minimum(off**2, FARTHEST_OFF**2) + 2.0 * np.log(spread)
        parts.append(part)
    return np.concatenate(parts)


def _middle(beams: Sequence[SignBeams]) -> float:
    """ln(25 m / R) of the ghosts' mean place, where strength and exponent are told independently."""
    return float(np.mean(np.concatenate([np.log(REFERENCE_M / b.range_m[b.detected]) for b in beams])))


def best_setting(
    beams: Sequence[SignBeams], libraries: Sequence[FaintPulseLibrary], exponent: float, free: bool
) -> tuple[float, float]:
    """Log strength and exponent that fit best: the best of a coarse search, then refined."""
    from scipy.optimize import minimize

    middle = _middle(beams)

    def misfit(at: FloatArray) -> float:
        power = at[1] if free else exponent
        return _misfit(beams, libraries, at[0] - power * middle, power)

    strengths = np.linspace(np.log(1e-8), 0.0, 120)
    powers = np.linspace(-2.0, 4.0, 13) if free else np.array([exponent])
    start = min(((s, p) for p in powers for s in strengths), key=lambda at: misfit(np.array(at)))
    step = np.array([[0.0, 0.0], [0.05, 0.0], [0.0, 0.1]])[: 3 if free else 2, : 2 if free else 1]
    simplex = np.array(start)[: 2 if free else 1] + step
    found = minimize(
        misfit, simplex[0], method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-5, "fatol": 1e-4}
    )
    power = float(found.x[1]) if free else exponent
    return float(found.x[0]) - power * middle, power


def extra_scatter(beams: Sequence[SignBeams], libraries: Sequence[FaintPulseLibrary]) -> tuple[float, float]:
    """Spread of the ghosts' log AREA beyond the sensor's own, and all of it over that; 0 and 1 where that is chance.

    Within each dataset, whatever its ghosts' strength: beside the spread that the sensor gives to echoes of such AREA.
    """
    sizes, expected, seen = [], [], []
    for b, lib in zip(beams, libraries, strict=True):
        log_area = np.log(b.area[b.detected])
        if len(log_area) < FEWEST_TO_SCATTER:
            continue
        # Where AREA no longer rises with S there is nothing to look up.
        rising = slice(0, int(np.argmax(lib.log_area)) + 1)
        at = np.interp(float(np.mean(log_area)), lib.log_area[rising], lib.log_signal[rising])
        own = float(lib.at(lib.log_area_spread, np.array([at]))[0])
        off = np.abs(log_area - np.mean(log_area))
        # A stray echo that stands where a ghost should is no scatter of ghosts.
        most = FARTHEST_OFF * max(own, 1.48 * float(np.median(off)))
        sizes.append(len(log_area) - 1.0)
        expected.append(own**2)
        seen.append(float(np.sum(np.minimum(off, most) ** 2)) / sizes[-1])
    count = sum(sizes)
    ratio = float(np.average(np.divide(seen, expected), weights=sizes)) if sizes else 1.0
    if ratio <= 1.0 + CHANCE_OF_SCATTER * np.sqrt(2.0 / max(count, 1.0)):
        return 0.0, 1.0
    weight = np.array(sizes) / np.square(expected)
    extra = float(np.average(np.subtract(seen, expected), weights=weight))
    return float(np.sqrt(max(extra, 0.0))), float(np.sqrt(ratio))


def doubt_of(
    beams: Sequence[SignBeams],
    libraries: Sequence[FaintPulseLibrary],
    best: tuple[float, float],
    free: bool,
    scatter: float,
) -> IntervalWidening:
    """How far to trust the likelihood, at the best setting; `scatter` as `extra_scatter` gives it."""
    offs = [off_of(b, lib, *best) for b, lib in zip(beams, libraries, strict=True) if b.detected.any()]
    left = len(offs) - (2 if free else 1)
    birge = sum(float(np.mean(off)) ** 2 * len(off) for off in offs) / left if left > 0 else 1.0
    disagreement = birge if birge > OVERDISPERSED else 1.0
    return IntervalWidening(scatter, disagreement, max(_sandwich(beams, libraries, best, free), disagreement, 1.0))


def _sandwich(
    beams: Sequence[SignBeams], libraries: Sequence[FaintPulseLibrary], best: tuple[float, float], free: bool
) -> float:
    """How many times more the beams' slopes scatter than the curvature says they should, in the worst direction."""
    middle = _middle(beams)

    def parts(level: float, power: float) -> FloatArray:
        return 0.5 * _misfits(beams, libraries, best[0] + level - power * middle, best[1] + power)

    steps = np.array([(SLOPE_STEP, 0.0), (0.0, 2.0 * SLOPE_STEP)][: 2 if free else 1])
    ahead, back, here = [parts(*s) for s in steps], [parts(*-s) for s in steps], parts(0.0, 0.0)
    slopes = np.array([(a - b) / 2.0 for a, b in zip(ahead, back, strict=True)])
    curve = np.diag([float(np.sum(a + b - 2.0 * here)) for a, b in zip(ahead, back, strict=True)])
    if free:
        both = np.sum(parts(*steps.sum(axis=0)) - ahead[0] - ahead[1] + here)
        other = np.sum(parts(*-steps.sum(axis=0)) - back[0] - back[1] + here)
        curve[0, 1] = curve[1, 0] = 0.5 * float(both + other)
    if np.any(np.linalg.eigvalsh(curve) <= 0.0):
        return 1.0
    return float(np.max(np.linalg.eigvals(np.linalg.solve(curve, slopes @ slopes.T)).real))


def off_of(b: SignBeams, lib: FaintPulseLibrary, log_strength: float, exponent: float) -> FloatArray:
    """How many standard deviations the log AREA of each ghost is off."""
    log_signal = log_signal_of(b, log_strength, exponent)[b.detected]
    return np.asarray(
        (np.log(b.area[b.detected]) - lib.at(lib.log_area, log_signal)) / lib.at(lib.log_area_spread, log_signal)
    )


def region_of(
    beams: Sequence[SignBeams],
    libraries: Sequence[FaintPulseLibrary],
    best: tuple[float, float],
    free: bool,
    inflation: float,
) -> Region:
    """All settings that a likelihood ratio does not exclude at 95 %: their extremes are the profile's interval."""
    middle, least = _middle(beams), _misfit(beams, libraries, *best)
    at_middle, limit = best[0] + best[1] * middle, TOLD**2 * inflation

    def rise(level: float, power: float) -> float:
        return _misfit(beams, libraries, level - power * middle, power) - least

    width = [_reach(lambda d: rise(at_middle + d, best[1]), limit), 0.0]
    if free:
        width[1] = _reach(lambda d: rise(at_middle, best[1] + d), limit)
    points: list[tuple[float, float]] = []
    ends = False
    for _ in range(ROUNDS):
        levels = at_middle + width[0] * np.linspace(-1.0, 1.0, GRID)
        powers = best[1] + width[1] * np.linspace(-1.0, 1.0, GRID if free else 1)
        powers = np.clip(powers, -10.0, 10.0) if free else np.array([best[1]])
        inside = np.array([[rise(level, power) <= limit for power in powers] for level in levels])
        points = [(levels[i], powers[j]) for i, j in np.argwhere(inside)]
        at_end = inside[[0, -1]].any(), free and inside[:, [0, -1]].any()
        ends = bool(any(at_end))
        if not ends:
            break
        width = [w * (1.6 if end else 1.0) for w, end in zip(width, at_end, strict=True)]
    level, power = np.array([(at_middle, best[1]), *points]).T
    # The border runs between the last point inside and the first one outside.
    level = level + np.sign(level - at_middle) * width[0] / (GRID - 1)
    power = power + np.sign(power - best[1]) * width[1] / (GRID - 1)
    return Region(np.minimum(level - power * middle, 0.0), power, ends)


def _reach(rise: Callable[[float], float], limit: float) -> float:
    """A little more than the farther of the two ways from the best setting to where a likelihood ratio excludes."""
    ways = []
    for side in (-1.0, 1.0):
        step = 1e-4
        while rise(side * step) < limit and step < 20.0:
            step *= 1.3
        ways.append(step)
    return 1.3 * max(ways)
