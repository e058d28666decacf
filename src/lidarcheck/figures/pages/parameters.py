"""A calibration as people and machines read it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lidarcheck.calibration.parameters.fitted import Fitted
from lidarcheck.calibration.parameters.workflow import Calibration, Round
from lidarcheck.figures.data import Course, Curve, Distribution, Page, Section, Table

__all__ = ["document", "number", "page"]

_FEATURES = {
    "range": ("Range residual", "echo's range less the surface's", "m"),
    "area": ("AREA", "AREA", ""),
    "peak": ("PEAK", "PEAK", ""),
    "width": ("WIDTH", "WIDTH", "ns"),
}
_TOLD = {"fitted": "", "no effect": "changes nothing here: not fitted", "not identified": "the data leave it open"}


def page(found: Calibration, diff: list[str], provenance: Mapping[str, str]) -> Page:
    """The page of a calibration; `diff`: what changed in the model's file, line by line."""
    sections = [
        Section("Parameters", found.warnings, (_parameters(found),)),
        Section("The course", found.notes, (_course(found),), _course_figures(found)),
        Section("Before and after, on what was held out", (), (), _distributions(found)),
        Section("What changes in the model", tuple(diff) or ("Nothing.",)),
    ]
    return Page("calibrate", summary(found), tuple(sections), provenance)


def summary(found: Calibration) -> str:
    """The verdict in a sentence or two."""
    fitted = [p for p in found.parameters if p.status == "fitted"]
    before, after = found.rounds[0].held_out.value, found.rounds[found.kept].held_out.value
    count = "1 parameter is" if len(fitted) == 1 else f"{len(fitted) or 'no'} parameters are"
    moved = "falls from" if found.improved else "does not improve: it was"
    text = (
        f"{count} fitted. The distance of model and measurement on what was held out {moved} {before:.3g} "
        f"{'to' if found.improved else 'and is'} {after:.3g}; two runs of one model are {found.floor:.3g} apart."
    )
    return text[:1].upper() + text[1:]


def document(found: Calibration) -> dict[str, Any]:
    """For JSON."""
    return {
        "parameters": [_parameter(p) for p in found.parameters],
        "rounds": [_round(one) for one in found.rounds],
        "kept_round": found.kept,
        "improved": found.improved,
        "held_out": {
            "before": found.rounds[0].held_out.value,
            "after": found.rounds[found.kept].held_out.value,
            "floor": found.floor,
        },
        "misfit": found.misfit,
        "correlation": found.correlation,
        "warnings": found.warnings,
        "notes": found.notes,
        "seed": found.seed,
        "hashes": dict(found.hashes),
    }


def number(value: float) -> str:
    """A value as tables have it."""
    return f"{value:.6g}"


def _parameter(p: Fitted) -> dict[str, Any]:
    names = ("name", "unit", "start", "value", "low", "high")
    return {**{name: getattr(p, name) for name in names}, "status": p.status}


def _round(one: Round) -> dict[str, Any]:
    values = {"round": one.number, "values": dict(one.values), "beams": one.beams, "seconds": round(one.seconds, 2)}
    return {**values, "fit": one.fit.value, "held_out": one.held_out.value, "held_out_by_seed": one.held_out.draws}


def _parameters(found: Calibration) -> Table:
    header = ("parameter", "start", "value", "90 % low", "90 % high", "unit", "")
    rows = tuple(
        (p.name, number(p.start), number(p.value), number(p.low), number(p.high), p.unit, _TOLD[p.status])
        for p in found.parameters
    )
    return Table("", header, rows, header[1:5])


def _course(found: Calibration) -> Table:
    names = [p.name for p in found.parameters]
    header = ("round", *names, "fitted frames", "held out")
    rows = tuple(
        (
            str(one.number),
            *(number(one.values[name]) for name in names),
            f"{one.fit.value:.4f}",
            f"{one.held_out.value:.4f}",
        )
        for one in found.rounds
    )
    return Table("", header, rows, header)


def _course_figures(found: Calibration) -> tuple[Course, ...]:
    rounds = np.array([float(one.number) for one in found.rounds])
    out = np.array([one.held_out.value for one in found.rounds])
    spread = np.array([2.0 * np.std(one.held_out.draws) / np.sqrt(len(one.held_out.draws)) for one in found.rounds])
    distances = Course(
        "Distance over rounds",
        "round",
        "mean distance [standard deviations of a beam]",
        (
            Curve("held out", rounds, out, out - spread, out + spread),
            Curve("fitted frames", rounds, np.array([one.fit.value for one in found.rounds])),
            Curve("two runs of one model", rounds, np.full(len(rounds), found.floor)),
        ),
        log_y=True,
    )
    return (distances, *(_values(found, p, rounds) for p in found.parameters if p.status != "no effect"))


def _values(found: Calibration, p: Fitted, rounds: Any) -> Course:
    values = np.array([one.values[p.name] for one in found.rounds])
    low, high = values.copy(), values.copy()
    if p.status == "fitted":
        low[-1], high[-1] = p.low, p.high
    label = f"{p.name} [{p.unit}]" if p.unit else p.name
    return Course(f"{p.name} over rounds", "round", label, (Curve(p.name, rounds, values, low, high),))


def _distributions(found: Calibration) -> tuple[Distribution, ...]:
    return tuple(
        Distribution(title, quantity, unit, found.samples[feature])
        for feature, (title, quantity, unit) in _FEATURES.items()
    )
