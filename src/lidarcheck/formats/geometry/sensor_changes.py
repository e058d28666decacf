"""What a sensor's file may say otherwise than its scans: the sense of turning, the fire time, steps, where beams start.

The reference sensor is what it is; nothing of this is tried on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.formats.geometry.changes import Change, Echoes
from lidarcheck.formats.geometry.head import Head, angles_of_deg
from lidarcheck.formats.geometry.lattice import Lattice
from lidarcheck.formats.geometry.pose import fit_moving_pose
from lidarcheck.formats.geometry.sensor_lattice import HeadLattice

__all__ = ["column_step_deg", "deskewed", "fitted_changes", "sensor_changes"]

_STEADY = 0.25
"""Steps between columns lie so near their median, as a part of it, or they are none."""
_NEIGHBOURS = 64
"""Columns so near to each other give a step, where nearer ones have no echoes: fewer than half a turn."""
_FEWEST_STEPS = 3
_FEWEST_ROWS = 200
"""Rows that tell where beams start, or how a vehicle moved."""
_FITTED = 3000


def sensor_changes(lattice: Lattice) -> list[Change]:
    """Keys of the sensor's file that are one of two."""
    if not isinstance(lattice, HeadLattice):
        return []
    head, found = lattice.head, []
    if not head.repeats or head.points > 1:
        sense = "left" if head.step_deg < 0.0 else "right"
        last = "first + 360" if sense == "left" else "first - 360"
        line = f'set direction = "{sense}" in [sweep] and azimuth_deg.last = {last}'
        found.append(_headed("the head turns the other way", "columns counted the other way", line, Head.reversed))
    if np.ptp(head.fire_s) > 0.0 and head.column_s:
        said = "the fire time turns the azimuth" + (" and should not" if head.fire_turns else ", which the file denies")
        line = f"set fire_time_in_azimuth = {'false' if head.fire_turns else 'true'} in [sweep]"
        found.append(_headed(said, "the other way", line, Head.with_fire))
    upside = replace(head, elevation_deg=head.elevation_deg[::-1])
    said, line = "elevation_deg runs from the other end", "turn elevation_deg around, and no other list"
    found.append(_headed(said, "the list turned around", line, lambda _: upside))
    order = np.argsort(head.elevation_deg, kind="stable")
    if not np.array_equal(order, np.arange(head.layers)) and not np.array_equal(order[::-1], np.arange(head.layers)):
        other = np.empty(head.layers, dtype=np.int32)
        other[order] = order[::-1]
        said, line = "rings count from the other end", "turn `ring` around, each channel's number in the file"
        found.append(Change(said, "the channel of the mirrored elevation", line, lambda e: _renumbered(e, other)))
    return found


def _headed(said: str, how: str, line: str, by: object) -> Change:
    def apply(echoes: Echoes) -> Echoes:
        assert isinstance(echoes.lattice, HeadLattice), "asked for"
        return replace(echoes, lattice=echoes.lattice.with_head(by(echoes.lattice.head)))  # type: ignore[operator]

    return Change(said, how, line, apply)


def _renumbered(echoes: Echoes, channel: IntArray) -> Echoes:
    known = (echoes.layer >= 0) & (echoes.layer < len(channel))
    return replace(echoes, layer=np.where(known, channel[np.where(known, echoes.layer, 0)], -1).astype(np.int32))


def fitted_changes(echoes: Echoes) -> Iterator[Change]:
    """Numbers of the sensor's file that are fitted: another step of the columns, another place where beams start."""
    lattice = echoes.lattice
    if not isinstance(lattice, HeadLattice) or len(echoes.layer) < _FEWEST_ROWS:
        return
    step = _fitted_step(echoes, lattice.head)
    if step is not None:
        columns = 360.0 / abs(step)
        near = abs(columns - round(columns)) < 0.02
        line = f"set columns = {round(columns)}" if near else f"set azimuth_step_deg = {abs(step):.6g}"
        head = replace(lattice.head, step_deg=step)
        said = f"columns are {abs(step):.6g} deg apart, {abs(lattice.head.step_deg):.6g} in the file"
        yield _headed(said, "that step", line, lambda _: head)
    forward, left, up = _fitted_origin(echoes)
    origin = np.zeros((lattice.layers, 3)) if lattice.head.origin_m is None else lattice.head.origin_m
    moved = replace(lattice.head, origin_m=origin + _turned_to(_column_azimuths(lattice), forward, left, up))
    said = f"beams start elsewhere: {forward:+.4f} m forward, {left:+.4f} m left, {up:+.4f} m up"
    line = f"add these to origin_m ({forward:.4f}), side_m ({left:.4f}), height_m ({up:.4f})"
    yield _headed(said, "from there", line, lambda _: moved)


def column_step_deg(position: FloatArray, layer: IntArray, point: IntArray) -> float | None:
    """The azimuth from one column to the next within a layer [deg]; None where there is no steady one."""
    order = np.lexsort((point, layer))
    azimuth = np.arctan2(position[order, 1], position[order, 0])
    columns = np.diff(point[order])
    near = (np.diff(layer[order]) == 0) & (columns > 0) & (columns <= _NEIGHBOURS)
    near &= columns <= np.median(columns[near]) if near.any() else False
    if np.count_nonzero(near) < _FEWEST_STEPS:
        return None
    turned = (np.diff(azimuth)[near] + np.pi) % (2.0 * np.pi) - np.pi
    steps = np.rad2deg(turned) / columns[near]
    middle = float(np.median(steps))
    return middle if float(np.median(np.abs(steps - middle))) <= _STEADY * abs(middle) else None


def _fitted_step(echoes: Echoes, head: Head) -> float | None:
    step = column_step_deg(echoes.position, echoes.layer, echoes.point)
    if step is None or step * head.step_deg <= 0.0 or not head.repeats:
        return None
    for _ in range(3):
        other = replace(head, step_deg=step)
        known = (echoes.layer >= 0) & (echoes.layer < head.layers)
        position, layer, point = echoes.position[known], echoes.layer[known], echoes.point[known]
        origin = other.origins_m(layer, point)
        _, azimuth = angles_of_deg(position if origin is None else position - origin)
        off = azimuth - other.azimuth_deg[layer] - point * step
        off = (off + 180.0) % 360.0 - 180.0
        use = point > 0
        if not use.any():
            return None
        step += float(np.median(off[use] / point[use]))
    return step


def _column_azimuths(lattice: HeadLattice) -> FloatArray:
    """Where column 0 stands when each channel fires [rad], shape (layers,)."""
    head = lattice.head
    fire = head.turn_deg_per_s * head.fire_s if head.fire_turns else np.zeros(head.layers)
    first = float((head.azimuth_deg - fire).mean()) if lattice.first_deg is None else lattice.first_deg
    return np.asarray(np.deg2rad(first + fire))


def _turned_to(azimuth: FloatArray, forward: float, left: float, up: float) -> FloatArray:
    """A place along azimuths [rad], left of them and up, shape (n, 3)."""
    x = forward * np.cos(azimuth) - left * np.sin(azimuth)
    return np.stack([x, forward * np.sin(azimuth) + left * np.cos(azimuth), np.full(len(azimuth), up)], axis=-1)


def _fitted_origin(echoes: Echoes) -> tuple[float, float, float]:
    """How far beams start forward along their column, left of it and up from where the file says [m]."""
    assert isinstance(echoes.lattice, HeadLattice), "asked for"
    some = echoes.thinned(_FITTED)
    relative, beams = some.placed()
    known = (some.layer >= 0) & (some.layer < some.lattice.layers)
    column = _column_azimuths(echoes.lattice)[np.where(known, some.layer, 0)]
    column = column + np.deg2rad(some.point * some.lattice.column_deg)
    axes = [_turned_to(column, *axis) for axis in np.eye(3)]
    u, range_m = beams.direction, np.linalg.norm(relative, axis=1)
    use = known & (range_m > 0.0)
    found = np.zeros(3)
    for _ in range(3):
        moved = relative - sum(number * axis for number, axis in zip(found, axes, strict=True))
        off = np.linalg.norm(np.cross(u, moved), axis=1)
        near = use & (off <= 3.0 * np.median(off) + 1e-9)
        slopes = np.stack([np.cross(u, axis)[near].ravel() for axis in axes], axis=-1)
        found = found + np.linalg.lstsq(slopes, np.cross(u, moved)[near].ravel(), rcond=1e-8)[0]
    return float(found[0]), float(found[1]), float(found[2])


def deskewed(echoes: Echoes) -> Iterator[Change]:
    """A pose that changes at a constant rate over the sweep: twelve numbers, where no fixed pose fits."""
    lattice = echoes.lattice
    if not isinstance(lattice, HeadLattice) or len(echoes.layer) < _FEWEST_ROWS or lattice.points < 2:
        return
    some = echoes.thinned(_FITTED)
    beams = some.beams
    share = some.point / (lattice.points - 1) - 0.5
    moving = fit_moving_pose(beams.direction, some.position, share, beams.origin_m)

    def apply(e: Echoes) -> Echoes:
        return replace(e, position=moving.placed(e.position, e.point / (lattice.points - 1) - 0.5))

    said = "a pose that changes over the sweep fits where no fixed one does: the cloud is deskewed (motion-compensated)"
    yield Change(said, "its twelve numbers taken out", "set deskewed = true in the sensor's file", apply)
