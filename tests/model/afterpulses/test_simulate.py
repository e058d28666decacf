"""Afterpulses counted: against every detector followed one by one, against a slow simulator, and closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import detector_reference as slow
from detector_kit import dark_flash, features, follow, light, same, sensor_of, unlikely
from lidarcheck.errors import UsageError
from lidarcheck.model import detection
from lidarcheck.model.afterpulses import law
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.scan import Light
from lidarcheck.sensor import NonIdeal

TYPICAL, STRONG = (NonIdeal(0.0, 0.0, chance, 5.0, 0.3, 30.0) for chance in (0.03, 0.15))
FREQUENT = NonIdeal(0.0, 0.0, 0.5, 3.0, 0.4, 20.0)
CASES = {
    "typical": (TYPICAL, {}, (0.02, 0.08, 1.0, 30.0), 3e-4),
    "strong": (STRONG, {}, (0.02, 0.08, 1.0, 30.0), 3e-4),
    "frequent": (FREQUENT, {"max_range_m": 40.0, "threshold": 5, "max_echoes": 8}, (0.03, 1.0, 60.0), 3e-4),
    "false alarms": (STRONG, {"threshold": 6, "max_echoes": 8}, (0.0, 0.05), 3e-4),
    "sun": (TYPICAL, {}, (0.05, 1.0), 7e-4),
    "crowded": (STRONG, {"max_range_m": 60.0, "threshold": 5, "max_echoes": 8}, (1.0,), 2e-3),
}
"""Afterpulses, overrides of the sensor, S of a pulse, and background."""


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
@pytest.mark.parametrize("case", CASES)
def test_echoes_agree_with_every_detector_followed_one_by_one(variant: str, case: str) -> None:
    real, overrides, signals, background = CASES[case]
    sensor = sensor_of(variant, real, **overrides)
    n, p_values = 12_000, {}
    for seed, signal in enumerate(signals):
        range_m = np.random.default_rng(seed).uniform(1.0, sensor.max_range_m - 2.0, n)
        beams = light(signal, n, range_m=range_m, background=background)
        ours = chain_echoes(beams, sensor, seed=10 + seed, threads=1)
        p_values |= {
            (signal, name): p for name, p in unlikely(ours, follow(beams, sensor, seed=20 + seed), sensor).items()
        }
    assert len(p_values) >= 4 * len(signals)
    assert min(p_values.values()) > 1e-3 / len(p_values), min(p_values.items(), key=lambda item: item[1])


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_echoes_agree_with_every_detector_followed_slowly(variant: str) -> None:
    sensor = sensor_of(variant, FREQUENT, max_range_m=24.0, max_echoes=2)
    few, times = 120, 25
    range_m = np.random.default_rng(3).uniform(9.0, 10.0, few)
    for signal in (0.12, 1.5, 60.0):
        theirs = slow.echoes(light(signal, few, range_m=range_m), sensor, np.random.default_rng(42))
        ours = features(
            chain_echoes(light(signal, times * few, range_m=np.tile(range_m, times)), sensor, seed=1), sensor
        )
        for column in range(1, 5):
            assert stats.ks_2samp(ours[:, column].round(3), theirs[:, column].round(3)).pvalue > 1e-4, (signal, column)
        assert len(ours) / times == pytest.approx(len(theirs), abs=4.5 * np.sqrt(len(theirs)))


def test_two_pulses_and_none_agree_with_detectors_followed_one_by_one() -> None:
    """The first pulse's afterpulses are due when the second one comes; some beams have background alone."""
    sensor = sensor_of("SLIM", STRONG, max_range_m=60.0, threshold=6, max_echoes=8)
    n = 9000
    pulses = np.arange(n) % 3
    near = np.random.default_rng(0).uniform(2.0, 40.0, n)
    range_m = np.concatenate([[one, one + 6.0][:k] for one, k in zip(near, pulses, strict=True)])
    beams = replace(
        light(0.0, n),
        first_pulse=np.append(0, np.cumsum(pulses)),
        pulse_range_m=range_m,
        pulse_signal=np.full(len(range_m), 0.6),
    )
    p_values = unlikely(chain_echoes(beams, sensor, seed=5), follow(beams, sensor, seed=6), sensor)
    assert min(p_values.values()) > 1e-3 / len(p_values), p_values


def test_afterpulses_without_delay_come_at_the_end_of_the_dead_time() -> None:
    """In the dark, all SPADs avalanche at once: half of them again a dead time later, half of these once more."""
    sensor = sensor_of(
        "SMART", NonIdeal(afterpulse=0.5, afterpulse_ns=0.0), dead_bins=20, pulse_fwhm_ns=0.05, max_echoes=8
    )
    n = 400
    echoes = chain_echoes(dark_flash(n), sensor, seed=3)
    centre = [echoes.centre[echoes.held > k, k] for k in range(4)]
    assert all(np.unique(one.round(6)).size == 1 for one in centre)
    assert np.diff([one[0] for one in centre]) == pytest.approx([20.0, 20.0, 20.0])
    for k in range(1, 3):
        expected = sensor.detectors * 0.5**k
        assert echoes.peak[:, k].mean() == pytest.approx(expected, abs=4.5 * np.sqrt(expected / n))


def test_the_same_echoes_for_any_threads_chunks_order_and_company(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beams of many backgrounds, some of which leave a beam alone in its group, and some too high to be counted."""
    sensor = sensor_of("SLIM", STRONG, max_range_m=120.0, threshold=6)
    n = 600
    rng = np.random.default_rng(1)
    background = np.repeat(rng.uniform(1e-5, 9e-4, 60), 10)
    background[::97], background[5::97] = 3e-2, 3e-4
    beams = replace(light(0.5, n, range_m=rng.uniform(3, 115, n)), background_per_ns=background)
    first = chain_echoes(beams, sensor, seed=1, threads=1)
    assert first.held.sum() > n
    monkeypatch.setattr(detection, "_CHUNK", 37)
    assert same(first, chain_echoes(beams, sensor, seed=1, threads=2))
    order = rng.permutation(n)[: n // 3]
    few = Light(
        layer=beams.layer[order],
        point=beams.point[order],
        background_per_ns=background[order],
        first_pulse=np.arange(len(order) + 1),
        pulse_range_m=beams.pulse_range_m[order],
        pulse_signal=beams.pulse_signal[order],
    )
    assert same(EchoArrays(*(column[order] for column in first)), chain_echoes(few, sensor, seed=1, threads=1))
    assert not same(first, chain_echoes(beams, sensor, seed=2, threads=1))
    assert not same(first, chain_echoes(beams, sensor, seed=1, frame=1, threads=1))


def test_a_weak_effect_changes_few_beams() -> None:
    """The pool draws what the exact chain draws, so that a beam without an afterpulse has the echoes it had."""
    beams = light(1.0, 2000, range_m=30.0, background=0.0)
    plain = chain_echoes(beams, sensor_of("SMART", NonIdeal()), seed=4)
    weak = chain_echoes(beams, sensor_of("SMART", NonIdeal(afterpulse=1e-3, afterpulse_ns=5.0)), seed=4)
    assert 0.8 < (plain.area[:, 0] == weak.area[:, 0]).mean() <= 1.0


@pytest.mark.parametrize(
    "changed",
    [{"crosstalk_sides": 0.01}, {"crosstalk_corners": 0.01}, {"dead_spread_ns": 0.5}, {"dead_recovery_ns": 0.5}],
)
def test_what_else_disturbs_detectors_is_not_counted(changed: dict[str, float]) -> None:
    sensor, other = sensor_of("SMART", TYPICAL), sensor_of("SMART", replace(TYPICAL, **changed))
    beams = light(1.0, 200, range_m=30.0)
    assert law.can_count(sensor, numbers_of(sensor), beams)
    assert not law.can_count(other, numbers_of(other), beams)
    assert same(chain_echoes(beams, other, seed=1), follow(beams, other, seed=1))


def test_a_probability_out_of_range_is_named() -> None:
    with pytest.raises(UsageError, match=r"afterpulse = 1\.0 is out of range"):
        chain_echoes(light(1.0, 5), sensor_of("SMART", replace(TYPICAL, afterpulse=1.0)))
