"""Summaries in plain words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import search_spec
from lidarcheck.explain.report.explanation import Standout
from lidarcheck.inference.intervals import ClassifierGap, Gap
from lidarcheck.inference.observed.echo_view import EchoView
from lidarcheck.inference.observed.summary import Summary

__all__ = ["classifier_words", "closed_words", "depends_on", "form_words", "measurement", "place_words", "standouts"]


# fmt: off
_MORE = {
    "range": ("ranges are longer", "ranges are shorter"),
    "area": ("echoes are stronger ({area})", "echoes are weaker ({area})"),
    "peak": ("echoes are higher ({peak})", "echoes are lower ({peak})"),
    "width": ("echoes are wider ({width})", "echoes are narrower ({width})"),
    "range scatter along columns": (
        "range scatters more from layer to layer", "range scatters less from layer to layer",
    ),
    "range scatter along layers": (
        "range scatters more from column to column", "range scatters less from column to column",
    ),
    "area scatter": ("{area} scatters more", "{area} scatters less"),
    "width scatter": ("{width} scatters more", "{width} scatters less"),
    "detected": ("surfaces are detected more often", "surfaces are detected less often"),
    "range along elevation": (
        "ranges are longer where the surface recedes upward", "ranges are shorter where the surface recedes upward",
    ),
    "range along azimuth": (
        "ranges are longer where the surface recedes to the left",
        "ranges are shorter where the surface recedes to the left",
    ),
    "echoes in front": ("more echoes in front of the surface", "fewer echoes in front of the surface"),
    "echoes behind": ("more echoes behind the surface", "fewer echoes behind the surface"),
    "echoes without a surface": ("more echoes of beams that meet nothing", "fewer echoes of beams that meet nothing"),
    "other echoes": ("more echoes of no surface of their own beam", "fewer echoes of no surface of their own beam"),
    "strength of other echoes": ("echoes of no surface are stronger", "echoes of no surface are weaker"),
    "area of bloom": ("bloom is stronger ({area})", "bloom is weaker ({area})"),
    "peak of bloom": ("bloom is higher ({peak})", "bloom is lower ({peak})"),
    "width of bloom": ("bloom is wider ({width})", "bloom is narrower ({width})"),
}
# fmt: on
_SUBJECT = {
    "range": "the range",
    "area": "{area}",
    "peak": "{peak}",
    "width": "{width}",
    "range scatter along columns": "the scatter of range",
    "range scatter along layers": "the scatter of range",
    "area scatter": "the scatter of {area}",
    "width scatter": "the scatter of {width}",
    "detected": "detection",
    "range along elevation": "the range along slopes",
    "range along azimuth": "the range along slopes",
    "echoes in front": "echoes in front of surfaces",
    "echoes behind": "echoes behind surfaces",
    "echoes without a surface": "echoes without a surface",
    "other echoes": "echoes of no surface",
    "strength of other echoes": "the strength of echoes of no surface",
    "area of bloom": "{area} of bloom",
    "peak of bloom": "{peak} of bloom",
    "width of bloom": "{width} of bloom",
}  # fmt: skip


def standouts(
    names: Sequence[Summary], r: FloatArray, level: float, view: EchoView, most: int = 24
) -> tuple[Standout, ...]:
    """The summaries beyond a level, the largest first; `r` (n_summaries,) in standard deviations. `view`: what the
    sensor calls its features."""
    found = []
    for i in np.argsort(-np.abs(r), kind="stable")[:most]:
        if abs(r[i]) <= level:
            break
        one = names[int(i)]
        found.append(Standout(one.feature, one.covariate, one.bin, float(r[i]), place_words(one, float(r[i]), view)))
    return tuple(found)


def place_words(one: Summary, z: float, view: EchoView) -> str:
    """One summary as half a sentence: `echoes are weaker (AREA) at range 20-30 m (-12.3 sd)`."""
    text = _MORE[one.feature][0 if z > 0.0 else 1].format_map(view.names)
    where = "" if one.covariate == "all" else f" at {one.covariate} {one.bin}"
    if one.covariate == "from column to column":
        text, where = f"{_SUBJECT[one.feature].format_map(view.names)} changes from column to column", ""
    return f"{text}{where} ({z:+.1f} sd)"


def depends_on(names: Sequence[Summary], r: FloatArray, view: EchoView, most: int = 3) -> str:
    """What a residual depends on: for the features that stand out most, the covariates over which they vary most."""
    groups: dict[tuple[str, str], list[float]] = {}
    for one, value in zip(names, r, strict=True):
        if one.covariate not in ("all", "each layer", "frame"):
            groups.setdefault((one.feature, one.covariate), []).append(float(value))
    strength = {}
    for key, values in groups.items():
        sizes = np.array(values)
        # A bin has unit variance by chance; what a covariate explains counts per bin, so that many bins do not win.
        strength[key] = float((sizes**2).sum() - len(sizes)) / np.sqrt(len(sizes))
    words: list[str] = []
    seen: set[str] = set()
    for (feature, covariate), value in sorted(strength.items(), key=lambda item: (-item[1], item[0])):
        if value <= 4.0 or len(words) >= most:
            break
        subject = _SUBJECT[feature].format_map(view.names)
        if subject not in seen:
            seen.add(subject)
            words.append(f"{subject} depends on {covariate}")
    return "; ".join(words) or "no single covariate stands out"


def closed_words(seen: float | None, gap: Gap) -> str:
    """What closes of the gap on the frames that chose the names, and on those that nothing has seen, with its interval:
    `98 % of the gap closes on the frames that it was chosen by, 22 % (10 to 35 %) on those that nothing has seen`."""
    low, high = (f"{100.0 * end:.0f}" for end in gap.closed_span)
    there = f"{100.0 * gap.closed:.0f} % ({low} to {high} %)"
    if seen is None:
        return f"{there} of the gap closes on frames that nothing has seen"
    return f"{100.0 * seen:.0f} % of the gap closes on the frames that chose, {there} on those that nothing has seen"


def measurement(one: str, other: str) -> str:
    """The measurement that separates two effects, as one of them says."""
    said = search_spec(one).confused_with.get(other) or search_spec(other).confused_with.get(one)
    return said or "panels over more ranges, materials and angles"


def classifier_words(figure: ClassifierGap) -> str:
    """What a classifier tells before and after, and by chance."""
    if figure.before is None or figure.after is None or figure.floor is None:
        return "too few frames and blocks of beams to ask one: what is said rests on the distance alone"
    return f"{figure.before:.3f} before, {figure.after:.3f} after; chance makes up to {figure.floor:.3f}"


def form_words(names: Sequence[str], figure: ClassifierGap) -> str:
    """That named effects are there and their form still differs, and by how much; empty where a classifier does not
    tell, or nothing was named."""
    if not names or not figure.tells:
        return ""
    them, form = ("the effect is", "its form") if len(names) == 1 else ("the effects are", "their form")
    return (
        f"A classifier still tells measured from simulated echoes by {figure.after:.3f}, where chance makes up to "
        f"{figure.floor:.3f}: {them} there, and {form}, or an error beside, still differs."
    )
