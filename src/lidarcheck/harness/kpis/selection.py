"""What one KPI looks at: the beams of a scenario, the part of them that is selected, and the echoes seen there."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.harness.kpis.echo_table import SelectedEchoes
from lidarcheck.harness.kpis.fired import FiredBeams
from lidarcheck.kpi.direction import Directions, off_beam
from lidarcheck.kpi.features import decades_of, strength_name
from lidarcheck.kpi.numbering import beams_in_order, with_copies
from lidarcheck.sensor import Sensor

__all__ = ["KpiInput", "KpiSelection", "SelectedEchoes", "Window"]

Mask = npt.NDArray[np.bool_]
Window = tuple[float, float]


@dataclass(frozen=True)
class KpiSelection:
    """The part of a scenario that one KPI looks at.

    `rows`: mask over the ideal scan's rows. `window_m`: an echo within it of a surface lies on that surface. `zone_m`:
    only echoes whose range lies in it are seen at all; None: all of them. `number`, `feature`: the echo number and the
    feature that are asked for. `sensor`: what made the echoes, a built-in one where None.
    """

    fired: FiredBeams
    rows: Mask
    window_m: float
    zone_m: Window | None = None
    number: int | None = None
    feature: str = ""
    sensor: Sensor | None = None

    @functools.cached_property
    def beams(self) -> Mask:
        """The beams with a selected row, shape (n_beams,)."""
        return self._beams_of(self.rows)

    @functools.cached_property
    def meeting(self) -> Mask:
        """The beams that meet a surface in a selected row, shape (n_beams,)."""
        return self._beams_of(self.rows & (self.fired.distance_m > 0.0))

    @functools.cached_property
    def at_edge(self) -> Mask:
        """The selected beams beside whose surface there is another at a different range, shape (n_beams,)."""
        return self.beams & self.fired.at_edge(self.window_m)

    def seen(self, echoes: SelectedEchoes, frames: int = 1) -> KpiInput:
        """What is seen of those echoes."""
        return KpiInput(self, echoes, frames)

    def _beams_of(self, rows: Mask) -> Mask:
        return np.bincount(self.fired.beam_of_row, weights=rows, minlength=len(self.fired)) > 0.0


@dataclass(frozen=True)
class KpiInput:
    """What one KPI is computed from: the echoes of the selected beams, worked out as far as the KPI asks.

    Counts of beams count them in each of the `frames`. `every`, `on`, `stray`, `mixed`, `ghosts` are indices of
    echoes: all of the selected beams; those on the selected surfaces; those on no surface of their beam; those between
    the surfaces of an edge and on none; those at twice the range of a selected surface. `area`, `peak`, `width_ns`,
    `residual_m`, `distance_m` (the surface's), `incidence_deg`, `layer`, `point` are of the echoes on the selected
    surfaces, shape (n,) each.
    """

    selection: KpiSelection
    echoes: SelectedEchoes
    frames: int = 1

    @functools.cached_property
    def every(self) -> IndexArray:
        """All echoes of the selected beams, in the zone."""
        return np.flatnonzero(self.selection.beams[self.echoes.beam] & self._in_zone)

    @functools.cached_property
    def on(self) -> IndexArray:
        """Echoes on the selected surfaces."""
        return np.flatnonzero(self._on_any & self.selection.rows[self.echoes.surface] & self._in_zone)

    @functools.cached_property
    def stray(self) -> IndexArray:
        """Echoes of the selected beams on no surface of theirs."""
        return self.every[~self._on_any[self.every]]

    @functools.cached_property
    def mixed(self) -> IndexArray:
        """Echoes of beams at an edge, between the surfaces there and on none of them."""
        fired, window = self.selection.fired, self.selection.window_m
        some = self.stray[self.selection.at_edge[self.echoes.beam[self.stray]]]
        beam, path_m = self.echoes.beam[some], self.echoes.path_m[some]
        nearest, farthest = fired.depth_m
        between = (path_m > nearest[beam]) & (path_m < farthest[beam])
        return some[between & (fired.off_surfaces_around_m(beam, path_m) > window)]

    @functools.cached_property
    def ghosts(self) -> IndexArray:
        """Stray echoes within the window of twice a selected surface's range."""
        return self.stray[np.abs(self._behind_doubled_m) <= self.selection.window_m]

    @property
    def ghost_excess_m(self) -> FloatArray:
        """How far behind twice their target's range the ghosts lie."""
        return self._behind_doubled_m[np.abs(self._behind_doubled_m) <= self.selection.window_m]

    @property
    def beams(self) -> int:
        """Fired beams of the selection."""
        return self.frames * int(np.count_nonzero(self.selection.beams))

    @property
    def beams_meeting(self) -> int:
        """Those of them that meet a surface."""
        return self.frames * int(np.count_nonzero(self.selection.meeting))

    @property
    def beams_at_edge(self) -> int:
        """Those of them beside whose surface there is another at a different range."""
        return self.frames * int(np.count_nonzero(self.selection.at_edge))

    def beams_with(self, which: IndexArray, *, echoes: int = 1) -> int:
        """How many beams, counted in each frame, have at least that many of those echoes."""
        return int(np.count_nonzero(np.unique(self.beam_of(which), return_counts=True)[1] >= echoes))

    @property
    def area(self) -> FloatArray:
        """AREA."""
        return self.echoes.area[self.on]

    @property
    def peak(self) -> FloatArray:
        """PEAK."""
        return self.echoes.peak[self.on]

    @property
    def width_ns(self) -> FloatArray:
        """WIDTH."""
        return self.echoes.width_ns[self.on]

    @property
    def strength(self) -> FloatArray:
        """What tells how strong the echoes are: AREA, or the sensor's own."""
        return self.echoes.feature(strength_name(self.selection.sensor))[self.on]

    @property
    def decades(self) -> FloatArray:
        """The logarithm to base 10 of the strength, NaN where there is none, shape (n,)."""
        decades = decades_of(self.selection.sensor)
        return np.full(len(self.on), np.nan) if decades is None else decades.log10(self.strength)

    @property
    def residual_m(self) -> FloatArray:
        """Range minus true range."""
        return self.echoes.residual_m[self.on]

    @property
    def distance_m(self) -> FloatArray:
        """True range."""
        return self.selection.fired.distance_m[self.echoes.surface[self.on]]

    @property
    def incidence_deg(self) -> FloatArray:
        """True angle of incidence."""
        return self.selection.fired.incidence_deg[self.echoes.surface[self.on]]

    @property
    def off_surface_m(self) -> FloatArray:
        """Echo minus surface point, shape (n, 3), of the echoes on the selected surfaces."""
        return self.echoes.xyz_m[self.on] - self.selection.fired.surface_m[self.echoes.surface[self.on]]

    def off_beam(self) -> Directions:
        """How far the directions of all echoes lie off those of their beams; those that have one."""
        x_m, y_m, z_m = self.echoes.xyz_m[self.every].T
        beams = self.selection.fired.beams
        found = off_beam(x_m, y_m, z_m, self.layer(self.every), self.point(self.every), beams)
        known = np.isfinite(found.azimuth_deg) & np.isfinite(found.elevation_deg)
        return Directions(found.azimuth_deg[known], found.elevation_deg[known])

    def layer(self, which: IndexArray) -> npt.NDArray[np.int32]:
        """Layer of those echoes."""
        return self.selection.fired.layer[self.echoes.beam[which]]

    def point(self, which: IndexArray) -> npt.NDArray[np.int32]:
        """Point of those echoes."""
        return self.selection.fired.point[self.echoes.beam[which]]

    @functools.cached_property
    def in_order(self) -> Mask:
        """Of each beam with two echoes or more, in each frame, whether its numbers are in the sensor's order."""
        echoes, which, sensor = self.echoes, self.every, self.selection.sensor
        strength = echoes.feature(strength_name(sensor))[which]
        return beams_in_order(self.beam_of(which), echoes.number[which], echoes.range_m[which], strength, sensor)

    @property
    def numbers(self) -> npt.NDArray[Any]:
        """The numbers of all echoes, as written, and of the copies of a sensor that writes a beam's only echo twice."""
        number, sensor = self.echoes.number[self.every], self.selection.sensor
        if sensor is None or sensor.duplicate_return != "repeat" or "_" not in sensor.keep:
            return number
        return with_copies(self.beam_of(self.every), number)[1]

    def beam_of(self, which: IndexArray) -> IndexArray:
        """One number for each beam and frame, of those echoes."""
        return self.echoes.frame[which] * len(self.selection.fired) + self.echoes.beam[which]

    @property
    def number(self) -> int:
        """The echo number that is asked for, the first where none is."""
        return 1 if self.selection.number is None else self.selection.number

    @functools.cached_property
    def _in_zone(self) -> Mask:
        zone, range_m = self.selection.zone_m, self.echoes.range_m
        return np.ones(len(range_m), dtype=np.bool_) if zone is None else (range_m >= zone[0]) & (range_m <= zone[1])

    @functools.cached_property
    def _on_any(self) -> Mask:
        return np.abs(self.echoes.residual_m) <= self.selection.window_m

    @functools.cached_property
    def _behind_doubled_m(self) -> FloatArray:
        beam, path_m = self.echoes.beam[self.stray], self.echoes.path_m[self.stray]
        return self.selection.fired.off_doubled_m(self.selection.rows, beam, path_m)
