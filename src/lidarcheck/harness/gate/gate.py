"""The gate: has a KPI moved by more than matters, more than chance explains, and in which direction?

The error budget is for a whole run: an unchanged model fails anywhere with probability 1e-3 at most. It is shared
equally (Bonferroni) by all KPIs of the suite, both references and the looks that can fail a KPI. A first look at 16
seeds can only pass a KPI or ask for more, so it spends nothing; only the balanced comparison, 64 seeds against 64, can
fail one. `docs/decisions/0001-gate-statistics.md` gives the reasons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from lidarcheck.harness.gate import statistics as stats
from lidarcheck.harness.gate.evidence import (
    FULL_SEEDS,
    GATE_LEVEL,
    PAIRED_SEEDS,
    KpiEvidence,
    KpiVerdict,
    Reference,
    Sample,
    mean_sd,
    null_rank,
    worst,
)
from lidarcheck.harness.gate.sensitivity import resolution, smallest_change
from lidarcheck.harness.kpis.spec import KpiSpec

__all__ = ["beyond_limit", "judge", "needs_more"]

_SCREEN_Z = 2.0
_SCREEN_TAIL = 0.0455
_FINITE_SHARE = 0.5


def needs_more(spec: KpiSpec, reference: Reference, sample: Sample, share: float) -> bool:
    """Whether the first fresh seeds leave a doubt that only all 64 can settle."""
    if len(sample.finite) < len(sample.fresh) or reference.seeds < 2:
        return True
    if spec.kind == "distance":
        above = (
            sum(value > reference.null[GATE_LEVEL] for value in sample.finite) if reference.null else len(sample.fresh)
        )
        return stats.exceedance_tail(above, len(sample.fresh), *null_rank(reference)) < _SCREEN_TAIL
    change = _difference(spec, reference, sample)
    if abs(change.delta) > _SCREEN_Z * change.se:
        return True
    return _believed_resolution(reference, sample, share) > spec.tolerance


def judge(spec: KpiSpec, reference: Reference, sample: Sample, share: float) -> KpiEvidence:
    """The verdict on one KPI against one reference.

    `sample` holds 64 seeds, or 16 fresh ones with which `needs_more` was content: those are equivalent. Never IDENTICAL
    or MISSING; the caller knows these from the digests and the names.
    """
    smallest = smallest_change(spec, reference, share)
    seeds = sample.seeds
    gap = _too_few(reference, sample, share)
    if gap:
        return KpiEvidence(KpiVerdict.INDETERMINATE, math.nan, math.nan, smallest, seeds, note=gap)
    first = sample.drawn < FULL_SEEDS
    decide = _judge_distance if spec.kind == "distance" else _judge_mean
    return decide(spec, reference, sample, share, smallest, first)


def beyond_limit(spec: KpiSpec, values: Sequence[float], share: float) -> str:
    """Which absolute limit the mean lies beyond by more than chance explains, in words; empty if none."""
    finite = [value for value in values if math.isfinite(value)]
    if len(finite) < 2:
        return ""
    mean, sd = mean_sd(finite)
    margin = stats.critical_t(share, len(finite) - 1) * sd / math.sqrt(len(finite))
    if spec.low is not None and mean + margin < spec.low:
        return f"{mean:.5g} is below the limit {spec.low:g} {spec.unit}".rstrip()
    if spec.high is not None and mean - margin > spec.high:
        return f"{mean:.5g} is above the limit {spec.high:g} {spec.unit}".rstrip()
    return ""


def _judge_mean(
    spec: KpiSpec, reference: Reference, sample: Sample, share: float, smallest: float, first: bool
) -> KpiEvidence:
    change = _difference(spec, reference, sample)
    margin = stats.critical_t(share, change.df) * change.se
    full = KpiVerdict.EQUIVALENT if first else _step(spec, change.delta, margin)
    paired_delta, paired_margin = _paired(reference, sample, share)
    paired = KpiVerdict.EQUIVALENT if math.isnan(paired_margin) else _step(spec, paired_delta, paired_margin)
    noise = _noise(spec, reference, sample, share) if not first else ""
    verdict = worst((full, paired, KpiVerdict.INDETERMINATE if noise else KpiVerdict.EQUIVALENT))
    note = noise if verdict is KpiVerdict.INDETERMINATE else ""
    if verdict not in (full, KpiVerdict.INDETERMINATE):
        note = f"the {len(sample.paired)} paired seeds differ by {paired_delta:+.4g} ±{paired_margin:.2g}"
    return KpiEvidence(verdict, change.delta, margin, smallest, sample.seeds, paired_delta, paired_margin, note)


def _judge_distance(
    spec: KpiSpec, reference: Reference, sample: Sample, share: float, smallest: float, first: bool
) -> KpiEvidence:
    rank, null = null_rank(reference)
    values, edge = sample.finite, reference.null[GATE_LEVEL]
    above = sum(value > edge for value in values)
    beyond = sum(value > edge + spec.tolerance for value in values)
    verdict, note = KpiVerdict.EQUIVALENT, ""
    if not first and stats.exceedance_tail(beyond, len(values), rank, null) <= share:
        verdict = KpiVerdict.REGRESSED
        note = f"{beyond} of {len(values)} seeds lie beyond the null's 95 % {edge:.4g} + tolerance {spec.tolerance:g}"
    elif not first and stats.exceedance_tail(above, len(values), rank, null) <= share:
        verdict = KpiVerdict.CHANGED
        note = f"{above} of {len(values)} seeds lie beyond the null's 95 % {edge:.4g}, but within the tolerance"
    delta = mean_sd(values)[0] - reference.mean
    return KpiEvidence(verdict, delta, math.nan, smallest, len(values), note=note)


def _step(spec: KpiSpec, delta: float, margin: float) -> KpiVerdict:
    """The verdict on a change of `delta` of which chance explains `margin`."""
    if abs(delta) <= margin:
        return KpiVerdict.EQUIVALENT
    if abs(delta) <= spec.tolerance + margin:
        return KpiVerdict.CHANGED
    better = {"higher": delta > 0.0, "lower": delta < 0.0, "target": False}[spec.direction]
    return KpiVerdict.IMPROVED if better else KpiVerdict.REGRESSED


def _difference(spec: KpiSpec, reference: Reference, sample: Sample) -> stats.Difference:
    mean, sd = sample.mean_sd
    floor = (1e-9 * abs(reference.mean)) ** 2  # a golden's printed digits; nothing is constant to more than these
    if spec.kind == "proportion" and sample.trials > 0 and reference.trials > 0:
        old, new = reference.trials * reference.seeds, sample.trials * sample.seeds
        pooled = stats.binomial_variance((reference.mean * old, old), (mean * new, new))
        floor = max(floor, pooled / max(reference.trials, sample.trials))
    return stats.two_sample((reference.mean, reference.sd, reference.seeds), (mean, sd, sample.seeds), floor)


def _paired(reference: Reference, sample: Sample, share: float) -> tuple[float, float]:
    """Mean difference over the paired seeds and t·SE of it; (nan, nan) where it would prove nothing.

    Repeated values mean a discrete KPI, whose eight differences may agree by chance: Student's t does not hold.
    """
    if len(sample.paired) != PAIRED_SEEDS or len(set(reference.paired)) < PAIRED_SEEDS:
        return math.nan, math.nan
    differences = [new - old for new, old in zip(sample.paired, reference.paired, strict=True)]
    if not all(math.isfinite(value) for value in differences):
        return math.nan, math.nan
    mean, sd = mean_sd(differences)
    margin = stats.critical_t(share, PAIRED_SEEDS - 1) * sd / math.sqrt(PAIRED_SEEDS)
    return mean, max(margin, 1e-9 * abs(reference.mean))


def _noise(spec: KpiSpec, reference: Reference, sample: Sample, share: float) -> str:
    """Why the KPI scatters too much for its tolerance to be held, beyond what chance makes of the scatter itself."""
    coarse = _believed_resolution(reference, sample, share)
    if coarse <= spec.tolerance:
        return ""
    return f"scatter allows ±{coarse:.3g} by chance, more than the tolerance {spec.tolerance:g}: measure more beams"


def _believed_resolution(reference: Reference, sample: Sample, share: float) -> float:
    """t·SE of 64 seeds against 64, with the run's scatter only as far as it has grown beyond what chance explains."""
    growth = stats.sd_growth(share, sample.seeds, reference.seeds)
    return resolution(share, max(sample.mean_sd[1] / growth, reference.sd))


def _too_few(reference: Reference, sample: Sample, share: float) -> str:
    new, old = sample.drawn - sample.seeds, reference.drawn - reference.seeds
    text = f"{new} of {sample.drawn} seeds gave no value, {old} of {reference.drawn} did not before"
    if reference.seeds < 2 or sample.seeds < max(2.0, _FINITE_SHARE * sample.drawn):
        return text
    return text if stats.missing_tail(old, reference.drawn, new, sample.drawn) <= share else ""
