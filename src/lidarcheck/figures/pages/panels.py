"""The result on panels as people read it, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.panels.find import Panel, Reject
from lidarcheck.calibration.panels.noise import NoiseSide, WalkCurve, features_of
from lidarcheck.calibration.panels.samples import PanelSamples
from lidarcheck.calibration.panels.workflow import PanelsResult
from lidarcheck.figures.data import Cloud, Course, Curve, Distribution, Figure, Page, Section, Table
from lidarcheck.figures.pages.thinning import thinned
from lidarcheck.figures.words import number
from lidarcheck.kpi.scatter import RangeScatter

__all__ = ["document", "overview", "page"]

MOST_SHOWN = 20_000
"""Values of one sample that a picture gets; more would not show."""
CLOUD_POINTS = 400
REAL, SIMULATED = "real", "simulated"


def page(result: PanelsResult, provenance: Mapping[str, str] | None = None) -> Page:
    """Verdict, tables and figures: two sections of all panels, then one of each, in their order, then the rest."""
    sections = (
        Section("Panels", _found_words(result), (_found_table(result),), (_cloud(result),)),
        Section("What they show", _side_words(result), tuple(_tables(result)), tuple(_courses(result))),
        *(_panel_section(result, i) for i in range(len(result.panels))),
        *_rest(result),
    )
    return Page("panels", _summary(result), sections, dict(provenance or {}))


def document(result: PanelsResult) -> dict[str, Any]:
    """The numbers for JSON; the echoes themselves are in the panels' files."""
    panels = []
    for panel, noise in zip(result.panels, result.noise, strict=True):
        own = {k: v for k, v in vars(panel).items() if k not in ("layer", "point", "expected_m", "plane")}
        own |= {"beams": len(panel.layer), "plane": panel.plane.a, "material_name": _of(result, panel)}
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
    noise = [_noise_m(s) for s in sides if math.isfinite(_noise_m(s))]
    if noise:
        least, most = f"{1000 * min(noise):.1f}", f"{1000 * max(noise):.1f}"
        text += f"; range noise {least if least == most else f'{least} to {most}'} mm"
    return f"{text}."


def _noise_m(side: NoiseSide) -> float:
    """From frame to frame where there are several, else around the plane."""
    return side.noise_robust_m if math.isfinite(side.noise_robust_m) else side.plane_robust_m


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


def _of(result: PanelsResult, panel: Panel) -> str:
    """What the panel is made of, as far as it is known."""
    if panel.material < 0:
        return ""
    return result.materials.get(panel.material, f"material {panel.material}")


def _found_table(result: PanelsResult) -> Table:
    header = (
        "panel",
        "range [m]",
        "azimuth [deg]",
        "elevation [deg]",
        "size [m]",
        "turned [deg]",
        "of",
        "beams",
        "trimmed",
    )
    rows = tuple(
        (
            str(p.number), f"{p.range_m:.2f}", f"{p.azimuth_deg:z.2f}", f"{p.elevation_deg:z.2f}",
            f"{p.width_m:.2f} x {p.height_m:.2f}", f"{p.incidence_deg:.0f}", _of(result, p) or "-",
            str(p.outline_beams), str(len(p.layer)),
        )
        for p in result.panels
    )  # fmt: skip
    right = tuple(name for name in header if name not in ("size [m]", "of"))
    return Table("", header, rows, right)


def overview(result: PanelsResult) -> Table:
    """Each panel in a line: where it is, how large, how many echoes it has and how often it is detected."""
    header = ("no.", "range [m]", "size [m]", "of", "echoes", "seen [%]", "95 %")
    some = result.noise[0].simulated is not None
    rows = []
    for panel, noise in zip(result.panels, result.noise, strict=True):
        own = (str(panel.number), f"{panel.range_m:.2f}", f"{panel.width_m:.2f} x {panel.height_m:.2f}")
        sides = [side for side in (noise.measured, noise.simulated) if side is not None]
        seen = [text for side in sides for text in _detection(side)]
        rows.append((*own, _of(result, panel) or "-", str(noise.measured.echoes), *seen))
    more = ("simulated [%]", "95 % of it") if some else ()
    return Table("", (*header, *more), tuple(rows), tuple(name for name in (*header, *more) if name != "of"))


def _detection(side: NoiseSide) -> tuple[str, str]:
    """How often it is detected, and the interval [%]."""
    return f"{100 * side.detection:.2f}", f"{100 * side.detection_low:.2f} ... {100 * side.detection_high:.2f}"


def _tables(result: PanelsResult) -> Iterator[Table]:
    header = (
        "panel",
        "range [m]",
        "side",
        "detection [%]",
        "95 %",
        "noise [mm]",
        "bias [mm]",
        "flatness [mm]",
        *_features(result),
    )
    rows = []
    for panel, noise in zip(result.panels, result.noise, strict=True):
        for name, side in ((REAL, noise.measured), (SIMULATED, noise.simulated)):
            if side is not None:
                first = (str(panel.number), f"{panel.range_m:.2f}") if name == REAL else ("", "")
                rows.append((*first, name, *_figures_of(side, _features(result))))
    yield Table("", header, tuple(rows), tuple(name for name in header if name != "side"))


def _features(result: PanelsResult) -> tuple[str, ...]:
    return tuple(result.noise[0].measured.means)


def _figures_of(side: NoiseSide, features: tuple[str, ...]) -> tuple[str, ...]:
    lengths = (_noise_m(side), side.bias_m, side.plane_robust_m)
    return (
        *_detection(side),
        *(number(1000 * length, ".1f") for length in lengths),
        *(number(side.means.get(name, math.nan), ".1f") for name in features),
    )


def _cloud(result: PanelsResult) -> Cloud:
    groups: dict[str, FloatArray] = {}
    for panel, sample in zip(result.panels, result.measured, strict=True):
        xyz = np.stack([sample.scan.x_m, sample.scan.y_m, sample.scan.z_m], axis=-1)
        name = _of(result, panel) or "panels"
        groups[name] = np.concatenate([groups.get(name, np.zeros((0, 3))), thinned(xyz, CLOUD_POINTS)])
    return Cloud("Echoes on panels", groups)


def _courses(result: PanelsResult) -> Iterator[Figure]:
    """Every figure of merit over range, a curve for each material and side."""
    label = "range [m]"
    limits = (lambda s: s.detection_low, lambda s: s.detection_high)
    yield Course("Detection over range", label, "detection probability", _curves(result, lambda s: s.detection, limits))
    yield Course("Range noise over range", label, "range noise [mm]", _curves(result, lambda s: 1000 * _noise_m(s)))
    if result.found_in == "ideal":
        title = "Bias over range"
        yield Course(title, label, "median range - ideal [mm]", _curves(result, lambda s: 1000 * s.bias_m))
    for name in _features(result):
        curves = _curves(result, lambda s, name=name: s.means.get(name, math.nan))  # type: ignore[misc]
        yield Course(f"{name} over range", label, f"mean {name}", curves, log_y=name == "AREA")
    walk = {REAL: result.walk_measured, SIMULATED: result.walk_simulated}
    yield _walk_course("Walk over all panels", walk)
    yield _scatter_course({REAL: result.scatter_measured, SIMULATED: result.scatter_simulated})


Getter = Callable[[NoiseSide], float]


def _curves(result: PanelsResult, get: Getter, limits: tuple[Getter, Getter] | None = None) -> tuple[Curve, ...]:
    groups: dict[str, list[int]] = {}
    for i, panel in enumerate(result.panels):
        groups.setdefault(_of(result, panel), []).append(i)
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
    if of := _of(result, panel):
        title += f", {of}"
    samples = {REAL: result.measured[i]}
    if result.simulated is not None:
        samples[SIMULATED] = result.simulated[i]
    figures: list[Figure] = [
        Distribution(
            f"{title}: {name}", name, unit, {side: thinned(_values(s, name), MOST_SHOWN) for side, s in samples.items()}
        )
        for name, unit in _shown(result)
    ]
    figures.append(
        _walk_course(
            f"{title}: walk",
            {REAL: noise.measured.walk, SIMULATED: None if noise.simulated is None else noise.simulated.walk},
        )
    )
    return Section(title, (), _gap_table(noise.gaps), tuple(figures))


def _shown(result: PanelsResult) -> tuple[tuple[str, str], ...]:
    """The quantities of which each panel gets a picture: the amplitude and the distance."""
    features = _features(result)
    first = next((name for name in ("AREA", *features) if name in features), None)
    return (*(((first, ""),) if first else ()), ("distance", "m"))


def _values(sample: PanelSamples, name: str) -> FloatArray:
    if name == "distance":
        return np.round(sample.scan.range_m, 4)
    return features_of(sample.scan).get(name, ("", np.zeros(0)))[1]


def _gap_table(gaps: Mapping[str, Any]) -> tuple[Table, ...]:
    if not gaps:
        return ()
    header = ("of", "unit", "real", "simulated", "Wasserstein", "KS", "bias", "scatter")
    rows = tuple(
        (
            name,
            gap.unit,
            *(
                f"{v:.4g}"
                for v in (gap.mean_measured, gap.mean_simulated, gap.wasserstein, gap.ks, gap.dvm_bias, gap.dvm_scatter)
            ),
        )
        for name, gap in gaps.items()
    )
    return (Table("", header, rows, header[2:]),)


def _rest(result: PanelsResult) -> tuple[Section, ...]:
    if not result.rejects:
        return ()
    header = ("range [m]", "azimuth [deg]", "size [m]", "beams", "why not")
    rows = tuple(_reject_row(reject) for reject in result.rejects)
    table = Table("", header, rows, ("range [m]", "azimuth [deg]", "beams"))
    return (Section("Flat surfaces that are no panels", ("The largest of them.",), (table,)),)


def _reject_row(r: Reject) -> tuple[str, ...]:
    size = f"{r.width_m:.1f} x {r.height_m:.1f}"
    return f"{r.range_m:.1f}", f"{r.azimuth_deg:.1f}", size, str(r.beams), r.why
