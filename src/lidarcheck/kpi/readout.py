"""Two scans by what their sensors wrote: directions, places, echo numbers; and the rows that this rests on."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.beams import ANOTHER_SENSOR
from lidarcheck.formats.scans import numbers_as_written
from lidarcheck.kpi.comparison import DirectionGap, Sides
from lidarcheck.kpi.direction import Directions, off_beam, off_surface
from lidarcheck.kpi.numbering import number_counts, with_copies
from lidarcheck.kpi.pairing import Pairing, beam_keys
from lidarcheck.kpi.validation import mean
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["DIRECTIONS", "NUMBERS", "Written", "direction_gap", "number_gap", "position_gap", "written"]

DIRECTIONS, NUMBERS = "direction_bias, direction_scatter", "echo_number_share"
"""What is left out where a scan does not say which beam, or which of its echoes, an echo is."""
_BEAM, _NUMBER = ("Layer", "Point"), ("EchoNumber",)


@dataclass(frozen=True)
class Written:
    """What one scan's sensor wrote. `directions`, `numbers`: of all echoes; `off_surface_m`: (n_of_surface, 3).

    `number_rows`: the echo of each number, where copies count besides; None where numbers are those of the echoes.
    """

    directions: Directions | None
    numbers: npt.NDArray[Any] | None
    off_surface_m: FloatArray | None
    number_rows: IndexArray | None = None


def written(
    scans: tuple[Scan, Scan],
    pairings: tuple[Pairing | None, Pairing | None],
    ideal: IdealScan | None,
    sensor: Sensor | None = None,
) -> tuple[tuple[Written, Written], dict[str, str]]:
    """What both scans have of it, measured first, and what cannot be compared, and why."""
    left_out = {}
    for name, columns, how in (
        (DIRECTIONS, _BEAM, "beams are found by X, Y, Z"),
        (NUMBERS, _NUMBER, "echoes are counted by range"),
    ):
        sides = [
            side for side, scan in zip(("measured", "simulated"), scans, strict=True) if {*columns} & {*scan.defaulted}
        ]
        if sides:
            left_out[name] = f"the {' and the '.join(sides)} scan's {how}"
    if not all(scan.beams.lattice for scan in scans):
        left_out[DIRECTIONS] = "the sensor's beams are its echoes' own directions"
    if any(scan.geometry.note.startswith(ANOTHER_SENSOR) for scan in scans):
        left_out[DIRECTIONS] = f"{ANOTHER_SENSOR}; name it with --sensor"
    found = [_written(scan, pairing, ideal, sensor, left_out) for scan, pairing in zip(scans, pairings, strict=True)]
    return (found[0], found[1]), left_out


def _written(
    scan: Scan, pairing: Pairing | None, ideal: IdealScan | None, sensor: Sensor | None, left_out: Collection[str]
) -> Written:
    directions = numbers = rows = None
    if DIRECTIONS not in left_out:
        directions = off_beam(scan.x_m, scan.y_m, scan.z_m, scan.layer, scan.point, scan.beams)
    if NUMBERS not in left_out:
        numbers = numbers_as_written(scan)
        if sensor is not None and sensor.duplicate_return == "repeat" and "_" in sensor.keep:
            rows, numbers = with_copies(beam_keys(scan.layer, scan.point), numbers)
    off_m = None if ideal is None or pairing is None else _off_surface(scan, pairing, ideal)
    return Written(directions, numbers, off_m, rows)


def _off_surface(scan: Scan, pairing: Pairing, ideal: IdealScan) -> FloatArray:
    echoes: IndexArray = np.flatnonzero(pairing.of_one_surface)
    return off_surface(scan, echoes, ideal, pairing.surface[echoes])


def direction_gap(m: Written, s: Written) -> dict[str, DirectionGap] | None:
    """Mean and standard deviation by `azimuth` and `elevation`; None where a scan does not tell beams."""
    if m.directions is None or s.directions is None:
        return None
    angles: dict[str, Callable[[Directions], FloatArray]] = {
        "azimuth": lambda found: found.azimuth_deg,
        "elevation": lambda found: found.elevation_deg,
    }
    gaps = {}
    for name, of in angles.items():
        sides = [_known(of(side)) for side in (m.directions, s.directions)]
        gaps[name] = DirectionGap(*map(mean, sides), *map(_scatter, sides))
    return gaps


def _known(angle: FloatArray) -> FloatArray:
    known = ~np.isnan(angle)
    return angle if known.all() else angle[known]


def _scatter(angle: FloatArray) -> float:
    return float(angle.std(ddof=1)) if len(angle) > 1 else float("nan")


def position_gap(m: Written, s: Written) -> dict[str, Sides] | None:
    """Mean of echo minus surface point by axis, of the echoes that come from a surface; None without an ideal scan."""
    if m.off_surface_m is None or s.off_surface_m is None:
        return None
    sides = m.off_surface_m, s.off_surface_m
    return {axis: Sides(*(mean(side[:, column]) for side in sides)) for column, axis in enumerate("xyz")}


def number_gap(m: Written, s: Written) -> dict[int, Sides] | None:
    """Share of each number that occurs, as written; None where a scan has none."""
    if m.numbers is None or s.numbers is None:
        return None
    counts = [number_counts(side) for side in (m.numbers, s.numbers)]
    size = max(map(len, counts))
    parts = [
        np.pad(side, (0, size - len(side))) / max(len(of), 1)
        for side, of in zip(counts, (m.numbers, s.numbers), strict=True)
    ]
    return {
        number: Sides(*(float(part[number]) for part in parts))
        for number in range(size)
        if parts[0][number] + parts[1][number] > 0.0
    }
