"""Moving echoes, or light, along the beams, as several effects do, and rounding ranges as the sensor reports them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import choice_parameter
from lidarcheck.scan import Haze, Light, Scan
from lidarcheck.sensor import Sensor

__all__ = [
    "StageByWhat",
    "at_range",
    "in_front",
    "moved_light",
    "quantised",
    "renumbered",
    "reported",
    "what_moves",
    "within_gate",
]


_SLACK_M = 1e-6
"""By so much may a range that was rounded to the gate's limit seem to lie outside."""


def what_moves() -> Any:
    """Declare what an error of range moves: echoes that were found, or the light before it is counted."""
    return choice_parameter(("echoes", "light"), meaning="what is moved; the echoes where left out", option=True)


class StageByWhat:
    """The stage of an effect that moves either echoes or light, by its `moves`."""

    def __get__(self, effect: Any, kind: type) -> str:
        return "light" if effect is not None and effect.moves == "light" else "readout"


def quantised(range_m: npt.NDArray[np.float64], sensor: Sensor) -> npt.NDArray[np.float64]:
    """Ranges as the sensor reports them: a multiple of its resolution, and none behind the sensor; same shape."""
    range_m = np.maximum(range_m, 0.0)
    if sensor.range_resolution_m > 0.0:
        range_m = np.rint(range_m / sensor.range_resolution_m) * sensor.range_resolution_m
    return range_m


def reported(scan: Scan, sensor: Sensor) -> Scan:
    """The same echoes as the sensor reports them: at ranges with its constant error, rounded, within its gate.

    What is timed before the shot, or rounded to 0, is none: no sensor reports it, and a range of 0 says in a file that
    a beam had no echo.
    """
    before_m = scan.range_m + sensor.range_offset_m
    xyz = scan.beams.positions_m(scan.layer, scan.point, quantised(before_m, sensor))
    found = replace(scan, x_m=xyz[:, 0], y_m=xyz[:, 1], z_m=xyz[:, 2])
    return within_gate(found, sensor, before_m < 0.0 if scan.made else None)


def within_gate(scan: Scan, sensor: Sensor, behind: npt.NDArray[np.bool_] | None = None) -> Scan:
    """The echoes that lie in the sensor's gate, in front of it in any case, numbered from 1.

    `behind` (n,): those that are none, where the gate's end is looked at too; a SPAD array's trace ends there.
    """
    if sensor.min_range_m == 0.0 and behind is None:
        return in_front(scan)
    range_m = scan.range_m
    inside = (range_m > _SLACK_M) & (range_m >= sensor.min_range_m - _SLACK_M)
    if behind is not None:
        inside &= ~behind & (range_m <= sensor.max_range_m + _SLACK_M)
    return scan if inside.all() else renumbered(scan.take(np.flatnonzero(inside)))


def in_front(scan: Scan) -> Scan:
    """The echoes at ranges above 0, numbered from 1."""
    seen = scan.range_m > _SLACK_M
    return scan if seen.all() else renumbered(scan.take(np.flatnonzero(seen)))


def renumbered(scan: Scan) -> Scan:
    """The same rows, the echoes of each beam numbered from 1 in the order of range; of equal range as before."""
    key = scan.layer.astype(np.int64) << 32 | scan.point
    order = np.lexsort((scan.echo_number, scan.range_m, key))
    place = np.arange(len(scan))
    starts = np.append(True, key[order][1:] != key[order][:-1])[: len(scan)]
    number = np.empty(len(scan), dtype=np.int32)
    number[order] = place - np.maximum.accumulate(np.where(starts, place, 0)) + 1 if len(scan) else number
    return replace(scan, echo_number=number)


def at_range(scan: Scan, range_m: npt.NDArray[np.float64]) -> Scan:
    """The same echoes at other ranges, shape (n,), not rounded yet: several effects may move an echo.

    No echo lies behind the sensor: a range below 0 becomes 0, which is none when it is reported. Echoes of a beam that
    have changed places change rows and numbers too, so that both still go by range; all other rows stay where they are.
    """
    range_m = np.maximum(range_m, 0.0)
    xyz = scan.beams.positions_m(scan.layer, scan.point, range_m)
    moved = replace(scan, x_m=xyz[:, 0], y_m=xyz[:, 1], z_m=xyz[:, 2])
    return _in_order(moved, range_m)


def moved_light(light: Light, factor: float, offset_m: float) -> Light:
    """All light from `factor` R + `offset_m` in the place of R; what would be behind the sensor is lost."""
    range_m = factor * light.pulse_range_m + offset_m
    signal = np.where(range_m < 0.0, 0.0, light.pulse_signal)
    haze = None if light.haze is None else _moved_haze(light.haze, factor, offset_m)
    return replace(light, pulse_range_m=np.maximum(range_m, 0.0), pulse_signal=signal, haze=haze)


def _moved_haze(haze: Haze, factor: float, offset_m: float) -> Haze:
    """The same light in cells of the same length, shared out between those that it now lies in."""
    cells = len(haze.density_per_m)
    edges_m = np.arange(cells + 1) * haze.step_m
    total = np.concatenate([[0.0], np.cumsum(haze.density_per_m * haze.step_m)])
    more = max(0, int(np.ceil((factor * edges_m[-1] + offset_m - edges_m[-1]) / haze.step_m)))
    new_m = np.arange(cells + more + 1) * haze.step_m
    density = np.diff(np.interp(new_m, factor * edges_m + offset_m, total)) / haze.step_m
    return replace(haze, density_per_m=density, row_end_m=np.maximum(factor * haze.row_end_m + offset_m, 0.0))


def _in_order(scan: Scan, range_m: npt.NDArray[np.float64]) -> Scan:
    """The same echoes; those of a beam whose numbers do not go by range share out its rows and numbers anew."""
    key = scan.layer.astype(np.int64) << 32 | scan.point
    same_beam = key[1:] == key[:-1]
    listed = np.all((key[1:] > key[:-1]) | (same_beam & (scan.echo_number[1:] >= scan.echo_number[:-1])))
    place = np.arange(len(scan)) if listed else np.lexsort((scan.echo_number, key))
    in_order, by_number_m = key[place], range_m[place]
    broken = (in_order[1:] == in_order[:-1]) & (by_number_m[1:] < by_number_m[:-1])
    if not broken.any():
        return scan
    place = place[np.isin(in_order, in_order[1:][broken])]
    by_range = np.lexsort((scan.echo_number[place], range_m[place], key[place]))
    row = np.arange(len(scan))
    row[place] = place[by_range]
    return replace(scan.take(row), echo_number=scan.echo_number)
