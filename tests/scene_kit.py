"""Measured frames of known truth from the independent generator, beside the package's ideal scan and model of them."""

from dataclasses import replace

import numpy as np

from hidden.chain import Nuisance, measure
from hidden.places import LAYERS, POINT_RANGE, TABLE, arrange
from hidden.rays import Beams, Hits, Rectangle, Scene, cast, directions
from hidden.sensor import Echoes
from lidarcheck.model import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor

BEAMS = Beams.block(LAYERS, POINT_RANGE)
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
