"""Static transforms of a bag: from the frame that a cloud is in to the sensor's own.

A driver publishes clouds in its sensor's frame, and then nothing is transformed. Where a cloud is in a frame of the
vehicle, and the bag says where on it the sensor is, it is taken back.

Source for the vehicle's frames: REP 105, "Coordinate Frames for Mobile Platforms".
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.formats.field.cursor import Cursor

__all__ = ["VEHICLE_FRAMES", "Tree", "read_transforms", "sensor_frames"]

VEHICLE_FRAMES = ("base_link", "base_footprint", "base", "vehicle", "ego_vehicle", "odom", "map", "world", "earth")
_OF_A_LIDAR = re.compile("lidar|laser|velodyne|ouster|os_sensor|hesai|pandar|livox|robosense|innoviz|aeva|luminar")
_MOST_TRANSFORMS = 100_000


@dataclass(frozen=True)
class _Step:
    """Takes positions of a child's frame into its parent's: p = rotation · p_child + move."""

    parent: str
    rotation: FloatArray
    move: FloatArray


class Tree:
    """The static transforms of a bag, by the frame that each places."""

    def __init__(self) -> None:
        self.steps: dict[str, _Step] = {}

    def add(self, child: str, step: _Step) -> None:
        """Place a frame; of several the last one holds."""
        self.steps[child] = step

    def between(self, source: str, target: str) -> tuple[FloatArray, FloatArray] | None:
        """Rotation (3, 3) and move (3,) from one frame into another; None where nothing joins them."""
        up, down = self._to_root(source), self._to_root(target)
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            return None
        rotation, move = up[common]
        other, shift = down[common]
        return other.T @ rotation, other.T @ (move - shift)

    def below(self, frame: str) -> list[str]:
        """The frames that stand on another one, directly or not."""
        return sorted(child for child in self.steps if child != frame and frame in self._to_root(child))

    def _to_root(self, frame: str) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Rotation and move into each frame above, the frame itself first."""
        found = {frame: (np.eye(3), np.zeros(3))}
        while frame in self.steps:
            rotation, move = found[frame]
            step = self.steps[frame]
            if step.parent in found:  # a circle
                break
            found[step.parent] = (step.rotation @ rotation, step.rotation @ move + step.move)
            frame = step.parent
        return found


def read_transforms(tree: Tree, content: bytes, encoding: str, path: Path) -> None:
    """Add what a `tf2_msgs/TFMessage` says."""
    cursor = Cursor(content, encoding, path)
    count = cursor.whole()
    if count > _MOST_TRANSFORMS:
        raise cursor.fault(f"it says that it holds {count} transforms")
    for _ in range(count):
        _, parent = cursor.head()
        child = cursor.text()
        numbers = np.array(cursor.values("ddddddd"), dtype=np.float64)
        length = float(np.sqrt(np.sum(numbers[3:] ** 2)))
        if not np.isfinite(numbers).all() or length == 0.0:
            raise cursor.fault(f"the transform of {child} is none")
        tree.add(_plain(child), _Step(_plain(parent), _rotation(numbers[3:] / length), numbers[:3]))


def sensor_frames(tree: Tree, frame: str) -> list[str]:
    """Frames on a vehicle's frame whose name says that they are a lidar's; none of a frame that is no vehicle's."""
    if _plain(frame) not in VEHICLE_FRAMES:
        return []
    return [name for name in tree.below(_plain(frame)) if _OF_A_LIDAR.search(name.casefold())]


def _plain(frame: str) -> str:
    return frame.lstrip("/")


def _rotation(quaternion: FloatArray) -> FloatArray:
    """Of a unit quaternion x, y, z, w; shape (3, 3)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
