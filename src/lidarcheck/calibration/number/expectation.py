"""What a SPAD array is expected to show beside a target, without noise: the light of each beam and its mean echo.

The mean of a logarithm is not the logarithm of the mean, and walk, neighbours in a bin and the like are left out: so an
expectation only says by how much a model differs from one that was simulated, and is added to what that one showed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.blooming.response import FEATURES, GATE_M, Response, response_of
from lidarcheck.calibration.number.beside import Beside
from lidarcheck.calibration.number.light import Lights, keys_of
from lidarcheck.calibration.number.misfit import Means, Misfit
from lidarcheck.inference.observed.echo_view import Slot
from lidarcheck.scan import Light
from lidarcheck.sensor import SpadArray

__all__ = ["expected_means", "moved"]

_DARK = 1e-6


def expected_means(misfit: Misfit, lights: Lights) -> Means | None:
    """The means of all cells by the light of their beams; None for a detector whose mean echo is not known."""
    if not lights.first or not isinstance(lights.first[0][1].sensor, SpadArray):
        return None
    light, run = lights.first[0]
    response = response_of(run.sensor, light.shape)
    at = np.log10(np.maximum(_signal(misfit.beside, [one for one, _ in lights.first]), _DARK))
    share, value = response.probability(at)[0], _features(response, at, misfit.slots)
    cells = len(misfit.cells)
    columns = [np.ones(len(share)), share, *(share * column for column in value.T)]
    n, hits, *totals = (np.asarray(np.bincount(misfit.cell, one, cells), dtype=np.float64) for one in columns)
    total = np.column_stack(totals or [np.zeros((cells, 0))])
    return Means(n, hits / np.maximum(n, 1.0), hits, total / np.maximum(hits, 1e-12)[:, None])


def moved(shown: Means, before: Means, after: Means) -> Means:
    """What a model showed, by as much further as it is expected to be: `before`, `after` are expectations."""
    share = np.clip(shown.share + after.share - before.share, 0.0, 1.0)
    seen = (shown.hits > 0.0)[:, None]
    value = np.where(seen, shown.value + after.value - before.value, after.value)
    return replace(shown, share=share, hits=share * shown.n, value=value)


def _features(response: Response, at: FloatArray, slots: Sequence[Slot]) -> FloatArray:
    """The mean features, (n, features), as the slots show them."""
    mean, _ = response.features(at)
    columns = [mean[:, FEATURES.index(slot.name)] for slot in slots]
    logs = [np.log(np.maximum(c, 1.0)) if slot.log else c for c, slot in zip(columns, slots, strict=True)]
    return np.column_stack(logs or [np.zeros((len(at), 0))])


def _signal(beside: Beside, lights: Sequence[Light]) -> FloatArray:
    """S of each beam at its target's range, (n,)."""
    found = np.zeros(len(beside))
    for i, light in enumerate(lights):
        keys, pulse = keys_of(light.layer, light.point), light.pulse_beam
        order = np.argsort(keys)
        for target in np.unique(beside.target):
            rows = np.flatnonzero((beside.frame == i) & (beside.target == target))
            place = np.full(len(light), -1)
            place[order[np.searchsorted(keys[order], beside.key[rows])]] = np.arange(len(rows))
            at = place[pulse]
            mine = (at >= 0) & (np.abs(light.pulse_range_m - beside.at_m[rows][at]) <= GATE_M)
            found[rows] += np.bincount(at[mine], light.pulse_signal[mine], len(rows))
    return found
