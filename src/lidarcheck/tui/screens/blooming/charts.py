"""What the plots of Blooming show: the curve of a table, and a profile, real against expected, with what is left."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.figures.pages.blooming_courses import (
    beside_course,
    beside_curve,
    profile_course,
    profile_curve,
    table_course,
)
from lidarcheck.tui.engine import Known
from lidarcheck.tui.plots.chart import Chart, Form, Strip, Trace
from lidarcheck.tui.plots.colours import PlotRole

if TYPE_CHECKING:
    from lidarcheck.formats.lut import Axis, LutTable
    from lidarcheck.tui.jobs.profiles import Shown

__all__ = ["BASELINE", "NOW", "REAL", "SAVED", "WANTED", "curve_chart", "profile_chart"]

REAL, NOW, BASELINE, SAVED, WANTED = "real", "now", "baseline", "saved", "wanted"
_FORMS: Mapping[str, tuple[PlotRole, Form]] = {
    REAL: ("real", "solid"), NOW: ("now", "open"), BASELINE: ("now", "open"),
    SAVED: ("saved", "dots"), WANTED: ("wanted", "dashes"),
}  # fmt: skip
_REACHES = (1.05, 1.1, 1.2, 1.5, 2.0, 5.0, 10.0, 100.0)
_REACHES_SD = (3.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_CHANCE = 2.0
"""What is further off than so many standard deviations of a cell's mean is marked with `!`."""
_FAR = 0.5
"""Without a number: what is further off than this part of the strip's reach is marked with `!`."""


def curve_chart(tables: Mapping[str, LutTable], axis: Axis, at: int) -> Chart:
    """Tables by name, that which is edited first (`NOW`, or `BASELINE` in its place), over X: even in its symmetric
    logarithm, with its own values as ticks, so that near rows stand apart as far ones do. `at`: the row under the
    cursor.
    """
    course = table_course("Curve", axis, ())
    traces = tuple(Trace(name, table.x, table.y, *_FORMS[name]) for name, table in tables.items())
    at = min(at, len(traces[0].x) - 1)
    return Chart(
        ("curve", axis), course.title, course.x_label, "", traces, "symlog", "log",
        own_ticks=True, at=(0, at), drag=0,
    )  # fmt: skip


def profile_chart(
    feature: str, sides: Mapping[str, Shown], where: str, axis: Axis, key: Hashable, known: Known | None = None
) -> Chart:
    """A feature of the sides, `REAL` first, over the offset; below it how far `REAL` and `NOW` are apart: in standard
    deviations of one beam where the number is `known`, else of the curves.

    `where`: at which distance.
    """
    from lidarcheck.calibration.blooming.beside import BesideTarget

    any_sensor = any(isinstance(side, BesideTarget) for side in sides.values())
    course = (beside_course if any_sensor else profile_course)("", feature, axis, ())
    traces = []
    for name, side in sides.items():
        curve = (
            beside_curve(name, side, feature) if isinstance(side, BesideTarget) else profile_curve(name, side, feature)
        )
        traces.append(Trace(name, curve.x, curve.y, *_FORMS[name]))
    chart = Chart(
        ("profile", key, feature), f"{where} {course.y_label}", course.x_label, "", tuple(traces),
        y_scale="log" if course.log_y else "lin", compared="difference",
    )  # fmt: skip
    now = next((name for name in (NOW, BASELINE) if name in sides), "")
    if REAL not in sides or not now:
        return chart
    strip = None if known is None else _in_spreads(feature, known, now)
    return replace(chart, strip=strip or _left_over(chart, now))


def _in_spreads(feature: str, known: Known, name: str) -> Strip | None:
    """Real minus simulated as the number has it; None where it has no such feature."""
    number = known.number
    residual = None if number is None else number.residual
    if number is None or residual is None or feature not in residual.off:
        return None
    off = residual.off[feature]
    most = float(np.nanmax(np.abs(off))) if np.isfinite(off).any() else 0.0
    reach = next((one for one in _REACHES_SD if one >= most), _REACHES_SD[-1])
    sides = [("rms", number), ("was", known.before), ("start", known.start)]
    told = [f"{word} {one.parts[feature]:.2f}" for word, one in sides if one is not None and feature in one.parts]
    words = f"real - {name} [sd], {', '.join(told)}{'' if known.is_of_now else ', OLD'}"
    return Strip(words, residual.offset, off, np.abs(off) > _CHANCE * residual.chance[feature], "lin", reach)


def _left_over(chart: Chart, name: str) -> Strip | None:
    """Real over expected where a feature is seen on a logarithmic axis, else real minus expected."""
    by_name = {trace.name: trace for trace in chart.traces}
    real, now = by_name[REAL], by_name[name]
    x, at, other = np.intersect1d(np.round(real.x, 6), np.round(now.x, 6), return_indices=True)
    measured, expected = real.y[at], now.y[other]
    known = np.isfinite(measured) & np.isfinite(expected)
    if not known.any():
        return None
    if chart.y_scale == "log":
        known &= (measured > 0.0) & (expected > 0.0)
        ratio = np.divide(measured, expected, out=np.full(len(x), np.nan), where=known)
        off = np.log(ratio, out=np.full(len(x), np.nan), where=known)
        most = float(np.exp(np.nanmax(np.abs(off)))) if known.any() else 1.0
        reach = next((one for one in _REACHES if one >= most), _REACHES[-1])
        words = f"real / {name}, rms {100.0 * _rms(off):.3g} %"
        return Strip(words, x, ratio, np.abs(off) > _FAR * np.log(reach), "log", reach, "x")
    off = np.where(known, measured - expected, np.nan)
    most = float(np.nanmax(np.abs(off)))
    reach = 10.0 ** np.ceil(np.log10(most)) if most > 0.0 else 1.0
    reach = next(part * reach for part in (0.2, 0.5, 1.0) if part * reach >= most)
    words = f"real - {name}, rms {_rms(off):.3g}"
    return Strip(words, x, off, np.abs(off) > _FAR * reach, "lin", float(reach))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
