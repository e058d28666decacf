"""Lists of numbers of an effect, read off what a fit with it leaves over.

A fit moves the numbers of an effect, and a list of them, a gain for every layer, only as a whole. The list was read off
the case's own model, whose echoes are farther from the measured ones than those of the fit. A walk is fitted as a curve
of two or three numbers, and a fall-off with incidence by a power, which the sensor's own is not quite.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.incidence_falloff import STEP_DEG
from lidarcheck.effects.walk_error import QUARTERS, WalkError
from lidarcheck.explain.search.located import Dimming, dimming_of, gains_of_layers
from lidarcheck.explain.search.starts import Probe
from lidarcheck.inference.gauss_newton import Fit, fit
from lidarcheck.inference.pairing import FEATURES, Observations
from lidarcheck.inference.simulator import Simulator

__all__ = ["read_again"]

FloatArray = npt.NDArray[np.float64]

_SEEDS, _MOST = 3, 3
_LEAST = 0.02
"""A list that comes nearer by a smaller part of the distance is not worth a further reading."""
_FOLLOW = {"layer_gain": 0, "walk_error": 2, "incidence_falloff": 2}
"""Steps by which the other numbers follow, the curve's own and those of other effects, which had made up for what the
curve has not; the gain of layers is but a factor on their list."""
_KNOTS, _ANGLES = 4 * QUARTERS + 1, round(90.0 / STEP_DEG) + 1
_BESIDES = 0.3
"""A table is what an effect's curve has not quite: no more than this part of the span of the curve itself."""
_CLIP_M, _RIDGE, _BENT = 1.0, 0.5, 20.0
"""Single ranges farther off say no more than this; a knot is held at 0 as firmly as by so many beams, and on a straight
line between its neighbours as by so many: other frames have beams where these have none."""
_RANGE, _AREA = FEATURES.index("range"), FEATURES.index("area")


def read_again(simulator: Simulator, now: Fit) -> Fit:
    """The fit with its lists read again, where that comes nearer once the other numbers have followed."""
    for place, probe in enumerate(now.probes):
        if probe.name not in _READERS or (probe.name == "layer_gain" and "gains" not in probe.settings):
            continue
        for _ in range(_MOST):
            probes = (*now.probes[:place], _read(simulator, now, place), *now.probes[place + 1 :])
            found = fit(simulator, probes, now.x, rounds=_FOLLOW[probe.name], nuisance=now.nuisance)
            if not found.distance < (1.0 - _LEAST) * now.distance:
                break
            now = found if found.jacobian is not None else replace(found, jacobian=now.jacobian)
    return now


def _read(simulator: Simulator, now: Fit, place: int) -> Probe:
    """The probe with its list read off what the fit leaves over."""
    model = now.model(simulator.model)
    shown = [simulator.observations(model, 400 + k, now.nuisance) for k in range(_SEEDS)]
    probe = now.probes[place]
    name, reader = _READERS[probe.name]
    return replace(probe, settings={**probe.settings, name: reader(simulator, shown, probe, now.x[place])})


def _dimming(simulator: Simulator, shown: list[Observations]) -> Dimming:
    """The gain that each beam's echo still asks for."""
    count = np.sum([one.detected for one in shown], axis=0)
    log_area = np.sum([np.where(one.detected, one.feature[:, _AREA], 0.0) for one in shown], axis=0)
    return dimming_of(simulator, log_area / np.maximum(count, 1), count == len(shown))


def _gains(simulator: Simulator, shown: list[Observations], probe: Probe, _x: FloatArray) -> tuple[float, ...]:
    """Each layer's gain times what the layer's echoes still ask for; these frames may have other layers than those that
    the list was read off first."""
    layers, place = np.unique(simulator.beams.layer, return_inverse=True)
    more = gains_of_layers(layers, *_dimming(simulator, shown).mean(place, len(layers)))
    gains = np.asarray(probe.settings["gains"])
    at = int(probe.fixed["first_layer"]) - int(layers[0]) + np.arange(len(gains))
    own = np.where((at >= 0) & (at < len(more)), more[np.clip(at, 0, len(more) - 1)], 1.0)
    return tuple(np.round(np.clip(gains * own, 0.0, 10.0), 3).tolist())


def _shifts(simulator: Simulator, shown: list[Observations], probe: Probe, x: FloatArray) -> tuple[float, ...]:
    """The table of shifts with what the ranges still ask for at each amplitude, within limits.

    Of measured echoes the mean range at an AREA is taken, and of simulated ones that at their own AREA: the photons of
    an echo that is brighter by chance also come earlier.
    """
    means = [_range_by_area(simulator, one) for one in shown]
    more = _range_by_area(simulator, simulator.measured_sights) - np.mean(means, axis=0)
    curve = WalkError(**{**probe.effect(x).settings(), "shifts_m": ()})
    log_area = simulator.measured_sights.feature[simulator.measured_sights.detected, _AREA]
    seen = np.quantile(log_area, [0.01, 0.99]) if len(log_area) else np.zeros(2)
    most = _BESIDES * float(np.ptp(curve.shift_m(np.exp(seen))))
    table = np.asarray(probe.settings.get("shifts_m") or np.zeros(_KNOTS)) + more
    return tuple(np.round(np.clip(table, -most, most), 4).tolist())


def _range_by_area(simulator: Simulator, shown: Observations) -> FloatArray:
    """The ranges' residuals [m] at each of the table's amplitudes, by least squares, shape (_KNOTS,)."""
    expected = simulator.summaries.expected
    used = np.flatnonzero(shown.detected & expected.known & ~expected.at_edge)
    quarters = np.clip(QUARTERS * shown.feature[used, _AREA] / np.log(10.0), 0.0, _KNOTS - 1.0)
    off_m = np.clip(shown.feature[used, _RANGE], -_CLIP_M, _CLIP_M)
    return _at_knots(quarters, off_m, 1.0 / np.maximum(expected.spread[used, _RANGE], 1e-3) ** 2, _KNOTS)


def _factors(simulator: Simulator, shown: list[Observations], probe: Probe, x: FloatArray) -> tuple[float, ...]:
    """The table of factors times what surfaces still ask for at each incidence, within limits."""
    dimming, beams = _dimming(simulator, shown), simulator.beams
    used = np.flatnonzero((dimming.weight > 0.0) & ~beams.retro & ~simulator.summaries.expected.at_edge)
    step = np.clip(beams.incidence_deg[used] / STEP_DEG, 0.0, _ANGLES - 1.0)
    more = _at_knots(step, dimming.log_gain[used], dimming.weight[used], _ANGLES)
    seen = np.quantile(beams.incidence_deg[used], [0.01, 0.99]) if len(used) else np.zeros(2)
    law = probe.effect(x).settings()
    cosine = np.cos(np.deg2rad(np.minimum(seen, law["level_from_deg"])))
    most = _BESIDES * abs(law["exponent"] - 1.0) * float(np.ptp(np.log(np.maximum(cosine, 1e-3))))
    table = np.log(np.asarray(probe.settings.get("factors") or np.ones(_ANGLES))) + more
    return tuple(np.round(np.exp(np.clip(table, -most, most)), 4).tolist())


def _at_knots(place: FloatArray, value: FloatArray, weight: FloatArray, knots: int) -> FloatArray:
    """The numbers at the places 0, 1, ... between which straight lines come nearest to values, shape (knots,)."""
    hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(knots)), 0.0)
    one = float(np.median(weight)) if len(weight) else 1.0
    bends = np.diff(np.eye(knots), 2, axis=0)
    curvature = hats.T @ (weight[:, None] * hats) + one * (_RIDGE * np.eye(knots) + _BENT * bends.T @ bends)
    return np.asarray(np.linalg.solve(curvature, hats.T @ (weight * value)))


_READERS = {
    "layer_gain": ("gains", _gains), "walk_error": ("shifts_m", _shifts), "incidence_falloff": ("factors", _factors),
}  # fmt: skip
"""The list that each effect has, and what reads it."""
