"""Crosstalk counted: against every detector followed one by one, against a slow simulator, and closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import detector_reference as slow
from detector_kit import dark_flash, features, follow, light, same, sensor_of, unlikely
from lidarcheck.errors import UsageError
from lidarcheck.model import detection
from lidarcheck.model.clusters import law, sizes
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.exact.blocks import new_blocks
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.scan import Light
from lidarcheck.sensor import NonIdeal


def typical(times: float) -> NonIdeal:
    return NonIdeal(crosstalk_sides=0.035 * times, crosstalk_corners=0.017 * times)


TYPICAL, STRONG, STRONGEST = typical(1), typical(5), typical(8)
NEAR = {"max_range_m": 60.0, "max_echoes": 8}
CASES = {
    "typical": (TYPICAL, {}, (0.02, 0.08, 1.0, 30.0), 3e-4),
    "strong": (STRONG, {}, (0.02, 0.08, 1.0, 30.0), 3e-4),
    "strongest": (STRONGEST, NEAR, (0.02, 1.0, 30.0), 4e-5),
    "saturated": (STRONG, NEAR, (300.0, 5000.0), 3e-4),
    "sides": (NonIdeal(crosstalk_sides=0.3), NEAR, (0.02, 1.0, 30.0), 3e-4),
    "corners": (NonIdeal(crosstalk_corners=0.3), NEAR, (0.02, 1.0, 30.0), 3e-4),
    "one row": (STRONG, {"spads": 25} | NEAR, (0.03, 1.0, 30.0), 3e-4),
    "false alarms": (TYPICAL, {"threshold": 5, "max_echoes": 8}, (0.0, 0.05), 3e-4),
    "strong false alarms": (STRONG, {"threshold": 6, "max_echoes": 8}, (0.0, 0.05), 2e-4),
    "sun": (TYPICAL, {}, (0.05, 1.0), 7e-4),
}
"""Crosstalk, overrides of the sensor, S of a pulse, and background."""


def compared(variant: str, case: str, n: int, planted: float = 1.0) -> dict[tuple[float, str], float]:
    """p-values that counted and followed detectors have one law; `planted`: a factor on the crosstalk of the former."""
    real, overrides, signals, background = CASES[case]
    sensor = sensor_of(variant, real, **overrides)
    other = replace(real, **{name: planted * getattr(real, name) for name in ("crosstalk_sides", "crosstalk_corners")})
    changed = replace(sensor, nonideal=other)
    assert law.law_of(changed, numbers_of(changed)).most_per_bin >= background * sensor.bin_ns, (
        "else nothing is counted"
    )
    p_values = {}
    for seed, signal in enumerate(signals):
        range_m = np.random.default_rng(seed).uniform(1.0, sensor.max_range_m - 2.0, n)
        beams = light(signal, n, range_m=range_m, background=background)
        counted, followed = (
            chain_echoes(beams, changed, seed=10 + seed, threads=1),
            follow(beams, sensor, seed=20 + seed),
        )
        p_values |= {(signal, name): p for name, p in unlikely(counted, followed, sensor).items()}
    assert len(p_values) >= 4 * len(signals)
    return p_values


@pytest.mark.parametrize("n", [12_000, pytest.param(150_000, marks=pytest.mark.long)])
@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
@pytest.mark.parametrize("case", CASES)
def test_echoes_agree_with_every_detector_followed_one_by_one(variant: str, case: str, n: int) -> None:
    p_values = compared(variant, case, n)
    # Of 40 cases one in 250 fails by chance.
    assert min(p_values.values()) > 1e-4 / len(p_values), min(p_values.items(), key=lambda item: item[1])


@pytest.mark.parametrize("case", ["strong", "strong false alarms"])
def test_a_crosstalk_that_is_a_few_percent_off_is_seen(case: str) -> None:
    p_values = compared("SLIM", case, 12_000, planted=0.96)
    assert min(p_values.values()) < 1e-3 / len(p_values)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_echoes_agree_with_every_detector_followed_slowly(variant: str) -> None:
    sensor = sensor_of(variant, STRONG, max_range_m=24.0, max_echoes=2)
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


@pytest.mark.parametrize("apart_m", [1.0, 3.0, 9.0])
def test_two_pulses_and_none_agree_with_detectors_followed_one_by_one(apart_m: float) -> None:
    """The first pulse leaves neighbours dead together, and armed together when the second one comes, or long before."""
    sensor = sensor_of("SMART", STRONG, max_range_m=60.0, threshold=6, max_echoes=8)
    n = 9000
    pulses = np.arange(n) % 3
    near = np.random.default_rng(0).uniform(2.0, 40.0, n)
    range_m = np.concatenate([[one, one + apart_m][:k] for one, k in zip(near, pulses, strict=True)])
    beams = replace(
        light(0.0, n),
        first_pulse=np.append(0, np.cumsum(pulses)),
        pulse_range_m=range_m,
        pulse_signal=np.full(len(range_m), 0.6),
    )
    p_values = unlikely(chain_echoes(beams, sensor, seed=5), follow(beams, sensor, seed=6), sensor)
    assert min(p_values.values()) > 1e-3 / len(p_values), p_values


def test_the_same_echoes_for_any_threads_chunks_order_and_company(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beams of many backgrounds, some of which leave a beam alone in its group, and some too high to be counted."""
    sensor = sensor_of("SLIM", STRONG, max_range_m=120.0, threshold=6)
    n = 600
    rng = np.random.default_rng(1)
    background = np.repeat(rng.uniform(1e-5, 2e-4, 60), 10)
    background[::97], background[5::97] = 3e-2, 0.0
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
    """Counts draw what the exact chain draws, so that a beam in which nothing is set off has the echoes it had."""
    beams = light(1.0, 2000, range_m=30.0, background=0.0)
    plain = chain_echoes(beams, sensor_of("SMART", NonIdeal()), seed=4)
    weak = chain_echoes(beams, sensor_of("SMART", typical(0.02)), seed=4)
    assert 0.8 < (plain.area[:, 0] == weak.area[:, 0]).mean() < 1.0


def test_detectors_that_fire_all_at_once_set_off_nobody() -> None:
    beams = dark_flash(100)
    sensor = sensor_of("SMART", STRONG, pulse_fwhm_ns=0.05)
    assert same(chain_echoes(beams, sensor), chain_echoes(beams, replace(sensor, nonideal=NonIdeal())))


@pytest.mark.parametrize(
    "changed", [{"afterpulse": 0.01}, {"dead_spread_ns": 0.5}, {"dead_recovery_ns": 0.5}, {"crosstalk_sides": 3.0}]
)
def test_what_else_disturbs_detectors_and_floods_are_not_counted(changed: dict[str, float]) -> None:
    sensor, other = sensor_of("SMART", TYPICAL), sensor_of("SMART", replace(TYPICAL, **changed))
    beams, numbers = light(1.0, 200, range_m=30.0), numbers_of(sensor)
    assert law.can_count(sensor, numbers, beams)
    assert not law.can_count(other, numbers, beams) or law.law_of(other, numbers).most_per_bin < 0.0
    assert same(chain_echoes(beams, other, seed=1), follow(beams, other, seed=1))


def test_clusters_without_limits_are_those_of_a_branching_process() -> None:
    """Simulated, and the mean 1 / (1 - m) and variance s^2 / (1 - m)^3 of m tries each."""
    side, corner = 0.05, 0.03
    found = sizes.sizes_of(side, corner)
    n = np.arange(len(found))
    tries, spread = 4 * (side + corner), 4 * (side * (1 - side) + corner * (1 - corner))
    assert found.sum() == pytest.approx(1.0, abs=1e-12)
    assert found @ n == pytest.approx(1 / (1 - tries))
    assert found @ n**2 - (found @ n) ** 2 == pytest.approx(spread / (1 - tries) ** 3)
    rng, trials = np.random.default_rng(0), 100_000
    size, new = np.ones(trials, dtype=int), np.ones(trials, dtype=int)
    while new.any():
        new = rng.binomial(4 * new, side) + rng.binomial(4 * new, corner)
        size += new
    seen = np.bincount(np.minimum(size, 7), minlength=8)[1:]
    assert stats.chisquare(seen, trials * np.append(found[1:7], found[7:].sum())).pvalue > 1e-3


def test_totals_of_a_block_are_those_of_its_clusters() -> None:
    numbers = numbers_of(sensor_of("SLIM", STRONG))
    blocks, found = new_blocks(numbers), sizes.sizes_of(0.04, 0.02)
    totals = np.zeros(len(found))
    sizes.tabulate(numbers, blocks, found, 3e-4, totals)
    rng, trials = np.random.default_rng(1), 50_000
    strikes = rng.poisson(numbers.detectors * blocks.length * 3e-4, trials)
    drawn = rng.choice(len(found), strikes.sum(), p=found / found.sum())
    seen = np.bincount(np.repeat(np.arange(trials), strikes), drawn, trials).astype(int)
    expected = trials * np.append(totals[:8], totals[8:].sum())
    assert stats.chisquare(np.bincount(np.minimum(seen, 8), minlength=9), expected).pvalue > 1e-3
    assert blocks.above[: len(blocks.above)] == pytest.approx(1.0 - np.cumsum(totals)[: len(blocks.above)], abs=1e-12)


def test_a_number_out_of_range_is_named() -> None:
    with pytest.raises(UsageError, match=r"crosstalk_sides = 5\.0 is out of range"):
        chain_echoes(light(1.0, 5), sensor_of("SMART", NonIdeal(crosstalk_sides=5.0)))
