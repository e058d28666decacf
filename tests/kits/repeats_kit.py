"""Repeats of a room at rest: what each ray of a sensor meets in it, and frames of it by the model."""

import tomllib
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.model import Model, simulate
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, sensor_of, shipped

ROOM = {
    (1, 0, 0): (30.0, 0.1), (-1, 0, 0): (60.0, 0.5), (0, 1, 0): (20.0, 0.05), (0, -1, 0): (15.0, 0.8),
    (0, 0, -1): (1.8, 0.2), (0, 0, 1): (8.0, 0.02),
}  # fmt: skip
"""Normals of walls, floor and ceiling: how far away they are [m], and their reflectance."""
MATERIALS = {k: Material(f"wall {k}", reflectance) for k, (_, reflectance) in enumerate(ROOM.values())}

COUNTING = """
name = "counting"
detector = "linear"
frame_rate_hz = 10
returns = 2
range = {min_m = 0.3, max_m = 200, step_m = 0.002}
linear = {signal_at_1m = 400000.0, near_m = 0.0}
[beams]
kind = "grid"
layers = 32
points = 400
elevation_deg = {first = -15.5, step = 1.0}
azimuth_deg = {first = 0.0, step = 0.9}
[features]
SIGNAL = {law = "affine", bits = 16}
"""
"""A sensor that counts photons, and whose file says nothing of its noise."""
TRUE = {
    "noise": 3.0, "excess": 1.0, "relative": 0.02, "threshold": 18.0, "range_floor_m": 0.004, "edge_factor": 0.8
}  # fmt: skip


def counting(**numbers):
    """The counting sensor, with its numbers where they are given."""
    return replace(sensor_of(tomllib.loads(COUNTING)), **numbers)


@dataclass(frozen=True)
class Truth:
    """What the rays meet, by (layer, point): distances, S, incidence; arrays (layers, points)."""

    ideal: IdealScan
    distance_m: np.ndarray
    signal: np.ndarray
    incidence_deg: np.ndarray


def room(sensor, layers=None, points=None, frame=0):
    """What the sensor's first layers and points meet, fired as in that frame."""
    beams, count = sensor.beams.of_frame(frame)
    shape = (layers or beams.layers, points or count)
    layer, point = (a.ravel() for a in np.mgrid[: shape[0], : shape[1]])
    u, origin = beams.directions(layer, point), beams.origins_m(layer, point)
    origin = np.zeros((len(layer), 3)) if origin is None else origin
    best, incidence, material = np.full(len(layer), np.inf), np.zeros(len(layer)), np.zeros(len(layer), dtype=int)
    for k, (normal, (away, _)) in enumerate(ROOM.items()):
        facing = u @ np.array(normal, dtype=float)
        along = np.where(facing > 1e-9, (away - origin @ normal) / np.maximum(facing, 1e-9), np.inf)
        nearer = along < best
        best[nearer], material[nearer] = along[nearer], k
        incidence[nearer] = np.rad2deg(np.arccos(np.clip(facing[nearer], 0, 1)))
    rho = np.array([one.reflectance for one in MATERIALS.values()])[material]
    signal = sensor.signal_at_1m * rho * np.cos(np.deg2rad(incidence)) / (best**2 + sensor.near_m**2)
    ideal = IdealScan(layer, point, best, material, incidence, beams=beams)
    return Truth(ideal, *(column.reshape(shape) for column in (best, signal, incidence)))


def frames(sensor, truth, count, seed=1):
    """So many frames of one room by the model; several rooms, one a frame, for columns that do not repeat."""
    rooms = truth if isinstance(truth, list) else [truth] * count
    model = Model(sensor, MATERIALS)
    return [simulate(rooms[k].ideal, model, seed=seed, frame=k) for k in range(count)]


def names(count):
    return [f"frame_{k}.parquet" for k in range(count)]


def certain(ideal):
    """The rows with a surface and beside no edge."""
    return (ideal.distance_m > 0) & (ideal.extra["Edge"] == 0)


def of_true(ideal, truth, column, rows):
    return getattr(truth, column)[ideal.layer[rows], ideal.point[rows]]


def signal_of(sensor, ideal, rows):
    """S and its standard error, of rows of an ideal scan."""
    white = sensor.signal_at_1m * np.cos(np.deg2rad(ideal.incidence_deg[rows])) / ideal.distance_m[rows] ** 2
    return white * ideal.extra["Reflectance"][rows], white * ideal.extra["ReflectanceError"][rows]


__all__ = [
    "COUNTING", "MATERIALS", "TRUE", "Truth", "certain", "counting", "frames", "names", "of_true", "room", "shipped",
    "signal_of",
]  # fmt: skip
