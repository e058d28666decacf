"""Measured frames of known truth from the independent generator, beside the package's ideal scan and model of them."""

import math
from dataclasses import replace

import numpy as np

from hidden.chain import Nuisance, measure
from hidden.places import ASPHALT, CAR, CONCRETE, LAYERS, POINT_RANGE, TABLE, Builder, arrange
from hidden.rays import Beams, Hits, Rectangle, Scene, cast, directions
from hidden.sensor import Echoes
from lidarcheck.model import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor

BEAMS = Beams.block(LAYERS, POINT_RANGE)
CAR_M = (4.4, 1.8, 1.5)
OTHER = 99
"""The material of an object that returns half of what its own material would."""


def model_of(variant: str = "SMART") -> Model:
    """The package's model of the generator's sensor and materials."""
    materials = {
        number: Material(name, rho, "retro" if gain else "lambertian", gain or 1.0)
        for number, (name, rho, gain) in TABLE.items()
    }
    return Model(Sensor.of(variant), materials)


def hits_of(scene: Scene, beams: Beams = BEAMS) -> Hits:
    heading = directions(beams.azimuth_deg, beams.elevation_deg)
    return cast(scene, np.zeros((len(beams), 3)), heading, beams.time_s)


def ideal_of(hits: Hits, beams: Beams = BEAMS, objects: bool = True) -> IdealScan:
    return IdealScan(
        layer=beams.layer,
        point=beams.point,
        distance_m=np.round(hits.range_m, 4),
        material_id=hits.material,
        incidence_deg=np.round(hits.incidence_deg, 3),
        object_id=np.maximum(hits.object_id, 0) if objects else None,
    )


def scan_of(echoes: Echoes, beams: Beams = BEAMS) -> Scan:
    start = np.append(True, np.diff(echoes.beam) != 0)[: len(echoes.beam)]
    row = np.arange(len(echoes.beam))
    number = row - np.maximum.accumulate(np.where(start, row, 0)) + 1
    return Scan.from_beams(
        beams.layer[echoes.beam].astype(np.int32),
        beams.point[echoes.beam].astype(np.int32),
        echoes.range_m,
        echo_number=number.astype(np.int32),
        width_ns=echoes.width_ns,
        area=echoes.area,
        peak=echoes.peak,
    )


def measured(scene: Scene, seed: int, variant: str = "SMART", table=TABLE, beams: Beams = BEAMS) -> Scan:
    return scan_of(measure(scene, beams, variant, table, (), Nuisance(), seed, 0), beams)


def scene_of(kind: str, seed: int) -> Scene:
    return arrange(kind, [seed, 0, 3], False)


def changed(scene: Scene, number: int, change) -> Scene:
    """The scene with `change` made to the rectangles of one object."""
    parts = tuple(change(part) if part.object_id == number else part for part in scene.rectangles)
    return Scene(parts, scene.kind)


def halved(scene: Scene, number: int) -> tuple[Scene, dict]:
    """The scene whose object returns half the light, and the table of materials that says so."""
    own = next(part.material for part in scene.rectangles if part.object_id == number)
    name, rho, gain = TABLE[own]
    return changed(scene, number, lambda part: replace(part, material=OTHER)), {**TABLE, OTHER: (name, rho / 2, gain)}


def shifted(scene: Scene, number: int, by_m: tuple[float, float, float]) -> Scene:
    def move(part: Rectangle) -> Rectangle:
        return replace(part, centre=tuple(c + d for c, d in zip(part.centre, by_m, strict=True)))

    return changed(scene, number, move)


def objects_in(hits: Hits, least: int) -> list[int]:
    """Objects that at least so many beams meet, the ones seen most first."""
    numbers, counts = np.unique(hits.object_id[hits.rectangle >= 0], return_counts=True)
    return [int(n) for n in numbers[np.argsort(-counts)] if counts[numbers == n][0] >= least]


def vehicle_scene(near_m: float, size_m=CAR_M, *, turn_deg: float = 0.0, azimuth_deg: float = 1.0, slope: float = 0.0):
    """A road, a house, a pole and one vehicle whose near end is at a range; the vehicle is object 2."""
    b = Builder(np.random.default_rng(0))
    b.ground(ASPHALT)
    b.box(near_m, azimuth_deg, size_m, CAR, turn_deg - azimuth_deg)
    b.box(near_m + 3.0, -7.0, (0.25, 0.25, 6.0), CONCRETE, 0.0)
    b.facade(1, 9.0, (20.0, 90.0), CONCRETE, 7.0)
    rectangles = tuple(_bright(part) for part in b.rectangles)
    return Scene(tuple(_tilted(part, slope) for part in rectangles), "street")


def _bright(part: Rectangle) -> Rectangle:
    # Asphalt fades before the vehicle; the ground must be seen to be fitted.
    return replace(part, material=CONCRETE) if part.material == ASPHALT else part


def _tilted(part: Rectangle, slope: float) -> Rectangle:
    """The scene turned about Y: a road that climbs."""
    c, s = math.cos(slope), math.sin(slope)

    def turn(v):
        return (c * v[0] - s * v[2], v[1], s * v[0] + c * v[2])

    return replace(part, centre=turn(part.centre), along=turn(part.along), across=turn(part.across))
