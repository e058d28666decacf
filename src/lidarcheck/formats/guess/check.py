"""How well a scan fits the beams of a sensor's file: share, residuals, each layer, and what would make it fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.assign import Assigned, Cloud, assigned_to
from lidarcheck.formats.geometry.changes import Echoes
from lidarcheck.formats.geometry.check import FEWEST_JUDGED, PASSED, angle_errors, outside
from lidarcheck.formats.geometry.lattice import Beams, Lattice
from lidarcheck.formats.geometry.pooled import words
from lidarcheck.formats.geometry.reader import evenly
from lidarcheck.formats.geometry.sensor_lattice import lattice_of
from lidarcheck.formats.geometry.unit import BEYOND_GATE_M, UnitFound, unit_of
from lidarcheck.formats.geometry.verdict import Refusal, geometry_of
from lidarcheck.sensor.sensor import Sensor

__all__ = ["LayerFit", "ScanCheck", "check_scan"]

Verdict = Literal["fits", "warning", "elevations fit", "not checked", "does not fit"]

_OF_SPACING = 0.1
"""A direction alone confirms a layer's elevation within this part of the spacing: half of it always fits."""
_RANGE_OFF_M = 0.001
"""By so much, and half a step, a RANGE may differ from the way from the beam's origin."""


@dataclass(frozen=True)
class LayerFit:
    """One layer: its rows, the medians of what they lie off their beams [deg], and the share outside the bound."""

    layer: int
    elevation_deg: float
    rows: int
    azimuth_off_deg: float
    elevation_off_deg: float
    outside: float


@dataclass(frozen=True)
class ScanCheck:
    """How a scan fits. `said`: the verdict in words; `fix`: what would make it fit; `notes`: what else to know.

    `by`: how the rows' beams were found. `share`: of the judged rows, within their bound. `median_deg`, `most_deg`:
    median and 99 % of the angle between points and beams.
    """

    verdict: Verdict
    said: str
    fix: str
    by: str
    rows: int
    judged: int
    share: float
    median_deg: float
    most_deg: float
    layers: tuple[LayerFit, ...]
    notes: tuple[str, ...]

    @property
    def fits(self) -> bool:
        """Whether nothing speaks against the sensor's file."""
        return self.verdict in ("fits", "warning", "elevations fit")


def check_scan(cloud: Cloud, sensor: Sensor) -> ScanCheck:
    """How one frame fits a sensor. `UsageError` where nothing tells the beams of its rows, or the sensor has none."""
    if not sensor.beams.lattice:
        what = "the directions of this sensor are each scan's own: there is nothing to check a scan against"
        raise UsageError(what, fix="check scans of sensors with channels, a grid or a table of beams")
    cloud = _thinned(cloud, sensor.beams.size)
    mirror = np.array([1.0, -1.0 if sensor.handedness == "left" else 1.0, 1.0])
    position = cloud.position * mirror
    lattice = lattice_of(sensor.beams, handedness=sensor.handedness)
    assigned = assigned_to(sensor, cloud, position)
    # Numbers that the file says are held against the points whatever they are; those that were found name beams.
    known = sensor.beams.has(assigned.layer, assigned.point) | (assigned.layers_told and assigned.points_told)
    found = _Found(position[known], assigned.layer[known], assigned.point[known], cloud.error, lattice)
    unit = _unit(found, None if cloud.range is None else cloud.range[known], sensor)
    notes = [*assigned.notes, *_unclaimed(assigned.layer)]
    verdict, said, fix = _verdict(found, unit, assigned, sensor)
    off, off_said, off_fix = _range_offset(found, cloud, known, sensor, unit)
    notes += off_said
    if off and verdict in ("fits", "warning", "elevations fit"):
        verdict, said, fix = "does not fit", off_said[-1], off_fix
    share, judged, median, most = found.figures()
    by = assigned.by
    return ScanCheck(verdict, said, fix, by, len(cloud), judged, share, median, most, found.by_layer(), tuple(notes))


def _verdict(found: _Found, unit: UnitFound, assigned: Assigned, sensor: Sensor) -> tuple[Verdict, str, str]:
    """The verdict, in words, and what would make the scan fit."""
    if not len(found.layer):
        return "does not fit", "no row belongs to a beam of the sensor", "take the file of this sensor"
    if sensor.deskewed:
        return "not checked", "the sensor's files are deskewed: directions do not name beams", ""
    last = int(found.layer.max())
    # One too high is a numbering from 1, which the search names; more is another sensor, or one with fewer channels.
    if last > sensor.beams.layers:
        what = f"a row has Layer {last}, the sensor's {sensor.beams.layers} channels are 0 to {sensor.beams.layers - 1}"
        return "does not fit", what, "take the file of this sensor, or number the layers as its channels"
    if assigned.layers_told:
        return _by_numbers(found, unit, assigned)
    return _by_direction(found, unit, int(np.count_nonzero(assigned.layer < 0)))


@dataclass(frozen=True)
class _Found:
    """Rows with their beams."""

    position: FloatArray
    layer: IntArray
    point: IntArray
    error_m: float
    lattice: Lattice

    def placed(self) -> tuple[FloatArray, Beams]:
        return Echoes(self.position, self.layer, self.point, self.error_m, self.lattice).placed()

    def judged(self) -> tuple[BoolArray, BoolArray]:
        return outside(*self.placed(), self.error_m)

    def errors(self) -> tuple[FloatArray, FloatArray]:
        relative, beams = self.placed()
        return angle_errors(relative, beams.direction)

    def figures(self) -> tuple[float, int, float, float]:
        """Share of the judged rows within their bound, how many, and median and 99 % of the angle off [deg]."""
        if not len(self.layer):
            return 0.0, 0, float("nan"), float("nan")
        wide, clear = self.judged()
        off = np.hypot(*self.errors())
        share = float(np.mean(~wide[clear])) if clear.any() else 0.0
        return share, int(np.count_nonzero(clear)), float(np.median(off)), float(np.quantile(off, PASSED))

    def by_layer(self) -> tuple[LayerFit, ...]:
        """Every layer with rows, ascending."""
        if not len(self.layer):
            return ()
        around, up = self.errors()
        wide, _ = self.judged()
        elevation = self.lattice.angles_deg(self.layer, self.point)[1]
        order = np.argsort(self.layer, kind="stable")
        fits = []
        for rows in np.split(order, np.flatnonzero(np.diff(self.layer[order])) + 1):
            layer = int(self.layer[rows[0]])
            medians = (float(np.median(values[rows])) for values in (elevation, around, up))
            height, aside, above = medians
            fits.append(LayerFit(layer, height, len(rows), aside, above, float(np.mean(wide[rows]))))
        return tuple(fits)


def _thinned(cloud: Cloud, beams: int) -> Cloud:
    """Evenly taken rows, as many as a scan is judged by where it is read."""
    some = evenly(len(cloud), beams)
    columns = ("position", "layer", "point", "ring", "column", "time", "range", "kind", "cell")
    taken: dict[str, Any] = {name: None if (own := getattr(cloud, name)) is None else own[some] for name in columns}
    return Cloud(**taken, height=cloud.height, width=cloud.width, error=cloud.error)


def _unclaimed(layer: IntArray) -> list[str]:
    lost = int(np.count_nonzero(layer < 0))
    return [f"{lost} of {len(layer)} rows belong to no channel"] if lost else []


def _unit(found: _Found, ranges: FloatArray | None, sensor: Sensor) -> UnitFound:
    known = sensor.beams.has(found.layer, found.point)
    layer = np.where(known, found.layer, 0)
    origin = found.lattice.beams(layer, np.where(known, found.point, 0)).origin_m
    relative = found.position if origin is None else found.position - origin
    distance = np.linalg.norm(relative, axis=1)
    told = None if ranges is None else ranges - sensor.beams.range_offset_m(layer)
    gate = (0.0, sensor.max_range_m + BEYOND_GATE_M)
    return unit_of(distance, told, found.error_m, sensor.range_resolution_m, gate)


def _by_numbers(found: _Found, unit: UnitFound, assigned: Assigned) -> tuple[Verdict, str, str]:
    """The verdict where the file says the layers."""
    judged = geometry_of(found.position, found.layer, found.point, found.error_m, unit, found.lattice)
    if isinstance(judged, Refusal):
        return "does not fit", judged.what, judged.fix
    verdicts: dict[str, Verdict] = {"ok": "fits", "warning": "warning", "not checked": "not checked"}
    said = words(judged).removeprefix("geometry checked: ").removeprefix("geometry not checked: ")
    if not assigned.points_told:
        said += "; azimuths not checked: the columns were made from them"
    return verdicts[judged.verdict], said, ""


def _by_direction(found: _Found, unit: UnitFound, nowhere: int) -> tuple[Verdict, str, str]:
    """The verdict where only directions tell the beams: elevations alone can be told from chance."""
    if unit.units:
        return "does not fit", f"X, Y, Z are not in m: the ranges fit in {' or '.join(unit.units)}", "write them in m"
    relative, beams = found.placed()
    _, up = angle_errors(relative, beams.direction)
    with np.errstate(divide="ignore"):
        blur = np.rad2deg(np.minimum(found.error_m / np.linalg.norm(relative, axis=1), 1.0))
    spacing = 2.0 * np.broadcast_to(beams.half_elevation_deg, up.shape)
    clear = blur <= _OF_SPACING * spacing
    near = int(np.count_nonzero(np.abs(up[clear]) <= (_OF_SPACING * spacing + blur)[clear]))
    judged = int(np.count_nonzero(clear)) + nowhere
    if judged < FEWEST_JUDGED:
        return "not checked", f"{judged} of {len(up) + nowhere} rows can be judged, {FEWEST_JUDGED} are needed", ""
    share = 100.0 * near / judged
    said = f"{share:.1f} % of {judged} rows lie within a tenth of the spacing of a layer's elevation"
    if near < PASSED * judged:
        fix = "take this sensor's own angles, or try `lidarcheck sensor guess`"
        return "does not fit", said, fix
    return "elevations fit", f"{said}; geometry not checked: the beams were made from X, Y, Z", ""


def _range_offset(
    found: _Found, cloud: Cloud, known: npt.NDArray[np.bool_], sensor: Sensor, unit: UnitFound
) -> tuple[bool, list[str], str]:
    """Whether RANGE is the way from the beam's origin and the sensor's `range_offset_m`; what to say, and the key."""
    if cloud.range is None or unit.units or not len(found.layer):
        return False, [], ""
    ranges = cloud.range[known]
    use = sensor.beams.has(found.layer, found.point) & (ranges > 0.0)
    if not use.any():
        return False, [], ""
    layer, point = found.layer[use], found.point[use]
    off = ranges[use] - sensor.beams.ranges_m(layer, point, found.position[use])
    middle = float(np.median(off))
    if abs(middle) <= _RANGE_OFF_M + 0.5 * sensor.range_resolution_m:
        return False, [], ""
    own = float(np.median(np.broadcast_to(sensor.beams.range_offset_m(layer), len(layer))))
    said = f"RANGE is {middle:+.4f} m off the way from the beam's origin and range_offset_m = {own:g}"
    return True, [said], f"set range_offset_m = {own + middle:.4f}"
