"""Beams of sensors, written from the formulas of the sensor description alone, and scans of a room that they see."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lidarcheck.sensor.channels import ChannelBeams
from lidarcheck.sensor.channels import Channels as RealChannels
from lidarcheck.sensor.sweep import Sweep


@dataclass(frozen=True)
class Channels:
    """Channels of a turning head, as the interface of a sensor's beams has them."""

    elevation: np.ndarray
    offset: np.ndarray | float = 0.0
    fire_us: np.ndarray | float = 0.0
    origin: np.ndarray | float = 0.0
    side: np.ndarray | float = 0.0
    height: np.ndarray | float = 0.0
    range_offset: np.ndarray | float = 0.0
    first: float = 0.0
    step: float = 0.2
    points: int = 1800
    rate_hz: float = 10.0
    fire_turns: bool = True
    repeats: bool = True
    phase: float = 0.0
    column_shift: np.ndarray | int = 0
    ring: tuple[int, ...] = ()

    @property
    def layers(self) -> int:
        return len(self.elevation)

    @property
    def column_s(self) -> float:
        return 1.0 / self.rate_hz / self.points if self.repeats else abs(self.step) / 360.0 / self.rate_hz

    def with_phase(self, deg: float) -> Channels:
        return replace(self, phase=deg)

    def _of(self, value: Any, layer: Any) -> np.ndarray:
        return np.broadcast_to(np.asarray(value, dtype=float), (self.layers,))[np.asarray(layer)]

    def _column_deg(self, layer: Any, point: Any) -> np.ndarray:
        theta = self.first + self.phase + np.asarray(point) * self.step
        if self.fire_turns:
            theta = theta + self.step / self.column_s * 1e-6 * self._of(self.fire_us, layer)
        return theta

    def angles_deg(self, layer: Any, point: Any) -> tuple[np.ndarray, np.ndarray]:
        return self._of(self.elevation, layer), self._column_deg(layer, point) + self._of(self.offset, layer)

    def directions(self, layer: Any, point: Any) -> np.ndarray:
        up, around = (np.deg2rad(a) for a in self.angles_deg(layer, point))
        return np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)

    def origins_m(self, layer: Any, point: Any) -> np.ndarray | None:
        psi = np.deg2rad(self._column_deg(layer, point))
        a, b, h = (self._of(v, layer) for v in (self.origin, self.side, self.height))
        out = np.stack([a * np.cos(psi) - b * np.sin(psi), a * np.sin(psi) + b * np.cos(psi), h], axis=-1)
        return out if out.any() else None

    def range_offset_m(self, layer: Any) -> np.ndarray:
        return self._of(self.range_offset, layer)

    def fire_time_s(self, layer: Any, point: Any) -> np.ndarray:
        return np.asarray(point) * self.column_s + 1e-6 * self._of(self.fire_us, layer)

    def beams(self, phase: float = 0.0) -> ChannelBeams:
        """The same as a sensor's file would say it."""
        values = (self.elevation, self.offset, self.origin, self.side, self.height, self.range_offset, self.fire_us)
        floats = [tuple(self._of(value, np.arange(self.layers)).tolist()) for value in values]
        ring = tuple(self.ring) or tuple(range(self.layers))
        shift = tuple(self._of(self.column_shift, np.arange(self.layers)).astype(int).tolist())
        direction: Any = "left" if self.step > 0 else "right"
        sweep = Sweep("columns", 1.0 / self.rate_hz, direction, fire_time_in_azimuth=self.fire_turns)
        span = self.step * self.points if self.repeats else float(np.copysign(360.0, self.step))
        heads = RealChannels(*floats, ring, shift)
        return ChannelBeams(sweep, heads, self.first, span, self.step, self.repeats, phase)

    def positions_m(self, layer: Any, point: Any, range_m: np.ndarray) -> np.ndarray:
        path = np.asarray(range_m) - self.range_offset_m(layer)
        out = self.directions(layer, point) * path[:, None]
        origin = self.origins_m(layer, point)
        return out if origin is None else out + origin


VLP16 = Channels(
    elevation=np.arange(-15.0, 16.0, 2.0), fire_us=2.304 * np.arange(16), step=-0.2, first=0.0, points=1800
)
OUSTER = Channels(
    elevation=np.linspace(20.0, -20.0, 32), offset=np.tile([-4.2, -1.4, 1.4, 4.2], 8), origin=0.0167, height=0.038,
    range_offset=0.0167, first=180.0, step=-360.0 / 1024, points=1024, column_shift=np.tile([12, 4, -4, -12], 8),
)  # fmt: skip
HDL32 = Channels(
    elevation=np.linspace(-30.67, 10.67, 32), fire_us=1.152 * np.r_[0:32:2, 1:32:2], fire_turns=False, repeats=False,
    first=0.0, step=-0.165888, points=2170,
)  # fmt: skip


def room_ranges(direction: np.ndarray, half_m: tuple[float, float] = (9.0, 14.0)) -> np.ndarray:
    """How far a room's walls, floor and ceiling lie along directions: not symmetric in any axis."""
    low, high = np.array([-half_m[0], -half_m[1], -1.7]), np.array([half_m[1], half_m[0] * 0.7, 3.1])
    with np.errstate(divide="ignore"):
        far = np.where(direction > 0, high / direction, np.where(direction < 0, low / direction, np.inf))
    return far.min(axis=1)


@dataclass(frozen=True)
class Shot:
    """One frame of a sensor in the room, rows in firing order."""

    layer: np.ndarray
    point: np.ndarray
    range_m: np.ndarray
    position: np.ndarray
    time_s: np.ndarray


def shoot(beams: Channels, *, every: int = 1, keep: float = 1.0, seed: int = 0, step_m: float = 0.004) -> Shot:
    """A frame of the room: every so many columns, a share of the rows, ranges rounded to a step."""
    point, layer = (
        a.ravel() for a in np.meshgrid(np.arange(0, beams.points, every), np.arange(beams.layers), indexing="ij")
    )
    rng = np.random.default_rng(seed)
    kept = rng.random(len(layer)) < keep
    layer, point = layer[kept], point[kept]
    path = room_ranges(beams.directions(layer, point)) + rng.normal(0.0, 0.01, len(layer))
    range_m = np.round((path + beams.range_offset_m(layer)) / step_m) * step_m
    position = beams.positions_m(layer, point, range_m).astype(np.float32).astype(float)
    return Shot(layer, point, range_m, position, beams.fire_time_s(layer, point))


def document(beams: Channels, **keys: Any) -> dict[str, Any]:
    """The sensor file of beams: what a linear detector needs at least, and `keys` besides."""
    lists = {
        "azimuth_offset_deg": beams.offset, "origin_m": beams.origin, "side_m": beams.side, "height_m": beams.height,
        "range_offset_m": beams.range_offset, "fire_time_us": beams.fire_us,
    }  # fmt: skip
    every = np.arange(beams.layers)
    span = beams.step * beams.points if beams.repeats else float(np.copysign(360.0, beams.step))
    columns: dict[str, Any] = {"columns": beams.points} if beams.repeats else {"azimuth_step_deg": abs(beams.step)}
    return {
        "name": "test head",
        "detector": "linear",
        "frame_rate_hz": beams.rate_hz,
        "sweep": {"direction": "left" if beams.step > 0 else "right", "fire_time_in_azimuth": beams.fire_turns},
        "range": {"step_m": 0.004, "max_m": 100.0},
        "linear": {"signal_at_1m": 461000.0},
        "beams": {
            "kind": "channels",
            "elevation_deg": np.asarray(beams.elevation, dtype=float).tolist(),
            **{key: beams._of(value, every).tolist() for key, value in lists.items()},
            **({"ring": list(beams.ring)} if beams.ring else {}),
            "column_shift": beams._of(beams.column_shift, every).astype(int).tolist(),
            "azimuth_deg": {"first": beams.first, "last": beams.first + span},
            "columns_repeat": beams.repeats,
            **columns,
        },
        **keys,
    }
