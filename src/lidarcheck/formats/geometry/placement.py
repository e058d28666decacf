"""What a user declares of a file's coordinates: their unit, an axis that is mirrored, the pose that turns them back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import UsageError
from lidarcheck.formats.columns import LENGTH_MAX_M, missing, real_column
from lidarcheck.formats.geometry.unit import METRES, UNITS
from lidarcheck.formats.table import Table

__all__ = ["AS_IT_IS", "AXES", "MOST_DEG", "MOST_M", "POSE_NAMES", "Placement", "Pose", "parse_pose", "rotation"]

Pose = tuple[float, float, float, float, float, float]
"""x, y, z [m], roll, pitch, yaw [deg]."""

AXES = ("x", "y", "z")
MOST_M, MOST_DEG = 1e6, 360.0
"""The farthest and the most that a pose moves and turns."""
POSE_NAMES = ("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg")
_SAME_RANGE = 0.02
"""A RANGE within so much of the distance of X, Y, Z is in their unit."""


@dataclass(frozen=True, slots=True)
class Placement:
    """How a file's coordinates become the sensor's: times the unit, one axis negated, then turned and moved.

    `pose`: x, y, z [m], roll, pitch, yaw [deg]; p = Rz(yaw) Ry(pitch) Rx(roll) p_file + t.
    """

    unit: str = "m"
    mirror: str = ""
    pose: Pose | None = None

    def __post_init__(self) -> None:
        if self.unit not in METRES:
            raise UsageError(f"there is no unit {self.unit!r}", fix=f"use {', '.join(UNITS)}")
        if self.mirror and self.mirror not in AXES:
            raise UsageError(f"there is no axis {self.mirror!r} to mirror", fix="use x, y or z")
        if self.pose is not None:
            _check_pose(self.pose)

    @property
    def moves(self) -> bool:
        """Whether anything is declared."""
        return self != AS_IT_IS

    def said(self) -> str:
        """What is declared, in words."""
        pose = "" if self.pose is None else f"the pose {','.join(f'{number:g}' for number in self.pose)}"
        mirror = f"{self.mirror} mirrored" if self.mirror else ""
        return ", ".join(part for part in (f"unit {self.unit}" if self.unit != "m" else "", mirror, pose) if part)

    def applied(self, table: Table) -> Table:
        """The table with X, Y, Z (or RANGE, without them) in the sensor's frame and in metres.

        RANGE beside X, Y, Z takes the unit where it is in theirs. `InputError` where a mirror or a pose is declared of
        a file without X, Y, Z.
        """
        if not self.moves:
            return table
        if missing(table, AXES):
            return self._ranges_only(table)
        columns = [real_column(table, name, -LENGTH_MAX_M, LENGTH_MAX_M, self.unit) for name in AXES]
        table = self._range_beside(table, columns)
        for name, column in zip(AXES, self.moved(np.stack(columns, axis=-1)).T, strict=True):
            table = table.with_column(name, np.ascontiguousarray(column))
        return table

    def moved(self, position: FloatArray) -> FloatArray:
        """Positions of the file, shape (n, 3), in the sensor's frame [m]."""
        placed = position * (METRES[self.unit] * self._signs())
        if self.pose is None:
            return placed
        return np.asarray(placed @ rotation(*self.pose[3:]).T + np.array(self.pose[:3]))

    def taken_back(self, position: FloatArray) -> FloatArray:
        """Placed positions, shape (n, 3) [m], as the file has them."""
        if self.pose is not None:
            position = (position - np.array(self.pose[:3])) @ rotation(*self.pose[3:])
        return np.asarray(position / (METRES[self.unit] * self._signs()))

    def _signs(self) -> FloatArray:
        return np.array([-1.0 if axis == self.mirror else 1.0 for axis in AXES])

    def _ranges_only(self, table: Table) -> Table:
        if self.mirror or self.pose is not None:
            what = f"a {'mirror' if self.mirror else 'pose'} is declared of a file without X, Y, Z"
            raise table.fault(what, fix="leave it out, or give X, Y, Z")
        ranges = table.get("RANGE")
        return table if ranges is None else table.with_column("RANGE", ranges * METRES[self.unit])

    def _range_beside(self, table: Table, columns: list[FloatArray]) -> Table:
        ranges = table.get("RANGE")
        if ranges is None or self.unit == "m":
            return table
        distance = np.sqrt(sum(column * column for column in columns))
        use = (distance > 0.0) & (ranges > 0)
        same = use.any() and abs(float(np.median(ranges[use] / distance[use])) - 1.0) <= _SAME_RANGE
        return table.with_column("RANGE", ranges * METRES[self.unit]) if same else table


AS_IT_IS = Placement()


def parse_pose(text: str) -> Pose:
    """A pose from six numbers with commas between: x, y, z in m, roll, pitch, yaw in degrees; else `UsageError`."""
    try:
        x, y, z, roll, pitch, yaw = (float(part) for part in text.split(","))
    except ValueError:
        what = f"the pose {text!r} is not six numbers"
        raise UsageError(what, fix='give "x,y,z,roll,pitch,yaw" in m and degrees, as "0,0,1.5,0,0,90"') from None
    _check_pose((x, y, z, roll, pitch, yaw))
    return x, y, z, roll, pitch, yaw


def rotation(roll_deg: float, pitch_deg: float, yaw_deg: float) -> FloatArray:
    """Rz(yaw) Ry(pitch) Rx(roll), shape (3, 3)."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (math.sin(a), math.cos(a)) for a in map(math.radians, (roll_deg, pitch_deg, yaw_deg))
    )
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _check_pose(pose: tuple[float, ...]) -> None:
    for name, value in zip(POSE_NAMES, pose, strict=True):
        most, unit = (MOST_M, "m") if name.endswith("_m") else (MOST_DEG, "deg")
        if not abs(value) <= most:
            raise UsageError(f"{name} = {value} of the pose is out of range", fix=f"use -{most:g} to {most:g} {unit}")
