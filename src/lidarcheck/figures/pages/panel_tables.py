"""The tables of panels: where they are, what they show, how far real and simulated are apart, and what was no panel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lidarcheck.calibration.panels.find import Panel, Reject
from lidarcheck.calibration.panels.noise import NoiseSide
from lidarcheck.calibration.panels.workflow import PanelsResult
from lidarcheck.figures.data import Section, Table
from lidarcheck.figures.words import number

__all__ = [
    "REAL",
    "SIMULATED",
    "features_shown",
    "figures_of_merit",
    "found_table",
    "gap_tables",
    "made_of",
    "noise_m",
    "overview",
    "rejects_section",
]

REAL, SIMULATED = "real", "simulated"


def noise_m(side: NoiseSide) -> float:
    """Range noise [m]: from frame to frame where there are several, else around the plane."""
    return side.noise_robust_m if math.isfinite(side.noise_robust_m) else side.plane_robust_m


def made_of(result: PanelsResult, panel: Panel) -> str:
    """What the panel is made of, as far as it is known."""
    if panel.material < 0:
        return ""
    return result.materials.get(panel.material, f"material {panel.material}")


def found_table(result: PanelsResult) -> Table:
    """Where each panel is, how large and how turned, and the beams on it."""
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
            f"{p.width_m:.2f} x {p.height_m:.2f}", f"{p.incidence_deg:.0f}", made_of(result, p) or "-",
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
        rows.append((*own, made_of(result, panel) or "-", str(noise.measured.echoes), *seen))
    more = ("simulated [%]", "95 % of it") if some else ()
    return Table("", (*header, *more), tuple(rows), tuple(name for name in (*header, *more) if name != "of"))


def _detection(side: NoiseSide) -> tuple[str, str]:
    """How often it is detected, and the interval [%]."""
    return f"{100 * side.detection:.2f}", f"{100 * side.detection_low:.2f} ... {100 * side.detection_high:.2f}"


def figures_of_merit(result: PanelsResult) -> Table:
    """Detection, noise, bias and flatness of each panel, and the means of its features; a row a side."""
    header = (
        "panel",
        "range [m]",
        "side",
        "detection [%]",
        "95 %",
        "noise [mm]",
        "bias [mm]",
        "flatness [mm]",
        *features_shown(result),
    )
    rows = []
    for panel, noise in zip(result.panels, result.noise, strict=True):
        for name, side in ((REAL, noise.measured), (SIMULATED, noise.simulated)):
            if side is not None:
                first = (str(panel.number), f"{panel.range_m:.2f}") if name == REAL else ("", "")
                rows.append((*first, name, *_figures_of(side, features_shown(result))))
    return Table("", header, tuple(rows), tuple(name for name in header if name != "side"))


def features_shown(result: PanelsResult) -> tuple[str, ...]:
    """The names of the features that the measured echoes have."""
    return tuple(result.noise[0].measured.means)


def _figures_of(side: NoiseSide, features: tuple[str, ...]) -> tuple[str, ...]:
    lengths = (noise_m(side), side.bias_m, side.plane_robust_m)
    return (
        *_detection(side),
        *(number(1000 * length, ".1f") for length in lengths),
        *(number(side.means.get(name, math.nan), ".1f") for name in features),
    )


def gap_tables(gaps: Mapping[str, Any]) -> tuple[Table, ...]:
    """How far real and simulated are apart on a panel, by feature; no table where nothing was simulated."""
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


def rejects_section(result: PanelsResult) -> tuple[Section, ...]:
    """The largest flat surfaces that were no panels, and why; empty where there are none."""
    if not result.rejects:
        return ()
    header = ("range [m]", "azimuth [deg]", "size [m]", "beams", "why not")
    rows = tuple(_reject_row(reject) for reject in result.rejects)
    table = Table("", header, rows, ("range [m]", "azimuth [deg]", "beams"))
    return (Section("Flat surfaces that are no panels", ("The largest of them.",), (table,)),)


def _reject_row(r: Reject) -> tuple[str, ...]:
    size = f"{r.width_m:.1f} x {r.height_m:.1f}"
    return f"{r.range_m:.1f}", f"{r.azimuth_deg:.1f}", size, str(r.beams), r.why
