"""Flat patches cast by hand, and what effects know of a frame: a reference for the effects that aim beams elsewhere."""

from dataclasses import dataclass, field, replace

import numpy as np

from lidarcheck.model import Model, streams
from lidarcheck.model.light import surface_signal
from lidarcheck.rays import Hits, Rays
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, Sensor
from reference_grid import beam_directions


@dataclass(frozen=True)
class Patch:
    """A parallelogram: centre, two half edges, material, object."""

    centre: tuple
    half: tuple
    other: tuple
    material: int = 1
    number: int = 1


@dataclass
class PatchScene:
    """Rays against every patch in turn."""

    patches: list
    velocities_m_s: dict = field(default_factory=dict)

    def cast(self, rays, *, moving=None, max_range_m=300.0):
        n = len(rays)
        best, material, number = np.full(n, np.inf), np.zeros(n, np.int32), np.zeros(n, np.int32)
        cosine, normal = np.ones(n), np.zeros((n, 3))
        for patch in self.patches:
            a, b = np.asarray(patch.half, float), np.asarray(patch.other, float)
            unit = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
            velocity = np.asarray((moving or {}).get(patch.number, (0.0, 0.0, 0.0)))
            to = np.asarray(patch.centre, float) + rays.time_s[:, None] * velocity - rays.origin_m
            along = rays.direction @ unit
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = (to @ unit) / along
                at = distance[:, None] * rays.direction - to
                # Coordinates along the edges, which may be oblique.
                dual = np.linalg.pinv(np.stack([a, b], axis=1))
                inside = (np.abs(at @ dual.T) <= 1.0).all(axis=1)
            hit = inside & (distance > 1e-6) & (distance <= max_range_m) & (distance < best)
            best[hit], material[hit], number[hit] = distance[hit], patch.material, patch.number
            cosine[hit] = np.abs(along[hit])
            normal[hit] = -np.sign(along[hit])[:, None] * unit
        met = np.isfinite(best)
        incidence = np.where(met, np.rad2deg(np.arccos(np.clip(cosine, 0, 1))), 0.0)
        return Hits(np.where(met, best, 0.0), material, number, incidence, normal)

    def ideal(self, layers, points, *, objects=True, **columns):
        layer, point = (c.ravel() for c in np.meshgrid(layers, points, indexing="ij"))
        n = len(layer)
        rays = Rays(np.zeros((n, 3)), beam_directions(layer, point), np.zeros(n), np.zeros(n, np.int32))
        hits = self.cast(rays)
        number = hits.object_id if objects else None
        return IdealScan(
            layer, point, hits.distance_m, hits.material_id, hits.incidence_deg, object_id=number, **columns
        )


WALL_AHEAD = {"half": (0, 500, 0), "other": (0, 0, 500)}
GROUND = {"half": (500, 0, 0), "other": (0, 500, 0)}


def box(low, high, **facts):
    """Six patches."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    middle, size = (low + high) / 2, (high - low) / 2
    patches = []
    for axis in range(3):
        one, two = (np.eye(3)[k] * size[k] for k in range(3) if k != axis)
        for side in (-1, 1):
            centre = middle + side * np.eye(3)[axis] * size[axis]
            patches.append(Patch(tuple(centre), tuple(one), tuple(two), **facts))
    return patches


@dataclass(frozen=True)
class Around:
    """What an effect may know."""

    ideal: IdealScan
    scene: object = None
    surfaces: object = None
    sensor: Sensor = field(default_factory=lambda: Sensor.of("SMART"))
    purpose: str = "test"
    seed: int = 1

    @property
    def materials(self):
        return {i: Material(f"material {i}", 0.1 * i) for i in range(1, 10)}

    @property
    def caster(self):
        return self.surfaces if self.scene is None else self.scene

    def signal(self, ideal):
        return surface_signal(ideal, Model(self.sensor, self.materials))

    def uniforms(self, layer, point, draws=1):
        return streams.uniforms(self.seed, self.purpose, 0, layer, point, draws)

    def after(self, ideal):
        return replace(self, ideal=ideal)


def around(ideal, scene=None, **facts):
    """The surroundings of an ideal scan that no effect has changed yet."""
    from lidarcheck.effects.geometry.surfaces import LocalSurfaces

    return Around(ideal, scene, LocalSurfaces.of(ideal) if scene is None else None, **facts)
