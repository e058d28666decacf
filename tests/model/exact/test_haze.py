"""Haze: backscatter of the air along the beam, ended by what the beam meets; its rates, and odd tables."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from haze_kit import TAIL, fog, light, same
from lidarcheck.jit import kernel
from lidarcheck.model import detection, echoes_of, reference, streams
from lidarcheck.model.exact import kernel as kernels
from lidarcheck.model.exact.echoes import new_echoes
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulses import Pulses, add_rates, pulses_of, window
from lidarcheck.model.trace import bin_rates
from lidarcheck.scan import Haze, Light, PulseShape
from lidarcheck.sensor import Sensor


def without_haze(beams: Light) -> Light:
    return replace(beams, haze=None)


@kernel
def run_add_rates(pulses, beam, begin, rates):  # type: ignore[no-untyped-def]
    add_rates(pulses, beam, begin, begin + len(rates), rates)


@kernel
def run_window(numbers, pulses, beam):  # type: ignore[no-untyped-def]
    return window(numbers, pulses, beam)


SHAPES = [None, TAIL, PulseShape(1.0, 0.5, 0.05), PulseShape(0.3, 0.3, 50.0), PulseShape(30.0)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("step_m", [0.01, 0.05, 0.3, 2.7, 40.0])
def test_rates_are_those_of_many_small_pulses(shape: PulseShape | None, step_m: float) -> None:
    """Cells from a fifteenth of a bin to longer than the trace, rows that end anywhere, sub-beams in any order."""
    rng = np.random.default_rng(1)
    sensor = Sensor.of("SMART", max_range_m=30.0)
    cells = int(25 / step_m) + 1
    density = rng.uniform(0, 2, cells) * (rng.random(cells) < 0.7)
    density[0] = 1.0
    ends = [0.003, 1.0, step_m / 2, step_m, 14.987, 24.0, 100.0, 29.9, 11.0, 5.0, 1e9, 11.3]
    haze = Haze(step_m, density, np.array([*range(9), 12]), np.array(ends), np.array([1.0] * 8 + [0.5, 0.2, 0.2, 0.1]))
    n = 9
    beams = Light(
        *(np.zeros(n), np.arange(n), np.zeros(n), np.arange(n + 1), np.full(n, 12.3)),
        np.append(np.zeros(n - 1), 3.0),
        shape=shape,
        haze=haze,
    )
    ours = bin_rates(beams, sensor)
    theirs = np.array([reference._rates(beams, i, sensor) for i in range(n)])
    assert np.abs(ours - theirs).max() < 1e-4
    pulses = pulses_of(beams, sensor, numbers_of(sensor))
    for i in range(n):
        part = np.zeros(60)
        run_add_rates(pulses, i, 37, part)
        assert part == pytest.approx(ours[i, 37:97], abs=1e-5)


def test_a_table_of_every_third_edge_gives_the_same_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = Sensor.of("SMART", max_range_m=40.0)
    beams = light(3, fog(50.0, 40.0), [3.0, 17.77], [0.3, 0.7], shape=TAIL)
    fine = bin_rates(beams, sensor)
    monkeypatch.setattr("lidarcheck.model.exact.haze_rates._ROOM", 800 * 110 // 3)
    assert pulses_of(beams, sensor, numbers_of(sensor)).haze.stride > 1
    assert bin_rates(beams, sensor) == pytest.approx(fine, abs=1e-12)


@pytest.mark.parametrize("shape", [None, TAIL])
def test_all_light_arrives_and_no_more(shape: PulseShape | None) -> None:
    """The trace holds share times the integral of the density up to the end, of each row."""
    sensor = Sensor.of("SMART", background_per_ns=0.0)
    density = fog(80.0, 60.0)
    ends, shares = [2.02, 7.77, 30.0, 500.0], [0.1, 0.2, 0.3, 0.15]
    rates = bin_rates(light(1, density, ends, shares, shape=shape, background=0.0), sensor)
    edges = np.arange(len(density) + 1) * 0.05
    integral = np.interp(ends, edges, np.append(0.0, np.cumsum(density) * 0.05))
    assert rates.sum() == pytest.approx(np.dot(shares, integral), abs=2e-8)
    assert rates.min() > -1e-15


def test_no_light_in_it_is_no_haze_bit_by_bit() -> None:
    sensor = Sensor.of("SMART", max_range_m=60.0)
    dark = light(3000, np.zeros(100), [5.0], pulse=(20.0, 0.15))
    own = echoes_of(without_haze(dark), sensor, seed=5)
    assert len(own) > 1000
    assert same(own, echoes_of(dark, sensor, seed=5))
    assert same(own, echoes_of(light(3000, np.ones(100), [5.0], [0.0], pulse=(20.0, 0.15)), sensor, seed=5))
    assert same(own, echoes_of(light(3000, np.zeros(0), [5.0], pulse=(20.0, 0.15)), sensor, seed=5))
    far = np.append(np.zeros(3000), 1.0)
    assert same(own, echoes_of(light(3000, far, [500.0], pulse=(20.0, 0.15)), sensor, seed=5)), "behind the trace"


def test_beams_without_haze_are_left_as_they_are_beside_hazy_ones() -> None:
    """Their candidates come at another rate, so only the distribution is the same, not the draws."""
    sensor = Sensor.of("SMART", max_range_m=60.0)
    beams = light(6000, fog(50.0, 40.0), [40.0], pulse=(20.0, 0.15))
    rows = np.concatenate([np.zeros(3000, dtype=np.int64), np.arange(3001)])
    assert beams.haze is not None
    half = Haze(0.05, beams.haze.density_per_m, rows, np.full(3000, 40.0), np.ones(3000))
    scan = echoes_of(replace(beams, haze=half), sensor, seed=5)
    own = echoes_of(without_haze(beams), sensor, seed=6)
    clear, hazy = scan.take(scan.point < 3000), scan.take(scan.point >= 3000)
    assert np.mean(hazy.range_m < 12.0) > 0.4
    assert stats.ks_2samp(clear.range_m, own.range_m).pvalue > 1e-4
    assert abs(len(clear) - len(own) / 2) < 5 * np.sqrt(len(own))


def test_the_window_covers_all_light() -> None:
    """Whoever asks for it finds next to nothing but background outside."""
    sensor = Sensor.of("SMART")
    numbers = numbers_of(sensor)
    cases = [
        light(1, fog(50.0, 90.0), [90.0]),
        light(1, fog(50.0, 90.0), [7.3], pulse=(60.0, 2.0)),
        light(1, fog(50.0, 90.0), [12.0, 40.0], [0.5, 0.5], shape=TAIL),
        light(1, fog(50.0, 90.0), [1.0], pulse=(20.0, 0.3)),
    ]
    for beams in cases:
        begin, end = run_window(numbers, pulses_of(beams, sensor, numbers), 0)
        rates = bin_rates(beams, sensor)[0] - 3e-4
        assert 0 <= begin < end < sensor.bins
        assert numbers.detectors * (rates[:begin].sum() + rates[end - numbers.on :].sum()) < 5e-6
        assert rates[max(begin, 0)] < 1e-3
    nothing = pulses_of(light(1, fog(50.0, 90.0, start_m=10.0), [1.0]), sensor, numbers)
    assert run_window(numbers, nothing, 0) == (0, 0)
    assert isinstance(nothing, Pulses)


def test_odd_tables() -> None:
    """No beams, no rows, no pulses, ends beyond the profile and in its first cell, far outside the trace."""
    sensor = Sensor.of("SMART", max_range_m=30.0, background_per_ns=0.0)
    none = Haze(0.05, fog(50.0, 30.0), np.zeros(1, dtype=np.int64), np.zeros(0), np.zeros(0))
    empty = Light(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(1), np.zeros(0), np.zeros(0), haze=none)
    assert len(echoes_of(empty, sensor)) == 0
    assert bin_rates(empty, sensor).shape == (0, sensor.bins)
    beams = np.zeros(4), np.arange(4), np.zeros(4)
    rows = Haze(0.05, fog(50.0, 30.0), np.array([0, 0, 1, 2, 3]), np.array([1e12, 0.01, np.inf]), np.ones(3))
    scan = echoes_of(Light(*beams, np.zeros(5), np.zeros(0), np.zeros(0), haze=rows), sensor, seed=1)
    assert sorted(set(scan.point.tolist())) == [1, 3]
    assert np.all(scan.range_m[scan.echo_number == 1] < 6.0)
    assert len(echoes_of(light(3, np.full(3, 5.0), [0.01], step_m=100.0, background=0.0), sensor)) == 0
    assert len(echoes_of(light(3, np.full(3, 5.0), [1e9], step_m=100.0, background=0.0), sensor)) >= 3


def test_the_same_bytes_for_any_threads_and_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = Sensor.of("SMART")
    beams = light(4000, fog(60.0, 70.0), [50.0], pulse=(50.0, 0.2))
    first = echoes_of(beams, sensor, seed=17, threads=1)
    assert len(first) > 4000
    monkeypatch.setattr(detection, "_CHUNK", 97)
    assert same(first, echoes_of(beams, sensor, seed=17, threads=2))


def test_a_slightly_fainter_pulse_moves_no_draws_of_the_haze() -> None:
    sensor = Sensor.of("SMART")
    scans = [
        echoes_of(light(2000, fog(60.0, 70.0), [50.0], pulse=(50.0, signal)), sensor, seed=17)
        for signal in (0.2, 0.201)
    ]
    near = [scan.take(scan.range_m < 20.0) for scan in scans]
    shared = set(zip(near[0].point, near[0].area, strict=True)) & set(zip(near[1].point, near[1].area, strict=True))
    assert len(shared) > 0.995 * len(near[0])


def test_work_space_is_left_as_it_was_found() -> None:
    sensor = Sensor.of("SMART", max_range_m=40.0)
    numbers = numbers_of(sensor)
    scratch = kernels.new_scratch(numbers)
    beams = light(500, fog(40.0, 40.0), [22.0], pulse=(22.0, 0.2))
    kernels.simulate_beams(
        numbers,
        streams.new_stream(1, "spads", 0),
        streams.beam_keys(beams.layer, beams.point),
        beams.background_per_ns * sensor.bin_ns,
        pulses_of(beams, sensor, numbers),
        np.arange(500),
        scratch,
        new_echoes(500, 3),
    )
    assert not scratch.counts.any()
