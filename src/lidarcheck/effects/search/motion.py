"""What a search must know of `motion`: a sensor that drives, or objects that move each on its own."""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.geometry.aiming import rays_of
from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence
from lidarcheck.effects.search.residuals import NOISE_M, best_factors, range_residuals

__all__ = ["driving_ahead"]


_USUAL_SPEEDS = (20.0, 5.0, 1.0, 30.0)
"""Speeds ahead, to the left and up [m/s] and to the left [deg/s] that are no surprise."""
_FEWEST_OF_ONE, _SURE = 20, 4.0
"""So many beams of an object tell its speed, which must be so many of its standard errors."""
_MOST_OF_ONE, _MOST_OF_ALL = 0.4, 0.5
"""What more of all beams see is no car, but the ground or a wall; and if more than half of all that is seen seems to
move, the sensor does."""
_MOST_OBJECTS, _USUAL_CAR_M_S = 6, 8.0
_FORWARD, _LEFT = FreeParameter("forward_m_s", 1.0), FreeParameter("left_m_s", 1.0)
_FREE = (_FORWARD, _LEFT, FreeParameter("up_m_s", 0.5), FreeParameter("yaw_deg_s", 2.0))


def _starts(evidence: Evidence) -> list[Probe]:
    """A speed, and those of several objects, each at its best."""
    found = range_residuals(evidence)
    if found is None:
        return []
    used, residual = found
    per_speed = _per_speed(evidence)[used]
    return _driving(per_speed, residual) + _traffic(per_speed, residual, evidence.beams.object_id[used])


def _driving(per_speed: FloatArray, residual: FloatArray) -> list[Probe]:
    """A sensor that drives ahead, and one that moves and turns, as ranges have changed when each column is fired."""
    forward = _ahead(per_speed, residual)
    if forward is None:
        return []
    speeds = (forward, best_factors(per_speed, residual, _USUAL_SPEEDS))
    return [Probe("motion", _settings(one), _FREE) for one in speeds if one.any()]


def driving_ahead(evidence: Evidence, offset_m: float) -> Probe | None:
    """A sensor that drives ahead so fast that ranges are longer by an offset in the middle of the frame; None where no
    beam looks ahead."""
    per_speed = _per_speed(evidence)
    forward = _ahead(per_speed, np.full(len(per_speed), offset_m))
    return None if forward is None else Probe("motion", _settings(forward), _FREE)


def _ahead(per_speed: FloatArray, residual: FloatArray) -> FloatArray | None:
    """The speeds of a sensor that only drives ahead, which explain most beams' residuals; None where none looks so."""
    ahead = per_speed[:, 0] < 0.0
    if not ahead.any():
        return None
    return np.array([float(np.median(residual[ahead] / per_speed[ahead, 0])), 0.0, 0.0, 0.0])


def _settings(speeds: FloatArray) -> dict[str, float]:
    limited = np.clip(speeds, [-60.0, -60.0, -60.0, -100.0], [60.0, 60.0, 60.0, 100.0])
    return dict(zip((one.name for one in _FREE), limited.tolist(), strict=True))


def _traffic(per_speed: FloatArray, residual: FloatArray, object_id: IndexArray) -> list[Probe]:
    """Objects that move each on its own, as the ranges of each have changed when its columns are fired."""
    per_speed = -per_speed[:, :1]
    speeds: dict[int, float] = {}
    moving = 0
    for number in np.unique(object_id[object_id >= 0]):
        mine = (object_id == number) & (per_speed[:, 0] != 0.0)
        if not _FEWEST_OF_ONE <= np.count_nonzero(mine) <= _MOST_OF_ONE * len(residual):
            continue
        speed = float(best_factors(per_speed[mine], residual[mine], _USUAL_SPEEDS[:1])[0])
        off = np.abs(residual[mine] - per_speed[mine, 0] * speed)
        error = max(1.5 * float(np.median(off)), NOISE_M) / float(np.sqrt(np.sum(per_speed[mine] ** 2)))
        if abs(speed) > _SURE * error:
            speeds[int(number)] = round(float(np.clip(speed, -60.0, 60.0)), 2)
            moving += int(np.count_nonzero(mine))
    if len(speeds) < 2 or moving > _MOST_OF_ALL * len(residual):
        return []
    settings = {"forward_m_s": 0.0, "objects": 1.0, "movers": (*speeds,), "movers_forward_m_s": (*speeds.values(),)}
    return [Probe("motion", settings, (FreeParameter("objects", 0.1),), {}, "several objects")]


def _per_speed(evidence: Evidence) -> FloatArray:
    """How each beam's range changes per 1 m/s ahead, to the left and up and per 1 deg/s to the left, from the ideal
    scan's time to the beam's; (n, 4)."""
    found = np.zeros((len(evidence.beams), 4))
    for number, ideal in enumerate(evidence.ideals):
        passed_s = ideal.beams.fire_time_s(ideal.layer, ideal.point) - (0.0 if ideal.time_s is None else ideal.time_s)
        rows = evidence.rows_of(number, ideal.layer, ideal.point)
        there, place = rows >= 0, rows[rows >= 0]
        found[place, :3] = -passed_s[there, None] * rays_of(ideal).direction[there]
        found[place, 3] = passed_s[there] * evidence.beams.slope_m_per_deg[place, 1]
    return found


def _starts_of_each(evidence: Evidence) -> list[Probe]:
    """Objects that have a number may move on their own."""
    numbered = evidence.beams.object_id[evidence.beams.object_id >= 0]
    ids, counts = np.unique(numbered, return_counts=True)
    return [
        Probe(
            "motion",
            {"forward_m_s": _USUAL_CAR_M_S * sign, "left_m_s": 0.0},
            (_FORWARD, _LEFT),
            {"object_id": int(number)},
        )
        for number in ids[np.argsort(-counts)][:_MOST_OBJECTS]
        for sign in (1.0, -1.0)
    ]


SPEC = SearchSpec(
    "motion",
    free=_FREE,
    fixed_starts=(
        {"forward_m_s": 12.0},
        {"forward_m_s": -12.0},
        {"forward_m_s": 0.0, "left_m_s": 10.0},
        {"forward_m_s": 0.0, "left_m_s": -10.0},
        {"forward_m_s": 0.0, "yaw_deg_s": 25.0},
        {"forward_m_s": 0.0, "yaw_deg_s": -25.0},
    ),
    starts=_starts,
    starts_of_each=_starts_of_each,
    order=9,
    amounts=("forward_m_s", "left_m_s", "up_m_s", "yaw_deg_s", "objects"),
    groups=frozenset({"ranges", "aim"}),
    lasting_case_of="vibration",  # a view that wanders follows any turn that lasts
    read_lists=("movers",),
    in_repeats=True,
    watched_by=("range_residual_per_point", "range_residual_mean", "range_noise"),
    shown_by=("range", "point"),
)
