"""The check where a file is read: every scan with X, Y, Z and beams passes here, whoever asks for it."""

from __future__ import annotations

import math

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.beams import Geometry
from lidarcheck.errors import InputError
from lidarcheck.formats.columns import missing
from lidarcheck.formats.geometry.lattice import REFERENCE, Lattice
from lidarcheck.formats.geometry.placement import AXES, Placement
from lidarcheck.formats.geometry.sensor_lattice import lattice_of
from lidarcheck.formats.geometry.steps import coordinate_steps, direction_error_m
from lidarcheck.formats.geometry.unit import BEYOND_GATE_M, METRES, UnitFound, unit_of
from lidarcheck.formats.geometry.verdict import Refusal, geometry_of, unit_fault
from lidarcheck.formats.table import Table
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor, reference_beams

__all__ = ["MOST_JUDGED", "checked_geometry", "evenly"]

MOST_JUDGED = 50_000
"""Rows that are judged: of 1 % that may lie outside, chance moves as many by 0.05 %; reading stays quick."""


def checked_geometry(scan: Scan, table: Table, placement: Placement, sensor: Sensor | None = None) -> Geometry:
    """How the scan's X, Y, Z agree with its beams; `InputError` where they do not, with what would make them agree.

    `table`: the columns as the file has them; `placement`: what was declared of them, which is in the scan already.
    `sensor`: what measured, a built-in one where None.
    """
    if missing(table, AXES):
        return Geometry(rows=len(scan), note="X, Y, Z were made from Layer, Point, RANGE")
    some = evenly(len(scan), scan.beams.size)
    position = np.stack([column[some] for column in (scan.x_m, scan.y_m, scan.z_m)]).T
    error_m = direction_error_m(coordinate_steps([_values(table, name) for name in AXES])) * METRES[placement.unit]
    unit = _unit(scan, some, position, table, placement, error_m, sensor)
    derived = missing(table, ("Layer", "Point"))
    if derived:
        if unit.units:
            raise _error(unit_fault(unit), table)
        return Geometry(rows=len(scan), note=f"{', '.join(derived)} made from X, Y, Z", unit_checked=unit.checked)
    blurred = _no_directions(scan, sensor)
    if blurred:
        return Geometry(rows=len(scan), note=blurred, unit_checked=unit.checked)
    lattice = _lattice(scan, sensor)
    layer, point = scan.layer[some], scan.point[some]
    found = geometry_of(position, layer, point, error_m, unit, lattice)
    if not isinstance(found, Refusal):
        return found
    if placement.moves:
        back, their_m = placement.taken_back(position), error_m / METRES[placement.unit]
        own = geometry_of(back, layer, point, their_m, UnitFound(), lattice)
        raise _wrongly_declared(found, placement, isinstance(own, Geometry) and own.verdict != "not checked", table)
    raise _error(found, table)


def _lattice(scan: Scan, sensor: Sensor | None) -> Lattice:
    if scan.beams == reference_beams():
        return REFERENCE
    return lattice_of(scan.beams, handedness="right" if sensor is None else sensor.handedness)


def _no_directions(scan: Scan, sensor: Sensor | None) -> str:
    """Why directions do not name the beams; empty where they do."""
    if not scan.beams.lattice:
        return "the sensor's directions are each scan's own"
    return "the sensor's files are deskewed: directions do not name beams" if sensor and sensor.deskewed else ""


def _unit(
    scan: Scan,
    some: slice,
    position: FloatArray,
    table: Table,
    placement: Placement,
    error_m: float,
    sensor: Sensor | None,
) -> UnitFound:
    """The unit of the distances from where the beams start."""
    ranges = table.get("RANGE")
    # RANGE is what it is in the file: where a unit is declared, it has done its part.
    told = None if ranges is None or placement.unit != "m" or len(ranges) != len(scan) else ranges[some] * 1.0
    if sensor is None:
        return unit_of(np.sqrt(np.sum(position * position, axis=1)), told, error_m)
    known = scan.beams.has(scan.layer[some], scan.point[some])
    layer, point = (np.where(known, column[some], 0) for column in (scan.layer, scan.point))
    origin, offset = scan.beams.origins_m(layer, point), scan.beams.range_offset_m(layer)
    distance = np.linalg.norm(position if origin is None else position - origin, axis=1)
    gate = (0.0, sensor.max_range_m + BEYOND_GATE_M)
    return unit_of(distance, None if told is None else told - offset, error_m, sensor.range_resolution_m, gate)


def evenly(rows: int, beams: int) -> slice:
    """At most about `MOST_JUDGED` rows, evenly taken; by a number that shares no factor with layers or columns."""
    every = max(1, -(-rows // MOST_JUDGED))
    while math.gcd(every, beams) > 1:
        every += 1
    return slice(None, None, every)


def _wrongly_declared(refusal: Refusal, placement: Placement, fits: bool, table: Table) -> InputError:
    """That what is declared does not make X, Y, Z fit; `fits`: they do without."""
    declared = f"with {placement.said()} as declared"
    if fits:
        what = f"{declared}, X, Y, Z do not lie where Layer and Point point; as they are in the file, they do"
        return InputError(what, file=table.path, fix="declare nothing")
    fix = "declare what makes X, Y, Z of the file fit: without any declaration the error says what does"
    return InputError(f"{declared}: {refusal.what}", file=table.path, fix=fix)


def _values(table: Table, name: str) -> FloatArray:
    column = table.get(name)
    assert column is not None, "asked for above"
    return column


def _error(refusal: Refusal, table: Table) -> InputError:
    return InputError(refusal.what, file=table.path, fix=refusal.fix)
