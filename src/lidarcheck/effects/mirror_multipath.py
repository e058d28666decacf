"""A mirror-like surface shows what it reflects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.geometry.aiming import moving_of, rays_of, second_rows
from lidarcheck.effects.geometry.reflections import GROUND_M, ground_of, march, reflected
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.effects.shared.draws import normals
from lidarcheck.effects.shared.reflectance import reflectance_of, with_reflectance
from lidarcheck.rays import Hits, Rays
from lidarcheck.scan import IdealScan, Light

__all__ = ["MirrorMultipath"]

_SAMPLE = 20_000
"""Points that the ground's plane is fitted to."""
_OFF_M = 2e-3
_LEVEL = 0.1
"""So much may the cosine of the incidence differ from that on the ground: the feet of walls do not mirror."""


class _Mirror(NamedTuple):
    """Rows that mirror, (n,); the unit normals there, (n, 3); and which rows of all are the mirror's, (n_rows,)."""

    row: IndexArray
    normal: FloatArray


@dataclass(frozen=True)
class MirrorMultipath(LightEffect):
    """A mirror-like surface shows what it reflects, behind itself.

    A beam that meets the mirror at R1 goes on, reflected about its normal, and meets a surface after a further R2. Its
    light comes back the same way: one more pulse at R1 + R2 of rho(iota)^`exponent` S, where S is what that surface
    would return at the range R1 + R2 at its own incidence (a flat mirror's image is as large as the thing), and
    exponent 2 stands for one reflection there and one back. rho(iota) = r + `grazing` (1 - r) (1 - cos iota)^5 is the
    `reflectivity` r for light along the normal, and with `grazing` 1 Schlick's approximation of Fresnel's formula, as
    for water. The mirror is the ground (a wet road) with `material_id` -1, else every surface of that material.
    `roughness_deg` tilts the normal at random, beam by beam (rms about either axis). The echo of the mirror itself
    stays. Gains of this stage that stand before this one do not act on its pulses; put them behind it. Without a
    scene only what the sensor sees itself, from the same side, can be reflected. Identity at reflectivity and grazing
    0.
    """

    name = "mirror_multipath"
    tree = (108,)

    reflectivity: float = parameter(
        "", low=0.0, high=1.0, typical=0.2, noticeable=0.02, meaning="reflected part at normal incidence"
    )
    material_id: int = parameter(
        "",
        low=-1,
        high=2**31 - 1,
        typical=-1,
        whole=True,
        noticeable=1,
        meaning="the mirror's material; -1: the ground",
    )
    grazing: float = parameter(
        "", low=0.0, high=1.0, typical=0.0, noticeable=0.2, meaning="rise to 1 at grazing incidence, its part"
    )
    exponent: float = parameter(
        "", low=0.0, high=4.0, typical=2.0, noticeable=0.25, meaning="power of the reflectivity"
    )
    roughness_deg: float = parameter(
        "deg", low=0.0, high=10.0, typical=0.0, noticeable=0.1, meaning="rms tilt of the normal"
    )
    max_range_m: float = parameter(
        "m", low=0.0, high=1000.0, typical=300.0, noticeable=-30.0, meaning="longest way R1 + R2"
    )

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add the pulses of what is reflected."""
        if self.reflectivity == self.grazing == 0.0 or len(light) == 0 or len(around.ideal) == 0:
            return light
        ideal, rays = around.ideal, rays_of(around.ideal)
        max_range_m = min(self.max_range_m, around.sensor.max_range_m)
        mirror = self._mirror(ideal, rays, around, max_range_m)
        if len(mirror.row) == 0:
            return light
        beam = _beams(light, ideal, mirror.row)
        mirror, beam = _Mirror(mirror.row[beam >= 0], mirror.normal[beam >= 0]), beam[beam >= 0]
        onward, faces = self._onward(ideal, rays, mirror, around)
        hits = _met(onward, rays, ideal, mirror, around, max_range_m)
        way = ideal.distance_m[mirror.row] + hits.distance_m
        met = np.flatnonzero(faces & (hits.distance_m > 0.0) & (way <= max_range_m))
        if len(met) == 0:
            return light
        row = mirror.row[met]
        image = IdealScan(
            ideal.layer[row],
            ideal.point[row],
            way[met],
            hits.material_id[met],
            hits.incidence_deg[met],
            file=ideal.file,
            beams=ideal.beams,
        )
        source = _rows_at(ideal, onward, hits, met)
        own = reflectance_of(ideal)
        if own is not None:
            image = with_reflectance(image, np.where(source >= 0, own[source], np.nan))
        cosine = np.abs(np.einsum("ij,ij->i", rays.direction[row], mirror.normal[met]))
        signal = self._passage(cosine) * around.signal(image) * ideal.shares()[row]
        signal *= elementary.exp(-2.0 * light.extinction_per_m * way[met])
        lit = signal > 0.0
        return light.with_pulses(beam[met][lit], way[met][lit], signal[lit], source[lit])

    def _passage(self, cosine: FloatArray) -> FloatArray:
        """The part of the light that two reflections leave."""
        rise = self.grazing * (1.0 - self.reflectivity) * (1.0 - np.minimum(cosine, 1.0)) ** 5
        reflectivity: FloatArray = self.reflectivity + rise
        return np.asarray(elementary.power(np.where(reflectivity > 0.0, reflectivity, 0.0), self.exponent))

    def _mirror(self, ideal: IdealScan, rays: Rays, around: Surroundings, max_range_m: float) -> _Mirror:
        """The rows that mirror, and their normals."""
        hit = (ideal.distance_m > 0.0) & (ideal.distance_m < max_range_m) & ~second_rows(ideal, rays)
        if self.material_id >= 0:
            row = np.flatnonzero(hit & (ideal.material_id == self.material_id))
            normal = _cast(rays.take(row), rays, around).normal
            known = np.any(normal != 0.0, axis=1)
            return _Mirror(row[known], normal[known])
        point = rays.origin_m + ideal.distance_m[:, None] * rays.direction
        below = np.flatnonzero(hit & (rays.direction[:, 2] < 0.0) & (point[:, 2] < -0.1))
        some = below[:: max(1, len(below) // _SAMPLE)]
        normal = _cast(rays.take(some), rays, around).normal
        # Where no neighbour tells the slope, the incidence does: on level ground it is that of the elevation.
        stated = np.abs(elementary.cos(np.deg2rad(ideal.incidence_deg[some])) + rays.direction[some, 2]) < 0.02
        ground = ground_of(point[some], np.where(np.any(normal != 0.0, axis=1), normal[:, 2] > 0.9, stated))
        if ground is None:
            return _Mirror(np.empty(0, dtype=np.int64), np.empty((0, 3)))
        cosine = -elementary.product(rays.direction[below], ground.normal)
        level = np.abs(elementary.cos(np.deg2rad(ideal.incidence_deg[below])) - cosine) < _LEVEL
        row = below[level & (np.abs(elementary.product(point[below], ground.normal) + ground.height_m) < GROUND_M)]
        return _Mirror(row, np.broadcast_to(ground.normal, (len(row), 3)))

    def _onward(
        self, ideal: IdealScan, rays: Rays, mirror: _Mirror, around: Surroundings
    ) -> tuple[Rays, npt.NDArray[np.bool_]]:
        """The reflected rays, and which of them leave the mirror on the side from which it was met."""
        row, normal = mirror
        if self.roughness_deg > 0.0:
            draw = normals(around.uniforms(ideal.layer[row], ideal.point[row], 2)) * np.deg2rad(self.roughness_deg)
            first, second = _across(normal)
            normal = normal + draw[:, :1] * first + draw[:, 1:] * second
            normal = normal / np.sqrt(np.square(normal).sum(axis=1, keepdims=True))
        direction = reflected(rays.direction[row], normal)
        leaves = np.einsum("ij,ij->i", direction, mirror.normal) > 0.0
        off = (_OFF_M + 2e-5 * ideal.distance_m[row])[:, None] * mirror.normal
        origin = rays.origin_m[row] + ideal.distance_m[row, None] * rays.direction[row] + off
        return Rays(origin, direction, rays.time_s[row], rays.slot[row]), leaves


def _cast(rays: Rays, whole: Rays, around: Surroundings, max_range_m: float = 1000.0) -> Hits:
    return around.caster.cast(rays, moving=moving_of(whole, around.caster) or None, max_range_m=max_range_m)


def _met(
    onward: Rays, whole: Rays, ideal: IdealScan, mirror: _Mirror, around: Surroundings, max_range_m: float
) -> Hits:
    """What the reflected rays meet, in the scene or among the surfaces that the scan itself shows."""
    caster = around.caster
    if not isinstance(caster, LocalSurfaces):
        return _cast(onward, whole, around, max_range_m)
    keys = caster.ideal.layer.astype(np.int64) << 32 | caster.ideal.point
    if len(caster.ideal) == len(ideal):
        rows = np.zeros(len(ideal), dtype=bool)
        rows[mirror.row] = True
    else:
        rows = np.isin(keys, ideal.layer[mirror.row].astype(np.int64) << 32 | ideal.point[mirror.row])
    return march(caster, onward, rows, max_range_m)


def _beams(light: Light, ideal: IdealScan, row: IndexArray) -> IndexArray:
    """The beam of the light that each of those rows belongs to, -1 where there is none; shape (m,)."""
    keys = light.layer.astype(np.int64) << 32 | light.point
    order = np.argsort(keys, kind="stable")
    wanted = ideal.layer[row].astype(np.int64) << 32 | ideal.point[row]
    place = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
    return np.where(keys[order[place]] == wanted, order[place], -1)


def _rows_at(ideal: IdealScan, onward: Rays, hits: Hits, met: IndexArray) -> IndexArray:
    """A row of the ideal scan that sees what those rays meet, from the sensor: the same material there; -1: none."""
    at = onward.origin_m[met] + hits.distance_m[met, None] * onward.direction[met]
    layer, point = ideal.beams.nearest(at)
    keys = ideal.layer.astype(np.int64) << 32 | ideal.point
    order = np.argsort(keys, kind="stable")
    wanted = layer.astype(np.int64) << 32 | point
    row = order[np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)]
    seen = (keys[row] == wanted) & (ideal.distance_m[row] > 0.0) & (ideal.material_id[row] == hits.material_id[met])
    if ideal.object_id is not None:
        seen &= ideal.object_id[row] == hits.object_id[met]
    return np.where(seen, row, -1)


def _across(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors across each normal and each other."""
    least = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, least)
    first /= np.sqrt(np.square(first).sum(axis=1, keepdims=True))
    return first, np.cross(normal, first)
