"""The beams of a sensor's file for the geometry check: a head's channels and columns, or a table of directions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.geometry.head import Head
from lidarcheck.formats.geometry.lattice import Beams, Lattice
from lidarcheck.sensor.beams import Beams as SensorBeams
from lidarcheck.sensor.channels import ChannelBeams

__all__ = ["HeadLattice", "TableLattice", "lattice_of"]


def lattice_of(beams: SensorBeams, *, handedness: str = "right") -> Lattice:
    """A sensor's beams as the check takes them; `handedness`: of its files, for the line that would change it."""
    head = Head.of(beams)
    if head is None:
        return TableLattice(beams)
    # Channels of one elevation are no neighbours in elevation.
    levels = np.unique(head.elevation_deg)
    around = np.full(head.layers, abs(head.step_deg))
    up = around
    if len(levels) > 1:
        gaps = np.diff(levels)
        nearest = np.minimum(np.r_[gaps, np.inf], np.r_[np.inf, gaps])
        up = nearest[np.searchsorted(levels, head.elevation_deg)]
    first_deg = beams.first_deg if isinstance(beams, ChannelBeams) else None
    return HeadLattice(head, up, around, handedness, first_deg)


@dataclass(frozen=True)
class HeadLattice:
    """Channels and columns. `up_deg`, `around_deg`, shape (layers,): spacing in elevation and azimuth."""

    head: Head
    up_deg: FloatArray
    around_deg: FloatArray
    handedness: str = "right"
    first_deg: float | None = None

    @property
    def layers(self) -> int:
        """How many channels."""
        return self.head.layers

    @property
    def points(self) -> int:
        """How many columns."""
        return self.head.points

    @property
    def column_deg(self) -> float:
        """The step of the azimuth, with its sign."""
        return self.head.step_deg

    @property
    def repeats(self) -> bool:
        """Whether every frame has the same columns."""
        return self.head.repeats

    def with_head(self, head: Head) -> HeadLattice:
        """Another head in the place of this one."""
        return replace(self, head=head)

    def beams(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> Beams:
        """The beams of those numbers; a channel that there is not points nowhere, columns go on."""
        whole, column = np.asarray(layer).astype(np.int64), np.asarray(point)
        known = (whole >= 0) & (whole < self.layers)
        at = np.where(known, whole, 0)
        direction = self.head.directions(at, column) * known[:, None]
        origin = self.head.origins_m(at, column)
        return Beams(direction, 0.5 * self.around_deg[at], 0.5 * self.up_deg[at], origin)

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Azimuth and elevation [deg] of those numbers; NaN of a channel that there is not."""
        whole = np.asarray(layer).astype(np.int64)
        known = (whole >= 0) & (whole < self.layers)
        at = np.where(known, whole, 0)
        azimuth = self.head.azimuth_deg[at] + np.asarray(point) * self.head.step_deg
        return np.where(known, azimuth, np.nan), np.where(known, self.head.elevation_deg[at], np.nan)

    def layers_beside(self, layer: npt.NDArray[Any], up_deg: FloatArray) -> npt.NDArray[Any]:
        """The channels whose elevation is nearest to that of these and so much more."""
        known = (layer >= 0) & (layer < self.layers)
        own = self.head.elevation_deg
        wanted = own[np.where(known, layer, 0)] + up_deg
        order = np.argsort(own, kind="stable")
        middles = 0.5 * (own[order][1:] + own[order][:-1])
        found = order[np.searchsorted(middles, wanted)]
        within = np.abs(own[found] - wanted) <= 0.5 * self.up_deg[found]
        return np.where(known & within, found, layer)

    def line(self, kind: str, value: float = 0.0) -> str:
        """What to change in the sensor's file where this is wrong; empty where that is not the way."""
        other = "right" if self.handedness == "left" else "left"
        if kind == "mirror y":
            return f'set handedness = "{other}" in the sensor\'s file'
        if kind == "yaw" and self.first_deg is not None:
            return f"set azimuth_deg.first = {(self.first_deg + value + 180.0) % 360.0 - 180.0:.5g} (last with it)"
        return {
            "yaw": f"add {value:.6g} deg to azimuth_deg.first and last",
            "elevation shift": f"add {value:.4g} deg to every elevation_deg",
            "elevation scale": f"multiply every elevation_deg by {value:.4g}",
            "layers count from the other end": "turn elevation_deg, and every other list of channels, around",
            "layer order": "put the channels in the file's order, or give `ring`, each channel's number in the file",
            "calibration": "take the angles of this very unit (its serial number's calibration file)",
        }.get(kind, "")


@dataclass(frozen=True)
class TableLattice:
    """Beams of a table: each has a direction of its own."""

    of: SensorBeams

    @property
    def layers(self) -> int:
        """How many layers."""
        return self.of.layers

    @property
    def points(self) -> int:
        """How many points a layer."""
        return self.of.points

    @property
    def column_deg(self) -> float:
        """A table has no columns that step."""
        return 0.0

    @property
    def repeats(self) -> bool:
        """A table's directions are the same in every frame."""
        return True

    def beams(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> Beams:
        """The beams of those numbers; one that the table does not have points nowhere."""
        layers, points, known = self._inside(layer, point)
        up, around = self.of.spacing_deg(layers, points)
        direction = self.of.directions(layers, points) * known[:, None]
        return Beams(direction, 0.5 * around, 0.5 * up, self.of.origins_m(layers, points))

    def angles_deg(self, layer: npt.ArrayLike, point: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Azimuth and elevation [deg]; NaN of a beam that there is not."""
        layers, points, known = self._inside(layer, point)
        elevation, azimuth = self.of.angles_deg(layers, points)
        return np.where(known, azimuth, np.nan), np.where(known, elevation, np.nan)

    def layers_beside(self, layer: npt.NDArray[Any], up_deg: FloatArray) -> npt.NDArray[Any]:
        """A table's layers are no elevations: these."""
        return layer

    def line(self, kind: str, value: float = 0.0) -> str:
        """What to change in the sensor's file where this is wrong; empty where that is not the way."""
        return "take the angles of this very unit for the table" if kind == "calibration" else ""

    def _inside(
        self, layer: npt.ArrayLike, point: npt.ArrayLike
    ) -> tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[np.bool_]]:
        layers, points = np.asarray(layer).astype(np.int32), np.asarray(point).astype(np.int32)
        known = self.of.has(layers, points)
        return np.where(known, layers, 0), np.where(known, points, 0), known
