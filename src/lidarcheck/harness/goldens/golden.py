"""A golden: what a scenario's KPIs were when somebody last looked and agreed. Building one, and judging by one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.harness.gate import evidence
from lidarcheck.harness.gate.seeds import QUANTILE_LEVELS, SeedRecord, distance
from lidarcheck.harness.goldens.provenance import Provenance
from lidarcheck.harness.kpis.spec import KpiSpec

__all__ = [
    "Golden",
    "KpiGolden",
    "build",
    "mean_quantiles",
    "paired_identical",
    "sample_of",
    "thresholds_changed",
    "values_of",
]

_SAME = 1e-9
"""Relative difference up to which a KPI of bit-identical echoes counts as the same: a golden prints 12 digits."""


@dataclass(frozen=True, slots=True)
class KpiGolden:
    """One KPI of a golden: what was asked, what was measured, and the reference of a distance.

    `quantiles`: for a distance, the mean quantile function of its feature at 129 levels; `reason`, `reason_date`: why
    it was accepted although something spoke against it;
    `accepted_by`, `accepted_date`: who accepted it and when; `verdict`: in a proposal, what the run said of it.
    """

    spec: KpiSpec
    reference: evidence.Reference
    quantiles: tuple[float, ...] = ()
    reason: str = ""
    reason_date: str = ""
    accepted_by: str = ""
    accepted_date: str = ""
    verdict: str = ""

    def same_values(self, other: KpiGolden) -> bool:
        """Whether both hold the same measured values."""
        return (self.reference, self.quantiles) == (other.reference, other.quantiles)


@dataclass(frozen=True, slots=True)
class Golden:
    """A scenario's golden, or a proposal for one. `digests`: of the echoes of the 8 paired seeds; `proposed`: a run
    wrote it, nobody has accepted it.
    """

    scenario: str
    kpis: Mapping[str, KpiGolden]
    digests: tuple[str, ...]
    provenance: Provenance
    proposed: bool = False

    @property
    def is_proposal(self) -> bool:
        """Whether nobody has accepted it: it says so, or holds what only proposals hold; those of old do not say so.

        A golden of a part of the seeds has the reason for which it was accepted.
        """
        kpis = self.kpis.values()
        unasked = kpis and all(kpi.reference.drawn < evidence.FULL_SEEDS and not kpi.reason for kpi in kpis)
        return bool(self.proposed or self.provenance.base or any(kpi.verdict for kpi in kpis) or unasked)

    @property
    def complete(self) -> bool:
        """Whether all 64 seeds were run for every KPI."""
        return all(kpi.reference.drawn >= evidence.FULL_SEEDS for kpi in self.kpis.values())


def build(
    scenario: str,
    specs: Sequence[KpiSpec],
    records: Sequence[SeedRecord],
    reference: Sequence[SeedRecord],
    provenance: Provenance,
) -> Golden:
    """The golden of `records`, one per seed with the paired ones first; `reference` are the seeds of the distances.

    A KPI that no record holds is left out; the check then says that it is missing.
    """
    kpis = {spec.name: _kpi_golden(spec, records, reference) for spec in specs if _measured(spec, records)}
    digests = tuple(record.digest for record in records[: evidence.PAIRED_SEEDS])
    return Golden(scenario, kpis, digests, provenance)


def values_of(kpi: KpiGolden, records: Sequence[SeedRecord]) -> tuple[float, ...]:
    """The KPI of each record, nan if absent; for a distance, that of its feature from this golden's reference."""
    if kpi.spec.kind != "distance":
        return tuple(record.values.get(kpi.spec.name, math.nan) for record in records)
    reference = np.asarray(kpi.quantiles, dtype=np.float64)
    features = [record.quantiles.get(kpi.spec.feature or "") for record in records]
    return tuple(math.nan if feature is None else distance(feature, reference) for feature in features)


def sample_of(kpi: KpiGolden, fresh: Sequence[SeedRecord], paired: Sequence[SeedRecord]) -> evidence.Sample:
    """What the gate needs to know of a run to compare it with this golden."""
    return evidence.Sample(values_of(kpi, fresh), values_of(kpi, paired), _trials(kpi.spec, fresh))


def paired_identical(golden: Golden, kpi: KpiGolden, paired: Sequence[SeedRecord]) -> bool:
    """Whether the paired seeds gave bit-identical echoes and the KPI that the golden has."""
    if tuple(record.digest for record in paired) != golden.digests:
        return False
    new = values_of(kpi, paired)
    return len(new) == len(kpi.reference.paired) and all(map(_same, new, kpi.reference.paired))


def thresholds_changed(old: KpiSpec, new: KpiSpec) -> str:
    """Which thresholds differ, with both values, in words; empty if none."""
    names = ("kind", "unit", "direction", "tolerance", "low", "high", "feature")
    pairs = [(name, getattr(old, name), getattr(new, name)) for name in names]
    return ", ".join(f"{name} {_word(was)} is now {_word(now)}" for name, was, now in pairs if was != now)


def mean_quantiles(records: Sequence[SeedRecord], feature: str) -> FloatArray:
    """The mean quantile function of the records that have the feature (their Wasserstein barycentre), 7 digits."""
    functions = [record.quantiles[feature] for record in records if feature in record.quantiles]
    functions = [function for function in functions if np.isfinite(function).all()]
    if not functions:
        return np.full(QUANTILE_LEVELS, np.nan)
    return np.array([float(f"{value:.7g}") for value in np.mean(functions, axis=0)])


def _kpi_golden(spec: KpiSpec, records: Sequence[SeedRecord], reference: Sequence[SeedRecord]) -> KpiGolden:
    empty = evidence.Reference(math.nan, 0.0, 0, len(records), ())
    quantiles: tuple[float, ...] = ()
    if spec.kind == "distance":
        quantiles = tuple(mean_quantiles(reference, spec.feature or "").tolist())
    values = values_of(KpiGolden(spec, empty, quantiles), records)
    finite = np.array([value for value in values if math.isfinite(value)])
    return KpiGolden(
        spec,
        evidence.Reference(
            mean=_round(float(finite.mean())) if finite.size else math.nan,
            sd=_round(float(finite.std(ddof=1))) if finite.size > 1 else 0.0,
            seeds=int(finite.size),
            drawn=len(values),
            paired=tuple(_round(value) for value in values[: evidence.PAIRED_SEEDS]),
            trials=_round(_trials(spec, records)),
            null=tuple(_round(value) for value in evidence.null_quantiles(values)) if spec.kind == "distance" else (),
        ),
        quantiles,
    )


def _measured(spec: KpiSpec, records: Sequence[SeedRecord]) -> bool:
    if spec.kind == "distance":
        return any(spec.feature in record.quantiles for record in records)
    return any(spec.name in record.values for record in records)


def _trials(spec: KpiSpec, records: Sequence[SeedRecord]) -> float:
    counts = [record.trials.get(spec.name, 0) for record in records]
    return float(np.mean(counts)) if spec.kind == "proportion" and counts else 0.0


def _same(new: float, old: float) -> bool:
    return (math.isnan(new) and math.isnan(old)) or math.isclose(new, old, rel_tol=_SAME, abs_tol=1e-12)


def _round(value: float) -> float:
    return float(f"{value:.12g}")


def _word(value: object) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
