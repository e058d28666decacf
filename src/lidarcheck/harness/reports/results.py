"""What a check found: plain frozen records that reports, plugins and pages are made of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck.formats.plain import plain
from lidarcheck.harness.gate.evidence import KpiEvidence, KpiVerdict
from lidarcheck.harness.kpis.spec import KpiSpec

__all__ = ["CheckReport", "KpiResult", "ScenarioResult"]


@dataclass(frozen=True, slots=True)
class KpiResult:
    """One KPI of one scenario.

    `verdict` is the one that counts. `old`: the golden's mean, `new`: the run's, nan where there is none, and the
    golden's where the paired seeds are bit-identical and no others were run; `golden`, `release`: the comparison with
    either reference, None where none was made; `limit`: the absolute limit that is broken, in words; `note`: what
    decided, or what to do; `reason`: why the golden was accepted, if it needed one; `fresh`, `paired`: values per seed;
    `old_paired`: the golden's, of the same seeds as `paired`; `old_quantiles`, `new_quantiles`: for distances, the
    feature's mean quantile function at the levels (i + ½)/129.
    """

    spec: KpiSpec
    verdict: KpiVerdict
    old: float = math.nan
    new: float = math.nan
    golden: KpiEvidence | None = None
    release: KpiEvidence | None = None
    limit: str = ""
    note: str = ""
    reason: str = ""
    fresh: tuple[float, ...] = ()
    paired: tuple[float, ...] = ()
    old_quantiles: tuple[float, ...] = ()
    new_quantiles: tuple[float, ...] = ()
    old_paired: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """The KPI's name within its scenario."""
        return self.spec.name

    @property
    def fails(self) -> bool:
        """Whether it fails the run."""
        return self.verdict.fails

    @property
    def smallest(self) -> float:
        """The smallest change that would have been caught; nan if nothing was compared."""
        return math.nan if self.golden is None else self.golden.smallest


@dataclass(frozen=True, slots=True)
class ScenarioResult:
    """One scenario of a run.

    `problems` fail it beyond its KPIs, each a line that says what to do; `notes` do not. `hashes`: SHA-256 of what is
    measured ("scenario") and of the model's numbers ("parameters").
    """

    name: str
    file: Path
    description: str
    kpis: tuple[KpiResult, ...]
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seeds: int = 0
    hashes: Mapping[str, str] = field(default_factory=dict)

    @property
    def identical(self) -> bool:
        """Whether every KPI is, bit for bit."""
        return bool(self.kpis) and all(kpi.verdict is KpiVerdict.IDENTICAL for kpi in self.kpis)

    @property
    def failed(self) -> bool:
        """Whether it fails the run."""
        return bool(self.problems) or any(kpi.fails for kpi in self.kpis)

    @property
    def compared(self) -> int:
        """The number of KPIs that were compared with a golden."""
        return sum(kpi.golden is not None for kpi in self.kpis)


@dataclass(frozen=True, slots=True)
class CheckReport:
    """A run.

    `problems`: what fails the run as a whole; `kpis_in_suite`: among how many the error budget is shared; `source`:
    SHA-256 of the code that determines results.
    """

    scenarios: tuple[ScenarioResult, ...]
    problems: tuple[str, ...]
    seed: int | None
    model: str
    kpis_in_suite: int
    error_budget: float
    seconds: float
    versions: Mapping[str, str]
    source: str = ""

    @property
    def failed(self) -> bool:
        """Whether anything fell out."""
        return bool(self.problems) or any(scenario.failed for scenario in self.scenarios)

    @property
    def exit_code(self) -> int:
        """0: everything holds; 1: a KPI fell out, or the run proves nothing."""
        return 1 if self.failed else 0

    @property
    def counts(self) -> dict[str, int]:
        """The number of KPIs per verdict, every verdict named."""
        found = [kpi.verdict for scenario in self.scenarios for kpi in scenario.kpis]
        return {verdict.value: found.count(verdict) for verdict in KpiVerdict}

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON holds it: lists, numbers, text; null where there is no number."""
        table: dict[str, Any] = plain(self)
        table |= {"verdict": "failed" if self.failed else "holds", "exit_code": self.exit_code, "counts": self.counts}
        for found, scenario in zip(table["scenarios"], self.scenarios, strict=True):
            found |= {"failed": scenario.failed, "identical": scenario.identical, "compared": scenario.compared}
            for entry, kpi in zip(found["kpis"], scenario.kpis, strict=True):
                entry |= {"name": kpi.name, "fails": kpi.fails}
        return table
