"""Readout effects on a program's echoes: what they move is rounded as the program rounds it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import ReadoutEffect
from lidarcheck.effects.shared.ranges import at_range, in_front, quantised, renumbered
from lidarcheck.model.stages import Run
from lidarcheck.scan import Scan
from lidarcheck.sensor import Program

__all__ = ["on_lattice", "read_out_program"]

_PURPOSE = "range_lattice"
_SLACK_M = 1e-4
_MOST_DIGITS = 6
_ON_LATTICE = 0.99
"""The part of the echoes that must lie on the lattice."""


def read_out_program(scan: Scan, run: Run, effects: Sequence[ReadoutEffect]) -> Scan:
    """A program's echoes behind the readout effects.

    Where one of these moves echoes by what each is, and the ranges lie on the sensor's lattice, uniform noise of one
    step comes before them and the range is rounded behind the last: else a shift of less than a step would act on a
    range that is rounded already. What effects add competes for the sensor's returns by strength.
    """
    if not effects or not len(scan):
        return scan
    program = run.sensor
    assert isinstance(program, Program)
    scan = _with_strength(scan, program)
    count = len(scan)
    step_m = program.range_resolution_m
    rounds = any(effect.moves_echoes for effect in effects) and on_lattice(scan, step_m)
    if rounds:
        scan = at_range(scan, scan.range_m + step_m * (_uniform(scan, run) - 0.5))
    for effect in effects:
        scan = effect.readout(scan, run.of(effect))
    if rounds:
        xyz = scan.beams.positions_m(scan.layer, scan.point, quantised(scan.range_m, program))
        scan = replace(scan, x_m=xyz[:, 0], y_m=xyz[:, 1], z_m=xyz[:, 2])
    more = len(scan) > count
    scan = in_front(scan)
    if more:
        scan = _strongest(scan, program.max_echoes)
    return replace(scan, made={})


def _with_strength(scan: Scan, program: Program) -> Scan:
    """The same with what says how strong echoes are where effects look for it."""
    name = program.strength_told
    if not name or name == "AREA":
        return scan
    known = name in scan.features or name in scan.feature_names
    return replace(scan, made={"amplitude": scan.feature(name)}) if known else scan


def on_lattice(scan: Scan, step_m: float) -> bool:
    """Whether ranges are multiples of the step, as well as the coordinates that they follow from can tell."""
    if step_m <= 0.0 or not len(scan):
        return False
    range_m = scan.range_m
    off_m = np.abs(range_m - np.rint(range_m / step_m) * step_m)
    slack_m = _SLACK_M + 0.5 * np.sqrt(3.0) * _step_m(np.column_stack([scan.x_m, scan.y_m, scan.z_m]))
    return bool(slack_m < 0.5 * step_m and np.mean(off_m <= slack_m) >= _ON_LATTICE)


def _step_m(xyz: FloatArray) -> float:
    """The decimal step of coordinates; 0 where they have more digits than anybody rounds to."""
    for digits in range(_MOST_DIGITS):
        scaled = xyz * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) < 1e-6):
            return float(10.0**-digits)
    return 0.0


def _uniform(scan: Scan, run: Run) -> FloatArray:
    """A uniform number an echo, its beam's own, shape (n,)."""
    echo = np.maximum(scan.echo_number.astype(np.int64) - 1, 0)
    drawn = replace(run, purpose=_PURPOSE).uniforms(scan.layer, scan.point, int(echo.max()) + 1)
    return np.asarray(drawn[np.arange(len(scan)), echo])


def _strongest(scan: Scan, room: int) -> Scan:
    """Of each beam the strongest echoes, as many as there is room for, numbered anew; of equal ones the nearest."""
    key = scan.layer.astype(np.int64) << 32 | scan.point
    order = np.lexsort((scan.range_m, -scan.strength, key))
    starts = np.flatnonzero(np.append(True, key[order][1:] != key[order][:-1]))
    place = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
    return scan if int(place.max()) < room else renumbered(scan.take(np.sort(order[place < room])))
