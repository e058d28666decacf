"""The gap on unseen frames: distances against scipy, the floor, growth with the effect, the waterfall; and verdicts."""

from types import SimpleNamespace

import numpy as np
import pytest

from explain_core_kit import WALL, frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.closure import Closure, confidence, lead
from lidarcheck.explain.decision.findings import is_doubtful
from lidarcheck.explain.report.explanation import Finding
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.observed.kernels import areas_between
from lidarcheck.inference.wasserstein import PARTS, Scale, _closed_span, gap_of

OFFSET = make("range_offset", {"offset_m": 0.08})
DIM = make("signal_gain", {"gain": 0.6})


def test_wasserstein_distances_are_those_of_scipy_in_every_bin() -> None:
    from scipy.stats import wasserstein_distance

    rng = np.random.default_rng(5)
    a, b = rng.normal(size=400), rng.normal(0.3, 1.5, size=700)
    a[::7] = 1.0
    b[::5] = 1.0
    a_bin, b_bin = rng.integers(0, 6, 400), rng.integers(0, 6, 700)
    a, a_bin = a[a_bin != 2], a_bin[a_bin != 2]
    b, b_bin = b[b_bin != 4], b_bin[b_bin != 4]
    a_weight, b_weight = rng.integers(0, 4, len(a)).astype(float), rng.uniform(0.0, 2.0, len(b))
    value, place = np.concatenate([a, b]), np.concatenate([a_bin, b_bin])
    order, scratch = np.argsort(value), np.full((5, 7), np.nan)
    weight = np.concatenate([a_weight, b_weight])
    areas_between(value[order], order, order < len(a), place, weight, scratch)
    found = scratch[4]
    assert scratch[0] == pytest.approx(np.bincount(a_bin, a_weight, 7))
    for i in range(7):
        mine, theirs = a_bin == i, b_bin == i
        expected = 0.0
        if mine.any() and theirs.any():
            expected = wasserstein_distance(a[mine], b[theirs], a_weight[mine], b_weight[theirs])
        assert found[i] == pytest.approx(expected, abs=1e-9)
    assert found[[2, 4, 6]].tolist() == [0.0, 0.0, 0.0]


def test_the_gap_of_a_model_with_its_own_data_is_the_floor() -> None:
    gap = gap_of(Scale.of(frames(model(OFFSET), 2), model(), 3), [("", model(OFFSET))])
    assert gap.before == gap.after
    assert gap.floor.low < gap.floor.value < gap.floor.high
    assert abs(gap.after.value - gap.floor.value) < 3.0 * (gap.floor.high - gap.floor.low)
    assert gap.after.low < gap.floor.high
    assert gap.after.high > gap.floor.low
    assert gap.waterfall == ()


def test_a_perfect_model_leaves_the_floor_on_the_mean_in_every_part() -> None:
    """Each part counts by how far it is from what is expected, to either side, and so must the floor."""
    found = []
    for seed in range(24):
        gap = gap_of(Scale.of(frames(model(OFFSET), 2, seed=seed), model(), 3 + seed), [("", model(OFFSET))])
        found.append([(after, floor) for _, after, floor in gap.by_feature.values()])
    after, floor = np.array(found).transpose(2, 0, 1)
    error = (after - floor).std(axis=0, ddof=1) / np.sqrt(len(found))
    assert np.all(np.abs((after - floor).mean(axis=0)) < 3.5 * error)
    assert after.mean() == pytest.approx(floor.mean(), rel=0.03)


@pytest.mark.parametrize(
    ("name", "parameter", "sizes", "feature"),
    [
        ("range_offset", "offset_m", (0.0, 0.02, 0.06, 0.15), "range"),
        ("signal_gain", "gain", (1.0, 0.8, 0.5, 0.25), "area"),
        ("dropout", "share", (0.0, 0.05, 0.15, 0.4), "detected"),
        ("interference", "share", (0.0, 0.02, 0.08, 0.3), "other echoes"),
    ],
)
def test_the_gap_grows_with_the_effect(name: str, parameter: str, sizes: tuple[float, ...], feature: str) -> None:
    found = []
    for size in sizes:
        scale = Scale.of(frames(model(make(name, {parameter: size})), 2), model(), 3)
        parts = scale.distance(scale.measured, scale.simulated(model(), 9100, 2))
        found.append((parts.mean(), parts[PARTS.index(feature)]))
    assert (np.diff(found, axis=0) > 0.0).all()
    assert found[-1][1] > 3.0 * found[0][1]


def test_a_scan_is_nowhere_from_itself() -> None:
    scale = Scale.of(frames(model(), 2), model(), 3)
    one = scale.simulated(model(), 9100, 1)[0]
    assert scale.distance(one, [one]) == pytest.approx(np.zeros(len(PARTS)), abs=1e-9)
    assert scale.distance(one, [one, one]) == pytest.approx(np.zeros(len(PARTS)), abs=1e-9)
    other = scale.simulated(model(), 9101, 1)[0]
    assert (scale.distance(one, [other])[:4] > 0.0).all()
    assert scale.distance(one, [other], np.full(len(scale.beams), 3.0)) == pytest.approx(scale.distance(one, [other]))


def test_the_waterfall_goes_from_the_case_s_model_to_the_last_in_the_order_of_the_stages() -> None:
    scale = Scale.of(frames(model(OFFSET, DIM), 2), model(), 4)
    stages = [("", model()), ("signal_gain", model(DIM)), ("range_offset", model(DIM, OFFSET))]
    on_progress: list[tuple[int, int]] = []
    gap = gap_of(scale, stages, lambda i, n, _gap: on_progress.append((i, n)))
    assert [name for name, _ in gap.waterfall] == ["signal_gain", "range_offset"]
    one, two = (interval for _, interval in gap.waterfall)
    assert two == gap.after
    assert gap.before.value > one.value > two.value
    assert gap.closed > 0.85
    assert set(gap.by_feature) == set(PARTS)
    assert gap.before.value == pytest.approx(np.mean([v[0] for v in gap.by_feature.values()]))
    assert gap.after.value == pytest.approx(np.mean([v[1] for v in gap.by_feature.values()]))
    assert gap.floor.value == pytest.approx(np.mean([v[2] for v in gap.by_feature.values()]))
    assert gap.by_feature["range"][0] > 2.0 * gap.by_feature["range"][1]
    assert on_progress[-1][0] <= on_progress[-1][1]
    for interval in (gap.before, gap.after, gap.floor):
        assert 0.0 <= interval.low <= interval.value <= interval.high
    assert gap_of(scale, stages) == gap


def test_an_effect_that_makes_it_worse_closes_nothing() -> None:
    scale = Scale.of(frames(model(), 2), model(), 4)
    gap = gap_of(scale, [("", model()), ("signal_gain", model(DIM))])
    assert gap.after.value > 2.0 * gap.before.value
    assert gap.closed <= 0.0


def test_the_noise_of_an_effect_that_strikes_at_random_is_no_gap() -> None:
    """What the effect adds by chance is as large between two of its own simulations."""
    struck = model(make("interference", {"share": 0.1}))
    found = [
        gap_of(Scale.of(frames(m, 2), model(), 4), [("", model()), ("interference", struck)]) for m in (struck, model())
    ]
    right, wrong = found
    assert right.floor.value > 1.1 * gap_of(Scale.of(frames(model(), 2), model(), 4), [("", model())]).floor.value
    assert right.closed > 0.6
    assert wrong.closed < 0.3


def test_the_scale_is_that_of_the_case_s_model() -> None:
    one, two = (Scale.of(frames(m, 2), model(), 4) for m in (model(), model(OFFSET)))
    assert np.array_equal(one.expected.mean, two.expected.mean)
    assert one.beams.distance_m.tolist() == two.beams.distance_m.tolist()
    assert (one.beams.material_id == WALL).any()


# Verdicts


def test_what_is_closed_is_told_by_what_is_left() -> None:
    whole, half, none = (Closure(1000.0, after, 100.0) for after in (20.0, 500.0, 1000.0))
    assert (whole.holds, half.holds, none.holds) == (True, False, False)
    assert (half.share, none.share) == (0.5, 0.0)
    assert Closure(0.0, 5.0, 10.0).share == 0.0


def trial(name: str, merit: float) -> FittedCandidate:
    probe = fixed_probes([name])[-1]
    found = Fit((probe,), (probe.start(),), 100.0, np.zeros((1, 3)))
    return FittedCandidate(name, 1, found, 0.5 * merit, 1.0, 0.5 * merit, 0.0)


def test_a_name_is_surer_the_farther_its_rivals_are_and_the_less_is_left_open() -> None:
    now = trial("range_offset", 1000.0).fit

    def sure(rival: float, after: float) -> float:
        trials = [trial("range_offset", 1000.0), trial("range_scale", rival)]
        return confidence(SimpleNamespace(), now, "range_offset", trials, Closure(2000.0, after, 100.0))  # type: ignore[arg-type]

    assert 0.0 < sure(990.0, 90.0) < sure(800.0, 90.0) < sure(500.0, 90.0) < 1.0
    assert sure(800.0, 150.0) < sure(800.0, 50.0)
    assert sure(500.0, 0.0) > 0.8
    trials = [trial("range_offset", 1000.0), trial("range_scale", 990.0)]
    closed = Closure(2000.0, 90.0, 100.0)
    lone = confidence(SimpleNamespace(), now, "range_offset", trials, closed, ("range_scale",))  # type: ignore[arg-type]
    assert lone == sure(500.0, 90.0) > sure(990.0, 90.0)


def test_a_name_leads_by_what_others_are_behind_in_its_place() -> None:
    """Beside another effect, found later, one that explained nearly as much in its round may be far behind."""
    now = trial("range_offset", 1000.0).fit
    trials = [trial("range_offset", 1000.0), trial("range_scale", 990.0), trial("signal_gain", 700.0)]
    assert lead("range_offset", now, trials) == pytest.approx(0.01, abs=0.005)
    assert lead("range_offset", now, trials, behind={"range_scale": 200.0}) == pytest.approx(0.2, abs=0.01)
    assert lead("range_offset", now, trials, behind={"range_scale": 600.0}) == pytest.approx(0.3, abs=0.01)
    assert lead("range_offset", now, trials, behind={"range_scale": -100.0}) == pytest.approx(0.01, abs=0.005)


@pytest.mark.parametrize(
    ("name", "confidence", "equals", "doubtful"),
    [
        ("range_scale", 0.60, (), True),
        ("range_scale", 0.70, (), False),
        ("range_scale", 0.50, ("range_offset",), False),
        ("range_scale", 0.40, ("range_offset",), True),
        ("boresight", 0.40, (), False),
    ],
)
def test_a_name_that_leads_too_little_is_not_said(
    name: str, confidence: float, equals: tuple[str, ...], doubtful: bool
) -> None:
    finding = Finding(name, {}, confidence, equals, "", "", ())
    assert is_doubtful(finding) is doubtful


def test_a_trial_passes_by_its_gain_on_both_kinds_of_frames_and_its_size() -> None:
    assert trial("range_offset", 1000.0).passes
    assert not trial("range_offset", 1.0).passes
    good = trial("range_offset", 1000.0)
    elsewhere_worse = FittedCandidate(good.name, 1, good.fit, 500.0, 1.0, 100.0, 150.0)
    assert not elsewhere_worse.passes
    small = fixed_probes(["signal_gain"])[0]
    x = np.array([small.free[0].encode(1.02)])
    assert not FittedCandidate(
        "signal_gain", 1, Fit((small,), (x,), 1.0, np.zeros((1, 3))), 500.0, 1.0, 500.0, 0.0
    ).passes


def test_what_closes_has_an_interval() -> None:
    """Beams drawn anew move both gaps alike, and another measurement the one that is left; of a gap that may be chance
    any share may close."""
    drawn, still = np.linspace(-0.05, 0.05, 17), np.zeros(6)
    before, after = (np.concatenate([[value], value + drawn]) for value in (1.1, 0.6))
    low, high = _closed_span(before, after, 0.1, still)
    assert low < 0.5 < high
    assert high - low == pytest.approx(0.5 / 0.95 - 0.5 / 1.05, abs=0.02)
    wider = _closed_span(before, after, 0.1, np.linspace(-0.1, 0.1, 6))
    assert wider[0] < low < high < wider[1]
    assert _closed_span(before, after, 1.2, still) == (-1.0, 1.0)
    assert _closed_span(before, 0.1 + 0.0 * after, 0.1, still) == (1.0, 1.0)
