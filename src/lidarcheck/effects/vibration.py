"""The beam's direction shakes from point column to point column."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.effects.base import AimEffect, Surroundings, parameter, unfit_for
from lidarcheck.effects.geometry.aiming import rays_of, recast, redirected, turned
from lidarcheck.effects.shared.draws import normals
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Beams, Sensor

__all__ = ["Vibration"]


@dataclass(frozen=True)
class Vibration(AimEffect):
    """The beam's direction shakes from point column to point column.

    A beam fired t after the sweep's start looks up by pitch(t) = `pitch_deg` sin(2 pi f t + phase) + g and to the left
    by yaw(t) = `yaw_deg` sin(2 pi f t + phase + yaw phase) + h, where g and h are Gaussian, of standard deviation
    `random_deg`, and their correlation falls by e over `memory_columns` columns; the echo is still reported on the
    nominal (layer, point). Where a sensor fires layer by layer, layers stand for columns; where it fires all beams at
    once, a frame is one column; where it lists its directions in the order of time, points are columns. With
    `new_phase` 1 each frame adds a phase of its own, uniform over the circle. With `rigid` 1 the sensor turns as a
    body, with 0 the angles add to each beam's azimuth and elevation. Engines and roads shake a car's body at 5 to 200
    Hz by some hundredths of a degree. Identity at pitch, yaw and random 0.
    """

    name = "vibration"
    unfit = unfit_for(photon_histogram="a zone is wide beside what shakes, and its shots last a whole frame")

    pitch_deg: float = parameter(
        "deg", low=0.0, high=5.0, typical=0.1, noticeable=0.02, meaning="amplitude of the view's pitch"
    )
    yaw_deg: float = parameter(
        "deg", low=0.0, high=5.0, typical=0.05, noticeable=0.01, meaning="amplitude of the view's yaw"
    )
    frequency_hz: float = parameter(
        "Hz", low=0.0, high=20000.0, typical=150.0, noticeable=15.0, meaning="frequency of both"
    )
    phase_deg: float = parameter(
        "deg", low=-360.0, high=360.0, typical=0.0, noticeable=30.0, meaning="phase at the sweep's start"
    )
    yaw_phase_deg: float = parameter(
        "deg", low=-360.0, high=360.0, typical=0.0, noticeable=30.0, meaning="yaw's lead over pitch"
    )
    random_deg: float = parameter(
        "deg", low=0.0, high=5.0, typical=0.01, noticeable=0.002, meaning="random part, rms per column"
    )
    memory_columns: float = parameter(
        "columns",
        low=0.0,
        high=100_000.0,
        typical=0.0,
        noticeable=10.0,
        meaning="over which the random part stays alike",
        option=True,
    )
    new_phase: int = parameter(
        "", low=0, high=1, typical=0, whole=True, noticeable=1, meaning="1: every frame has another phase", option=True
    )
    rigid: int = parameter(
        "", low=0, high=1, typical=1, whole=True, noticeable=-1, meaning="1: as a body; 0: offsets of the angles"
    )

    def aim(self, ideal: IdealScan, around: Surroundings) -> IdealScan:
        """What the shaken beams meet."""
        if self.pitch_deg == self.yaw_deg == self.random_deg == 0.0:
            return ideal
        yaw, pitch = self.angles_deg(ideal.layer, ideal.point, around)
        rays = rays_of(ideal)
        direction = turned(rays.direction, yaw, pitch, as_a_body=bool(self.rigid))
        return recast(ideal, redirected(rays, direction), around)

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """Directions as they were fired."""
        return "its files are compensated for motion" if sensor.deskewed else ""

    def angles_deg(
        self, layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32], around: Surroundings
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Yaw and pitch when those beams are fired, shape (n,) each."""
        beams = around.ideal.beams
        column, columns = _columns(beams, layer, point)
        phase = np.deg2rad(self.phase_deg)
        if self.new_phase:
            # A layer beyond the sensor's own: what a frame has once is drawn apart from what columns have.
            phase = phase + 2.0 * np.pi * around.uniforms([beams.layers], [0])[0, 0]
        time_s, moment = np.unique(beams.fire_time_s(layer, point), return_inverse=True)
        swing = 2.0 * np.pi * self.frequency_hz * time_s + phase
        pitch = (self.pitch_deg * elementary.sin(swing))[moment]
        yaw = (self.yaw_deg * elementary.sin(swing + np.deg2rad(self.yaw_phase_deg)))[moment]
        if self.random_deg > 0.0:
            used, place = np.unique(column, return_inverse=True)
            scatter = self._scatter(used, columns, around)[place]
            pitch, yaw = pitch + self.random_deg * scatter[:, 0], yaw + self.random_deg * scatter[:, 1]
        return yaw, pitch

    def _scatter(self, column: npt.NDArray[np.int32], columns: int, around: Surroundings) -> npt.NDArray[np.float64]:
        """The random part of pitch and yaw in standard deviations, shape (n, 2), of some of so many columns."""
        if self.memory_columns == 0.0:
            return normals(around.uniforms(np.zeros(len(column), dtype=np.int32), column, 2))
        from scipy.signal import lfilter

        # All columns from 0 on, so that a column's angle does not depend on which others are looked at.
        every = np.arange(max(columns, int(column.max(initial=0)) + 1))
        kicks = normals(around.uniforms(np.zeros(len(every), dtype=np.int32), every, 2))
        keep = float(elementary.exp(-1.0 / self.memory_columns))
        kicks[1:] *= np.sqrt(1.0 - keep**2)
        return np.asarray(lfilter([1.0], [1.0, -keep], kicks, axis=0)[column])


def _columns(
    beams: Beams, layer: npt.NDArray[np.int32], point: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int32], int]:
    """What shakes alike, in the order in which it is fired: the number of each beam's, (n,), and how many there are."""
    if beams.sweep.order == "flash":
        return np.zeros(len(point), dtype=np.int32), 1
    return (layer, beams.layers) if beams.sweep.order == "layers" else (point, beams.points)
