"""The page of the gap workflow: one self-contained HTML file, without scripts: what was missing, and the proof."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from lidarcheck.cases.frame import Frame
from lidarcheck.explain.report.explanation import Calibrated, Explanation, Finding
from lidarcheck.explain.report.wording import classifier_words
from lidarcheck.figures.gap.data import FieldMap, Pictures
from lidarcheck.figures.gap.measure import pictures_of
from lidarcheck.figures.gap.verdict import verdict_of
from lidarcheck.figures.html.environment import page_environment
from lidarcheck.figures.svg.gap_map import map_svg, reach_of, scale_svg
from lidarcheck.figures.svg.gap_plots import detected_svg, histogram_svg, residual_svg
from lidarcheck.figures.svg.gap_strips import candidate_strip, feature_strip, gap_reach, gap_strip
from lidarcheck.figures.words import amount
from lidarcheck.formats.atomic import write_text
from lidarcheck.inference.intervals import Interval
from lidarcheck.model.spec import Model

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = ["Measured", "explanation_html", "verify_pictures", "write_html"]

_TELLING, _OF_EACH = 8, 2
"""Panels of residuals that stand before the others, and how many of them may show the same residual."""


class Measured(Protocol):
    """What the page needs of a case."""

    @property
    def frames(self) -> tuple[Frame, ...]:
        """All frames."""

    @property
    def model(self) -> Model:
        """The model as it was."""

    @property
    def directory(self) -> Path:
        """Where the case is."""

    @property
    def hashes(self) -> Mapping[str, str]:
        """Of its files, by name."""


@dataclass(frozen=True, slots=True)
class _Drop:
    """A row of the waterfall, as text; `strip`: SVG."""

    name: str
    what: str
    strip: str
    gap: str
    closes: str


@dataclass(frozen=True, slots=True)
class _Panel:
    """A plot with its caption; `clearness`: how clearly the model before misses."""

    group: str
    caption: str
    plot: str
    clearness: float = 0.0


@dataclass(frozen=True, slots=True)
class _Maps:
    """The two maps of a quantity and their scale; `same`: nothing changed, so one stands for both."""

    caption: str
    unit: str
    before: str
    after: str
    scale: str


def write_html(
    explanation: Explanation,
    case: Measured,
    path: Path,
    pictures: Pictures | None = None,
    *,
    first: Sequence[str] = (),
) -> None:
    """Write the page of an explanation, whole or not at all; `InputError` when it cannot be written.

    `pictures`: where they have been made already, with `verify_pictures`. `first`: lines above all else. The same
    arguments give the same bytes.
    """
    write_text(path, explanation_html(explanation, case, pictures, first=first))


def verify_pictures(explanation: Explanation, case: Measured) -> Pictures:
    """The pictures' numbers, on the frames that no fit has seen; the same explanation and case, the same numbers."""
    numbers = explanation.split.get("verify", ())
    frames = [frame for frame in case.frames if frame.number in numbers]
    seeds = explanation.seeds
    seed = seeds.get("seed", next(iter(seeds.values()), 0))
    return pictures_of(frames, case.model, explanation.model, seed=seed)


def explanation_html(
    explanation: Explanation, case: Measured, pictures: Pictures | None = None, *, first: Sequence[str] = ()
) -> str:
    """The page as text."""
    from lidarcheck.explain.report.model_diff import model_diff

    shown = verify_pictures(explanation, case) if pictures is None else pictures
    panels = _residual_panels(shown)
    telling = _telling(panels)
    found = {finding.name for finding in explanation.findings}
    return _template().render(
        explanation=explanation,
        first=first,
        verdict=verdict_of(explanation),
        icon=_ICONS.get(explanation.verdict, "?"),
        case=case.directory.resolve().name,
        findings=[_finding(finding) for finding in explanation.findings],
        waterfall=_waterfall(explanation),
        classifier=classifier_words(explanation.gap.classifier),
        features=_features(explanation),
        diff=[(_DIFF.get(line[:1], "same"), line) for line in model_diff(case.model, explanation.model)],
        pictures=shown,
        histograms=[_Panel("", one.words, histogram_svg(one, changed=shown.changed)) for one in shown.histograms],
        telling=telling,
        groups=_grouped([panel for panel in panels if panel not in telling]),
        maps=[_map(one, changed=shown.changed) for one in shown.maps],
        candidates=[(one, candidate_strip(one), one.name in found) for one in explanation.candidates],
        hashes={**case.hashes, **explanation.hashes},
    )


_ICONS: Mapping[str, str] = {"no_gap": "=", "explained": "✓", "unknown": "?"}
_DIFF = {"+": "added", "-": "removed"}


@cache
def _template() -> Template:
    environment = page_environment().overlay()
    environment.filters = {**environment.filters, "amount": amount, "ranged": _ranged}
    return environment.get_template("explain.html.jinja")


def _ranged(one: Interval | Calibrated) -> str:
    """The interval's ends."""
    return f"{amount(one.low)} to {amount(one.high)}"


def _finding(finding: Finding) -> dict[str, Any]:
    """The finding with what its effects do to the data."""
    summaries = dict.fromkeys(effect.summary() for effect in finding.effects)
    return {
        "found": finding,
        "summaries": [text for text in summaries if text],
        "empirical": any(effect.empirical for effect in finding.effects),
        "sure": f"{100.0 * finding.confidence:.0f} %",
    }


def _waterfall(explanation: Explanation) -> list[_Drop]:
    """The gap as it was, after each effect, and the floor."""
    gap, reach = explanation.gap, gap_reach(explanation.gap)
    excess = gap.before.value - gap.floor.value
    drops, earlier = [("As it was", "", gap.before, gap.before.value)], gap.before.value
    steps = gap.waterfall or ((("the new model", gap.after),) if explanation.findings else ())
    for name, left in steps:
        drops.append((f"+ {name}", "closes", left, earlier))
        earlier = left.value
    drops.append(("Floor", "floor", gap.floor, gap.floor.value))
    return [
        _Drop(
            name,
            what,
            gap_strip(one, before, gap.floor, reach),
            f"{amount(one.value)} ({_ranged(one)})",
            f"{amount(100.0 * (before - one.value) / excess)} %" if what == "closes" and excess > 0.0 else "",
        )
        for name, what, one, before in drops
    ]


def _features(explanation: Explanation) -> list[tuple[str, str, tuple[float, float, float]]]:
    """Each feature's name, strip, and distances before, after and floor; the widest gap first."""
    features = explanation.gap.by_feature
    names = sorted(features, key=lambda name: -features[name][0] / max(features[name][2], 1e-12))
    return [(name, feature_strip(*features[name]), features[name]) for name in names]


def _residual_panels(pictures: Pictures) -> list[_Panel]:
    """All residuals over all covariates, and the share detected; those without anything to show left out."""
    panels = [
        _Panel(
            curve.words,
            f"{curve.words} over {curve.covariate}{'' if curve.unit == '1' else f' [{curve.unit}]'}",
            residual_svg(curve, changed=pictures.changed),
            curve.clearness,
        )
        for curve in pictures.curves
    ]
    panels += [
        _Panel(
            "Detection",
            f"surfaces that have an echo over {one.covariate} [%]",
            detected_svg(one, changed=pictures.changed),
            one.clearness,
        )
        for one in pictures.detected
    ]
    return [panel for panel in panels if panel.plot]


def _telling(panels: Sequence[_Panel]) -> list[_Panel]:
    """The clearest, not all of them of one kind."""
    chosen: list[_Panel] = []
    for panel in sorted(panels, key=lambda panel: -panel.clearness):
        if sum(other.group == panel.group for other in chosen) < _OF_EACH:
            chosen.append(panel)
    return chosen[:_TELLING]


def _grouped(panels: Sequence[_Panel]) -> list[tuple[str, list[_Panel]]]:
    groups: dict[str, list[_Panel]] = {}
    for panel in panels:
        groups.setdefault(panel.group, []).append(panel)
    return list(groups.items())


def _map(one: FieldMap, *, changed: bool) -> _Maps:
    reach = reach_of(one)
    before = map_svg(one, "before", reach) if changed else ""
    return _Maps(one.words, one.unit, before, map_svg(one, "after", reach), scale_svg(one, reach))
