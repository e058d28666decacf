"""Reports of checks, made by hand, for the tests of what is written from them."""

import math
from pathlib import Path

from lidarcheck.harness.gate.evidence import KpiEvidence, KpiVerdict
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult

SEEDS = tuple(100.0 + 0.3 * (-1) ** seed for seed in range(8))


def kpi(name="area_mean", verdict=KpiVerdict.IDENTICAL, delta=0.0, **changes) -> KpiResult:
    spec = KpiSpec(name, "mean", "counts", "target", 2.0, low=90.0)
    values = {
        "old": 100.0,
        "new": 100.0 + delta,
        "golden": KpiEvidence(verdict, delta, 0.5, 3.5, 64),
        "old_paired": SEEDS,
        "paired": tuple(value + delta for value in SEEDS),
        "fresh": tuple(100.0 + delta + 0.01 * seed for seed in range(64)),
    }
    return KpiResult(spec, verdict, **(values | changes))


def distance(verdict=KpiVerdict.CHANGED) -> KpiResult:
    spec = KpiSpec("area_distance", "distance", "counts", "lower", 1.0, feature="area")
    old = tuple(10.0 * 1.04**level for level in range(129))
    return KpiResult(
        spec,
        verdict,
        1.0,
        1.5,
        golden=KpiEvidence(verdict, 0.5, math.nan, 1.8, 64, note="9 of 64 seeds lie beyond"),
        old_paired=SEEDS,
        paired=SEEDS,
        old_quantiles=old,
        new_quantiles=tuple(1.02 * value for value in old),
    )


def missing(name="gone") -> KpiResult:
    spec = KpiSpec(name, "mean", "1", "higher", 0.1)
    return KpiResult(spec, KpiVerdict.MISSING, math.nan, 0.5, note="there is no golden: run `lidarcheck review x`")


def scenario(name="wall", *kpis, file=None, **changes) -> ScenarioResult:
    values = {"seeds": 72, "hashes": {"scenario": "ab" * 32, "parameters": "cd" * 32}} | changes
    return ScenarioResult(name, file or Path(f"scenarios/{name}.toml"), f"a {name}", kpis, **values)


def report(*scenarios, problems=(), seed=None) -> CheckReport:
    versions = {"python": "3.11.7", "numpy": "2.4.6"}
    return CheckReport(scenarios, tuple(problems), seed, "", 12, 1e-3, 1.25, versions, source="ef" * 32)


def regressed() -> KpiResult:
    return kpi("area_mean.near", KpiVerdict.REGRESSED, 9.0, note="the 8 paired seeds differ", reason="a new lens")
