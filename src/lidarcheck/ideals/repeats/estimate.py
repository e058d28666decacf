"""One ideal scan from repeats: what each ray meets, by the frames that it is estimated from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.shared.reflectance import REFLECTANCE
from lidarcheck.ideals.repeats.amplitude import Amplitudes
from lidarcheck.ideals.repeats.errors import errors_of
from lidarcheck.ideals.repeats.groups import Groups, grouped
from lidarcheck.ideals.repeats.neighbours import at_edges, incidence_deg
from lidarcheck.ideals.repeats.observations import Observations
from lidarcheck.ideals.repeats.response import Response
from lidarcheck.ideals.repeats.signal import STRONG, WEAK_UNFIRED, Shots, signals
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import RETRO_GAIN_MAX, Sensor

__all__ = ["FREE_FROM", "Estimate", "estimated", "ideal_of"]

FREE_FROM = 9
"""A ray that so many repeats fired and none saw meets nothing."""
_NEAREST_M = 1e-3


@dataclass(frozen=True)
class Estimate:
    """What the rays meet, a row a surface; columns of shape (n,) beside those of `groups`.

    Per ray: `edge`, `free` (it meets nothing), both of shape (rays,).
    """

    groups: Groups
    distance_m: FloatArray
    distance_error_m: FloatArray
    signal: FloatArray
    signal_error: FloatArray
    margin: FloatArray
    incidence_deg: FloatArray
    edge: BoolArray
    free: BoolArray


def estimated(
    seen: Observations,
    amplitudes: Amplitudes,
    gaps_m: FloatArray,
    use: BoolArray,
    hidden: BoolArray,
    response: Response,
    sensor: Sensor,
    *,
    untold_m: float = 0.0,
) -> Estimate:
    """The estimate by the frames of `use`, without the rays that are `hidden` in them.

    `untold_m`: nearer than this amplitudes say nothing of the signal; such rays are left out, as at an edge.
    """
    groups = grouped(seen, amplitudes, gaps_m, use, hidden)
    signal, told = _signals(groups, response, seen.fired_known)
    margin = response.margin(signal)
    distance = np.maximum(groups.median_m - response.shift_m(signal), _NEAREST_M)
    scatter, error = errors_of(
        signal, response.range_sd_m(signal, distance), np.nan_to_num(groups.high - groups.low), groups.hits,
        groups.fired[groups.ray], response, sensor.range_resolution_m, fired_known=seen.fired_known,
    )  # fmt: skip
    error = error if told else np.zeros_like(error)
    place = np.full(len(seen.rays), np.nan)
    has = groups.row >= 0
    place[has] = distance[groups.row[has]]
    angle, flat = incidence_deg(seen.rays, place)
    edge: BoolArray = np.asarray(at_edges(seen.rays, place) | groups.two | (has & ~flat) | (place < untold_m))
    if not seen.fired_known:
        weak = margin < WEAK_UNFIRED
        edge[groups.ray[weak]] = True
    return Estimate(
        groups,
        distance,
        scatter,
        signal,
        error,
        margin,
        np.where(groups.main, angle[groups.ray], 0.0),
        edge,
        (groups.seen == 0) & (groups.fired >= FREE_FROM),
    )


def _signals(groups: Groups, response: Response, fired_known: bool) -> tuple[FloatArray, bool]:
    """The signal of each surface, and whether anything tells it."""
    if len(groups) and not np.isfinite(groups.amplitude).any():
        # Nothing tells amplitudes: as strong as is seen for certain.
        return np.full(len(groups), _certain(response)), False
    hits = groups.hits
    variance = np.nan_to_num(groups.amplitude_var) * (hits - 1) / np.maximum(hits, 1)
    shots = Shots(groups.fired[groups.ray], hits, groups.amplitude, variance, groups.low, groups.high, groups.capped)
    return signals(shots, response, fired_known=fired_known), True


def _certain(response: Response) -> float:
    places = np.geomspace(1e-9, 1e12, 2000)
    above = np.flatnonzero(response.margin(places) >= STRONG + 1.0)
    return float(places[above[0]]) if len(above) else float(places[-1])


def ideal_of(
    estimate: Estimate, seen: Observations, sensor: Sensor, material: int, *, frame: int | None = None,
    hidden: BoolArray | None = None,
) -> IdealScan:  # fmt: skip
    """The ideal scan of an estimate. `frame`: whose fired rays it has, else those of any; `hidden` (rays,) in it.

    Rays without a surface, and hidden ones, have a row whose distance is not known.
    """
    rays, groups = seen.rays, estimate.groups
    fired: BoolArray = np.asarray(seen.fired.any(axis=0) if frame is None else seen.fired[frame])
    left = np.zeros(len(rays), dtype=np.bool_) if hidden is None else hidden
    some = np.flatnonzero(fired[groups.ray] & ~left[groups.ray])
    bare = np.flatnonzero(fired & ((groups.row < 0) | left))
    ray = np.concatenate([groups.ray[some], bare])
    columns = _columns(estimate, some, sensor)
    unknown = np.where(estimate.free[bare] & ~left[bare], 0.0, np.nan)
    distance = np.concatenate([columns.pop("distance"), unknown])
    none = np.full(len(bare), np.nan)
    edge = np.concatenate([estimate.edge[groups.ray[some]], np.zeros(len(bare), dtype=np.bool_)])
    order = np.lexsort((np.nan_to_num(distance), ray))
    extra = {name: np.concatenate([column, none])[order] for name, column in columns.items()}
    extra["Edge"] = edge[order].astype(np.int32)
    if not rays.beams.repeats:
        extra["Azimuth0"] = np.full(len(ray), rays.beams.first_azimuth_deg)
    several = len(np.unique(groups.ray[some])) < len(some)
    incidence = np.concatenate([estimate.incidence_deg[some], np.zeros(len(bare))])[order]
    return IdealScan(
        layer=rays.layer[ray][order],
        point=rays.point[ray][order],
        distance_m=distance[order],
        material_id=np.full(len(ray), material, dtype=np.int32),
        incidence_deg=incidence,
        share=np.ones(len(ray)) if several else None,
        extra=extra,
        beams=rays.beams,
    )


def _columns(estimate: Estimate, rows: IndexArray, sensor: Sensor) -> dict[str, FloatArray]:
    """Distance, Reflectance and the errors of both, of these surfaces."""
    distance = estimate.distance_m[rows]
    cosine = np.cos(np.deg2rad(estimate.incidence_deg[rows]))
    white = sensor.signal_at_1m * cosine / (distance**2 + sensor.near_m**2)
    return {
        "distance": distance,
        REFLECTANCE: np.clip(estimate.signal[rows] / white, 0.0, RETRO_GAIN_MAX),
        "ReflectanceError": estimate.signal_error[rows] / white,
        "DistanceError": estimate.distance_error_m[rows],
    }


def with_numbers(sensor: Sensor, **numbers: float | str) -> Sensor:
    """The sensor with these numbers, none of them missing any more."""
    missing = tuple(name for name in sensor.missing if name not in numbers)
    return replace(sensor, missing=missing, **numbers)  # type: ignore[arg-type]
