"""The exact chain against closed forms, limits and the path that follows every detector on its own."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy import stats

from lidarcheck.model import Model, detection, echoes_of, expected_trace, light_of, reference, simulate
from lidarcheck.model.trace import bin_rates, draw_traces, on_probability
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, Material, Sensor
from reference_kit import detector_traces, simulate_detectors

SHORT = {"max_range_m": 40.0}


def light(signal: float | np.ndarray, n: int, *, range_m: float | np.ndarray = 20.0, background: float = 3e-4) -> Light:
    """`n` beams with one pulse each."""
    layer, point = np.divmod(np.arange(n), 960)
    return Light(
        layer=layer,
        point=point,
        background_per_ns=np.full(n, background),
        first_pulse=np.arange(n + 1),
        pulse_range_m=np.broadcast_to(range_m, n),
        pulse_signal=np.broadcast_to(np.asarray(signal, dtype=np.float64), n),
    )


def binomial_p_value(values: np.ndarray, trials: int, chance: float) -> float:
    """Chi-square of a sample against Binomial(trials, chance), cells pooled to at least eight expected."""
    pmf = stats.binom.pmf(np.arange(trials + 1), trials, chance) * len(values)
    cells: list[list[int]] = [[]]
    for k in np.flatnonzero(pmf > 1e-12):
        cells[-1].append(int(k))
        if pmf[cells[-1]].sum() >= 8:
            cells.append([])
    cells[-2 if len(cells) > 1 else 0] += cells.pop() if len(cells) > 1 else []
    expected = np.array([pmf[cell].sum() for cell in cells])
    observed = np.array([np.isin(values, cell).sum() for cell in cells])
    if len(cells) == 1:
        return 1.0
    return float(stats.chisquare(observed, expected * observed.sum() / expected.sum()).pvalue)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
@pytest.mark.parametrize("signal", [0.02, 0.5, 8.0, 300.0])
def test_each_bin_is_binomial(variant: str, signal: float) -> None:
    sensor = Sensor.of(variant, **SHORT)
    beams = light(signal, 4000)
    q = on_probability(bin_rates(light(signal, 1), sensor), [3e-4], sensor)[0]
    traces = draw_traces(beams, sensor, seed=11)
    centre = int(2 * 20.0 / LIGHT_SPEED_M_PER_NS)
    bins = [0, 5, 60, *range(centre - 8, centre + 30, 3), sensor.bins - 1]
    p_values = [binomial_p_value(traces[:, k], sensor.detectors, q[k]) for k in bins]
    assert min(p_values) > 1e-4 / len(bins), dict(zip(bins, p_values, strict=True))


def test_background_alone_is_stationary_from_the_first_bin() -> None:
    sensor = Sensor.of("SMART", background_per_ns=0.02, **SHORT)
    p = -np.expm1(-0.02)
    expected = sensor.detectors * sensor.on_bins * p / (1 + (sensor.dead_bins - 1) * p)
    beams = light(0.0, 3000, background=0.02)
    assert expected_trace(light(0.0, 1, background=0.02), sensor)[0] == pytest.approx(np.full(sensor.bins, expected))
    mean = draw_traces(beams, sensor, seed=2).mean(axis=0)
    spread = np.sqrt(expected * (1 - expected / sensor.detectors) / len(beams))
    assert np.abs(mean - expected).max() < 5 * spread


def test_no_light_no_echo_but_false_alarms() -> None:
    quiet = Sensor.of("SMART", background_per_ns=0.0)
    assert len(echoes_of(light(0.0, 2000, background=0.0), quiet)) == 0
    assert len(echoes_of(light(1e-12, 2000, background=0.0), quiet)) == 0


@pytest.mark.parametrize(("variant", "peak"), [("SMART", 135), ("SLIM", 236)])
def test_endless_light_in_one_bin_fires_all_detectors_at_once(variant: str, peak: int) -> None:
    """Every detector fires in the pulse's bin and is ON for 9: nothing is left to chance."""
    sensor = Sensor.of(variant, background_per_ns=0.0, pulse_fwhm_ns=0.05)
    middle_of_bin_ns = 669.5
    range_m = middle_of_bin_ns * LIGHT_SPEED_M_PER_NS / 2
    scan = echoes_of(light(1e9, 50, range_m=range_m, background=0.0), sensor)
    assert len(scan) == 50
    assert np.all(scan.width_ns == 9)
    assert np.all(scan.area == 9 * sensor.detectors)
    assert np.all(scan.peak == peak)
    assert scan.range_m == pytest.approx(np.full(50, round(range_m, 2)))


def test_saturation_pulls_the_echo_nearer() -> None:
    """Pile-up: of a pulse of finite length, only the foot is seen, the more so the brighter it is."""
    sensor = Sensor.of("SMART", background_per_ns=0.0)
    shift = [echoes_of(light(s, 4000, background=0.0), sensor, seed=1).range_m.mean() - 20.0 for s in (0.3, 2.0, 10.0)]
    assert 0.0 > shift[0] > shift[1] > shift[2]
    assert shift[2] < -0.3


def test_weak_light_is_unbiased() -> None:
    """Where nothing piles up, the mean range is the surface's; dead time only pulls it nearer."""
    sensor = Sensor.of("SLIM", background_per_ns=0.0)
    truth = np.random.default_rng(0).uniform(50, 60, 40_000)
    scan = echoes_of(light(0.12, 40_000, range_m=truth, background=0.0), sensor)
    residual = scan.range_m - truth[scan.layer * 960 + scan.point]
    assert abs(residual.mean()) < 0.01 + 4 * residual.std() / np.sqrt(len(residual))


def agreement(ours: Scan, theirs: Scan) -> Iterator[tuple[str, float]]:
    """p-values of every feature of two simulations of the same light."""
    for name in ("peak", "area", "width_ns", "range_m"):
        one, other = np.round(getattr(ours, name), 3), np.round(getattr(theirs, name), 3)
        if min(len(one), len(other)) > 20:
            yield name, float(stats.ks_2samp(one, other).pvalue)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_the_chain_agrees_with_every_detector_followed_on_its_own(variant: str) -> None:
    sensor = Sensor.of(variant, max_range_m=30.0)
    rng = np.random.default_rng(42)
    n, range_m = 400, np.random.default_rng(3).uniform(14.0, 15.0, 400)
    p_values = {}
    for signal in (0.0, 0.03, 0.06, 0.1, 0.2, 0.5, 1.5, 5.0, 20.0, 200.0, 5000.0):
        # Many more beams cost the chain nothing and halve the statistical error of the comparison.
        many = light(signal, 20 * n, range_m=np.tile(range_m, 20))
        theirs = simulate_detectors(light(signal, n, range_m=range_m), sensor, rng)
        ours = echoes_of(many, sensor, seed=5)
        p_values |= {(signal, name): p for name, p in agreement(ours, theirs)}
        hits = np.unique(ours.layer * 960 + ours.point).size
        found = np.unique(theirs.layer * 960 + theirs.point).size
        p_values[signal, "detected"] = stats.fisher_exact([[hits, found], [20 * n - hits, n - found]]).pvalue
    assert min(p_values.values()) > 1e-3 / len(p_values), min(p_values.items(), key=lambda item: item[1])


@pytest.mark.parametrize("background", [0.0, 3e-4, 0.02])
def test_detectors_are_followed_side_by_side_as_on_their_own(background: float) -> None:
    """What holds the chain to the slow reference is that reference, with its draws."""
    sensor = Sensor.of("SLIM", max_range_m=30.0)
    rates = background + np.random.default_rng(1).exponential(0.01, (5, sensor.bins))
    settling = reference._SETTLING_DEAD_TIMES * sensor.dead_bins
    for row in rates:
        ours = detector_traces(row[None], np.array([background]), sensor, np.random.default_rng(2), settling)
        theirs = reference.detector_trace(row, background, sensor, np.random.default_rng(2))
        assert np.array_equal(ours, theirs[None])
        assert theirs.max() > 5
    still = np.stack([np.zeros(sensor.bins), rates[0], np.full(sensor.bins, 1e9)])
    dark, _, bright = detector_traces(still, np.zeros(3), sensor, np.random.default_rng(3), 2)
    assert dark.max() == 0
    assert bright[0] == sensor.detectors


@pytest.mark.parametrize("signals", [(0.15, 0.0), (0.15, 0.15), (3.0, 0.2)])
def test_several_pulses_agree_with_every_detector_followed_on_its_own(signals: tuple[float, float]) -> None:
    sensor = Sensor.of("SMART", max_range_m=30.0)
    n = 300
    pulses = Light(
        layer=np.zeros(20 * n, int),
        point=np.arange(20 * n),
        background_per_ns=np.full(20 * n, 3e-4),
        first_pulse=np.arange(0, 40 * n + 1, 2),
        pulse_range_m=np.tile([9.7, 11.9], 20 * n),
        pulse_signal=np.tile(signals, 20 * n),
    )
    few = Light(
        *(getattr(pulses, name)[:n] for name in ("layer", "point", "background_per_ns")),
        first_pulse=pulses.first_pulse[: n + 1],
        pulse_range_m=pulses.pulse_range_m[: 2 * n],
        pulse_signal=pulses.pulse_signal[: 2 * n],
    )
    ours = echoes_of(pulses, sensor, seed=1)
    theirs = simulate_detectors(few, sensor, np.random.default_rng(8))
    for name, p_value in agreement(ours, theirs):
        assert p_value > 1e-4, name
    assert len(ours) / 20 == pytest.approx(len(theirs), abs=5 * np.sqrt(n))


@pytest.mark.parametrize(("variant", "background"), [("SMART", 1.1e-3), ("SLIM", 5.5e-4)])
def test_skipped_background_raises_as_many_false_alarms_as_visiting_every_bin(variant: str, background: float) -> None:
    """Echoes before, in and behind the pulse, where most beams are settled by one draw, against the whole trace."""
    sensor = Sensor.of(variant, background_per_ns=background, max_range_m=150.0)
    n = 30_000
    beams = light(0.03, n, range_m=75.0, background=background)
    skipping = echoes_of(beams, sensor, seed=3)
    visited: list[tuple[float, float, int, int]] = []
    for start in range(0, n, 5000):
        part = draw_traces(light(0.03, 5000, range_m=75.0, background=background), sensor, seed=start)
        busy = np.flatnonzero(part.max(axis=1) > sensor.threshold)
        visited += [echo for i in busy for echo in reference.echoes_of_trace(part[i], sensor)]
    ranges, areas = np.array(visited)[:, 0], np.array(visited)[:, 2]
    assert len(visited) > 200
    for low, high in [(-1.0, 72.0), (72.0, 78.0), (78.0, 151.0)]:
        ours = np.count_nonzero((skipping.range_m > low) & (skipping.range_m <= high))
        theirs = np.count_nonzero((ranges > low) & (ranges <= high))
        assert abs(ours - theirs) < 4.5 * np.sqrt(ours + theirs + 1), (low, high, ours, theirs)
    assert stats.ks_2samp(np.round(skipping.range_m, 2), np.round(ranges, 2)).pvalue > 1e-4
    assert stats.ks_2samp(skipping.area, areas).pvalue > 1e-4


def scene(n: int = 6000) -> tuple[IdealScan, Model]:
    rng = np.random.default_rng(9)
    layer, point = np.divmod(np.arange(n), 50)
    ideal = IdealScan(layer, point, rng.uniform(3, 290, n), np.ones(n), rng.uniform(0, 80, n))
    return ideal, Model(Sensor.of("SLIM"), {1: Material("wall", 0.5)})


def same(one: Scan, other: Scan) -> bool:
    names = ("x_m", "y_m", "z_m", "layer", "point", "echo_number", "width_ns", "area", "peak")
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in names)


def test_the_same_bytes_for_any_threads_chunks_and_order(monkeypatch: pytest.MonkeyPatch) -> None:
    ideal, model = scene()
    first = simulate(ideal, model, seed=17, threads=1)
    assert len(first) > 1000
    assert same(first, simulate(ideal, model, seed=17, threads=1))
    assert same(first, simulate(ideal, model, seed=17, threads=2))
    shuffled = ideal.take(np.random.default_rng(0).permutation(len(ideal)))
    assert same(first, simulate(shuffled, model, seed=17, threads=3))
    monkeypatch.setattr(detection, "_CHUNK", 97)
    assert same(first, simulate(ideal, model, seed=17, threads=2))
    half = simulate(ideal.take(np.arange(0, len(ideal), 2)), model, seed=17)
    assert same(half, first.take(first.point % 2 == 0)), "a beam's echoes do not depend on other beams"


def test_other_seeds_and_frames_give_other_echoes() -> None:
    ideal, model = scene()
    first = simulate(ideal, model, seed=17)
    assert not same(first, simulate(ideal, model, seed=18))
    assert not same(first, simulate(ideal, model, seed=17, frame=1))


def test_the_largest_echoes_are_kept_in_order_of_range() -> None:
    signals = np.array([0.3, 2.0, 0.5, 50.0, 1.0])
    ranges = np.array([10.0, 20.0, 30.0, 40.0, 50.0])
    beam = Light([0], [0], [0.0], [0, 5], ranges, signals)  # type: ignore[arg-type]
    for room, kept in [(1, [40]), (2, [20, 40]), (3, [20, 40, 50]), (5, [10, 20, 30, 40, 50])]:
        scan = echoes_of(beam, Sensor.of("SLIM", max_echoes=room, background_per_ns=0.0), seed=4)
        assert np.round(scan.range_m / 10).astype(int).tolist() == [k // 10 for k in kept]
        assert scan.echo_number.tolist() == list(range(1, len(kept) + 1))


def test_ranges_are_whole_centimetres_and_lie_on_their_beams() -> None:
    ideal, model = scene()
    scan = simulate(ideal, model, seed=1)
    assert np.abs(scan.range_m * 100 - np.rint(scan.range_m * 100)).max() < 1e-6
    expected = light_of(ideal, model)
    assert set(zip(scan.layer, scan.point, strict=True)) <= set(zip(expected.layer, expected.point, strict=True))


@pytest.mark.parametrize("overrides", [{"dead_bins": 9, "on_bins": 1}, {"dead_bins": 1, "on_bins": 1}, {"bin_ns": 0.5}])
def test_every_number_of_the_sensor_can_be_another(overrides: dict[str, float]) -> None:
    sensor = Sensor.of("SMART", max_range_m=30.0, threshold=4, **overrides)
    n = 250
    range_m = np.full(n, 12.2)
    theirs = simulate_detectors(light(0.3, n, range_m=range_m), sensor, np.random.default_rng(1))
    ours = echoes_of(light(0.3, 20 * n, range_m=12.2), sensor, seed=1)
    assert len(theirs) > 100
    for name, p_value in agreement(ours, theirs):
        assert p_value > 1e-4, name


def test_a_dazzled_sensor_runs_through_every_bin() -> None:
    """Background beyond what blocks can hold: the explicit chain takes over, on the same stationary level."""
    sensor = Sensor.of("SMART", background_per_ns=0.2, max_range_m=30.0)
    theirs = simulate_detectors(light(0.0, 40, background=0.2), sensor, np.random.default_rng(1))
    ours = echoes_of(light(0.0, 2000, background=0.2), sensor, seed=1)
    assert len(ours) / 2000 == pytest.approx(len(theirs) / 40, rel=0.05)
    assert ours.area.mean() == pytest.approx(theirs.area.mean(), rel=0.05)
