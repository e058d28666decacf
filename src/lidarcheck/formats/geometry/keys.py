"""The keys of a configuration file by which a frame declares its measured file: `unit`, `mirror`, `pose`."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from lidarcheck.config.schema import Config
from lidarcheck.formats.geometry.placement import MOST_DEG, MOST_M, Placement

__all__ = ["PlacementKeys", "PoseTable"]


def _length() -> Any:
    return Field(0.0, ge=-MOST_M, le=MOST_M, json_schema_extra={"unit": "m"})


def _angle() -> Any:
    return Field(0.0, ge=-MOST_DEG, le=MOST_DEG, json_schema_extra={"unit": "deg"})


class PoseTable(Config):
    """A pose: what takes the file's frame into the sensor's."""

    x_m: float = _length()
    y_m: float = _length()
    z_m: float = _length()
    roll_deg: float = _angle()
    pitch_deg: float = _angle()
    yaw_deg: float = _angle()


class PlacementKeys(Config):
    """A frame's keys, where its measured file is not in metres and the sensor's frame."""

    unit: Literal["m", "mm", "cm", "ft", "in", "hm", "km"] = "m"
    mirror: Literal["x", "y", "z"] | None = None
    pose: PoseTable | None = None

    @property
    def placement(self) -> Placement:
        """What the keys declare."""
        p = self.pose
        pose = None if p is None else (p.x_m, p.y_m, p.z_m, p.roll_deg, p.pitch_deg, p.yaw_deg)
        return Placement(self.unit, self.mirror or "", pose)
