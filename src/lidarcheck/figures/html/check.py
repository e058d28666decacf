"""The page of a check: one self-contained HTML file, without scripts, that says what each KPI has done."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.figures.html.environment import page_environment
from lidarcheck.figures.png.check_plots import Pen, drawing
from lidarcheck.figures.svg.kpi_strip import strip
from lidarcheck.formats.atomic import write_text
from lidarcheck.harness.gate.evidence import KpiEvidence, KpiVerdict
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.harness.reports.annotations import advice, number, with_unit
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = ["report_html", "write_report"]

_ICONS = {
    KpiVerdict.IDENTICAL: "=",
    KpiVerdict.EQUIVALENT: "≈",
    KpiVerdict.CHANGED: "~",
    KpiVerdict.IMPROVED: "▲",
    KpiVerdict.INDETERMINATE: "?",
    KpiVerdict.REGRESSED: "✗",
    KpiVerdict.MISSING: "∅",
}


@dataclass(frozen=True, slots=True)
class _Kpi:
    """A row of a scenario's table, as text; from `strip` on SVG, empty where there is nothing."""

    found: KpiResult
    icon: str
    old: str
    new: str
    change: str
    tolerance: str
    limits: str
    catches: str
    release: str
    strip: str
    seeds: str
    distribution: str
    shift: str


@dataclass(frozen=True, slots=True)
class _Scenario:
    """A scenario's section; `word`: its verdict, `anchor`: its place on the page."""

    found: ScenarioResult
    anchor: str
    icon: str
    word: str
    fallen: int
    kpis: tuple[_Kpi, ...]

    @property
    def shown(self) -> bool:
        """Whether there is more to say of it than that it was not run."""
        return bool(self.kpis or self.found.problems)

    @property
    def reasons(self) -> list[tuple[str, list[str]]]:
        """Each reason for which goldens were accepted, and whose."""
        reasons = dict.fromkeys(kpi.found.reason for kpi in self.kpis if kpi.found.reason)
        return [(reason, [kpi.found.name for kpi in self.kpis if kpi.found.reason == reason]) for reason in reasons]

    @property
    def advice(self) -> list[str]:
        """What to do, once for all KPIs that fail alike."""
        groups: dict[tuple[KpiVerdict, bool], list[KpiResult]] = {}
        for kpi in self.found.kpis:
            if kpi.fails:
                groups.setdefault((kpi.verdict, bool(kpi.limit)), []).append(kpi)
        return [text for kpis in groups.values() if (text := advice(self.found, kpis))]

    @property
    def fallen_by_verdict(self) -> list[tuple[str, list[str]]]:
        """The names of the KPIs that fell out, by verdict."""
        fallen = [kpi.found for kpi in self.kpis if kpi.found.fails]
        verdicts = dict.fromkeys(kpi.verdict for kpi in fallen)
        return [(word.value, [kpi.name for kpi in fallen if kpi.verdict is word]) for word in verdicts]


_EXAMPLE = KpiResult(
    KpiSpec("example", "mean", "1", "target", 1.0),
    KpiVerdict.CHANGED,
    golden=KpiEvidence(KpiVerdict.CHANGED, 0.8, 0.4, 1.7, 64),
)


def write_report(report: CheckReport, path: Path | str) -> None:
    """Write the page of `report`, whole or not at all; `InputError` when it cannot be written."""
    write_text(Path(path), report_html(report))


def report_html(report: CheckReport) -> str:
    """The page as text; the same report gives the same bytes."""
    with drawing() as pen:
        scenarios = [_scenario(found, index, pen) for index, found in enumerate(report.scenarios, 1)]
    counts = [(word, count, _ICONS[KpiVerdict(word)]) for word, count in report.counts.items() if count]
    return _template().render(
        report=report,
        scenarios=scenarios,
        counts=counts,
        total=sum(report.counts.values()),
        fallen=sum(scenario.fallen for scenario in scenarios),
        legend_strip=strip(_EXAMPLE),
        failed_scenarios=sum(scenario.found.failed for scenario in scenarios),
    )


@cache
def _template() -> Template:
    return page_environment().get_template("report.html.jinja")


def _scenario(found: ScenarioResult, index: int, pen: Pen) -> _Scenario:
    if found.failed:
        icon, word = "✗", "failed"
    elif not found.kpis:
        icon, word = "–", "not run"
    else:
        icon, word = "✓", "identical" if found.identical else "holds"
    fallen = sum(kpi.fails for kpi in found.kpis)
    return _Scenario(found, f"s{index}", icon, word, fallen, tuple(_kpi(kpi, pen) for kpi in found.kpis))


def _kpi(kpi: KpiResult, pen: Pen) -> _Kpi:
    spec, release = kpi.spec, kpi.release
    limits = [f"≥ {number(spec.low)}"] if spec.low is not None else []
    limits += [f"≤ {number(spec.high)}"] if spec.high is not None else []
    return _Kpi(
        found=kpi,
        icon=_ICONS[kpi.verdict],
        old=number(kpi.old),
        new=number(kpi.new),
        change=_change(kpi),
        tolerance=with_unit(f"{'' if spec.kind == 'distance' else '±'}{number(spec.tolerance)}", kpi),
        limits=", ".join(limits),
        catches="–" if math.isnan(kpi.smallest) else f"{kpi.smallest:.3g}",
        release=f"{release.delta:+.4g}, {release.verdict.value}" if release and not math.isnan(release.delta) else "",
        strip=strip(kpi),
        seeds=pen.seeds(kpi),
        distribution=pen.distribution(kpi),
        shift=pen.shift(kpi),
    )


def _change(kpi: KpiResult) -> str:
    """The change with what chance explains of it."""
    if kpi.golden is None or math.isnan(kpi.golden.delta):
        return "–"
    if kpi.golden.delta == 0.0:
        return "0"
    margin = "" if math.isnan(kpi.golden.margin) else f" ±{kpi.golden.margin:.2g}"
    return f"{kpi.golden.delta:+.4g}{margin}"
