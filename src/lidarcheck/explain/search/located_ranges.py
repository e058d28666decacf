"""Starts for what shifts ranges, read off the paired range residuals: over the amplitude, the range, surfaces' slopes
and the sweep, or all alike."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.geometry.aiming import rays_of
from lidarcheck.effects.walk_error import LARGEST_REFERENCE
from lidarcheck.explain.search.starts import FreeParameter, Probe, free_of
from lidarcheck.inference.beam_table import key_of
from lidarcheck.inference.simulator import Simulator
from lidarcheck.rays import sweep_time_s

__all__ = ["driving_instead", "range_probes"]

FloatArray = npt.NDArray[np.float64]

_BINS = 24
_FEWEST = 200
"""Fewer beams than this do not show a curve."""
_POWERS = (-1.0, -0.5, 0.5)
_TRIMMED, _NOISE_M = 3, 0.01
_USUAL_SPEEDS, _USUAL_ANGLES = (20.0, 5.0, 1.0, 30.0), (0.3, 0.3)
"""Speeds ahead, to the left and up [m/s] and to the left [deg/s], and angles [deg], that are no surprise."""
_FEWEST_OF_ONE, _SURE = 20, 4.0
"""So many beams of an object tell its speed, which must be so many of its standard errors."""
_MOST_OF_ONE, _MOST_OF_ALL = 0.4, 0.5
"""What more of all beams see is no car, but the ground or a wall; and if more than half of all that is seen seems to
move, the sensor does."""
_REFERENCE = FreeParameter("reference_area", 0.5, log=True)


def range_probes(simulator: Simulator, names: Collection[str]) -> list[Probe]:
    """A walk as a curve in log AREA and as a power of it, a scale, an offset, an aim, a speed: each at its best."""
    used, residual = _range_residuals(simulator)
    if len(residual) < _FEWEST:
        return []
    area, range_m = np.exp(simulator.measured_sights.feature[used, 1]), simulator.beams.distance_m[used]
    found: list[Probe] = []
    if "range_offset" in names:
        found += _of_echoes_and_light("range_offset", {"offset_m": float(np.median(residual))})
    if "range_scale" in names:
        y, x = _medians(range_m, residual)
        fraction = float(np.clip(np.sum(x * y) / np.sum(x * x), -0.05, 0.05))
        found += _of_echoes_and_light("range_scale", {"fraction": fraction})
    if "boresight" in names:
        found += _aimed(simulator)
    if "motion" in names:
        found += _driving(simulator) + _traffic(simulator)
    if "walk_error" in names:
        found += _walks(*_medians(np.log10(area), residual)[::-1])
    return found


def _of_echoes_and_light(name: str, settings: dict[str, float]) -> list[Probe]:
    """Ranges may be off because echoes are moved or because the light is, before it is counted in bins."""
    free = free_of(name)
    return [Probe(name, settings, free), Probe(name, settings, free, {"moves": "light"}, "light")]


def _driving(simulator: Simulator) -> list[Probe]:
    """A sensor that drives ahead, and one that moves and turns, as ranges have changed when each column is fired."""
    used, residual = _range_residuals(simulator)
    per_speed = _per_speed(simulator)[used]
    forward = _ahead(per_speed, residual)
    if forward is None:
        return []
    found = [_motion(speeds) for speeds in (forward, _best(per_speed, residual, _USUAL_SPEEDS)) if speeds.any()]
    return [Probe("motion", settings, free_of("motion")) for settings in found]


def driving_instead(simulator: Simulator, offset_m: float) -> Probe | None:
    """A sensor that drives ahead so fast that ranges are longer by an offset in the middle of the frame; None where no
    beam looks ahead."""
    per_speed = _per_speed(simulator)
    forward = _ahead(per_speed, np.full(len(per_speed), offset_m))
    return None if forward is None else Probe("motion", _motion(forward), free_of("motion"))


def _ahead(per_speed: FloatArray, residual: FloatArray) -> FloatArray | None:
    """The speeds of a sensor that only drives ahead, which explain most beams' residuals; None where none looks so."""
    ahead = per_speed[:, 0] < 0.0
    if not ahead.any():
        return None
    return np.array([float(np.median(residual[ahead] / per_speed[ahead, 0])), 0.0, 0.0, 0.0])


def _motion(speeds: FloatArray) -> dict[str, float]:
    limited = np.clip(speeds, [-60.0, -60.0, -60.0, -100.0], [60.0, 60.0, 60.0, 100.0])
    names = ("forward_m_s", "left_m_s", "up_m_s", "yaw_deg_s")
    return dict(zip(names, limited.tolist(), strict=True))


def _traffic(simulator: Simulator) -> list[Probe]:
    """Objects that move each on its own, as the ranges of each have changed when its columns are fired."""
    used, residual = _range_residuals(simulator)
    per_speed, object_id = -_per_speed(simulator)[used, :1], simulator.beams.object_id[used]
    speeds: dict[int, float] = {}
    moving = 0
    for number in np.unique(object_id[object_id >= 0]):
        mine = (object_id == number) & (per_speed[:, 0] != 0.0)
        if not _FEWEST_OF_ONE <= np.count_nonzero(mine) <= _MOST_OF_ONE * len(residual):
            continue
        speed = float(_best(per_speed[mine], residual[mine], _USUAL_SPEEDS[:1])[0])
        off = np.abs(residual[mine] - per_speed[mine, 0] * speed)
        error = max(1.5 * float(np.median(off)), _NOISE_M) / float(np.sqrt(np.sum(per_speed[mine] ** 2)))
        if abs(speed) > _SURE * error:
            speeds[int(number)] = round(float(np.clip(speed, -60.0, 60.0)), 2)
            moving += int(np.count_nonzero(mine))
    if len(speeds) < 2 or moving > _MOST_OF_ALL * len(residual):
        return []
    settings = {"forward_m_s": 0.0, "objects": 1.0, "movers": (*speeds,), "movers_forward_m_s": (*speeds.values(),)}
    return [Probe("motion", settings, (FreeParameter("objects", 0.1),), {}, "several objects")]


def _per_speed(simulator: Simulator) -> FloatArray:
    """How each beam's range changes per 1 m/s ahead, to the left and up and per 1 deg/s to the left, from the ideal
    scan's time to the beam's; (n, 4)."""
    found = np.zeros((len(simulator.beams), 4))
    for number, frame in enumerate(simulator.frames):
        ideal = frame.ideal
        passed_s = sweep_time_s(ideal.point) - (0.0 if ideal.time_s is None else ideal.time_s)
        place = np.searchsorted(simulator.beams.key, key_of(number, ideal.layer, ideal.point))
        found[place, :3] = -passed_s[:, None] * rays_of(ideal).direction
        found[place, 3] = passed_s * simulator.beams.slope_m_per_deg[place, 1]
    return found


def _best(per_unit: FloatArray, residual: FloatArray, usual: Sequence[float]) -> FloatArray:
    """The factors of the columns that explain the residuals best, without those that none explains; (n_columns,).

    `usual`: sizes that are no surprise, to which the data must add what goes beyond.
    """
    kept = np.ones(len(residual), dtype=bool)
    noise = _NOISE_M
    for _ in range(_TRIMMED):
        rows = np.concatenate([per_unit[kept], np.diag(noise / np.asarray(usual))])
        factors = np.asarray(np.linalg.lstsq(rows, np.append(residual[kept], np.zeros(len(usual))), rcond=None)[0])
        off = np.abs(residual - per_unit @ factors)
        noise = max(1.5 * float(np.median(off)), _NOISE_M)
        kept = off <= 2.0 * noise
    return factors


def _aimed(simulator: Simulator) -> list[Probe]:
    """A sensor that looks elsewhere, as ranges have changed along the slopes of surfaces."""
    used, residual = _range_residuals(simulator)
    pitch, yaw = np.clip(_best(simulator.beams.slope_m_per_deg[used], residual, _USUAL_ANGLES), -2.0, 2.0).tolist()
    return [Probe("boresight", {"yaw_deg": yaw, "pitch_deg": pitch}, free_of("boresight"))] if pitch or yaw else []


def _range_residuals(simulator: Simulator) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """The beams whose range the model knows well, (n_beams,), and their range residuals [m]."""
    expected, measured = simulator.summaries.expected, simulator.measured_sights
    used = measured.detected & expected.known & ~expected.at_edge & (expected.spread[:, 0] < 0.5)
    return used, measured.feature[used, 0] - expected.mean[used, 0]


def _medians(over: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Medians of the residuals and of what they are looked at over, in bins of as many beams; shapes (n_bins,)."""
    parts = np.array_split(np.argsort(over, kind="stable"), _BINS)
    return np.array([np.median(residual[p]) for p in parts]), np.array([np.median(over[p]) for p in parts])


def _walks(log_area: FloatArray, shift_m: FloatArray) -> list[Probe]:
    """The parabola and the power of AREA that go best through the shifts."""
    bend, slope, level = np.polyfit(log_area - 3.0, shift_m, 2)
    roots = np.roots([bend, slope, level])
    real = roots[np.abs(roots.imag) < 1e-9].real
    # Where the shift is zero nowhere, the nearest thing to a zero, its vertex, stands for it.
    zero = real[np.argmin(np.abs(real))] if len(real) else -slope / (2.0 * bend)
    zero = float(np.clip(zero, -3.0, 3.0))
    found = [_walk(float(slope + 2.0 * bend * zero), float(bend), 10.0 ** (3.0 + zero), 0.0, "curve")]
    best = (np.inf, 0.0, 0.0, 0.0)
    for power in _POWERS:
        basis = np.column_stack([10.0 ** (power * (log_area - 3.0)), np.ones(len(log_area))])
        (factor, constant), *_ = np.linalg.lstsq(basis, shift_m, rcond=None)
        left = float(np.sum((basis @ [factor, constant] - shift_m) ** 2))
        if left < best[0]:
            best = (left, power, float(factor), float(constant))
    _, power, factor, constant = best
    ratio = -constant / factor if factor else 0.0
    # factor (A / 1000)^q + constant is zero at A = 1000 ratio^(1 / q); without such an A it is taken far off.
    far = LARGEST_REFERENCE if power < 0.0 else 1.0
    reference = float(np.clip(1000.0 * ratio ** (1.0 / power), 1.0, LARGEST_REFERENCE)) if ratio > 0.0 else far
    per_decade = factor * (reference / 1000.0) ** power * power * np.log(10.0)
    found.append(_walk(float(per_decade), 0.0, reference, power, "power"))
    return found


def _walk(per_decade_m: float, bend_m: float, reference: float, power: float, variant: str) -> Probe:
    settings = {
        "per_decade_m": float(np.clip(per_decade_m, -2.0, 2.0)),
        "bend_m": float(np.clip(bend_m, -2.0, 2.0)),
        "reference_area": float(np.clip(reference, 1.0, LARGEST_REFERENCE)),
    }
    bends = free_of("walk_error") if power == 0.0 else free_of("walk_error")[:1]
    fixed = {"power": power} if power else {}
    return Probe("walk_error", settings, (*bends, _REFERENCE), fixed, variant)
