"""Input to measure speeds with: a full frame of a lab, and a text file of its size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.model.spec import Model
from lidarcheck.rays import Rays
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, PhotonHistogram, Sensor, reference_beams

if TYPE_CHECKING:
    import trimesh

    from lidarcheck.scenes import SceneObject

__all__ = ["hills", "lab_frame", "lab_model", "signs_frame", "sized_frame", "write_rows"]

HEIGHT_M, WALL_M, CEILING_M = 1.8, 85.0, 6.0
PANELS_M = np.arange(5.0, 81.0, 5.0)
SIGNS_M = (25.0, 45.0, 70.0)
ECHOES = 4
MATERIALS = {
    1: Material("panel 10 %", 0.1),
    2: Material("panel 50 %", 0.5),
    3: Material("panel 90 %", 0.9),
    4: Material("concrete", 0.3),
    5: Material("traffic sign", 0.8, "retro", 1000.0),
}


def lab_model(variant: str) -> Model:
    """The reference sensor of that variant with the lab's materials."""
    return Model(sensor=Sensor.of(variant), materials=MATERIALS)


def lab_frame() -> IdealScan:
    """520 x 960 beams in a hall: floor, ceiling, end wall, and 16 panels from 5 to 80 m of three reflectances each."""
    beams = reference_beams()
    layer, point = beams.every()
    middle = beams.layers // 2
    x, _, z = beams.directions(layer, point).T
    with np.errstate(divide="ignore"):
        hall = np.minimum(WALL_M / x, np.where(z < 0.0, HEIGHT_M / -z, CEILING_M / z))
    slot = point // (beams.points // len(PANELS_M))
    panel = PANELS_M[slot] / x
    on_panel = (np.abs(layer - middle) < 120) & (point % 60 < 40) & (panel < hall)
    reflectance = 1 + np.clip((layer - (middle - 120)) // 80, 0, 2)
    floor = ~on_panel & (hall < WALL_M / x)
    incidence = np.rad2deg(np.arccos(np.clip(np.where(floor, np.abs(z), x), 0.0, 1.0)))
    return IdealScan(
        layer=layer,
        point=point,
        distance_m=np.where(on_panel, panel, hall),
        material_id=np.where(on_panel, reflectance, 4).astype(np.int32),
        incidence_deg=incidence,
    )


def signs_frame() -> IdealScan:
    """The same hall with traffic signs on its panels of 25, 45 and 70 m, 20 beams by 8 each."""
    frame = lab_frame()
    beams = frame.beams
    middle = (np.abs(frame.layer - beams.layers // 2) < 10) & (np.abs(frame.point % 60 - 20) < 4)
    slots = [int(np.flatnonzero(range_m == PANELS_M)[0]) for range_m in SIGNS_M]
    sign = middle & np.isin(frame.point // (beams.points // len(PANELS_M)), slots)
    return replace(frame, material_id=np.where(sign, 5, frame.material_id).astype(np.int32))


def sized_frame(sensor: Sensor, beams: int) -> IdealScan:
    """About that many beams of a sensor in the hall with signs: columns about each panel's middle.

    Of a sensor other than the built-in grid, columns side by side, in a hall that shrinks with its range.
    """
    if sensor.beams == reference_beams():
        frame = signs_frame()
        columns = min(max(round(60 * beams / len(frame)), 1), 60)
        first = max(20 - columns // 2, 0)
        return _middle(frame.take((frame.point % 60 >= first) & (frame.point % 60 < first + columns)), beams)
    frame = _hall_around(sensor)
    points = sensor.beams.points
    columns = min(max(round(points * beams / max(len(frame), 1)), 1), points)
    first = (points - columns) // 2
    return _middle(frame.take((frame.point >= first) & (frame.point < first + columns)), beams)


def _middle(frame: IdealScan, beams: int) -> IdealScan:
    """Of a frame of more beams than asked for the layers in the middle, at least one."""
    half = frame.beams.layers * min(beams / max(len(frame), 1), 1.0) / 2.0
    return frame.take(np.abs(frame.layer - frame.beams.layers // 2) <= half)


def _hall_around(sensor: Sensor) -> IdealScan:
    """The hall's floor, ceiling, walls, panels and signs in all directions, as large as the sensor's range asks for."""
    beams = sensor.beams
    layer, point = beams.every()
    x, y, z = beams.directions(layer, point).T
    size = min(sensor.max_range_m / WALL_M, 1.0)
    level = np.hypot(x, y)
    with np.errstate(divide="ignore"):
        hall = np.minimum(WALL_M / level, np.where(z < 0.0, HEIGHT_M / -z, CEILING_M / z))
    part = (np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * len(PANELS_M)
    slot, across = np.minimum(part.astype(np.int64), len(PANELS_M) - 1), part % 1.0
    panel = PANELS_M[slot] / level
    up = np.rad2deg(np.arcsin(z))
    on_panel = (np.abs(up) < 6.0) & (across < 0.67) & (panel < hall)
    material = np.where(on_panel, 1 + np.clip(((up + 6.0) / 4.0).astype(np.int64), 0, 2), 4)
    sign = on_panel & (np.abs(up) < 1.0) & (np.abs(across - 0.33) < 0.06) & np.isin(PANELS_M[slot], SIGNS_M)
    floor = ~on_panel & (hall < WALL_M / level)
    return IdealScan(
        layer=layer,
        point=point,
        distance_m=size * np.where(on_panel, panel, hall),
        material_id=np.where(sign, 5, material).astype(np.int32),
        incidence_deg=np.rad2deg(np.arccos(np.clip(np.where(floor, np.abs(z), level), 0.0, 1.0))),
        beams=beams,
        rays=_rays_of_zones(sensor, np.stack([x, y, z], axis=1)),
    )


def _rays_of_zones(sensor: Sensor, direction: FloatArray) -> Rays | None:
    """What the rays of zones must be told, since a zone is wide; None where beams are rays."""
    n = len(direction)
    zones = sensor.detector == PhotonHistogram.detector
    return Rays(np.zeros((n, 3)), direction, np.zeros(n), np.zeros(n, dtype=np.int32)) if zones else None


def hills(triangles: int) -> tuple[trimesh.Trimesh, SceneObject]:
    """Rolling ground of about that many triangles below the sensor, as a mesh and as an object of a scene."""
    import trimesh

    from lidarcheck.scenes import SceneObject

    side = round((triangles / 2) ** 0.5)
    x, y = np.meshgrid(np.linspace(0.0, 200.0, side + 1), np.linspace(-100.0, 100.0, side + 1), indexing="ij")
    z = -HEIGHT_M + 0.3 * np.sin(x / 7.0) * np.cos(y / 5.0) + 8.0 * np.clip(x / 200.0, 0.0, 1.0) ** 2
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + side + 1, corner + 1], axis=1),
            np.stack([corner + 1, corner + side + 1, corner + side + 2], axis=1),
        ]
    )
    mesh = trimesh.Trimesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, process=False)
    return mesh, SceneObject(mesh.triangles, np.full(len(mesh.faces), 4), object_id=1)


def write_rows(path: Path, rows: int) -> None:
    """A CloudCompare text file of nine columns, as a sensor writes it: about so many rows, four echoes a beam."""
    from lidarcheck.formats.table import Table
    from lidarcheck.formats.text import write_text

    beams = reference_beams()
    layer, point = (np.repeat(number[: rows // ECHOES], ECHOES) for number in beams.every())
    draw = np.random.Generator(np.random.Philox(1))
    number = np.tile(np.arange(1, ECHOES + 1), len(layer) // ECHOES)
    range_m = 40.0 * (number - draw.uniform(0.1, 0.9, len(number)))
    xyz = np.round(beams.directions(layer, point) * range_m[:, None], 4)
    width, area, peak = draw.integers([[5], [50], [10]], [[40], [1300], [136]], (3, len(layer)))
    told = {"Point": point, "Layer": layer, "EchoNumber": number, "WIDTH": width, "AREA": area, "PEAK": peak}
    write_text(Table({**dict(zip("XYZ", xyz.T, strict=True)), **told}), path)
