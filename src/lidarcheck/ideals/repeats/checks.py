"""Whether a recording is repeats of one scene at rest, seen by one sensor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.errors import InputError, UsageError
from lidarcheck.ideals.repeats.groups import Groups, jump_m
from lidarcheck.ideals.repeats.observations import Observations
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

__all__ = ["check_at_rest", "check_scans", "check_sensor", "moved_share"]

_MOST_MOVED = 0.5
_TOGETHER = 0.6
"""Frames of which so many rays agree saw one scene."""


def check_sensor(sensor: Sensor) -> None:
    """Refuse a sensor whose rays come with each scan: none of them is fired again."""
    if not sensor.beams.lattice:
        what = f"{sensor.name} fires other rays in every scan: there are no repeats of a ray"
        raise UsageError(what, fix="use ideal from-snippet or ideal from-map")


def check_scans(names: Sequence[str], scans: Sequence[Scan], sensor: Sensor) -> None:
    """Refuse too few frames, an empty one, and frames that report different things."""
    if len(scans) < 2:
        what = f"{len(scans)} frame{'' if len(scans) == 1 else 's'}: one frame has no repeats"
        raise UsageError(what, fix="give two frames or more of a scene at rest; three or more for a verdict")
    for name, scan in zip(names, scans, strict=True):
        if not len(scan):
            raise InputError("holds no echo", file=name, fix="leave it out")
    features = [{f.name for f in sensor.features} & set(scan.feature_names) for scan in scans]
    for name, own in zip(names, features, strict=True):
        if own != features[0]:
            what = f"reports {_listed(own)}, and {names[0]} {_listed(features[0])}: they are of two sensors or settings"
            raise InputError(what, file=name, fix="give frames of one sensor with one setting")


def check_at_rest(names: Sequence[str], seen: Observations, groups: Groups, gaps_m: FloatArray) -> float:
    """The share of the rays that moved; refused where it is more than half, with what moved and how far."""
    moved, far_m = moved_share(seen, groups)
    if moved <= _MOST_MOVED:
        return moved
    agree = _agreement(seen)
    groups_of = _one_after_another(agree)
    if groups_of is not None:
        first, second = (", ".join(names[k] for k in rows) for rows in groups_of)
        what = f"two recordings in one: {first} agree among themselves, and {second}, but not with each other"
        raise UsageError(what, fix="name the frames of one sensor and place alone")
    what = (
        f"nothing stands still: {100.0 * moved:.0f} % of the rays that see something moved, by {far_m:.2g} m (median)"
    )
    raise UsageError(what, fix="record with sensor and scene at rest, or use ideal from-map with poses")


def moved_share(seen: Observations, groups: Groups) -> tuple[float, float]:
    """Of the rays seen twice or more, the share without a range that comes again, and their median move [m]."""
    twice = groups.seen >= 2
    moved = twice & (groups.row < 0)
    if not twice.any():
        return 1.0, float("nan")
    ray, place = seen.ray, seen.path_m
    first = np.flatnonzero(np.concatenate(([True], ray[1:] != ray[:-1])))
    last = np.append(first[1:], len(ray)) - 1
    span = np.full(len(seen.rays), np.nan)
    span[ray[first]] = place[last] - place[first]
    far = float(np.median(span[moved])) if moved.any() else 0.0
    return float(moved.sum() / twice.sum()), far


def _agreement(seen: Observations) -> FloatArray:
    """Of the rays that two frames both see, the share whose nearest ranges agree, shape (frames, frames)."""
    nearest = np.full((seen.frames, len(seen.rays)), np.nan)
    nearest[seen.frame[::-1], seen.ray[::-1]] = seen.path_m[::-1]
    found = np.eye(seen.frames)
    for i in range(seen.frames):
        for j in range(i):
            both = np.isfinite(nearest[i]) & np.isfinite(nearest[j])
            a, b = nearest[i][both], nearest[j][both]
            found[i, j] = found[j, i] = float(np.mean(np.abs(a - b) < jump_m(np.minimum(a, b)))) if len(a) else 0.0
    return found


def _one_after_another(agree: FloatArray) -> tuple[list[int], list[int]] | None:
    """Two sets of frames that agree within themselves and not with each other; None where there are none."""
    with_first: BoolArray = agree[0] >= _TOGETHER
    first, second = np.flatnonzero(with_first), np.flatnonzero(~with_first)
    if len(first) < 2 or len(second) < 2:
        return None
    within = min(agree[np.ix_(rows, rows)].min() for rows in (first, second))
    across = agree[np.ix_(first, second)].max()
    if within < _TOGETHER or across >= _TOGETHER:
        return None
    return first.tolist(), second.tolist()


def _listed(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "ranges alone"
