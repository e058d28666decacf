"""Small sensors of other kinds: a turning head, a rosette, zones; and a room of flat walls around them."""

from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.rays import Hits, Rays
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Beams, Sensor, sensor_of
from lidarcheck.sensor.beam_table import TableBeams
from lidarcheck.sensor.sweep import Sweep

LINEAR = {"signal_at_1m": 461000.0, "threshold": 5.84, "excess": 0.02}
ZONES = {"spads": 9, "shots": 10_000, "bins": 64, "bin_ns": 0.5, "signal_at_1m": 1e-3, "cover_glass": 4e-4}
INTENSITY = {"INTENSITY": {"law": "calibrated_reflectivity", "bits": 8}}
SPADS = {
    "spads": 27, "shots": 5, "threshold": 9, "peak_saturation": 135, "on_bins": 9, "dead_bins": 12,
    "background_per_ns": 0.0003, "signal_at_1m": 6000.0, "bin_ns": 1.0, "time_offset_ns": 4.0,
}  # fmt: skip


def head(detector: str = "linear", **more: Any) -> Sensor:
    """Sixteen channels, the uppermost first, that look 1 deg aside of their column by turns; 900 columns to the right.

    Channels fire 2 us one after the other, from beside the axis.
    """
    numbers = {"linear": LINEAR, "spad_array": SPADS, "photon_histogram": ZONES}[detector]
    beams = {
        "kind": "channels",
        "elevation_deg": [15.0 - 2.0 * i for i in range(16)],
        "azimuth_offset_deg": [1.0 if i % 2 else -1.0 for i in range(16)],
        "fire_time_us": [2.0 * i for i in range(16)],
        "origin_m": 0.03,
        "height_m": 0.04,
        "range_offset_m": 0.03,
        "columns": 900,
        "azimuth_deg": {"first": 0.0, "last": -360.0},
        **more.pop("beams", {}),
    }
    return _sensor({"sweep": {"direction": "right"}, **more}, detector, numbers, beams)


def zones(**more: Any) -> Sensor:
    """Three by three zones of a histogram chip, 10 deg wide each."""
    beams = {
        "kind": "grid",
        "layers": 3,
        "points": 3,
        "elevation_deg": {"first": -10.0, "step": 10.0},
        "azimuth_deg": {"first": -10.0, "step": 10.0},
        "footprint_deg": {"horizontal": 10.0, "vertical": 10.0},
        "footprint": "box",
        "sub_rays": {"horizontal": 3, "vertical": 3},
    }
    histogram = {"photon_histogram": {**ZONES, **more.pop("photon_histogram", {})}}
    return _sensor({"sweep": {"order": "flash"}, **more}, "photon_histogram", histogram["photon_histogram"], beams)


def flash(**more: Any) -> Sensor:
    """A linear detector behind an even grid that fires all at once: 32 layers, the uppermost first, once around."""
    beams = {
        "kind": "grid",
        "layers": 32,
        "points": 180,
        "elevation_deg": {"first": 10.0, "step": -1.25},
        "azimuth_deg": {"first": 0.0, "step": -2.0},
    }
    return _sensor({"sweep": {"order": "flash"}, **more}, "linear", LINEAR, beams)


def _sensor(more: dict[str, Any], detector: str, numbers: dict[str, Any], beams: dict[str, Any]) -> Sensor:
    given = {**numbers, **more.pop(detector, {})}
    document = {"name": "test", "detector": detector, "frame_rate_hz": 10, "returns": 2, "beams": beams}
    features = {"PEAK": {"law": "peak_counts"}} if detector == "spad_array" else INTENSITY
    return sensor_of({**document, "features": features, **more, detector: given})


def rosette(beams: int = 4000, *, of_scan: bool = False) -> TableBeams:
    """Directions along a rosette in a cone of 35 deg, fired one after the other in 0.1 s.

    `of_scan`: those that a scan brings, whose numbers say nothing: a line for each.
    """
    turn = np.linspace(0.0, 60.0 * np.pi, beams)
    off_deg = 17.5 * np.abs(np.sin(3.07 * turn))
    columns = {
        "Layer": np.arange(beams) if of_scan else np.zeros(beams, dtype=int),
        "Point": np.zeros(beams, dtype=int) if of_scan else np.arange(beams),
        "elevation_deg": off_deg * np.sin(1.37 * turn),
        "azimuth_deg": off_deg * np.cos(1.37 * turn),
        "time_s": np.linspace(0.0, 0.1, beams),
    }
    return TableBeams.of_columns(Sweep(order="table"), columns, from_scan=of_scan)


WALLS = (
    ((1, 0, 0), 20.0),
    ((-1, 0, 0), 20.0),
    ((0, 1, 0), 12.0),
    ((0, -1, 0), 12.0),
    ((0, 0, -1), 1.8),
    ((0, 0, 1), 8.0),
)
"""Normals and distances of a room's walls, its floor and its ceiling."""


def room(origin_m: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray, IndexArray]:
    """Distance, incidence [deg] and wall of rays in the room, shape (n,) each."""
    distance = np.full(len(direction), np.inf)
    incidence, wall = np.zeros(len(direction)), np.zeros(len(direction), dtype=np.int64)
    for number, (normal, away) in enumerate(WALLS):
        along = direction @ np.array(normal, dtype=float)
        way = (away - origin_m @ np.array(normal, dtype=float)) / np.where(along > 1e-9, along, np.nan)
        nearer = (way > 0.0) & (way < distance)
        distance[nearer], incidence[nearer], wall[nearer] = way[nearer], np.rad2deg(np.arccos(along[nearer])), number
    return distance, incidence, wall


class Room:
    """The room as something that rays can be cast against."""

    velocities_m_s: dict[int, tuple[float, float, float]] = {}  # noqa: RUF012

    def cast(self, rays: Rays, *, moving: Any = None, max_range_m: float = 300.0) -> Hits:
        """What rays meet in the room."""
        distance, incidence, wall = room(rays.origin_m, rays.direction)
        return Hits(distance, np.ones(len(rays), dtype=np.int32), wall, incidence, np.zeros((len(rays), 3)))


def in_room(beams: Beams, layer: IndexArray | None = None, point: IndexArray | None = None) -> IdealScan:
    """What beams meet in the room, all of them or those of these numbers."""
    if layer is None or point is None:
        layer, point = beams.every()
    origins = beams.origins_m(layer, point)
    origins = np.zeros((len(layer), 3)) if origins is None else origins
    distance, incidence, wall = room(origins, beams.directions(layer, point))
    return IdealScan(layer, point, distance, np.ones(len(layer), dtype=int), incidence, object_id=wall, beams=beams)
