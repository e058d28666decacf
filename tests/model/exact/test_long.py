"""Beams that visit many bins: side by side as on their own, and counts from 16 bits as from all digits."""

import numpy as np
import pytest

from exact_kit import on_their_own, side_by_side
from haze_kit import TAIL, fog
from lidarcheck.jit import kernel
from lidarcheck.model import streams
from lidarcheck.model.exact.binomial import binomial, inverses
from lidarcheck.model.exact.short_draws import count_of
from lidarcheck.model.streams import rewind
from lidarcheck.scan import Haze, Light, PulseShape
from lidarcheck.sensor import Sensor

CELLS = 65536


def mixed(n: int, background: float, mor_m: float | None, shape: PulseShape | None = None) -> Light:
    """Pulses from faint to glaring at all ranges, each where the haze of its beam ends, or one of its two rows."""
    rng = np.random.default_rng(3)
    ends = rng.uniform(0.5, 42.0, n)
    haze = None
    if mor_m is not None:
        rows = np.append(0, np.cumsum(1 + (np.arange(n) % 5 == 0)))
        end_m = np.repeat(ends, np.diff(rows))
        end_m[rows[:-1]] *= np.where(np.arange(n) % 5 == 0, 0.6, 1.0)
        haze = Haze(0.05, fog(mor_m, 40.0), rows, end_m, rng.uniform(0.2, 1.5, rows[-1]))
    signal = 10.0 ** rng.uniform(-3.0, 4.0, n)
    beams = *np.divmod(np.arange(n), 960), np.full(n, background)
    return Light(*beams, np.arange(n + 1), ends, signal, shape=shape, haze=haze)


CASES = {
    "fog": (Sensor.of("SMART", max_range_m=40.0), mixed(1500, 3e-4, 50.0)),
    "thin fog, many detectors": (Sensor.of("SLIM", max_range_m=40.0), mixed(1500, 4e-4, 300.0)),
    "fog under the sun, a tail": (Sensor.of("SLIM", max_range_m=40.0), mixed(1500, 8e-4, 100.0, TAIL)),
    "no background": (Sensor.of("SMART", max_range_m=40.0, threshold=2, max_echoes=2), mixed(1500, 0.0, 20.0)),
    "dazzled": (Sensor.of("SMART", max_range_m=40.0), mixed(1500, 2e-2, None)),
    "dazzled to the last": (Sensor.of("SLIM", max_range_m=40.0), mixed(700, 1.5, None)),
    "one detector": (Sensor.of("SMART", spads=1, shots=1, threshold=0, max_range_m=40.0), mixed(1500, 1e-2, 30.0)),
    "short times": (Sensor.of("SLIM", max_range_m=40.0, on_bins=1, dead_bins=1), mixed(700, 3e-4, 60.0)),
}


@pytest.mark.parametrize("case", CASES)
def test_echoes_side_by_side_are_those_of_beams_on_their_own(case: str) -> None:
    sensor, beams = CASES[case]
    alone = on_their_own(beams, sensor)
    assert alone.held.sum() > 300
    for chunk in (1 << 20, 11):
        for one, other in zip(side_by_side(beams, sensor, chunk), alone, strict=True):
            assert np.array_equal(one, other)


@kernel
def run_counts(stream, rates, armed, inverse, counts, ends):  # type: ignore[no-untyped-def]
    for row in range(len(rates)):
        for short in range(CELLS):
            counts[row, short] = count_of(
                stream, np.uint64(7), np.uint64(row), short, armed[row], rates[row], len(inverse) - 5, inverse
            )
            low = short / CELLS
            ends[row, short, 0] = binomial(low, armed[row], rates[row], inverse)
            ends[row, short, 1] = binomial(low + 0.999999 / CELLS, armed[row], rates[row], inverse)


def test_a_count_lies_between_those_of_its_cells_ends_and_is_drawn_anew_where_they_differ() -> None:
    """Means are right far beyond 16 bits: what a cell holds of two counts is drawn from a number of its own."""
    rates = np.array([1e-6, 3e-4, 0.02, 0.5, 0.6931, 0.6932, 2.0, 40.0, 0.3])
    armed = np.array([135, 315, 300, 315, 50, 50, 315, 10, 1])
    counts, ends = np.empty((len(rates), CELLS), np.int64), np.empty((len(rates), CELLS, 2), np.int64)
    stream = streams.new_stream(3, "spads", 5)
    rewind(stream, np.uint64(7))
    run_counts(stream, rates, armed, inverses(315), counts, ends)
    assert np.all(counts >= ends.min(axis=2))
    assert np.all(counts <= ends.max(axis=2))
    open_cells = (ends[..., 0] != ends[..., 1]).sum(axis=1)
    assert open_cells.sum() > 50
    assert open_cells.max() < 200
    spread = open_cells + 1.0
    assert np.all(np.abs(counts.sum(axis=1) - CELLS * armed * -np.expm1(-rates)) < 5.0 * spread)
