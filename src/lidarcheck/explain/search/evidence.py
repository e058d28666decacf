"""What effects may look at: the frames of a simulator, as `effects.search.evidence.Evidence` asks for them."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.finding import make, with_role
from lidarcheck.effects.search.evidence import AREA, Dimming, Observations
from lidarcheck.inference.nuisances import beside
from lidarcheck.inference.observed.beam_table import BeamTable, key_of
from lidarcheck.inference.observed.expectation import Expected
from lidarcheck.inference.simulator import Simulator
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Sensor

__all__ = ["SimulatorEvidence", "dimming_of"]


_LOST = -1.0
"""ln gain that a surely expected but missing echo stands for."""
_SURE = 0.8
_BRIGHTER, _LEAST_SLOPE = 1.25, 0.1
_BINS = 25


class SimulatorEvidence:
    """The frames of a simulator, and what its model shows of them."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator

    @property
    def sensor(self) -> Sensor:
        """The model's sensor."""
        return self._simulator.model.sensor

    @property
    def ideals(self) -> Sequence[IdealScan]:
        """The ideal scans of the frames."""
        return [frame.ideal for frame in self._simulator.frames]

    @property
    def beams(self) -> BeamTable:
        """What the beams meet."""
        return self._simulator.beams

    @property
    def measured(self) -> Observations:
        """What was measured."""
        return self._simulator.measured_observations

    @property
    def expected(self) -> Expected:
        """What the model shows."""
        return self._simulator.summaries.expected

    def rows_of(self, frame: int, layer: npt.ArrayLike, point: npt.ArrayLike) -> IndexArray:
        """The places of a frame's beams in the table, -1 for those that are left out, (n,)."""
        key = key_of(frame, layer, point)
        place = np.minimum(np.searchsorted(self.beams.key, key), len(self.beams) - 1)
        return np.where(self.beams.key[place] == key, place, -1)

    def dimming(self, shown: Sequence[Observations] | None = None) -> Dimming:
        """The gain that each beam's echo asks for beyond what the model shows, or beyond some simulations."""
        if shown is None:
            return self._own_dimming
        count = np.sum([one.detected for one in shown], axis=0)
        log_area = np.sum([np.where(one.detected, one.feature[:, AREA], 0.0) for one in shown], axis=0)
        return dimming_of(self._simulator, log_area / np.maximum(count, 1), count == len(shown))

    @functools.cached_property
    def _own_dimming(self) -> Dimming:
        return dimming_of(self._simulator, self.expected.mean[:, AREA], self.expected.known)


def _slope(simulator: Simulator) -> FloatArray:
    """Slope of ln AREA over ln S of each beam, as more light shows it; 1 around a program that cannot be given more."""
    expected, gain = simulator.summaries.expected, with_role("gain")
    if gain.why_not(simulator.model.sensor):
        return np.ones(len(expected.known))
    brighter = simulator.observations(beside(simulator.model, make(gain.name, {"gain": _BRIGHTER})), 0)
    seen = expected.known & brighter.detected
    change = np.where(seen, brighter.feature[:, AREA] - expected.mean[:, AREA], 0.0) / np.log(_BRIGHTER)
    return _by_amplitude(simulator, change, seen)


def dimming_of(simulator: Simulator, log_area: FloatArray, known: BoolArray) -> Dimming:
    """The gain that each beam asks for, against a model's mean ln AREA where that is known, shapes (n,).

    From ln AREA, by its slope over ln S at that amplitude, as the case's model itself shows with more light.
    """
    expected = simulator.summaries.expected
    slope = _slope(simulator)
    measured = simulator.measured_observations
    valid = measured.detected & known & expected.known & (slope > _LEAST_SLOPE)
    spread = np.maximum(expected.spread[:, AREA], 1e-3)
    gain = np.where(valid, (measured.feature[:, AREA] - log_area) / np.maximum(slope, _LEAST_SLOPE), 0.0)
    weight = np.where(valid, (slope / spread) ** 2, 0.0)
    lost = ~measured.detected & known & expected.known & (expected.probability > _SURE)
    typical = float(np.median(weight[valid])) if valid.any() else 1.0
    return Dimming(
        np.where(lost, _LOST, np.clip(gain, -2.0, 2.0)), np.where(lost, typical, np.minimum(weight, 4.0 * typical))
    )


def _by_amplitude(simulator: Simulator, value: FloatArray, seen: BoolArray) -> FloatArray:
    """The mean of beams alike in amplitude, for every beam."""
    amplitude = simulator.summaries.expected.mean[:, AREA]
    edges = np.quantile(amplitude[seen], np.linspace(0.0, 1.0, _BINS)[1:-1]) if seen.any() else np.zeros(0)
    place = np.searchsorted(edges, amplitude)
    count = np.bincount(place[seen], minlength=len(edges) + 1)
    total = np.bincount(place[seen], value[seen], len(edges) + 1)
    return (total / np.maximum(count, 1))[place]
