"""The result on panels as people read it, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.echoes import features_of
from lidarcheck.calibration.panels.noise import NoiseSide, WalkCurve
from lidarcheck.calibration.panels.samples import PanelSamples
from lidarcheck.calibration.panels.workflow import PanelsResult
from lidarcheck.figures.data import Cloud, Course, Curve, Distribution, Figure, Page, Section
from lidarcheck.figures.pages.panel_tables import (
    REAL,
    SIMULATED,
    features_shown,
    figures_of_merit,
    found_table,
    gap_tables,
    made_of,
    noise_m,
    rejects_section,
)
from lidarcheck.figures.pages.thinning import thinned
from lidarcheck.kpi.features import strength_name
from lidarcheck.kpi.scatter import RangeScatter
from lidarcheck.sensor import Sensor

__all__ = ["document", "page"]

MOST_SHOWN = 20_000
"""Values of one sample that a picture gets; more would not show."""
CLOUD_POINTS = 400


def page(result: PanelsResult, provenance: Mapping[str, str] | None = None) -> Page:
    """Verdict, tables and figures: two sections of all panels, then one of each, in their order, then the rest."""
    sections = (
        Section("Panels", _found_words(result), (found_table(result),), (_cloud(result),)),
        Section("What they show", _side_words(result), (figures_of_merit(result),), tuple(_courses(result))),
        *(_panel_section(result, i) for i in range(len(result.panels))),
        *rejects_section(result),
    )
    return Page("panels", _summary(result), sections, dict(provenance or {}))


def document(result: PanelsResult) -> dict[str, Any]:
    """The numbers for JSON; the echoes themselves are in the panels' files."""
    panels = []
    for panel, noise in zip(result.panels, result.noise, strict=True):
        own = {k: v for k, v in vars(panel).items() if k not in ("layer", "point", "expected_m", "plane")}
        own |= {"beams": len(panel.layer), "plane": panel.plane.a, "material_name": made_of(result, panel)}
        own |= {"layers": _span(panel.layer), "points": _span(panel.point)}
        panels.append(own | vars(noise))
    rest = ("found_in", "frames_measured", "frames_simulated", "floor_m", "roof_m", "settings", "notes", "rejects")
    over_all = ("walk_measured", "walk_simulated", "scatter_measured", "scatter_simulated")
    return {"panels": panels, **{name: getattr(result, name) for name in (*rest, *over_all)}}


def _span(index: npt.NDArray[np.int64]) -> list[int]:
    return [int(index.min()), int(index.max())]


def _summary(result: PanelsResult) -> str:
    panels, sides = result.panels, [noise.measured for noise in result.noise]
    plural = "panel" if len(panels) == 1 else "panels"
    place = (
        f"at {panels[0].range_m:.1f} m"
        if len(panels) == 1
        else f"from {panels[0].range_m:.1f} to {panels[-1].range_m:.1f} m"
    )
    frames = f"{result.frames_measured} measured frame{'s' if result.frames_measured > 1 else ''}"
    text = f"{len(panels)} {plural} {place} in {frames}"
    detection = sum(s.detected for s in sides) / sum(s.trials for s in sides)
    text += f": {100 * detection:.2f} % of the beams on panels are detected"
    simulated = [noise.simulated for noise in result.noise if noise.simulated is not None]
    if simulated:
        share = sum(s.detected for s in simulated) / sum(s.trials for s in simulated)
        text += f", {100 * share:.2f} % in {result.frames_simulated} simulated"
    noise = [noise_m(s) for s in sides if math.isfinite(noise_m(s))]
    if noise:
        least, most = f"{1000 * min(noise):.1f}", f"{1000 * max(noise):.1f}"
        text += f"; range noise {least if least == most else f'{least} to {most}'} mm"
    return f"{text}."


def _found_words(result: PanelsResult) -> tuple[str, ...]:
    where = (
        "the ideal scan"
        if result.found_in == "ideal"
        else "the measured frames themselves, since there is no ideal scan"
    )
    levels = [
        f"{name} {abs(height):.2f} m {side} the sensor"
        for name, height, side in (("floor", result.floor_m, "below"), ("roof", result.roof_m, "above"))
        if math.isfinite(height)
    ]
    trimmed = f"Trimmed: {' and '.join(levels)}." if levels else "No floor and no roof was found to trim."
    return (f"Found in {where}. {trimmed}", *result.notes)


def _side_words(result: PanelsResult) -> tuple[str, ...]:
    several = result.frames_measured > 1
    noise = "from frame to frame on one beam" if several else "around the panel's plane, as there is one frame"
    words = f"Detection with its 95 % interval; range noise is half the central 68.3 %, {noise}."
    some = [p.number for p, s in zip(result.panels, result.measured, strict=True) if s.kept_beams > 1]
    more = f"Of panels {', '.join(map(str, some))} only some beams' echoes are held; detection counts all."
    return (words, more) if some else (words,)


def _cloud(result: PanelsResult) -> Cloud:
    groups: dict[str, FloatArray] = {}
    for panel, sample in zip(result.panels, result.measured, strict=True):
        xyz = np.stack([sample.scan.x_m, sample.scan.y_m, sample.scan.z_m], axis=-1)
        name = made_of(result, panel) or "panels"
        groups[name] = np.concatenate([groups.get(name, np.zeros((0, 3))), thinned(xyz, CLOUD_POINTS)])
    return Cloud("Echoes on panels", groups)


def _courses(result: PanelsResult) -> Iterator[Figure]:
    """Every figure of merit over range, a curve for each material and side."""
    label = "range [m]"
    limits = (lambda s: s.detection_low, lambda s: s.detection_high)
    yield Course("Detection over range", label, "detection probability", _curves(result, lambda s: s.detection, limits))
    yield Course("Range noise over range", label, "range noise [mm]", _curves(result, lambda s: 1000 * noise_m(s)))
    if result.found_in == "ideal":
        title = "Bias over range"
        yield Course(title, label, "median range - ideal [mm]", _curves(result, lambda s: 1000 * s.bias_m))
    for name in features_shown(result):
        curves = _curves(result, lambda s, name=name: s.means.get(name, math.nan))  # type: ignore[misc]
        yield Course(f"{name} over range", label, f"mean {name}", curves, log_y=name == "AREA")
    walk = {REAL: result.walk_measured, SIMULATED: result.walk_simulated}
    yield _walk_course("Walk over all panels", walk)
    yield _scatter_course({REAL: result.scatter_measured, SIMULATED: result.scatter_simulated})


Getter = Callable[[NoiseSide], float]


def _curves(result: PanelsResult, get: Getter, limits: tuple[Getter, Getter] | None = None) -> tuple[Curve, ...]:
    groups: dict[str, list[int]] = {}
    for i, panel in enumerate(result.panels):
        groups.setdefault(made_of(result, panel), []).append(i)
    curves = []
    for name, members in groups.items():
        x = np.array([result.panels[i].range_m for i in members])
        for side_name in (REAL, SIMULATED):
            sides = [result.noise[i].measured if side_name == REAL else result.noise[i].simulated for i in members]
            some = [side for side in sides if side is not None]
            if len(some) < len(sides):
                continue
            low, high = (None, None) if limits is None else (np.array([f(s) for s in some]) for f in limits)
            whole = f"{side_name}, {name}" if name and len(groups) > 1 else side_name
            curves.append(Curve(whole, x, np.array([get(s) for s in some]), low, high))
    return tuple(curves)


def _walk_course(title: str, walks: Mapping[str, WalkCurve | None]) -> Course:
    curves = tuple(
        Curve(name, w.amplitude, 1000 * w.residual_m, 1000 * w.low_m, 1000 * w.high_m)
        for name, w in walks.items()
        if w is not None
    )
    return Course(title, "amplitude", "median range residual [mm]", curves, log_x=True)


def _scatter_course(scatters: Mapping[str, RangeScatter | None]) -> Course:
    curves = tuple(
        Curve(name, s.signal, 1000 * s.sigma_m) for name, s in scatters.items() if s is not None and s.signal.size
    )
    return Course("Range noise over amplitude", "amplitude", "range noise [mm]", curves, log_x=True, log_y=True)


def _panel_section(result: PanelsResult, i: int) -> Section:
    panel, noise = result.panels[i], result.noise[i]
    title = f"Panel {panel.number}, {panel.range_m:.1f} m"
    if of := made_of(result, panel):
        title += f", {of}"
    samples = {REAL: result.measured[i]}
    if result.simulated is not None:
        samples[SIMULATED] = result.simulated[i]
    figures: list[Figure] = [
        Distribution(
            f"{title}: {name}",
            name,
            unit,
            {side: thinned(_values(s, name, result.sensor), MOST_SHOWN) for side, s in samples.items()},
        )
        for name, unit in _shown(result)
    ]
    figures.append(
        _walk_course(
            f"{title}: walk",
            {REAL: noise.measured.walk, SIMULATED: None if noise.simulated is None else noise.simulated.walk},
        )
    )
    return Section(title, (), gap_tables(noise.gaps), tuple(figures))


def _shown(result: PanelsResult) -> tuple[tuple[str, str], ...]:
    """The quantities of which each panel gets a picture: the amplitude and the distance."""
    features = features_shown(result)
    first = next((name for name in (strength_name(result.sensor), *features) if name in features), None)
    return (*(((first, ""),) if first else ()), ("distance", "m"))


def _values(sample: PanelSamples, name: str, sensor: Sensor | None) -> FloatArray:
    if name == "distance":
        return np.round(sample.scan.range_m, 4)
    return features_of(sample.scan, sensor).get(name, ("", np.zeros(0)))[1]
