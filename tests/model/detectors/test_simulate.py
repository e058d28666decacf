"""SPADs that disturb each other: against a slow simulator of its own, against the exact chain, and closed forms."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import detector_reference as slow
from detector_kit import NOWHERE_M, dark_flash, features, follow, light, same, sensor_of
from lidarcheck.errors import UsageError
from lidarcheck.model import echoes_of
from lidarcheck.model.detectors import array as array
from lidarcheck.model.detectors import heap as heap
from lidarcheck.model.detectors.simulate import draw_avalanches
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, NonIdeal, Sensor

TYPICAL = NonIdeal(0.035, 0.017, 0.03, 5.0, 0.3, 30.0, 1.0)
KINDS = {
    "crosstalk": NonIdeal(crosstalk_sides=0.4, crosstalk_corners=0.2),
    "afterpulsing": NonIdeal(afterpulse=0.5, afterpulse_ns=3.0, afterpulse_slow_share=0.4, afterpulse_slow_ns=20.0),
    "dead time": NonIdeal(dead_spread_ns=4.0),
    "recovery": NonIdeal(dead_recovery_ns=5.0),
    "dead time and recovery": NonIdeal(dead_spread_ns=2.0, dead_recovery_ns=3.0),
    "all": NonIdeal(0.3, 0.2, 0.3, 8.0, 0.2, 25.0, 2.0),
}


def agreement(ours: np.ndarray, many: int, theirs: np.ndarray, few: int) -> Iterator[tuple[str, float]]:
    """p-values of every feature, of the number of echoes and of beams with one; each sample's number of beams."""
    for column, name in enumerate(("range", "width", "area", "peak"), start=1):
        if min(len(ours), len(theirs)) > 20:
            yield (
                name,
                float(stats.ks_2samp(ours[:, column].round(3), theirs[:, column].round(3), method="asymp").pvalue),
            )
    hits, found = len(np.unique(ours[:, 0])), len(np.unique(theirs[:, 0]))
    yield "beams with an echo", float(stats.fisher_exact([[hits, found], [many - hits, few - found]]).pvalue)
    second, other = len(ours) - hits, len(theirs) - found
    if second + other > 20:
        yield "further echoes", float(stats.binomtest(other, second + other, few / (few + many)).pvalue)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
@pytest.mark.parametrize("kind", KINDS)
def test_echoes_agree_with_every_detector_followed_slowly(variant: str, kind: str) -> None:
    sensor = sensor_of(variant, KINDS[kind], max_range_m=24.0, max_echoes=2)
    few, times = 120, 25
    range_m = np.random.default_rng(3).uniform(9.0, 10.0, few)
    p_values = {}
    for signal in (0.03, 0.12, 1.5, 60.0):
        theirs = slow.echoes(light(signal, few, range_m=range_m), sensor, np.random.default_rng(42))
        ours = features(follow(light(signal, times * few, range_m=np.tile(range_m, times)), sensor), sensor)
        p_values |= {(signal, name): p for name, p in agreement(ours, times * few, theirs, few)}
    assert len(p_values) > 10
    assert min(p_values.values()) > 1e-3 / len(p_values), min(p_values.items(), key=lambda item: item[1])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("signal", "background"), [(0.0, 0.02), (5.0, 3e-4), (1.0, 0.2)])
def test_avalanches_agree_with_every_detector_followed_slowly(kind: str, signal: float, background: float) -> None:
    """Means over stretches of the trace, from the first bins (the steady state) to the tail behind the pulse."""
    sensor = sensor_of("SMART", KINDS[kind], max_range_m=24.0)
    few, times = 150, 20
    beams = light(signal, few, range_m=9.5, background=background)
    theirs = slow.avalanches(
        slow.rates_of(beams, sensor), beams.background_per_ns * sensor.bin_ns, sensor, np.random.default_rng(7)
    ).sum(axis=(2, 3, 4))
    ours = draw_avalanches(light(signal, times * few, range_m=9.5, background=background), sensor, seed=2).T
    scores = []
    for low, high in [(0, 5), (5, 20), (20, 55), (55, 62), (62, 70), (70, 80), (80, 100), (100, 160)]:
        one, other = ours[low:high].sum(axis=0), theirs[low:high].sum(axis=0)
        error = np.sqrt(one.var() / len(one) + other.var() / len(other))
        scores.append(abs(one.mean() - other.mean()) / max(error, 1e-9))
    assert max(scores) < 4.2, np.round(scores, 1)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_ideal_detectors_agree_with_the_exact_chain(variant: str) -> None:
    sensor = Sensor.of(variant, max_range_m=30.0)
    n = 6000
    range_m = np.random.default_rng(3).uniform(14.0, 15.0, n)
    p_values = {}
    for signal in (0.03, 0.06, 0.2, 1.5, 20.0, 5000.0):
        beams = light(signal, n, range_m=range_m)
        scan = echoes_of(beams, sensor, seed=5)
        beam = scan.layer * 960 + scan.point
        theirs = np.stack([beam, scan.range_m.round(2), scan.width_ns, scan.area, scan.peak], axis=1)
        ours = features(follow(beams, sensor, seed=6), sensor)
        p_values |= {(signal, name): p for name, p in agreement(ours, n, theirs, n)}
    assert min(p_values.values()) > 1e-3 / len(p_values), min(p_values.items(), key=lambda item: item[1])


@pytest.mark.parametrize(("variant", "background"), [("SMART", 1.1e-3), ("SLIM", 5e-4)])
def test_ideal_detectors_raise_as_many_false_alarms_as_the_exact_chain(variant: str, background: float) -> None:
    sensor = Sensor.of(variant, max_range_m=150.0, threshold=6)
    beams = light(0.0, 20_000, background=background)
    scan, ours = echoes_of(beams, sensor, seed=3), features(follow(beams, sensor, seed=4), sensor)
    assert len(scan) > 150
    assert abs(len(scan) - len(ours)) < 4 * np.sqrt(len(scan) + len(ours))
    assert stats.ks_2samp(scan.range_m.round(2), ours[:, 1]).pvalue > 1e-3
    assert stats.ks_2samp(scan.area, ours[:, 3]).pvalue > 1e-3


@pytest.mark.parametrize("background", [3e-3, 0.3])
def test_ideal_detectors_are_in_the_steady_state_from_the_first_bin(background: float) -> None:
    """Below and above the rate from which bins are gone through one by one."""
    sensor = Sensor.of("SMART", max_range_m=8.0)
    avalanches = draw_avalanches(light(0.0, 5000, background=background), sensor, seed=1)
    p = -np.expm1(-background)
    expected = sensor.detectors * p / (1 + (sensor.dead_bins - 1) * p)
    assert np.abs(avalanches.mean(axis=0) - expected).max() < 4.5 * np.sqrt(expected / 5000)


def test_one_avalanche_sets_off_the_neighbours_that_it_has() -> None:
    """Mean number set off per primary, to second order in the coupling, in 3 x 9 SPADs without any dead time."""
    side, corner, background, n = 0.04 / 4, 0.08 / 4, 1e-4, 3000
    real = NonIdeal(crosstalk_sides=4 * side, crosstalk_corners=4 * corner)
    sensor = sensor_of("SMART", real, on_bins=1, dead_bins=1, max_range_m=300.0)
    row, column = np.divmod(np.arange(27), 9)
    down, right = np.abs(row[:, None] - row), np.abs(column[:, None] - column)
    coupling = side * (down + right == 1) + corner * ((down == 1) & (right == 1))
    twice = coupling @ coupling
    np.fill_diagonal(twice, 0.0)
    per_primary = 1.0 + (coupling + twice).sum() / 27
    avalanches = draw_avalanches(light(0.0, n, background=background), sensor, seed=3)
    primaries = n * sensor.bins * sensor.detectors * -np.expm1(-background)
    assert per_primary > 1.08
    assert avalanches.sum() / primaries == pytest.approx(per_primary, abs=4 * 1.3 / np.sqrt(primaries))


def test_certain_crosstalk_floods_the_shot_and_no_other() -> None:
    sides = sensor_of("SMART", NonIdeal(crosstalk_sides=4.0), on_bins=1, dead_bins=1)
    beams = light(0.0, 300, background=2e-6)
    flooded = draw_avalanches(beams, sides)
    assert set(np.unique(flooded)) - {54} == {0, 27}, "54: two shots at once"
    # Corners lead from black squares to black ones: 14 of the 27 SPADs of a shot, or the 13 white ones.
    corners = replace(sides, nonideal=NonIdeal(crosstalk_corners=4.0))
    assert set(np.unique(draw_avalanches(beams, corners))) == {0, 13, 14}
    # 7 SPADs stand in one row, without corners.
    row = sensor_of("SMART", NonIdeal(crosstalk_sides=4.0), spads=7, on_bins=1, dead_bins=1)
    assert set(np.unique(draw_avalanches(beams, row))) == {0, 7}
    alone = replace(row, nonideal=NonIdeal(crosstalk_corners=4.0))
    assert set(np.unique(draw_avalanches(beams, alone))) == {0, 1}


def test_crosstalk_adds_to_the_same_primaries() -> None:
    """Without dead time nothing is taken away: in no bin fewer avalanches than without crosstalk."""
    plain = sensor_of("SMART", NonIdeal(), on_bins=1, dead_bins=1)
    beams = light(0.0, 200, background=1e-3)
    alone = draw_avalanches(beams, plain)
    joined = draw_avalanches(beams, replace(plain, nonideal=NonIdeal(crosstalk_sides=0.2)))
    assert np.all(joined >= alone)
    assert 1.05 < joined.sum() / alone.sum() < 1.25
    assert np.array_equal(joined > 0, alone > 0)


def test_afterpulses_of_a_flash_come_by_two_exponentials() -> None:
    """All SPADs of a dark array fire at once; for one dead time behind theirs, only their own afterpulses are seen."""
    real = NonIdeal(afterpulse=0.4, afterpulse_ns=4.0, afterpulse_slow_share=0.35, afterpulse_slow_ns=30.0)
    sensor = sensor_of("SMART", real, dead_bins=60, max_range_m=60.0, bin_ns=0.5, pulse_fwhm_ns=0.01)
    n = 400
    total = draw_avalanches(dark_flash(n), sensor, seed=4).sum(axis=0)
    first = int(2 * NOWHERE_M / LIGHT_SPEED_M_PER_NS / 0.5)
    assert total[first] == n * sensor.detectors
    assert not total[:first].any()
    assert not total[first + 1 : first + 60].any()
    edges_ns = np.arange(61) * 0.5
    later = 0.65 * np.exp(-edges_ns / 4.0) + 0.35 * np.exp(-edges_ns / 30.0)
    chances = 0.4 * -np.diff(later)
    seen = total[first + 60 : first + 120]
    others = n * sensor.detectors - seen.sum()
    expected = n * sensor.detectors * np.append(chances, 1.0 - chances.sum())
    assert stats.chisquare(np.append(seen, others), expected).pvalue > 1e-3


def test_afterpulses_have_afterpulses_and_stay_in_their_detector() -> None:
    """In the dark none is lost, so chains are geometric: 1 / (1 - a) avalanches for each of the flash."""
    sensor = sensor_of("SLIM", NonIdeal(afterpulse=0.3, afterpulse_ns=2.0), pulse_fwhm_ns=0.05)
    n = 300
    total = draw_avalanches(dark_flash(n), sensor, seed=5).sum()
    detectors = n * sensor.detectors
    spread = np.sqrt(0.3) / 0.7 / np.sqrt(detectors)
    assert total / detectors == pytest.approx(1 / 0.7, abs=4 * spread)


def test_afterpulses_without_delay_come_at_the_end_of_the_dead_time() -> None:
    sensor = sensor_of("SMART", NonIdeal(afterpulse=0.5, afterpulse_ns=0.0), dead_bins=20, pulse_fwhm_ns=0.05)
    total = draw_avalanches(dark_flash(100), sensor).sum(axis=0)
    busy = np.flatnonzero(total)
    assert len(busy) > 5
    assert np.all(np.diff(busy) == 20)


def test_an_afterpulse_whose_detector_is_dead_is_lost() -> None:
    """A second flash while the afterpulse waits: only those due before the flash or behind its dead time are left."""
    real = NonIdeal(afterpulse=0.9, afterpulse_ns=1e-9)
    sensor = sensor_of("SMART", real, dead_bins=20, on_bins=9, pulse_fwhm_ns=0.05, max_range_m=20.0)
    flash_ns = 2 * NOWHERE_M / LIGHT_SPEED_M_PER_NS
    second_m = LIGHT_SPEED_M_PER_NS * (flash_ns + 20.0) / 2
    two = Light([0], [0], [0.0], [0, 2], [NOWHERE_M, second_m], [1e9, 1e9])  # type: ignore[arg-type]
    total = draw_avalanches(two, sensor)[0]
    first = int(flash_ns)
    assert total[first] == total[first + 20] == sensor.detectors, "due with the second flash: no avalanche more"
    assert 0.75 * sensor.detectors < total[first + 40] < sensor.detectors, "those of the second flash alone"


def dead_times(sensor: Sensor) -> tuple[np.ndarray, np.ndarray]:
    """Dead times and their probabilities: rounded numbers, those below the ON time counted as it. The sum of a normal
    and an exponential number by the mean over the quantiles of the first."""
    real = sensor.nonideal
    spread, recovery = real.dead_spread_ns / sensor.bin_ns, real.dead_recovery_ns / sensor.bin_ns
    bins = np.arange(sensor.on_bins, sensor.dead_bins + int(12 * spread + 30 * recovery) + 2)
    edges = np.concatenate([[-np.inf], bins[:-1] + 0.5, [np.inf]])
    if recovery == 0.0:
        return bins, np.diff(stats.norm.cdf(edges, sensor.dead_bins, spread))
    normal = sensor.dead_bins + spread * stats.norm.ppf((np.arange(4000) + 0.5) / 4000)
    return bins, np.diff(stats.expon.cdf(edges[:, None] - normal, scale=recovery).mean(axis=1))


@pytest.mark.parametrize(
    ("spread_ns", "recovery_ns", "bin_ns"),
    [(0.3, 0.0, 1.0), (2.0, 0.0, 0.5), (6.0, 0.0, 1.0), (0.0, 5.0, 1.0), (0.0, 2.0, 0.5), (2.0, 4.0, 1.0)],
)
def test_dead_times_are_rounded_numbers(spread_ns: float, recovery_ns: float, bin_ns: float) -> None:
    """A single SPAD in endless light fires the moment it is armed: the gaps are the dead times."""
    real = NonIdeal(dead_spread_ns=spread_ns, dead_recovery_ns=recovery_ns)
    sensor = sensor_of("SMART", real, spads=1, shots=1, bin_ns=bin_ns)
    avalanches = draw_avalanches(light(0.0, 40, background=10.0 / bin_ns * 9), sensor, seed=8)
    gaps = np.concatenate([np.diff(np.flatnonzero(row)) for row in avalanches])
    bins, chances = dead_times(sensor)
    expected = chances * len(gaps)
    likely = expected > 8
    observed = np.array([np.count_nonzero(gaps == b) for b in bins])
    pooled = [np.append(x[likely], x[~likely].sum()) for x in (observed, expected)]
    keep = pooled[1] > 0.5
    assert gaps.min() >= sensor.on_bins
    assert observed.sum() == len(gaps)
    assert stats.chisquare(pooled[0][keep], pooled[1][keep] * observed.sum() / pooled[1][keep].sum()).pvalue > 1e-3


@pytest.mark.parametrize("background", [0.01, 0.3])
@pytest.mark.parametrize("real", [NonIdeal(dead_spread_ns=5.0), NonIdeal(dead_recovery_ns=6.0)])
def test_the_rate_under_random_dead_times_is_the_renewal_one(real: NonIdeal, background: float) -> None:
    """Mean gap = E[d] + (1 - p) / p, and in the steady state as many avalanches in the first bins as in the last."""
    sensor = sensor_of("SMART", real, max_range_m=60.0)
    n = 1500
    avalanches = draw_avalanches(light(0.0, n, background=background), sensor, seed=9)
    bins, chances = dead_times(sensor)
    p = -np.expm1(-background)
    rate = 1.0 / ((bins * chances).sum() + (1.0 - p) / p)
    for part in (avalanches[:, :60], avalanches):
        assert part.mean() / sensor.detectors == pytest.approx(
            rate, rel=4.5 / np.sqrt(n * part.shape[1] * 27 * 5 * rate)
        )


def test_afterpulses_are_in_the_steady_state_from_the_first_bin() -> None:
    """1 / (1 - a) of the dark rate where avalanches are so rare that none is lost, also for long chains of them."""
    n, dark = 40_000, 1e-5
    for share, delay_ns in ((0.3, 60.0), (0.8, 10.0)):
        sensor = sensor_of("SLIM", NonIdeal(afterpulse=share, afterpulse_ns=delay_ns), max_range_m=15.0)
        early = draw_avalanches(light(0.0, n, background=dark), sensor, seed=2)
        expected = n * sensor.bins * sensor.detectors * dark / (1.0 - share)
        spread = np.sqrt(expected * (1.0 + share) / (1.0 - share) ** 2)
        assert abs(early.sum() - expected) < 4 * spread, (share, early.sum(), expected)


def test_the_same_echoes_for_any_threads_chunks_and_order() -> None:
    sensor = sensor_of("SLIM", TYPICAL, max_range_m=60.0)
    n = 900
    range_m = np.random.default_rng(1).uniform(3, 55, n)
    beams = light(0.5, n, range_m=range_m, background=1e-3)
    first = follow(beams, sensor)
    assert first.held.sum() > 800
    assert same(first, follow(beams, sensor, chunk=97, threads=2))
    order = np.random.default_rng(0).permutation(n)[: n // 2]
    few = replace(light(0.5, len(order), range_m=range_m[order], background=1e-3), layer=beams.layer[order])
    few = replace(few, point=beams.point[order])
    others = EchoArrays(*(column[order] for column in first))
    assert same(others, follow(few, sensor, chunk=50)), "neither the order nor other beams matter"
    assert not same(first, follow(beams, sensor, seed=2))
    assert not same(first, follow(beams, sensor, frame=1))


@pytest.mark.parametrize("on_bins", [5, 9, 12])
def test_echoes_are_those_of_the_avalanches(on_bins: int) -> None:
    """The search leaves out bins that cannot hold an echo; none is lost by that, whatever its blocks."""
    real = replace(TYPICAL, afterpulse=0.4)
    sensor = sensor_of("SMART", real, max_range_m=60.0, threshold=4, max_echoes=16, on_bins=on_bins)
    beams = light(0.3, 200, range_m=np.random.default_rng(1).uniform(1, 58, 200), background=3e-4)
    ours, counts = follow(beams, sensor), draw_avalanches(beams, sensor, seed=1)
    total = np.cumsum(np.pad(counts, ((0, 0), (sensor.on_bins, 0))), axis=1)
    on = total[:, sensor.on_bins :] - total[:, : -sensor.on_bins]
    found = []
    for i, trace in enumerate(on):
        # What was ON before bin 0 is not in the counts.
        trace[: sensor.on_bins] = 0
        found += [(i, *echo) for echo in slow.echoes_of_trace(trace, sensor)]
    theirs, mine = np.array(found), features(ours, sensor)
    late = mine[:, 1] > 6.0
    assert ours.held.max() < 16
    assert np.array_equal(mine[late][:, 2:], theirs[theirs[:, 1] > 6.0][:, 2:])
    assert len(found) > 200


def test_waiting_afterpulses_leave_the_heap_in_order() -> None:
    rng = np.random.default_rng(0)
    entries, size = np.empty(300, dtype=np.int64), np.zeros(2, dtype=np.int64)
    due, detector = rng.integers(-500, 500, 300), rng.integers(0, heap.MOST_DETECTORS, 300)
    for one, other in zip(due, detector, strict=True):
        heap.push(entries, size, one, other)
    heap.push(entries, size, 1, 1)
    assert size.tolist() == [300, 1], "one too many is counted, not kept"
    taken = [(heap.due_bin(entries), heap.pop(entries, size)) for _ in range(300)]
    assert taken == sorted(zip(due.tolist(), detector.tolist(), strict=True))
    assert size[0] == 0


def test_too_many_waiting_afterpulses_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(array, "_ROOM", 3)
    sensor = sensor_of("SMART", NonIdeal(afterpulse=0.9, afterpulse_ns=50.0), max_range_m=30.0)
    with pytest.raises(UsageError, match="more than 3 afterpulses of a beam wait"):
        follow(dark_flash(2), sensor)


@pytest.mark.parametrize(
    ("name", "value"),
    [("crosstalk_sides", -0.1), ("crosstalk_corners", 4.1), ("afterpulse", 1.0), ("afterpulse", float("nan"))],
)
def test_numbers_out_of_range_are_named(name: str, value: float) -> None:
    sensor = sensor_of("SMART", replace(NonIdeal(), **{name: value}))
    with pytest.raises(UsageError, match=f"{name} = .* is out of range"):
        array.detectors_of(sensor, numbers_of(sensor))
