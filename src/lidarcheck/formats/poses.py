"""Files of poses: where a sensor stood in a map, and when.

Three layouts, told by their content: CSV with a header `x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg`, and `time` [s] and
`name` where there are such; rows of eight numbers `time x y z qx qy qz qw`, as trajectory tools write them; rows of
twelve, the upper three rows of a 4 x 4 matrix. A pose takes the sensor's frame into the map's.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.errors import InputError
from lidarcheck.formats.geometry.placement import MOST_DEG, POSE_NAMES, rotation
from lidarcheck.formats.source import read_text

__all__ = ["Poses", "read_poses"]

_MOST_M = 1e8
"""Country grids have coordinates of some thousand kilometres."""
_UNIT = 1e-3
"""So far a quaternion's length, or a matrix' product with its own turned one, may be from 1 by rounding."""
_QUATERNION, _MATRIX = 8, 12


@dataclass(frozen=True, eq=False)
class Poses:
    """Where a sensor stood: `turn` (n, 3, 3) and `place_m` (n, 3) take its frame into the map's.

    `time_s` (n,) ascending, counted in rows where the file has none; `timed`: whether it has. `names`: of each, or "".
    """

    turn: FloatArray
    place_m: FloatArray
    time_s: FloatArray
    names: tuple[str, ...]
    timed: bool

    def __len__(self) -> int:
        return len(self.time_s)

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`turn` (n, 3, 3) and `place_m` (n, 3) at those times, shape (n,): straight, and turning evenly, from pose to
        pose."""
        from scipy.spatial.transform import Rotation, Slerp

        inside = np.clip(time_s, self.time_s[0], self.time_s[-1])
        if len(self) == 1:
            return np.broadcast_to(self.turn[0], (len(inside), 3, 3)), np.broadcast_to(
                self.place_m[0], (len(inside), 3)
            )
        turn = Slerp(self.time_s, Rotation.from_matrix(self.turn))(inside).as_matrix()
        place = np.stack([np.interp(inside, self.time_s, self.place_m[:, i]) for i in range(3)], axis=1)
        return turn, place


def read_poses(path: str | os.PathLike[str]) -> Poses:
    """The poses of a file; `InputError` with the line for whatever is wrong with it."""
    file = Path(path)
    lines = [
        (number, line.strip())
        for number, line in enumerate(read_text(file).splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise InputError("holds no pose", file=file, fix=f"write a header {','.join(POSE_NAMES)} and a row each")
    if any(letter.isalpha() and letter not in "eE" for letter in lines[0][1]):
        return _ordered(file, *_with_header(file, lines))
    return _ordered(file, *_plain(file, lines))


_Found = tuple[list[FloatArray], list[FloatArray], list[float] | None, list[str], list[int]]


def _with_header(file: Path, lines: Sequence[tuple[int, str]]) -> _Found:
    header = [name.strip() for name in next(csv.reader(io.StringIO(lines[0][1])))]
    lacking = [name for name in POSE_NAMES if name not in header]
    if lacking:
        fix = f"name the columns {','.join(POSE_NAMES)}, and time, name where there are such"
        raise InputError(f"no column {', '.join(lacking)} of a pose", file=file, line=lines[0][0], fix=fix)
    turns, places, times, names, numbers = [], [], [], [], []
    for number, line in lines[1:]:
        cells = [cell.strip() for cell in next(csv.reader(io.StringIO(line)))]
        if len(cells) != len(header):
            what = f"has {len(cells)} cells, the header {len(header)}"
            raise InputError(what, file=file, line=number, fix="write a cell for each column")
        row = dict(zip(header, cells, strict=True))
        place = [_number(row[name], name, _MOST_M, file, number) for name in POSE_NAMES[:3]]
        angles = [_number(row[name], name, MOST_DEG, file, number) for name in POSE_NAMES[3:]]
        places.append(np.array(place))
        turns.append(rotation(*angles))
        times.append(_number(row["time"], "time", 1e12, file, number) if "time" in row else 0.0)
        names.append(row.get("name", ""))
        numbers.append(number)
    return turns, places, times if "time" in header else None, names, numbers


def _plain(file: Path, lines: Sequence[tuple[int, str]]) -> _Found:
    count = len(lines[0][1].replace(",", " ").split())
    if count not in (_QUATERNION, _MATRIX):
        what = f"the first row has {count} numbers"
        fix = f"write time x y z qx qy qz qw, or twelve of a matrix, or a header {','.join(POSE_NAMES)}"
        raise InputError(what, file=file, line=lines[0][0], fix=fix)
    turns, places, times, numbers = [], [], [], []
    for number, line in lines:
        words = line.replace(",", " ").split()
        if len(words) != count:
            what = f"has {len(words)} numbers, the first row {count}"
            raise InputError(what, file=file, line=number, fix="write the same in every row")
        row = np.array([_number(word, "a number", 1e12, file, number) for word in words])
        time, turn, place = _of_quaternion(row) if count == _QUATERNION else _of_matrix(row)
        if count == _QUATERNION:
            sound, what = abs(float(np.sum(row[4:] ** 2)) - 1.0) <= _UNIT, "the quaternion has not the length 1"
        else:
            turns_only = np.abs(turn @ turn.T - np.eye(3)).max() <= _UNIT and np.linalg.det(turn) > 0.0
            sound, what = bool(turns_only), "the matrix does not turn alone"
        if not sound:
            raise InputError(what, file=file, line=number, fix="is it time x y z qx qy qz qw, or a row of a matrix?")
        if np.abs(place).max() > _MOST_M:
            raise InputError(
                f"a place of {np.abs(place).max():g} m", file=file, line=number, fix=f"use up to {_MOST_M:g}"
            )
        turns.append(turn)
        places.append(place)
        times.append(time)
        numbers.append(number)
    return turns, places, times if count == _QUATERNION else None, [""] * len(turns), numbers


def _of_quaternion(row: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    x, y, z, w = row[4:]
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return float(row[0]), turn, row[1:4]


def _of_matrix(row: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    matrix = row.reshape(3, 4)
    return 0.0, matrix[:, :3], matrix[:, 3]


def _ordered(
    file: Path,
    turns: list[FloatArray],
    places: list[FloatArray],
    times: list[float] | None,
    names: list[str],
    numbers: list[int],
) -> Poses:
    if not turns:
        raise InputError("holds no pose below its header", file=file, fix="write a row for each pose")
    taken: set[str] = set()
    for name, number in zip(names, numbers, strict=True):
        if name and (name in taken or name != Path(name).name or name.startswith(".")):
            what = f"the name {name!r} {'stands twice' if name in taken else 'is no name of a file'}"
            raise InputError(what, file=file, line=number, fix="give each frame a name of its own")
        taken.add(name)
    time_s = np.arange(len(turns), dtype=np.float64) if times is None else np.array(times)
    back = np.flatnonzero(np.diff(time_s) <= 0.0)
    if len(back):
        raise InputError(
            "is not later than the pose before", file=file, line=numbers[int(back[0]) + 1], fix="sort by time"
        )
    return Poses(np.array(turns), np.array(places), time_s, tuple(names), times is not None)


def _number(text: str, name: str, most: float, file: Path, line: int) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= most:
        raise InputError(f"{name} is {text!r}", file=file, line=line, fix=f"write a number from -{most:g} to {most:g}")
    return value
