"""What the gate can see: the smallest change that it catches, and whether a golden is fine enough to judge by."""

from __future__ import annotations

import math

import numpy as np

from lidarcheck.harness.gate import statistics as stats
from lidarcheck.harness.gate.evidence import FULL_SEEDS, GATE_LEVEL, NULL_LEVELS, Reference, null_rank
from lidarcheck.harness.kpis.spec import KpiSpec

__all__ = ["misses", "resolution", "smallest_change", "too_coarse"]

_MARGIN = 1.1
"""What a suggestion adds: 64 seeds know a scatter to 9 %, so the next release may measure that much more."""


def resolution(share: float, sd: float) -> float:
    """t·SE of 64 seeds against 64 of that standard deviation."""
    return stats.critical_t(share, 2 * (FULL_SEEDS - 1)) * sd * math.sqrt(2.0 / FULL_SEEDS)


def too_coarse(spec: KpiSpec, reference: Reference, share: float) -> str:
    """Why this golden could never prove a KPI unchanged, and what would help; empty if it can."""
    if reference.seeds < 0.9 * reference.drawn:
        return f"only {reference.seeds} of {reference.drawn} seeds gave a value: measure more beams"
    coarse = 0.0 if spec.kind == "distance" else resolution(share, reference.sd)
    if coarse > spec.tolerance:
        return (
            f"chance alone explains ±{coarse:.3g}, more than the tolerance {spec.tolerance:g}: measure more beams, "
            f"or set the tolerance to {_MARGIN * coarse:.3g} at least"
        )
    return ""


def misses(spec: KpiSpec, reference: Reference, share: float) -> str:
    """Why this golden lets a change pass that the scenario wants caught; empty where it catches it."""
    smallest = smallest_change(spec, reference, share)
    if smallest <= spec.must_catch:
        return ""
    what = f"it catches changes from {smallest:.4g} on, not {spec.must_catch:.4g}"
    return f"{what}: measure more beams, or state catches = {_MARGIN * smallest:.3g}"


def smallest_change(spec: KpiSpec, reference: Reference, share: float) -> float:
    """The smallest change of the mean, for the worse, that 64 fresh seeds catch with 95 % power; nan if none is."""
    if spec.kind == "distance":
        return _smallest_shift(spec, reference, share)
    signs = {"higher": (-1.0,), "lower": (1.0,), "target": (-1.0, 1.0)}[spec.direction]
    return max(_smallest_step(spec, reference, share, sign) for sign in signs)


def _smallest_step(spec: KpiSpec, reference: Reference, share: float, sign: float) -> float:
    step = spec.tolerance
    for _ in range(50):  # the variance of a proportion depends on where the change leads
        before, after = (_sd_at(spec, reference, mean) for mean in (reference.mean, reference.mean + sign * step))
        change = stats.two_sample((0.0, before, FULL_SEEDS), (0.0, after, FULL_SEEDS))
        t = stats.critical_t(share, change.df)
        reach = t + stats.POWER_Z * math.sqrt(1.0 + t * t / (2.0 * change.df))
        step, last = spec.tolerance + reach * change.se, step
        if math.isclose(step, last, rel_tol=1e-6):
            break
    return step


def _sd_at(spec: KpiSpec, reference: Reference, mean: float) -> float:
    """The standard deviation of a seed if the mean were `mean`: a proportion's follows its coin, scaled as it was."""
    if spec.kind != "proportion" or reference.trials <= 0:
        return reference.sd
    measured = _coin(reference, reference.mean)
    inflation = max(1.0, reference.sd**2 / measured)
    return math.sqrt(_coin(reference, min(max(mean, 0.0), 1.0)) * inflation)


def _coin(reference: Reference, p: float) -> float:
    trials = reference.trials * reference.seeds
    return stats.binomial_variance((p * trials, trials), (p * trials, trials)) / reference.trials


def _smallest_shift(spec: KpiSpec, reference: Reference, share: float) -> float:
    """The shift of a distance's whole null distribution that would be caught, its own scatter allowed for."""
    if not reference.null:
        return math.nan
    count = stats.critical_count(share, FULL_SEEDS, *null_rank(reference))
    level = 1.0 - stats.probability_caught(count, FULL_SEEDS)
    level -= stats.POWER_Z * math.sqrt(level * (1.0 - level) / reference.seeds)
    quantile = float(np.interp(level, NULL_LEVELS, reference.null))
    return spec.tolerance + reference.null[GATE_LEVEL] - quantile
