"""Avalanches and echoes of hazy beams against closed forms and slower ways to draw them."""

import numpy as np
import pytest
from scipy import stats

from haze_kit import TAIL, fog, light
from lidarcheck.jit import kernel
from lidarcheck.model import echoes_of, expected_trace, reference, streams
from lidarcheck.model.exact import kernel as kernels
from lidarcheck.model.exact import long_alone
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.model.streams import rewind
from lidarcheck.model.trace import bin_rates, draw_traces, on_probability
from lidarcheck.scan import Light, PulseShape
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Sensor
from reference_kit import simulate_detectors

BIN_M = LIGHT_SPEED_M_PER_NS / 2


def test_a_row_cut_at_its_end_is_a_set_of_small_pulses_drawn_alike() -> None:
    """Two kinds of light with the same rates: their traces have the same distribution in each bin."""
    sensor = Sensor.of("SMART", max_range_m=20.0)
    end = 9.13
    density = np.full(200, 0.3)
    density[:40] = 0.0
    small = np.append(np.arange(2.005, end - 0.01, 0.01), 9.125)

    def both(n: int) -> tuple[Light, Light]:
        pulses = np.arange(n + 1) * len(small), np.tile(small, n), np.full(n * len(small), 0.003)
        return light(n, density, [end]), Light(np.zeros(n), np.arange(n), np.full(n, 3e-4), *pulses)

    of_haze, of_pulses = (bin_rates(one, sensor)[0] for one in both(1))
    assert of_haze == pytest.approx(of_pulses, abs=2e-6)
    hazy, many = both(500)
    one, other = draw_traces(hazy, sensor, seed=1), draw_traces(many, sensor, seed=2)
    for k in range(10, 75, 4):
        assert stats.ks_2samp(one[:, k], other[:, k]).pvalue > 1e-5


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_draws_have_the_expected_trace(variant: str) -> None:
    sensor = Sensor.of(variant, max_range_m=40.0)
    beams = light(4000, fog(50.0, 40.0), [14.2, 30.0], [0.4, 0.6], pulse=(14.2, 0.4), shape=TAIL)
    one = light(1, fog(50.0, 40.0), [14.2, 30.0], [0.4, 0.6], pulse=(14.2, 0.4), shape=TAIL)
    mean = draw_traces(beams, sensor, seed=1).mean(axis=0)
    q = on_probability(bin_rates(one, sensor), [3e-4], sensor)[0]
    assert expected_trace(one, sensor)[0] == pytest.approx(sensor.detectors * q)
    spread = np.sqrt(sensor.detectors * q * (1 - q) / 4000)
    assert np.abs((mean - expected_trace(one, sensor)[0]) / spread).max() < 5.0


def compare(beams: Light, few: Light, sensor: Sensor, seed: int) -> dict[str, float]:
    """p-values of echo counts and echo features, the exact chain against every detector followed on its own."""
    ours = echoes_of(beams, sensor, seed=seed)
    theirs = simulate_detectors(few, sensor, np.random.default_rng(seed))
    p_values = {}
    for name in ("peak", "area", "width_ns", "range_m"):
        one, other = np.round(getattr(ours, name), 3), np.round(getattr(theirs, name), 3)
        p_values[name] = float(stats.ks_2samp(one, other).pvalue) if min(len(one), len(other)) > 10 else 1.0
    counts = [
        np.bincount(np.bincount(s.point, minlength=len(b)), minlength=4) for s, b in ((ours, beams), (theirs, few))
    ]
    kept = (counts[0] + counts[1]) > 20
    p_values["echoes"] = float(stats.chi2_contingency([c[kept] for c in counts]).pvalue) if kept.sum() > 1 else 1.0
    return p_values


CASES = {
    "fog, beam meets nothing": (fog(50.0, 40.0), [40.0], [1.0], (10.0, 0.0), None, 3e-4),
    "fog, a wall in it": (fog(50.0, 40.0), [9.3], [1.0], (9.3, 1.0), None, 3e-4),
    "fog, a faint wall behind it": (fog(50.0, 25.0), [25.0], [1.0], (25.0, 0.12), None, 3e-4),
    "fog, partial sub-beams": (fog(30.0, 40.0), [4.0, 11.0, 40.0], [0.5, 0.2, 0.3], (11.0, 0.3), None, 3e-4),
    "fog, tail": (fog(30.0, 40.0), [7.0], [1.0], (7.0, 0.5), TAIL, 3e-4),
    "mist everywhere": (np.full(800, 3e-3), [31.0], [1.0], (31.0, 0.1), None, 3e-4),
    "mist that crowds": (np.full(800, 1.2e-2), [33.0], [1.0], (10.0, 0.0), None, 3e-4),
    "a cloud at 20 m": (np.where(np.arange(800) > 400, 0.05, 0.0), [23.0], [1.0], (10.0, 0.1), None, 3e-4),
    "sun and mist": (np.full(800, 8e-3), [24.0], [1.0], (24.0, 0.1), None, 2e-3),
    "no background": (fog(20.0, 40.0), [15.0], [1.0], (15.0, 0.2), None, 0.0),
    "dazzled": (fog(50.0, 40.0), [15.0], [1.0], (15.0, 2.0), None, 0.02),
}


@pytest.mark.parametrize("name", CASES)
def test_echoes_agree_with_every_detector_followed_on_its_own(name: str) -> None:
    density, ends, shares, pulse, shape, background = CASES[name]
    sensor = Sensor.of("SMART", max_range_m=40.0)
    few, many = (
        light(n, density, ends, shares, pulse=pulse, shape=shape, background=background) for n in (250, 10_000)
    )
    p_values = compare(many, few, sensor, seed=4)
    assert min(p_values.values()) > 1e-3 / (len(CASES) * len(p_values)), p_values


@pytest.mark.parametrize(("variant", "level"), [("SMART", 3e-3), ("SLIM", 1.6e-3)])
@pytest.mark.parametrize("calm", [1e-3, 0.15])
def test_faint_haze_behind_the_window_raises_as_many_false_alarms_as_visiting_every_bin(
    variant: str, level: float, calm: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Haze that falls with range and ends at 90 m; the more is called calm, the more alarms lie behind the window."""
    monkeypatch.setattr("lidarcheck.model.exact.blocks._CROWDED_CALM", calm)
    background = 4e-4 if variant == "SMART" else 2e-4
    sensor = Sensor.of(variant, background_per_ns=background, max_range_m=120.0)
    density = level * np.exp(-np.arange(3000) * 0.05 / 60.0)
    density[200:240] = 0.0
    n = 60_000
    skipping = echoes_of(light(n, density, [90.0], pulse=(20.0, 0.03), background=background), sensor, seed=3)
    visited: list[tuple[float, float, int, int]] = []
    for start in range(0, n, 6000):
        beams = light(6000, density, [90.0], pulse=(20.0, 0.03), background=background)
        part = draw_traces(beams, sensor, seed=start)
        busy = np.flatnonzero(part.max(axis=1) > sensor.threshold)
        visited += [echo for i in busy for echo in reference.echoes_of_trace(part[i], sensor)]
    ranges, areas = np.array(visited)[:, 0], np.array(visited)[:, 2]
    assert len(visited) > 200
    for low, high in [(-1.0, 18.0), (18.0, 23.0), (23.0, 40.0), (40.0, 90.0), (90.0, 121.0), (-1.0, 121.0)]:
        ours = np.count_nonzero((skipping.range_m > low) & (skipping.range_m <= high))
        theirs = np.count_nonzero((ranges > low) & (ranges <= high))
        assert abs(ours - theirs) < 4.5 * np.sqrt(ours + theirs + 1), (low, high, ours, theirs)
    assert stats.ks_2samp(np.round(skipping.range_m, 2), np.round(ranges, 2)).pvalue > 1e-4
    assert stats.ks_2samp(skipping.area, areas).pvalue > 1e-4


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_haze_that_is_all_faint_alarms_as_often_as_it_should(variant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """No background, no window: every echo is of haze that is visited only where candidates crowd."""
    monkeypatch.setattr("lidarcheck.model.exact.blocks._CROWDED_CALM", 0.15)
    sensor = Sensor.of(variant, background_per_ns=0.0, max_range_m=120.0)
    calm = kernels.new_scratch(numbers_of(sensor)).blocks.calm
    density = 0.98 * calm / BIN_M * np.where(np.arange(300) < 200, 1.0, 0.8)
    n = 120_000
    skipping = echoes_of(light(n, density, [90.0], step_m=0.4, background=0.0), sensor, seed=3)
    alarms: list[float] = []
    for start in range(0, n, 6000):
        part = draw_traces(light(6000, density, [90.0], step_m=0.4, background=0.0), sensor, seed=start)
        busy = np.flatnonzero(part.max(axis=1) > sensor.threshold)
        alarms += [echo[0] for i in busy for echo in reference.echoes_of_trace(part[i], sensor)]
    assert len(alarms) > 100
    assert abs(len(alarms) - len(skipping)) < 4.5 * np.sqrt(len(alarms) + len(skipping))
    assert stats.ks_2samp(np.round(skipping.range_m, 2), np.round(alarms, 2)).pvalue > 1e-4


@kernel
def run_hazy(numbers, stream, beams, pulses, per_bin, scratch, avalanches):  # type: ignore[no-untyped-def]
    for i in range(len(beams)):
        rewind(stream, beams[i])
        long_alone.hazy(numbers, stream, scratch, pulses, i, per_bin, 0, numbers.bins)
        for k in range(numbers.bins):
            avalanches[i, k] = scratch.counts[numbers.pad + k]
        scratch.counts[:] = 0


@pytest.mark.parametrize(("spads", "level"), [(1, 1.5), (3, 0.5), (135, 0.011), (135, 0.03)])
def test_going_from_candidate_to_candidate_is_going_bin_by_bin(spads: int, level: float) -> None:
    """Avalanches per bin, in haze of very different strength within a piece, with few detectors and many."""
    sensor = Sensor.of("SMART", spads=spads, shots=1, on_bins=1, max_range_m=30.0)
    numbers = numbers_of(sensor)
    n = 60_000 if spads < 10 else 12_000
    density = level * np.random.default_rng(3).random(300) ** 2
    density[100:150] = 0.0
    beams = light(n, density, [27.0], step_m=0.1, background=1e-4, shape=PulseShape(1.0))
    rates = bin_rates(light(1, density, [27.0], step_m=0.1, background=1e-4, shape=PulseShape(1.0)), sensor)
    # Nobody enters: all detectors are armed in bin 0. ON for one bin, a detector is ON when it avalanches.
    q = on_probability(rates, [0.0], sensor)[0]
    avalanches = np.empty((n, sensor.bins), dtype=np.int32)
    stream, scratch = streams.new_stream(1, "spads", 0), kernels.new_scratch(numbers)
    keys = streams.beam_keys(beams.layer, beams.point)
    run_hazy(numbers, stream, keys, pulses_of(beams, sensor, numbers), 1e-4, scratch, avalanches)
    z = (avalanches.mean(axis=0) - spads * q) / np.sqrt(spads * q * (1 - q) / n)
    assert np.abs(z).max() < 4.8
    assert abs(z.sum()) / np.sqrt(len(z)) < 5.0
    p_rare = sum(
        stats.chisquare(*pooled(avalanches[:, k], spads, q[k])).pvalue < 1e-3 for k in range(5, sensor.bins, 7)
    )
    assert p_rare <= 1, "binomial in each bin"
    # No detector avalanches twice within its dead time.
    in_dead_time = np.lib.stride_tricks.sliding_window_view(avalanches, sensor.dead_bins, axis=1).sum(axis=2)
    assert in_dead_time.max() <= spads


def pooled(values: np.ndarray, trials: int, chance: float) -> tuple[list[float], list[float]]:
    """Observed and expected numbers of 0, 1 and more."""
    expected = stats.binom.pmf([0, 1], trials, chance) * len(values)
    observed = [float(np.count_nonzero(values == k)) for k in (0, 1)]
    if trials == 1 or len(values) - expected.sum() < 8:
        return [observed[0], len(values) - observed[0]], [expected[0], len(values) - expected[0]]
    return [*observed, len(values) - sum(observed)], [*expected, len(values) - expected.sum()]
