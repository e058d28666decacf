"""What a search must know of `layer_gain`: a band of layers, every k-th of them, or a gain for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence, Observations
from lidarcheck.effects.search.parts import ListReader, TakeOver
from lidarcheck.sensor import PhotonHistogram

_FREE = (FreeParameter("gain", 0.05, log=True),)
_PERIODS = (2, 3, 4, 5, 6, 8)
_FEWEST = 4
_BAND = 0.8
"""A band of more of the layers is what the others are darker or brighter than."""
_MIDDLE_GAIN = 0.85
_LARGEST = 10.0
"""The largest gain of a layer that the effect can have."""


def _lines(evidence: Evidence) -> IndexArray:
    """What has a gain of its own: each beam's layer, or its zone; shape (n,)."""
    beams, sensor = evidence.beams, evidence.sensor
    return sensor.beams.index(beams.layer, beams.point) if isinstance(sensor, PhotonHistogram) else beams.layer


def _starts(evidence: Evidence) -> list[Probe]:
    """A band, every k-th layer of the whole view or of a band, by the largest contrast with the other layers."""
    layers, place = np.unique(_lines(evidence), return_inverse=True)
    if len(layers) < _FEWEST:
        return []
    gain, weight = evidence.dimming().mean(place, len(layers))
    mean = float(np.average(gain, weights=weight + 1e-9))
    gain = gain - mean
    found = []
    for sign in (1.0, -1.0):
        first, last = _best_run(sign * gain * weight, weight)
        inside = slice(first, last + 1)
        outside = np.ones(len(layers), dtype=bool)
        outside[inside] = False
        rest = np.average(gain[outside], weights=weight[outside] + 1e-9) if outside.any() else 0.0
        level = float(np.exp(np.average(gain[inside], weights=weight[inside] + 1e-9) - rest))
        band = {"first_layer": int(layers[first]), "last_layer": int(layers[last]), "every": 1}
        found.append(Probe("layer_gain", {"gain": level}, _FREE, band))
    third = max(len(layers) // 3, 1)
    middle = {"first_layer": int(layers[third]), "last_layer": int(layers[-third]), "every": 1}
    found.append(Probe("layer_gain", {"gain": _MIDDLE_GAIN}, _FREE, middle))
    return [*found, _comb(layers, gain, weight), _each_layer(layers, gain, weight, mean)]


def _each_layer(layers: IndexArray, gain: FloatArray, weight: FloatArray, mean: float) -> Probe:
    """A gain of its own for every layer, nearer to that of all where little is known of it."""
    gains = np.round(_gains_of_layers(layers, gain, weight), 3)
    place = {"first_layer": int(layers[0]), "last_layer": int(layers[-1]), "every": 1}
    settings = {"gain": float(np.exp(np.clip(mean, -3.0, 2.0))), "gains": tuple(gains.tolist())}
    return Probe("layer_gain", settings, _FREE, place, "pattern")


def _gains_of_layers(layers: IndexArray, log_gain: FloatArray, weight: FloatArray) -> FloatArray:
    """The gain of each layer from the first to the last of `layers`, ascending, by their ln gains, shape (n,); nearer
    to 1 where little is known of it; shape (last - first + 1,)."""
    scatter = max(float(np.average(log_gain**2, weights=weight + 1e-9)), 1e-6)
    shrunk = log_gain * weight / (weight + 1.0 / scatter)
    span = np.arange(layers[0], layers[-1] + 1)
    return np.asarray(np.exp(np.clip(np.interp(span, layers, shrunk), -3.0, 2.0)))


def _best_run(total: FloatArray, weight: FloatArray) -> tuple[int, int]:
    """First and last of the run whose mean stands out most: largest sum over the root of its weight."""
    sums, weights = np.concatenate([[0.0], np.cumsum(total)]), np.concatenate([[0.0], np.cumsum(weight)])
    score = (sums[None, :] - sums[:, None]) / np.sqrt(np.maximum(weights[None, :] - weights[:, None], 1e-9))
    n = len(total)
    length = np.arange(n + 1)[None, :] - np.arange(n + 1)[:, None]
    score = np.where((length > 0) & (length <= _BAND * n), score, -np.inf)
    first, after = np.unravel_index(int(np.argmax(score)), score.shape)
    return int(first), int(after) - 1


def _comb(layers: IndexArray, gain: FloatArray, weight: FloatArray) -> Probe:
    """Every k-th layer, with the period and phase of the largest contrast."""
    best = (-1.0, 2, 0, 0.8)
    for period in _PERIODS:
        for phase in range(period):
            mine = (layers % period) == phase
            if not mine.any() or mine.all():
                continue
            a, b = (np.average(gain[m], weights=weight[m] + 1e-9) for m in (mine, ~mine))
            noise = np.sqrt(1.0 / max(weight[mine].sum(), 1e-9) + 1.0 / max(weight[~mine].sum(), 1e-9))
            if abs(a - b) / noise > best[0]:
                best = (abs(a - b) / noise, period, phase, float(np.exp(a - b)))
    _, period, phase, level = best
    first = int(layers[layers % period == phase][0])
    settings = {"first_layer": first, "last_layer": int(layers[-1]), "every": period}
    return Probe("layer_gain", {"gain": level}, _FREE, settings)


def _gains(evidence: Evidence, shown: Sequence[Observations], probe: Probe, _x: FloatArray) -> tuple[float, ...]:
    """Each layer's gain times what the layer's echoes still ask for; these frames may have other layers than those that
    the list was read off first."""
    layers, place = np.unique(_lines(evidence), return_inverse=True)
    more = _gains_of_layers(layers, *evidence.dimming(shown).mean(place, len(layers)))
    gains = np.asarray(probe.settings["gains"])
    at = int(probe.fixed["first_layer"]) - int(layers[0]) + np.arange(len(gains))
    own = np.where((at >= 0) & (at < len(more)), more[np.clip(at, 0, len(more) - 1)], 1.0)
    return tuple(np.round(np.clip(gains * own, 0.0, _LARGEST), 3).tolist())


def _brighter(probe: Probe, x: FloatArray, gain: Mapping[str, Any]) -> tuple[Probe, FloatArray]:
    """A gain for every layer that makes all so many times as bright, where it can."""
    gains = np.minimum(np.asarray(probe.settings["gains"]) * float(gain["gain"]), _LARGEST)
    return replace(probe, settings={**probe.settings, "gains": tuple(np.round(gains, 4).tolist())}), x


SPEC = SearchSpec(
    "layer_gain",
    free=_FREE,
    starts=_starts,
    order=2,
    factors=("gain", "gains"),
    groups=frozenset({"light"}),
    takes_over=TakeOver("signal_gain", _brighter, can=lambda probe: "gains" in probe.settings, wholly=True),
    read_lists=("gains",),
    list_reader=ListReader("gains", _gains, rounds=0, always=False),  # its gain is but a factor on the list
    watched_by=("area_layer_spread", "area_mean", "detection_probability"),
    shown_by=("area", "layer"),
)
