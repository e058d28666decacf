"""The scene or the sensor moves while the frame is swept."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.effects.base import AimEffect, Surroundings, list_parameter, parameter, unfit_for
from lidarcheck.effects.geometry.aiming import rays_of, recast, turned
from lidarcheck.errors import UsageError
from lidarcheck.rays import Velocity
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor

__all__ = ["Motion"]


@dataclass(frozen=True)
class Motion(AimEffect):
    """The scene or the sensor moves while the frame is swept.

    Each beam is fired t after the frame's start, as the sensor's sweep says: point column p of the built-in sensors at
    t = 30 ms p / 959. With `object_id` -1 the sensor moves: its
    beams start at v t and are turned to the left by yaw rate times t, v in the sensor's frame at the start. With
    `object_id` 0 or more the sensor stands, and the object of that number moves by v t; the yaw rate has no part
    then. Besides, objects that have velocities of their own move by `objects` times those: the scene's, and those
    listed in `movers`, each along X with its number in `movers_forward_m_s`. Ranges are as the sensor measures
    them, not corrected for its motion. Where the ideal scan has times, it shows the scene at those, and only the
    time from there to t counts. Without a scene, surfaces that no beam has seen are continued from the nearest ones
    in the layer: good for ways of a metre or two; an ideal scan without object numbers has no object that could
    move.
    Identity at velocity, yaw rate and objects 0.
    """

    name = "motion"
    tree = (102,)
    unfit = unfit_for(photon_histogram="the shots of all zones last the whole frame: it shows between frames only")

    forward_m_s: float = parameter(
        "m/s", low=-100.0, high=100.0, typical=10.0, noticeable=1.0, meaning="velocity along X"
    )
    left_m_s: float = parameter("m/s", low=-100.0, high=100.0, typical=0.0, noticeable=1.0, meaning="velocity along Y")
    up_m_s: float = parameter("m/s", low=-100.0, high=100.0, typical=0.0, noticeable=1.0, meaning="velocity along Z")
    yaw_deg_s: float = parameter(
        "deg/s", low=-360.0, high=360.0, typical=0.0, noticeable=5.0, meaning="turn of the sensor to the left"
    )
    object_id: int = parameter(
        "", low=-1, high=2**31 - 1, typical=-1, whole=True, noticeable=1, meaning="what moves; -1: the sensor"
    )
    objects: float = parameter(
        "", low=0.0, high=2.0, typical=1.0, noticeable=-0.25, meaning="factor on the objects' own velocities"
    )
    movers: tuple[int, ...] = list_parameter(
        "",
        low=0,
        high=2**31 - 1,
        ascending=True,
        counted=True,
        noticeable=1,
        meaning="objects that move each on its own",
    )
    movers_forward_m_s: tuple[float, ...] = list_parameter(
        "m/s", low=-100.0, high=100.0, noticeable=1.0, meaning="velocity along X of each of those"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.movers) != len(self.movers_forward_m_s):
            counts = f"{len(self.movers)} movers and {len(self.movers_forward_m_s)} velocities"
            raise UsageError(f"{self.name}: {counts}", fix="give movers_forward_m_s a number for each of movers")

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """Beams that are fired one after the other, and files that keep what moves."""
        if sensor.deskewed:
            return "its files are compensated for motion"
        return "all its beams are fired at once: it shows between frames only" if sensor.sweep.order == "flash" else ""

    def aim(self, ideal: IdealScan, around: Surroundings) -> IdealScan:
        """What each beam meets at its time."""
        velocity: Velocity = (self.forward_m_s, self.left_m_s, self.up_m_s)
        sensor_moves = self.object_id < 0
        moving = self._moving(velocity, ideal, around)
        if not moving and not (sensor_moves and (any(velocity) or self.yaw_deg_s)):
            return ideal
        rays = rays_of(ideal)
        fired_s = ideal.beams.fire_time_s(ideal.layer, ideal.point)
        remaining_s = fired_s - (0.0 if ideal.time_s is None else ideal.time_s)
        if not np.any(remaining_s):
            return ideal
        if sensor_moves:
            origin = turned(rays.origin_m, self.yaw_deg_s * remaining_s, 0.0) + np.outer(remaining_s, velocity)
            direction = turned(rays.direction, self.yaw_deg_s * remaining_s, 0.0)
            rays = replace(rays, origin_m=origin, direction=direction)
        # A scene moves on from the frame's start, the scan's own surfaces from the time that they were seen at.
        time_s = remaining_s if around.scene is None else fired_s
        return recast(ideal, replace(rays, time_s=time_s), around, moving)

    def _moving(self, velocity: Velocity, ideal: IdealScan, around: Surroundings) -> dict[int, Velocity]:
        """The objects that move, and how fast; without a scene only those that the ideal scan shows."""
        listed = {number: (along, 0.0, 0.0) for number, along in zip(self.movers, self.movers_forward_m_s, strict=True)}
        own = {**around.caster.velocities_m_s, **listed}
        moving = {number: (self.objects * x, self.objects * y, self.objects * z) for number, (x, y, z) in own.items()}
        if self.object_id >= 0 and any(velocity):
            moving[int(self.object_id)] = velocity
        named = {self.object_id, *self.movers}
        if around.scene is None and named & moving.keys():
            named -= set() if ideal.object_id is None else set(np.unique(ideal.object_id).tolist())
            moving = {number: one for number, one in moving.items() if number not in named}
        return {number: one for number, one in moving.items() if any(one)}
