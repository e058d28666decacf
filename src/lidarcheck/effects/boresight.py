"""The sensor looks in a direction other than assumed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lidarcheck.effects.base import AimEffect, Surroundings, parameter
from lidarcheck.effects.geometry.aiming import rays_of, recast, redirected, slid, turned
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor

__all__ = ["Boresight"]


@dataclass(frozen=True)
class Boresight(AimEffect):
    """The sensor looks in a direction (yaw, pitch) other than assumed.

    A beam reported as (layer, point) meets what lies in the direction R u, u being that beam's nominal direction; its
    echo is still reported on (layer, point). `yaw_deg` turns the view to the left, `pitch_deg` upward, `roll_deg` lifts
    its left side. With `rigid` 1 the sensor is turned as a body, with the places where its beams begin: R is the
    rotation about the vector (roll, -pitch, yaw) in X forward, Y left, Z up; the order of the three does not matter,
    and negative angles turn back. With `rigid` 0 yaw adds to every beam's azimuth and pitch to its elevation, as an
    offset of the encoders does. The mounting error of automotive sensors is a few tenths of a degree. Without a scene,
    what lies between or beyond the ideal scan's beams is taken from its nearest surfaces: good up to about a degree.
    Where an edge lies to a part of a beam no ideal scan says; with `own_surface` 1 each beam stays on the surface that
    it meets, for corrections smaller than a beam. Identity at yaw, pitch and roll 0.
    """

    name = "boresight"
    role = "pose"

    yaw_deg: float = parameter(
        "deg", low=-10.0, high=10.0, typical=0.2, noticeable=0.05, meaning="turn of the view to the left"
    )
    pitch_deg: float = parameter(
        "deg", low=-10.0, high=10.0, typical=0.1, noticeable=0.05, meaning="turn of the view upward"
    )
    roll_deg: float = parameter(
        "deg", low=-10.0, high=10.0, typical=0.0, noticeable=0.05, meaning="lift of the view's left side"
    )
    rigid: int = parameter(
        "", low=0, high=1, typical=1, whole=True, noticeable=-1, meaning="1: as a body; 0: offsets of the angles"
    )
    own_surface: int = parameter(
        "",
        low=0,
        high=1,
        typical=0,
        whole=True,
        option=True,
        noticeable=1,
        meaning="1: each beam stays on the surface that it meets",
    )

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """Directions that name beams."""
        return "its files are compensated for motion" if sensor.deskewed else ""

    def aim(self, ideal: IdealScan, around: Surroundings) -> IdealScan:
        """What the turned beams meet."""
        if self.yaw_deg == self.pitch_deg == self.roll_deg == 0.0:
            return ideal
        rays = self._turned(rays_of(ideal), ideal)
        return slid(ideal, rays, around) if self.own_surface else recast(ideal, rays, around)

    def _turned(self, rays: Rays, ideal: IdealScan) -> Rays:
        """The rays of a turned sensor; beams that begin beside its middle begin elsewhere."""
        angles = self.yaw_deg, self.pitch_deg, self.roll_deg
        turned_rays = redirected(rays, turned(rays.direction, *angles, as_a_body=bool(self.rigid)))
        origins = ideal.beams.origins_m(ideal.layer, ideal.point) if self.rigid else None
        if origins is None:
            return turned_rays
        return replace(turned_rays, origin_m=rays.origin_m + turned(origins, *angles) - origins)
