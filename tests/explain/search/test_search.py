"""Screening, the fit, and the same random numbers for all models."""

import numpy as np
import pytest

from explain_core_kit import MATERIALS, PANEL, WALL, frames, model, same, street
from lidarcheck.effects import make
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.explain.decision.closure import intervals
from lidarcheck.explain.search.screening import Screened, chance_level, screen, weaker_starts
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import fit
from lidarcheck.inference.metric import Metric
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.nuisances import LIMIT, Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model import Model, simulate
from lidarcheck.model.incremental import simulate_detected
from lidarcheck.scan import Scan


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    return Simulator(frames(model(), 2, sign=True), model(), 0)


# Screening


def toy(rng: np.random.Generator, n: int = 12) -> tuple[Metric, np.ndarray]:
    metric = Metric(rng.uniform(0.5, 2.0, n), rng.normal(size=(n, 4)))
    return metric, np.diag(metric.diagonal) + metric.factors @ metric.factors.T


class Toy:
    """What screening asks of a lab."""

    def __init__(self, metric: Metric, check: np.ndarray) -> None:
        self.metric, self.check = metric, check


def test_the_metric_is_the_inverse_of_the_covariance() -> None:
    rng = np.random.default_rng(1)
    metric, covariance = toy(rng)
    r = rng.normal(size=(12, 3))
    assert metric.times(r) == pytest.approx(np.linalg.solve(covariance, r))
    assert metric.times(r[:, 0]) == pytest.approx(np.linalg.solve(covariance, r[:, 0]))
    assert metric.square(r[:, 1]) == pytest.approx(r[:, 1] @ np.linalg.solve(covariance, r[:, 1]))


@pytest.mark.parametrize("true_scale", [-0.7, 0.0, 0.6, 1.0, 7.0])
def test_the_gain_of_a_change_is_what_the_best_scale_takes_off(true_scale: float) -> None:
    rng = np.random.default_rng(2)
    metric, covariance = toy(rng)
    change = rng.normal(size=12)
    residual = true_scale * change + 0.1 * rng.normal(size=12)
    probe = fixed_probes(["range_offset"])[0]
    gain, scale = Screened(probe, change, 1.0).gain(Toy(metric, np.zeros((1, 12))), residual)  # type: ignore[arg-type]

    def left(s: float) -> float:
        off = residual - s * change
        return float(off @ np.linalg.solve(covariance, off))

    tried = np.linspace(0.0, 1.5, 3001)
    best = tried[np.argmin([left(s) for s in tried])]
    assert scale == pytest.approx(best, abs=1e-3)
    assert gain == pytest.approx(left(0.0) - left(scale), abs=1e-9)
    assert gain >= 0.0


def test_what_changes_nothing_gains_nothing() -> None:
    metric, _ = toy(np.random.default_rng(3))
    none = Screened(fixed_probes(["dropout"])[0], np.zeros(12), 1.0)
    assert none.gain(Toy(metric, np.zeros((1, 12))), np.ones(12)) == (0.0, 0.0)  # type: ignore[arg-type]


def test_the_chance_level_is_passed_once_in_a_hundred_draws() -> None:
    rng = np.random.default_rng(4)
    metric, covariance = toy(rng, 40)
    root = np.linalg.cholesky(covariance)
    probe = fixed_probes(["dropout"])[0]
    changes = rng.normal(size=(25, 40))
    screened = [Screened(probe, change, 1.0) for change in changes]
    level = chance_level(Toy(metric, rng.normal(size=(200, 40)) @ root.T), screened)  # type: ignore[arg-type]
    fresh = (rng.normal(size=(4000, 40)) @ root.T) @ np.linalg.solve(covariance, changes.T)
    length = (changes * np.linalg.solve(covariance, changes.T).T).sum(axis=1)
    above = ((np.maximum(fresh, 0.0) ** 2 / length).max(axis=1) > level).mean()
    assert 0.0005 < above < 0.04
    assert chance_level(Toy(metric, np.zeros((1, 40))), []) == 0.0  # type: ignore[arg-type]


def test_screening_leaves_out_what_the_model_cannot_carry_and_ranks_the_true_effect_first() -> None:
    bench = Simulator(frames(model(make("range_offset", {"offset_m": 0.05})), 2), model(), 5)
    on_progress: list[tuple[int, int]] = []
    impossible = Probe("dropout", {"share": 7.0}, search_spec("dropout").free)
    probes = [*fixed_probes(["signal_gain", "range_offset", "dropout", "fog"]), impossible]
    screened = screen(bench, probes, lambda i, n: on_progress.append((i, n)))
    assert len(screened) == len(probes) - 1
    assert on_progress[0] == (1, len(probes))
    best = max(screened, key=lambda one: one.gain(bench, bench.measured)[0])
    assert best.probe.name == "range_offset"
    assert best.probe.settings["offset_m"] > 0.0


def test_a_start_that_is_much_too_strong_is_screened_again_as_weak_as_fits_and_explains_more() -> None:
    bench = Simulator(frames(model(make("range_offset", {"offset_m": 0.03})), 2), model(), 5)
    screened = screen(bench, [Probe("range_offset", {"offset_m": 0.3}, search_spec("range_offset").free)])
    [weaker] = weaker_starts(bench, screened)
    gain, scale = screened[0].gain(bench, bench.measured)
    assert scale < 0.6
    assert weaker.settings["offset_m"] == pytest.approx(0.3 * scale)
    [again] = screen(bench, [weaker])
    assert again.gain(bench, bench.measured)[0] > 1.2 * gain
    assert weaker not in weaker_starts(bench, [*screened, again])


# Fitting

TRUTHS = [
    ("signal_gain", {"gain": 0.82}, "gain", 0.03),
    ("range_offset", {"offset_m": 0.06}, "offset_m", 0.025),
    ("fog", {"mor_m": 90.0, "overlap_start_m": 1.0, "overlap_full_m": 3.0}, "mor_m", 18.0),
]


@pytest.mark.parametrize(("name", "true", "parameter", "near"), TRUTHS, ids=[t[0] for t in TRUTHS])
def test_the_fit_finds_the_parameter_that_made_the_data(name: str, true: dict, parameter: str, near: float) -> None:
    fine = {"layers": range(230, 290, 2), "points": range(320, 640, 12)}
    simulator = Simulator(frames(model(make(name, true)), 2, **fine), model(), 6)
    screened = screen(simulator, fixed_probes([name]))
    best = max(screened, key=lambda one: one.gain(simulator, simulator.measured)[0])
    start = simulator.distance(np.zeros((1, len(simulator.measured))))
    found = fit(simulator, [best.probe], [best.probe.start()], rounds=5)
    assert found.names() == (name,)
    assert found.distance < start - 0.6 * (start - simulator.floor_distance)
    value = found.effects()[0].settings()[parameter]
    assert value == pytest.approx(true[parameter], abs=near)
    one = intervals(simulator, found, 1.5)[0][parameter]
    assert one.low < one.value < one.high
    assert one.value == pytest.approx(value)
    # Nine intervals in ten hold the truth; twice as wide all of these must.
    assert one.value - 2.0 * (one.value - one.low) <= true[parameter] <= one.value + 2.0 * (one.high - one.value)
    assert [e.name for e in found.model(model()).effects] == [name]


def test_without_effects_a_fit_stays_where_it_is(simulator: Simulator) -> None:
    found = fit(simulator, [], [])
    assert found.probes == ()
    assert found.model(model()) == model()
    assert found.distance == pytest.approx(simulator.distance(simulator.shows(model())))


def test_two_effects_are_fitted_together() -> None:
    true = model(make("range_offset", {"offset_m": 0.05}), make("signal_gain", {"gain": 0.85}))
    simulator = Simulator(frames(true, 2), model(), 7)
    probes = [fixed_probes(["signal_gain"])[0], fixed_probes(["range_offset"])[0]]
    found = fit(simulator, probes, [probe.start() for probe in probes], rounds=4)
    gain, offset = found.effects()
    assert gain.settings()["gain"] == pytest.approx(0.85, abs=0.03)
    assert offset.settings()["offset_m"] == pytest.approx(0.05, abs=0.012)


def test_a_small_error_of_a_table_entry_is_found_as_a_nuisance() -> None:
    true = Nuisance(materials={WALL: -2.0}).model(model())
    simulator = Simulator(frames(true, 2, layers=range(230, 290, 2), points=range(320, 640, 8)), model(), 8)
    plain = fit(simulator, [], [])
    found = fit_nuisance(simulator, plain, rounds=4)
    assert -LIMIT <= found.nuisance.materials[WALL] < -0.2
    assert found.distance < plain.distance


# The same random numbers


READOUTS = [("range_offset", {"offset_m": 0.3}), ("dropout", {"share": 0.2}), ("walk_error", {})]


@pytest.mark.parametrize(("name", "settings"), READOUTS, ids=[r[0] for r in READOUTS])
def test_a_readout_effect_leaves_the_echoes_as_they_are(simulator: Simulator, name: str, settings: dict) -> None:
    plain, changed = simulator.scans(model(), 5), simulator.scans(model(make(name, settings)), 5)
    for one, other, frame in zip(plain, changed, simulator.frames, strict=True):
        assert not same(one, other)
        assert same(other, simulate(frame.ideal, model(make(name, settings)), seed=5, frame=frame.number))
        kept = np.isin(beam(one), beam(other)) if name == "dropout" else np.ones(len(one), dtype=bool)
        assert same(one.take(kept), other, ("layer", "point", "width_ns", "area", "peak"))
        if name == "dropout":
            assert same(one.take(kept), other)


def beam(scan: Scan) -> np.ndarray:
    return scan.layer * 1000 + scan.point


def test_a_lab_shows_what_the_simulation_does_and_its_memory_does_not_matter(simulator: Simulator) -> None:
    one = make("fog", {"mor_m": 80.0})
    two = make("range_scale", {"fraction": 0.01})
    brighter = Nuisance(materials={PANEL: 2.0}).model(model(one))
    for _ in range(2):
        for at_seed in (3, 4):
            for m in (model(), model(one), model(two), model(one, two)):
                scans = simulator.scans(m, at_seed)
                assert all(
                    same(s, simulate(f.ideal, m, seed=at_seed, frame=f.number))
                    for s, f in zip(scans, simulator.frames, strict=True)
                )
            scans = simulator.scans(model(one), at_seed, Nuisance(materials={PANEL: 2.0}))
            assert same(scans[0], simulate(simulator.frames[0].ideal, brighter, seed=at_seed, frame=0))
            turned = simulator.scans(model(), at_seed, Nuisance(yaw=2.0))
            assert not same(turned[0], simulator.scans(model(), at_seed)[0])


def test_a_model_shows_the_same_to_the_same_lab_again(simulator: Simulator) -> None:
    changed = model(make("signal_gain", {"gain": 0.9}))
    first = simulator.shows(changed)
    simulator.shows(model(make("fog", {})))
    assert np.array_equal(simulator.shows(changed), first)
    assert not simulator.shows(model()).any()
    again = Simulator(simulator.frames, model(), simulator.seed)
    assert np.array_equal(again.shows(changed), first)
    assert np.array_equal(again.measured, simulator.measured)


def test_noise_of_the_seeds_falls_out_of_the_distance(simulator: Simulator) -> None:
    rng = np.random.default_rng(2)
    n = len(simulator.measured)
    truth = rng.normal(size=n)
    off = np.array(
        [simulator.distance(truth + rng.normal(size=(2, n)), np.zeros(n), simulator.bare) for _ in range(60)]
    )
    plain = simulator.bare.square(truth)
    assert off.mean() == pytest.approx(plain, abs=4.0 * off.std() / np.sqrt(60.0))
    noisy = np.mean(
        [simulator.distance(truth + rng.normal(size=(1, n)), np.zeros(n), simulator.bare) for _ in range(20)]
    )
    assert noisy > 1.2 * plain


UNREAD: list[tuple[str, ...]] = [
    (), ("range_offset",), ("walk_error", "range_scale", "dropout"), ("fog", "timing_jitter"),
    ("boresight", "dead_time", "threshold", "range_offset"), ("crosstalk", "afterpulsing", "walk_error"),
]  # fmt: skip


@pytest.mark.parametrize("names", UNREAD, ids=["+".join(n) or "none" for n in UNREAD])
def test_echoes_read_out_later_are_those_of_the_simulation(names: tuple[str, ...]) -> None:
    ideal = street(1, sign=True)
    full = model(*(make(name, {}) for name in names))
    before = Model(full.sensor, MATERIALS, tuple(e for e in full.effects if e.stage != "readout"))
    unread = simulate_detected(ideal, before, seed=9, frame=3)
    assert same(unread.read_out(full), simulate(ideal, full, seed=9, frame=3))
    assert same(unread.read_out(before), simulate(ideal, before, seed=9, frame=3))
    assert same(simulate_detected(ideal, full, seed=9, frame=3).read_out(full), unread.read_out(full))


@pytest.mark.parametrize(
    ("name", "settings", "off", "parameter", "total"),
    [
        ("material_reflectance", {"factor": 1.1}, Nuisance(materials={1: 0.5, 2: 2.5}), "factor", 1.1 * np.exp(0.1)),
        ("signal_gain", {"gain": 0.9}, Nuisance(materials={1: -1.5, 2: -0.5, 3: -1.0}), "gain", 0.9 * np.exp(-0.04)),
        ("boresight", {"yaw_deg": 0.1, "pitch_deg": 0.05}, Nuisance(yaw=2.0, pitch=-1.0), "yaw_deg", 0.13),
    ],
)
def test_an_effect_takes_over_what_nuisances_said_of_the_same(
    name: str, settings: dict[str, float], off: Nuisance, parameter: str, total: float
) -> None:
    """A reflectance of 1.2 of which a nuisance had a half: with a name of its own, it has no such nuisance."""
    fixed = {"material_id": 2} if name == "material_reflectance" else {}
    probe = Probe(name, settings, search_spec(name).free, fixed)
    true = (
        off.calibrated(model(probe.effect()))
        if name != "boresight"
        else model(make(name, {"yaw_deg": 0.13, "pitch_deg": 0.035}))
    )
    simulator = Simulator(frames(true, 2, layers=range(230, 290, 2), points=range(320, 640, 12)), model(), 3)
    both = fit(simulator, [probe], [probe.start()], rounds=0, nuisance=off)
    alone = fit_nuisance(simulator, both)
    assert alone.effects()[0].settings()[parameter] == pytest.approx(total, rel=1e-3)
    assert alone.nuisance.said_by(alone.effects()[0], parameter) == pytest.approx(0.0, abs=1e-9)
    assert alone.distance < 1.2 * both.distance
