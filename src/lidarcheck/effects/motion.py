"""The scene or the sensor moves while the frame is swept."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.effects.aiming import rays_of, recast, turned
from lidarcheck.effects.base import AimEffect, Surroundings, parameter
from lidarcheck.rays import Velocity, sweep_time_s
from lidarcheck.scan import IdealScan

__all__ = ["Motion"]


@dataclass(frozen=True)
class Motion(AimEffect):
    """The scene or the sensor moves while the frame is swept.

    Point column p is fired t = 30 ms p / 959 after the frame's start. With `object_id` -1 the sensor moves: its beams
    start at v t and are turned to the left by yaw rate times t, v in the sensor's frame at the start. With `object_id`
    0 or more the sensor stands, and the object of that number moves by v t; the yaw rate has no part then. Besides, the
    scene's objects that have velocities of their own move by `objects` times those. Ranges are as the sensor measures
    them, not corrected for its motion. Where the ideal scan has times, it shows the scene at those, and only the time
    from there to t counts. Without a scene, surfaces that no beam has seen are continued from the nearest ones in the
    layer: good for ways of a metre or two; an ideal scan without object numbers has no object that could move.
    Identity at velocity, yaw rate and objects 0.
    """

    name = "motion"
    tree = (102,)

    forward_m_s: float = parameter("m/s", low=-100.0, high=100.0, typical=10.0, meaning="velocity along X")
    left_m_s: float = parameter("m/s", low=-100.0, high=100.0, typical=0.0, meaning="velocity along Y")
    up_m_s: float = parameter("m/s", low=-100.0, high=100.0, typical=0.0, meaning="velocity along Z")
    yaw_deg_s: float = parameter("deg/s", low=-360.0, high=360.0, typical=0.0, meaning="turn of the sensor to the left")
    object_id: int = parameter("", low=-1, high=2**31 - 1, typical=-1, whole=True, meaning="what moves; -1: the sensor")
    objects: float = parameter("", low=0.0, high=1.0, typical=1.0, meaning="factor on the scene's own velocities")

    def aim(self, ideal: IdealScan, around: Surroundings) -> IdealScan:
        """What each point column meets at its time."""
        velocity: Velocity = (self.forward_m_s, self.left_m_s, self.up_m_s)
        sensor_moves = self.object_id < 0
        moving = self._moving(velocity, around)
        if not moving and not (sensor_moves and (any(velocity) or self.yaw_deg_s)):
            return ideal
        if not moving.keys() - {self.object_id} and not sensor_moves and around.scene is None:
            known = ideal.object_id is not None and bool(np.any(ideal.object_id == self.object_id))
            if not known:
                return ideal
        rays = rays_of(ideal)
        remaining_s = sweep_time_s(ideal.point) - (0.0 if ideal.time_s is None else ideal.time_s)
        if not np.any(remaining_s):
            return ideal
        if sensor_moves:
            origin = turned(rays.origin_m, self.yaw_deg_s * remaining_s, 0.0) + np.outer(remaining_s, velocity)
            direction = turned(rays.direction, self.yaw_deg_s * remaining_s, 0.0)
            rays = replace(rays, origin_m=origin, direction=direction)
        # A scene moves on from the frame's start, the scan's own surfaces from the time that they were seen at.
        time_s = remaining_s if around.scene is None else sweep_time_s(ideal.point)
        return recast(ideal, replace(rays, time_s=time_s), around, moving)

    def _moving(self, velocity: Velocity, around: Surroundings) -> dict[int, Velocity]:
        """The objects that move, and how fast."""
        moving: dict[int, Velocity] = {}
        if self.objects > 0.0:
            for number, (x, y, z) in around.caster.velocities_m_s.items():
                moving[number] = (self.objects * x, self.objects * y, self.objects * z)
        if self.object_id >= 0 and any(velocity):
            moving[int(self.object_id)] = velocity
        return {number: own for number, own in moving.items() if any(own)}
