"""Kinds of start for another pulse: what is free of them is enough for pulses that the effect has no formula of."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from lidarcheck.effects.search import Probe
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.model.exact.pulse_form import form_of
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import FWHM_PER_SIGMA, Sensor

SENSOR = Sensor.of("SMART")
SIGMA_NS = SENSOR.pulse_fwhm_ns / FWHM_PER_SIGMA
EDGES_NS = np.arange(-15.0, 60.0, 0.1)


def slow_fall(times: float) -> np.ndarray:
    """Share of the light in each step of a Gaussian that falls so many times as slowly as it rises; its peak at 0."""
    middle = (EDGES_NS[1:] + EDGES_NS[:-1]) / 2.0
    power = np.exp(-0.5 * (middle / np.where(middle < 0.0, SIGMA_NS, times * SIGMA_NS)) ** 2)
    return np.asarray(power / power.sum())


def misplaced(probe: Probe, wanted: np.ndarray) -> float:
    """The share of the light that comes at other times, from this start on, with all free numbers fitted."""

    def off(x: np.ndarray) -> np.ndarray:
        effect = probe.effect(x).settings()
        shape = PulseShape(SENSOR.pulse_fwhm_ns * effect["stretch"], *(effect[name] for name in TAIL))
        return np.asarray(np.diff(form_of(shape, SENSOR, 1.0).before(EDGES_NS)) - wanted)

    return float(np.abs(least_squares(off, probe.start()).fun).sum() / 2.0)


TAIL = ("tail_share", "tail_ns", "tail_delay_ns")


@pytest.mark.parametrize("times", [1.12, 1.35, 2.3])
def test_a_pulse_that_falls_slowly_needs_no_other_range(times: float) -> None:
    wanted = slow_fall(times)
    best: dict[str, float] = {}
    for probe in fixed_probes(["pulse_shape"]):
        best[probe.variant] = min(misplaced(probe, wanted), best.get(probe.variant, 1.0))
    assert best["slow fall"] < 0.016
    assert best["slow fall"] < 0.7 * best[""]
