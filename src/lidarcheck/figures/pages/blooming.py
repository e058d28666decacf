"""The blooming calibration as people read it: profiles, the table with its intervals, how it holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from lidarcheck.calibration.blooming.cells import Cells, Profile
from lidarcheck.calibration.blooming.response import FEATURES
from lidarcheck.calibration.blooming.workflow import BloomingCalibration, rms_of
from lidarcheck.figures.data import Course, Curve, Page, Section, Table
from lidarcheck.figures.pages.blooming_courses import LABELS, profile_course, profile_curve, table_course
from lidarcheck.figures.words import number
from lidarcheck.formats.lut import Axis

__all__ = ["calibration_document", "calibration_page", "profiles_document", "profiles_page"]

_MOST_ROWS = 48
_FAILS = 4.0
"""Mean squared residual [variances] above which a fit is said not to hold."""
_HEADER = ("target at [m]", "offsets", "echoes", "PEAK off [%]", "AREA off [%]", "WIDTH off [ns]")


def calibration_page(result: BloomingCalibration, provenance: Mapping[str, str]) -> Page:
    """The page of a fit."""
    fit = result.fit
    fitted = sum(row.status == "fitted" for row in result.rows)
    at = ", ".join(f"{cells.distance_m:.1f}" for cells in result.cells)
    summary = f"The {result.axis} table fitted at {at} m: {fitted} of {len(result.rows)} rows rest on data."
    if fit.misfit > _FAILS:
        free = "; try --free pulse" if not any(p.name == "fwhm_ns" for p in fit.parameters) else ""
        summary += (
            f" The model does not show what was measured: squared residuals are {fit.misfit:.0f} variances{free}."
        )
    names = [f"{cells.distance_m:.1f} m" for cells in result.cells]
    table = Section(
        "Table",
        (
            f"Smoothness {fit.smoothness:g}, "
            + (f"chosen by leaving out {fit.left_out}." if fit.scores else "as given."),
            f"Squared residuals are {fit.misfit:.2f} variances on average; above 1 the model does not hold, and the "
            "intervals are as much wider.",
        ),
        (_rows_table(result), *_parameter_table(result)),
        (_table_figure(result), *_score_figure(result)),
    )
    held = Section(
        "How it holds",
        ("RMS beside the target, where the measured PEAK exceeds 20, of what the written table is expected to show.",),
        (_residual_table(names, result.measured, result.expected),),
    )
    shown = [
        Section(f"Profile at {name}", figures=_profile_figures(name, result.axis, real, made))
        for name, real, made in zip(names, result.measured, result.expected, strict=True)
    ]
    return Page(f"Blooming, {result.axis}", summary, (held, table, *shown), provenance)


def profiles_page(
    cells: Sequence[Cells], real: Sequence[Profile], made: Sequence[Profile | None], provenance: Mapping[str, str]
) -> Page:
    """The page of measured profiles and, where there is one, what is simulated."""
    axis = cells[0].axis
    at = ", ".join(f"{one.distance_m:.1f}" for one in cells)
    echoes = sum(int(one.echoes[one.bloom].sum()) for one in cells)
    sections = []
    for one, measured, simulated in zip(cells, real, made, strict=True):
        name = f"{one.distance_m:.1f} m"
        low, high = one.extent
        words = f"{one.name}: the target covers offsets {low:g} to {high:g}; {one.left_out} beams left out."
        figures = _profile_figures(name, axis, measured, simulated)
        sections.append(Section(f"Profile at {name}", (words,), (_profile_table(measured, simulated),), figures))
    if all(simulated is not None for simulated in made):
        held = _residual_table([f"{one.distance_m:.1f} m" for one in cells], real, [m for m in made if m is not None])
        sections.insert(0, Section("Simulated against real", tables=(held,)))
    summary = f"The target blooms at {at} m: {echoes} echoes beside it."
    return Page(f"Blooming profiles, {axis}", summary, tuple(sections), provenance)


def _rows_table(result: BloomingCalibration) -> Table:
    rows = tuple((f"{r.x:g}", f"{r.before:.3g}", f"{r.y:.3g}", _interval(r.low, r.high), r.status) for r in result.rows)
    return Table("", ("X", "Y before", "Y", "95 %", "status"), rows, ("X", "Y before", "Y"))


def _interval(low: float, high: float) -> str:
    return "" if np.isnan(low) else f"{low:.3g} ... {high:.3g}"


def _parameter_table(result: BloomingCalibration) -> tuple[Table, ...]:
    rows = tuple((p.name, f"{p.value:.4g}", f"{p.low:.4g} ... {p.high:.4g}", p.unit) for p in result.fit.parameters)
    return (Table("Also free", ("name", "value", "95 %", "unit"), rows, ("value",)),) if rows else ()


def _residual_table(names: Sequence[str], real: Sequence[Profile], made: Sequence[Profile]) -> Table:
    rows = []
    for name, measured, simulated in zip(names, real, made, strict=True):
        off = rms_of(measured, _at(simulated, measured.offset))
        beside = ~measured.on_target & (measured.echoes > 0)
        numbers = (f"{100 * off['PEAK']:.1f}", f"{100 * off['AREA']:.1f}", f"{off['WIDTH']:.2f}")
        rows.append((name, str(int(beside.sum())), str(int(measured.echoes[beside].sum())), *numbers))
    return Table("", _HEADER, tuple(rows), _HEADER)


def _at(profile: Profile, offset: Any) -> Profile:
    """A profile's rows at those offsets, NaN where it has none."""
    place = np.searchsorted(profile.offset, offset)
    place = np.minimum(place, len(profile.offset) - 1)
    same = np.abs(profile.offset[place] - offset) < 0.01
    value = np.where(same[:, None], profile.value[place], np.nan)
    range_m = np.where(same, profile.range_m[place], np.nan)
    return Profile(np.asarray(offset), range_m, value, profile.echoes[place] * same, profile.on_target[place] & same)


def _table_figure(result: BloomingCalibration) -> Course:
    rows = [row for row in result.rows if row.x != 0.0]
    x, before, y = (np.array([getattr(row, name) for row in rows]) for name in ("x", "before", "y"))
    low, high = (np.array([getattr(row, name) for row in rows]) for name in ("low", "high"))
    known = np.array([row.status != "held" for row in rows])
    y, low, high = (np.where(known & (column > 0.0), column, np.nan) for column in (y, np.maximum(low, 1e-8), high))
    fitted = Curve("fitted", x, y, low, high)
    given = Curve("before", x, np.where(before > 0, before, np.nan))
    return table_course("The table", result.axis, (fitted, given))


def _score_figure(result: BloomingCalibration) -> tuple[Course, ...]:
    scores = sorted(result.fit.scores)
    if not scores:
        return ()
    x, loss, _, error = (np.array(column) for column in zip(*scores, strict=True))
    curve = Curve("left out", x, loss, loss - error, loss + error)
    return (Course("How well left-out cells are predicted", "smoothness", "mean loss", (curve,), log_x=True),)


def _profile_figures(name: str, axis: Axis, real: Profile, made: Profile | None) -> tuple[Course, ...]:
    figures = []
    for feature in LABELS:
        curves = [profile_curve("real", real, feature)]
        if (made is not None and feature != "range") or (
            made is not None and made is not real and not np.array_equal(made.range_m, real.range_m, equal_nan=True)
        ):
            curves.append(profile_curve("simulated", made, feature))
        figures.append(profile_course(f"{feature} at {name}", feature, axis, curves))
    return tuple(figures)


def _profile_table(real: Profile, made: Profile | None) -> Table:
    """The profile, thinned to what a page can hold."""
    rows = np.flatnonzero(real.echoes > 0)
    step = -(-len(rows) // _MOST_ROWS) or 1
    other = None if made is None else _at(made, real.offset)
    header = ["offset", "echoes", "range [m]"]
    for feature in FEATURES:
        header += [feature] if other is None else [feature, f"{feature} sim."]
    lines = []
    for row in rows[::step]:
        line = [f"{round(float(real.offset[row]), 2):g}", str(int(real.echoes[row])), number(real.range_m[row], ".2f")]
        for j in range(len(FEATURES)):
            line += [number(p.value[row, j], ".1f") for p in (real, other) if p is not None]
        lines.append(tuple(line))
    title = "" if step == 1 else f"every {step} offsets; the JSON has all"
    return Table(title, tuple(header), tuple(lines), tuple(header))


def profiles_document(
    cells: Sequence[Cells], real: Sequence[Profile], made: Sequence[Profile | None]
) -> list[dict[str, Any]]:
    """Measured profiles and what is simulated, as JSON has them."""
    found = []
    for one, measured, simulated in zip(cells, real, made, strict=True):
        other = None if simulated is None else _profile_document(simulated)
        facts = {"scan": one.name, "axis": one.axis, "distance_m": one.distance_m, "target": list(one.extent)}
        found.append({**facts, "real": _profile_document(measured), "simulated": other})
    return found


def _profile_document(profile: Profile) -> dict[str, Any]:
    features = {name: profile.value[:, j] for j, name in enumerate(FEATURES)}
    return {
        "offset": profile.offset,
        "range_m": profile.range_m,
        **features,
        "echoes": profile.echoes,
        "on_target": profile.on_target,
    }


def calibration_document(result: BloomingCalibration) -> dict[str, Any]:
    """The fit as JSON has it."""
    fit = result.fit
    pairs = zip(result.cells, result.measured, result.expected, strict=True)
    return {
        "axis": result.axis,
        "rows": [asdict(row) for row in result.rows],
        "parameters": {
            p.name: {"value": p.value, "low": p.low, "high": p.high, "unit": p.unit} for p in fit.parameters
        },
        "smoothness": fit.smoothness,
        "cross_validation": {"left_out": fit.left_out, "scores": [score._asdict() for score in fit.scores]},
        "misfit": fit.misfit,
        "residuals": [{"distance_m": c.distance_m, "scan": c.name, **rms_of(real, made)} for c, real, made in pairs],
        "profiles": profiles_document(result.cells, result.measured, result.expected),
    }
