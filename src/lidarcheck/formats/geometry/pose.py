"""The rigid pose that brings points onto their beams: where a cloud stands in another frame than the sensor's."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray

__all__ = ["MovingPose", "angles_of", "fit_moving_pose", "fit_pose"]

_ROUNDS = 30
"""Steps of the refinement; it ends sooner where nothing moves."""
_TRIM = 3.0
"""Rows farther off than so many medians say nothing of the pose: in a mixed file they belong to something else."""


def _fit_rotation(direction: FloatArray, position: FloatArray) -> FloatArray:
    """The rotation matrix that turns positions, shape (n, 3), best onto directions, shape (n, 3)."""
    unit = position / np.linalg.norm(position, axis=1)[:, None]
    u, _, vt = np.linalg.svd(direction.T @ unit)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def fit_pose(
    direction: FloatArray, position: FloatArray, origin: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """The rotation, shape (3, 3), and move [m], shape (3,), that bring positions onto the directions' rays.

    All inputs have shape (n, 3); `origin`: where the rays start, None for all at 0. Starts at the linear solution of
    cross(direction, R p + t) = 0 and at the best rotation alone; the better of the two after refinement.
    """
    starts = [(_fit_rotation(direction, position), np.zeros(3))]
    linear = _linear(direction, position)
    if linear is not None:
        starts.append(linear)
    fits = [_refined(direction, position, *start, origin) for start in starts]
    return min(fits, key=lambda fit: float(np.median(_off(direction, position, fit[0], fit[1], origin)[0])))


@dataclass(frozen=True)
class MovingPose:
    """A pose in the middle of the sweep, and how it changes over the whole of it.

    `turn` (3, 3), `move` [m]; `turning` [rad], `moving` [m], shape (3,): from its first moment to its last.
    """

    turn: FloatArray
    move: FloatArray
    turning: FloatArray
    moving: FloatArray

    def placed(self, position: FloatArray, share: FloatArray) -> FloatArray:
        """Points, shape (n, 3), where the sensor saw them; `share` (n,): of the sweep, -0.5 to 0.5."""
        fixed = position @ self.turn.T + self.move
        angle = float(np.linalg.norm(self.turning))
        axis = self.turning / angle if angle > 1e-15 else np.array([0.0, 0.0, 1.0])
        by = (angle * share)[:, None]
        along = np.cross(axis, fixed)
        turned = fixed + np.sin(by) * along + (1.0 - np.cos(by)) * np.cross(axis, along)
        return np.asarray(turned + self.moving * share[:, None])


def fit_moving_pose(
    direction: FloatArray, position: FloatArray, share: FloatArray, origin: FloatArray | None = None
) -> MovingPose:
    """The pose, changing at constant rates over the sweep, that brings positions onto the directions' rays.

    `direction`, `position`, `origin`: shape (n, 3); `share` (n,): of the sweep, -0.5 to 0.5.
    """
    turn, move = fit_pose(direction, position, origin)
    found = MovingPose(turn, move, np.zeros(3), np.zeros(3))
    for _ in range(_ROUNDS):
        placed = found.placed(position, share) - (0.0 if origin is None else origin)
        off, unit, range_m = _beside(direction, placed)
        near = off <= max(_TRIM * float(np.median(off)), 1e-9)
        u, p, r, s = direction[near], unit[near], range_m[near], share[near]
        slopes = _slopes(u, p, r)
        both = np.concatenate([slopes, slopes * s[:, None, None]], axis=-1).reshape(-1, 12)
        step = np.linalg.lstsq(both, -np.cross(u, p).ravel(), rcond=1e-10)[0]
        small = _turned(step[:3])
        found = MovingPose(
            small @ found.turn, small @ found.move + step[3:6], found.turning + step[6:9], found.moving + step[9:]
        )
        if float(np.max(np.abs(step))) < 1e-10:
            break
    return found


def angles_of(matrix: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch and yaw [deg] of Rz(yaw) Ry(pitch) Rx(roll)."""
    pitch = math.asin(float(np.clip(-matrix[2, 0], -1.0, 1.0)))
    if abs(matrix[2, 0]) > 1.0 - 1e-12:
        # Straight up: roll and yaw turn about one axis.
        return 0.0, math.degrees(pitch), math.degrees(math.atan2(-matrix[0, 1], matrix[1, 1]))
    roll = math.atan2(matrix[2, 1], matrix[2, 2])
    yaw = math.atan2(matrix[1, 0], matrix[0, 0])
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)


def _linear(direction: FloatArray, position: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """R and t up to their scale from the null space of the rows; None where the points do not determine it."""
    scale = float(np.median(np.linalg.norm(position, axis=1)))
    points = np.column_stack([position / scale, np.ones(len(position))])
    u = direction
    zero = np.zeros_like(points)
    rows = np.concatenate(
        [
            np.concatenate([zero, -u[:, 2:] * points, u[:, 1:2] * points], axis=1),
            np.concatenate([u[:, 2:] * points, zero, -u[:, :1] * points], axis=1),
            np.concatenate([-u[:, 1:2] * points, u[:, :1] * points, zero], axis=1),
        ]
    )
    _, vectors = np.linalg.eigh(rows.T @ rows)
    solution = vectors[:, 0].reshape(3, 4)
    left, sizes, right = np.linalg.svd(solution[:, :3])
    if sizes[2] < 1e-6 * sizes[0]:
        return None
    # The sign: points lie before their beams, not behind.
    ahead = np.einsum("ij,ij->i", u, points @ solution.T)
    sign = 1.0 if float(np.median(ahead)) > 0.0 else -1.0
    turn = sign * left @ right
    if np.linalg.det(turn) < 0.0:
        return None
    return turn, sign * solution[:, 3] / float(np.mean(sizes)) * scale


def _off(
    direction: FloatArray, position: FloatArray, turn: FloatArray, move: FloatArray, origin: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How far the placed points lie off their rays (as a sine, 2 behind), the points, and their ranges."""
    placed = position @ turn.T + move
    return _beside(direction, placed if origin is None else placed - origin)


def _beside(direction: FloatArray, placed: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    range_m = np.maximum(np.linalg.norm(placed, axis=1), 1e-9)
    unit = placed / range_m[:, None]
    sine = np.linalg.norm(np.cross(direction, unit), axis=1)
    return np.where(np.einsum("ij,ij->i", direction, unit) > 0.0, sine, 2.0 - sine), unit, range_m


def _refined(
    direction: FloatArray, position: FloatArray, turn: FloatArray, move: FloatArray, origin: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Gauss-Newton on the cross products, of the rows that are not far off."""
    for _ in range(_ROUNDS):
        off, unit, range_m = _off(direction, position, turn, move, origin)
        near = off <= max(_TRIM * float(np.median(off)), 1e-9)
        u, p, r = direction[near], unit[near], range_m[near]
        residual = np.cross(u, p).ravel()
        slopes = _slopes(u, p, r).reshape(-1, 6)
        # Six equations in the place of all rows': what these cannot tell, below 1e-7 of the rest, stays as it is.
        step = np.asarray(np.linalg.lstsq(slopes.T @ slopes, -slopes.T @ residual, rcond=1e-14)[0])
        turn, move = _turned(step[:3]) @ turn, _turned(step[:3]) @ move + step[3:]
        if float(np.max(np.abs(step))) < 1e-10:
            break
    return turn, move


def _slopes(u: FloatArray, p: FloatArray, r: FloatArray) -> FloatArray:
    """How the cross products of rays and placed points change with a small turn and move, shape (n, 3, 6)."""
    # A small turn w moves the unit vector by w x p, a small move m by (m - p p.m) / r.
    by_turn = np.stack([np.cross(u, np.cross(axis, p)) for axis in np.eye(3)], axis=-1)
    by_move = np.stack(
        [np.cross(u, (axis - p * p[:, i : i + 1]) / r[:, None]) for i, axis in enumerate(np.eye(3))], axis=-1
    )
    return np.concatenate([by_turn, by_move], axis=-1)


def _turned(vector: FloatArray) -> FloatArray:
    """The rotation about a vector by its length [rad]."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)
