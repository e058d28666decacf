"""The page of a scene comparison: where the two disagree, then the whole frame, its objects and its sectors."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from lidarcheck.calibration.scenes.parts import SectorMap
from lidarcheck.calibration.scenes.rank import FALSE_ALARMS
from lidarcheck.calibration.scenes.workflow import SceneComparison
from lidarcheck.figures.data import Cloud, Course, Curve, Figure, Grid, Page, Section, Table
from lidarcheck.figures.pages.thinning import thinned_cloud
from lidarcheck.figures.words import number
from lidarcheck.kpi.overlap import Overlap

__all__ = ["MOST_PARTS", "page"]

MOST_PARTS = 30
"""Rows of the table of objects; result.json has all."""


def page(result: SceneComparison, provenance: Mapping[str, str] | None = None) -> Page:
    """The result as people read it."""
    return Page(
        title="Comparative scene",
        summary=_summary(result),
        sections=(_disagreements(result), _whole(result), _parts(result), _sectors(result)),
        provenance=provenance or {},
    )


def _summary(result: SceneComparison) -> str:
    frames = "frame" if result.frames == 1 else f"{result.frames} frames"
    if result.scenes > 1:
        frames += f" of {result.scenes} scenes, taken together,"
    if not result.disagreements:
        chance = (
            f"chance gives in {100.0 * (1.0 - FALSE_ALARMS):.0f} % of frames" if result.has_floor else "chance gives"
        )
        return f"Measured and simulated {frames} disagree nowhere by more than {chance}."
    number = len(result.disagreements) + result.more
    places = "one place" if number == 1 else f"{number} places"
    return f"Measured and simulated {frames} disagree in {places}; most: {result.disagreements[0].words}."


def _disagreements(result: SceneComparison) -> Section:
    words = [f"{i}. {d.words}{_also(d.also)}" for i, d in enumerate(result.disagreements, 1)]
    if result.more:
        words.append(f"{result.more} more stand out; result.json has the KPIs of all objects and sectors.")
    if not result.has_floor:
        words.append(
            "Without the model there is no second simulation, which would say what chance gives: every difference of a "
            "beam is taken for chance, and only its sign and place are judged."
        )
    rows = tuple(
        (
            str(i),
            d.kind,
            d.name,
            d.feature,
            number(d.measured),
            number(d.simulated),
            str(d.units),
            number(d.strength),
        )
        for i, d in enumerate(result.disagreements, 1)
    )
    header = ("", "kind", "where", "feature", "measured", "simulated", "beams", "strength")
    table = Table("", header, rows, right=("", "measured", "simulated", "beams", "strength"))
    real, simulated = map(thinned_cloud, result.worst_points)
    clouds: tuple[Figure, ...] = ()
    if len(real) or len(simulated):
        clouds = (Cloud("Where they disagree most", {"real": real, "simulated": simulated}),)
    return Section("Where they disagree most", tuple(words), (table,) if rows else (), clouds)


def _also(others: tuple[str, ...]) -> str:
    return f" (also {'; '.join(others)})" if others else ""


def _whole(result: SceneComparison) -> Section:
    rows = [_overlap_row(f"frame {i}" if result.frames > 1 else "frame", o) for i, o in enumerate(result.overlap, 1)]
    if result.overlap_floor is not None:
        rows.append(_overlap_row("two simulations", result.overlap_floor))
    radius = result.overlap[0].radius_m
    cover = Table(
        f"Overlap within {radius:g} m and Chamfer distance",
        ("", "of measured", "of simulated", "Chamfer [m]"),
        tuple(rows),
        right=("of measured", "of simulated", "Chamfer [m]"),
    )
    header = ("feature", "unit", "n real", "n simulated", "wasserstein", "ks", "js", "dvm_bias", "dvm_scatter")
    gaps = tuple(
        (
            name,
            g.unit,
            str(g.n_measured),
            str(g.n_simulated),
            *_numbers(g.wasserstein, g.ks, g.js, g.dvm_bias, g.dvm_scatter),
        )
        for name, g in result.features.items()
    )
    features = Table("Echoes from surfaces", header, gaps, right=header[2:])
    words = [
        f"{result.echoes_measured} measured and {result.echoes_simulated} simulated echoes on {result.beams} beams."
    ]
    words += [f"Not compared: {name}, {why}." for name, why in result.left_out.items()]
    return Section("The whole frame", tuple(words), (cover, features), (_layers(result),))


def _overlap_row(name: str, o: Overlap) -> tuple[str, ...]:
    return name, _percent(o.measured_share), _percent(o.simulated_share), number(o.chamfer_m)


def _layers(result: SceneComparison) -> Course:
    real, simulated = 100.0 * result.layer_echo
    angle = result.layer_deg
    fired = np.isfinite(real) | np.isfinite(simulated)
    curves = (Curve("real", angle[fired], real[fired]), Curve("simulated", angle[fired], simulated[fired]))
    return Course("Beams with an echo from their surface", "elevation [deg]", "of the beams [%]", curves)


def _parts(result: SceneComparison) -> Section:
    header = (
        result.by, "beams", "distance [m]", "echoes real", "echoes sim", "range bias [m]", "AREA ratio",
        "stray real", "stray sim", "strength",
    )  # fmt: skip
    rows = tuple(
        (
            *(p.name, str(p.beams), f"{p.distance_m:.1f}", _percent(p.echo_measured), _percent(p.echo_simulated)),
            *_numbers(p.range_bias_m, p.area_ratio, p.stray_measured, p.stray_simulated),
            number(p.strength) if p.strength else "",
        )
        for p in result.parts[:MOST_PARTS]
    )
    left = len(result.parts) - len(rows)
    words = (f"The {len(rows)} that most beams meet; result.json has {left} more.",) if left else ()
    return Section(f"By {result.by}", words, (Table("", header, rows, right=header[1:]),))


def _sectors(result: SceneComparison) -> Section:
    s = result.sectors
    x, y = (0.5 * (edges[1:] + edges[:-1]) for edges in (s.azimuth_deg, s.elevation_deg))
    maps = (
        ("Echoes, measured minus simulated", "of the beams [%]", 100.0 * s.echo_difference),
        ("AREA, measured over simulated", "difference [%]", 100.0 * (s.area_ratio - 1.0)),
        ("Range, measured minus simulated", "[cm]", 100.0 * s.range_bias_m),
        ("Stray echoes, measured minus simulated", "a beam", s.stray_difference),
    )
    figures = tuple(
        Grid(title, "azimuth [deg]", "elevation [deg]", x, y, values, label, diverging=True)
        for title, label, values in maps
        if np.isfinite(values).any()
    )
    rows, columns = s.beams.shape
    standing = int(np.count_nonzero(np.nan_to_num(s.strength) > 0.0))
    words = [f"{columns} by {rows} sectors, {standing} of which stand out by themselves."]
    if result.scenes > 1:
        words.append(
            f"The {result.scenes} scenes stand in one map, direction by direction, whatever is there in each; name the "
            "frames of one scene alone for a map of it."
        )
    table = _sector_table(s)
    left = int(np.count_nonzero(s.beams)) - len(table.rows)
    words += [f"The {len(table.rows)} that stand out most; result.json has {left} more."] if left else []
    return Section("By sector", tuple(words), (table,), figures)


def _sector_table(s: SectorMap) -> Table:
    """The sectors that stand out most, then those with most beams."""
    strength = np.nan_to_num(s.strength)
    order = np.lexsort((-s.beams.ravel(), -strength.ravel()))[:MOST_PARTS]
    header = (
        "azimuth [deg]",
        "elevation [deg]",
        "beams",
        "echoes [%]",
        "range [cm]",
        "AREA ratio",
        "stray",
        "strength",
    )
    rows = []
    for i, j in zip(*np.unravel_index(order, s.beams.shape), strict=True):
        if not s.beams[i, j]:
            continue
        place = (f"{e[k]:.1f} to {e[k + 1]:.1f}" for e, k in ((s.azimuth_deg, j), (s.elevation_deg, i)))
        values = (100.0 * s.echo_difference, 100.0 * s.range_bias_m, s.area_ratio, s.stray_difference)
        rows.append(
            (
                *place,
                str(s.beams[i, j]),
                *_numbers(*(float(value[i, j]) for value in values)),
                number(float(strength[i, j])) if strength[i, j] else "",
            )
        )
    return Table("Measured minus simulated", header, tuple(rows), right=header)


def _numbers(*values: float) -> tuple[str, ...]:
    """Cells of a table: four digits, - where there is no number."""
    return tuple(number(value) for value in values)


def _percent(share: float) -> str:
    return "-" if math.isnan(share) else f"{100.0 * share:.2f} %"
