"""The last judgements beam by beam: whether the named effects carry over."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.model_check import Open
from lidarcheck.explain.decision.model_check import carries_over as closed_by
from lidarcheck.inference.intervals import Gap, Interval
from lidarcheck.inference.wasserstein import PARTS, Scale
from lidarcheck.model.spec import Model

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 8)}
OFFSET = make("range_offset", {"offset_m": 0.1})


def gap(before: float, after: float, floor: float) -> Gap:
    parts = dict.fromkeys(PARTS, (before, after, floor))
    return Gap(*(Interval(value, value, value) for value in (before, after, floor)), by_feature=parts)


def carries_over(seen: Scale, first: Model, last: Model, others: Gap, names: tuple[str, ...] = ()) -> bool:
    """Of the mean of some frames and of others, of which the gap is given by hand."""
    (before, noise), (after, noise_after) = seen.excess_by_part(first), seen.excess_by_part(last)
    parts = np.array([others.by_feature[part] for part in PARTS])
    there = np.maximum(parts[:, :2] - parts[:, 2:], 0.0)
    both = ((before + there[:, 0]) / 2.0, (after + there[:, 1]) / 2.0)
    return closed_by(Open(*both, 0.87 * noise, 0.87 * noise_after), names)


@pytest.fixture(scope="module")
def shifted() -> Scale:
    return Scale.of(frames(model(OFFSET), 2, **FINE), model(), 5)


def test_the_right_effect_carries_over_and_another_does_not(shifted: Scale) -> None:
    last, wrong = model(OFFSET), model(make("signal_gain", {"gain": 0.8}))
    closed, open_ = gap(1.0, 0.1, 0.1), gap(1.0, 0.95, 0.1)
    assert carries_over(shifted, model(), last, closed)
    assert not carries_over(shifted, model(), wrong, open_)


def test_frames_that_do_not_show_it_count_by_how_little_they_show(shifted: Scale) -> None:
    """The gap of unseen frames may stay open where these have hardly any; where it is large, it must close."""
    last = model(OFFSET)
    assert carries_over(shifted, model(), last, gap(0.12, 0.12, 0.1))
    assert not carries_over(shifted, model(), last, gap(9.0, 9.0, 0.1))


def test_where_there_is_no_gap_nothing_can_fail_to_close() -> None:
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    assert carries_over(scale, model(), model(OFFSET), gap(0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("names", "carries"),
    [(("vibration",), True), (("fog",), False), (("vibration", "fog"), False), (("beam_divergence", "fog"), True)],
)
def test_what_lies_past_edges_is_not_asked_of_effects_that_turn_beams(names: tuple[str, ...], carries: bool) -> None:
    """Of a large gap in other echoes nothing closes, of the rest nearly all; of a footprint whatever is beside it."""
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    parts = {part: (9.0, 9.0, 0.0) if part == "other echoes" else (1.0, 0.1, 0.0) for part in PARTS}
    mean = [sum(values) / len(PARTS) for values in zip(*parts.values(), strict=True)]
    found = Gap(*(Interval(value, value, value) for value in mean), by_feature=parts)
    assert carries_over(scale, model(), model(), found, names) == carries


@pytest.mark.parametrize(
    ("names", "carries"),
    [(("motion",), True), (("walk_error", "motion"), False), (("walk_error", "fog"), True)],
)
def test_relatives_must_close_more_together(names: tuple[str, ...], carries: bool) -> None:
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    assert carries_over(scale, model(), model(), gap(0.9, 0.22, 0.0), names) == carries
    assert carries_over(scale, model(), model(), gap(0.9, 0.09, 0.0), names)


@pytest.mark.parametrize(
    ("names", "left", "carries"),
    [
        (("range_scale",), 0.3, True),
        (("range_scale", "range_offset"), 0.3, True),
        (("range_scale",), 0.5, False),
        (("range_scale", "range_offset"), 0.5, False),
        (("walk_error", "range_offset"), 0.5, True),
        (("walk_error",), 0.5, True),
        (("walk_error",), 0.9, False),
        (("walk_error", "fog"), 0.79, True),
    ],
)
def test_effects_of_one_form_leave_nothing_of_the_ranges(names: tuple[str, ...], left: float, carries: bool) -> None:
    """Of a range error of 9 standard deviations 4 % may stay, 0.36, of what has a form of its own, of a walk 8 %, 0.72;
    all else closes."""
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    parts = {part: (9.0, left if part == "range" else 0.0, 0.0) for part in PARTS}
    mean = [sum(values) / len(PARTS) for values in zip(*parts.values(), strict=True)]
    found = Gap(*(Interval(value, value, value) for value in mean), by_feature=parts)
    assert carries_over(scale, model(), model(), found, names) == carries


@pytest.mark.parametrize(
    ("names", "part", "left", "carries"),
    [
        (("motion",), "range", 0.8, True),
        (("motion",), "range", 0.95, False),
        (("fog",), "other echoes", 1.0, True),
        (("fog",), "other echoes", 1.3, False),
        (("vibration",), "other echoes", 1.8, True),
        (("vibration",), "range", 1.0, True),
        (("vibration",), "range", 1.2, False),
        (("signal_gain",), "area", 0.25, True),
        (("signal_gain",), "area", 0.4, False),
        (("signal_gain", "fog"), "area", 0.4, True),
    ],
)
def test_no_part_of_the_gap_may_stay(names: tuple[str, ...], part: str, left: float, carries: bool) -> None:
    """The part was 2.4 standard deviations wide on unseen frames; on the others there is nothing."""
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    parts = {one: (2.4, left if one == part else 0.05, 0.0) for one in PARTS}
    mean = [sum(values) / len(PARTS) for values in zip(*parts.values(), strict=True)]
    found = Gap(*(Interval(value, value, value) for value in mean), by_feature=parts)
    assert carries_over(scale, model(), model(), found, names) == carries


@pytest.mark.parametrize(
    ("part", "left", "names", "carries"),
    [
        ("range", 0.7, ("fog",), True),
        ("range", 0.9, ("fog",), False),
        ("peak", 0.9, ("rain", "layer_gain"), False),
        ("detected", 0.9, ("fog",), True),
        ("other echoes", 0.9, ("fog",), True),
        ("range", 0.9, ("boresight",), True),
    ],
)
def test_of_a_gap_however_large_a_feature_may_keep_little(
    part: str, left: float, names: tuple[str, ...], carries: bool
) -> None:
    """Of 8 standard deviations by which unseen frames were off, so much is left, and half as much over all frames."""
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    parts = {one: (8.0, left if one == part else 0.05, 0.0) for one in PARTS}
    mean = [sum(values) / len(PARTS) for values in zip(*parts.values(), strict=True)]
    found = Gap(*(Interval(value, value, value) for value in mean), by_feature=parts)
    assert carries_over(scale, model(), model(), found, names) == carries


@pytest.mark.parametrize(("part", "left"), [("area", 0.09), ("detected", 0.45), ("other echoes", 0.55)])
def test_what_errors_of_pose_and_reflectances_leave_may_stay(part: str, left: float) -> None:
    """So much on the mean of these frames and of others, where chance is all that is left; of twice that, too much."""
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    for open_, carries in ((left, True), (2.0 * left, False)):
        parts = {one: (open_, open_, 0.0) if one == part else (1.0, 0.0, 0.0) for one in PARTS}
        mean = [sum(values) / len(PARTS) for values in zip(*parts.values(), strict=True)]
        found = Gap(*(Interval(value, value, value) for value in mean), by_feature=parts)
        assert carries_over(scale, model(), model(), found, ("walk_error",)) == carries


def test_a_small_rest_of_the_ranges_may_be_of_reflectances_and_pose() -> None:
    scale = Scale.of(frames(model(), 2, **FINE), model(), 5)
    parts = {part: (1.2, 0.25 if part == "range" else 0.1, 0.0) for part in PARTS}
    found = Gap(*(Interval(value, value, value) for value in (1.2, 0.15, 0.0)), by_feature=parts)
    assert carries_over(scale, model(), model(), found, ("range_offset",))


@pytest.mark.parametrize(("scatter", "closed"), [(0.001, False), (0.05, True)])
def test_what_strikes_at_random_has_a_noise_of_its_own(scatter: float, closed: bool) -> None:
    """Packets that are lost: their number is another one in each frame, and so is the gap, before and after."""
    still = np.random.default_rng(1).normal(0.0, 0.001, (8, len(PARTS)))
    there = Open(np.full(len(PARTS), 0.03), np.full(len(PARTS), 0.03), still, scatter / 0.001 * still)
    assert closed_by(there, ("dropout",)) == closed


@pytest.mark.parametrize(
    ("whole", "left", "noise_after", "carries"),
    [
        (0.8, 0.4, 0.01, False),
        (0.8, 0.4, 0.14, True),
        (0.8, 0.5, 0.2, False),
        (0.08, 0.12, 0.1, True),
        (0.08, 0.12, 0.06, False),
        (0.08, 0.3, 0.1, False),
    ],
)
def test_what_strikes_at_random_may_leave_its_own_noise(
    whole: float, left: float, noise_after: float, carries: bool
) -> None:
    """Of ranges that a wandering view has changed, 0.8, half may stay open where that is as much as it makes itself; of
    a change that is no larger than what it makes itself, all and more."""
    before, after = np.ones(len(PARTS)), np.full(len(PARTS), 0.05)
    before[PARTS.index("range")], after[PARTS.index("range")] = whole, left
    draws = np.array([-1.0, 1.0])[:, None] * np.ones(len(PARTS))
    there = Open(before, after, 0.001 * draws, noise_after * draws / np.sqrt(2.0))
    assert closed_by(there, ("ambient_light", "vibration")) == carries


@pytest.mark.parametrize(("shown", "carries"), [(0.02, False), (0.3, True)])
def test_what_scatters_far_more_than_the_sensor_is_not_what_the_gap_is_made_of(shown: float, carries: bool) -> None:
    """Ranges of two simulations of a view that wanders are 0.4 apart; a measurement of it differs by about as much."""
    before, after = np.full(len(PARTS), 0.03), np.full(len(PARTS), 0.01)
    before[PARTS.index("range")], after[PARTS.index("range")] = shown, 0.02
    still = 0.05 + np.random.default_rng(1).normal(0.0, 0.002, (6, len(PARTS)))
    wandering = still.copy()
    wandering[:, PARTS.index("range")] += 0.35 + 0.1 * np.arange(-2.5, 3.0)
    assert closed_by(Open(before, after, still, wandering), ("vibration",)) == carries


@pytest.mark.parametrize(("whole", "carries"), [(0.01, True), (0.1, False)], ids=["little more than chance", "much"])
def test_what_chance_takes_of_what_closes_is_forgiven(whole: float, carries: bool) -> None:
    """Of a gap of so much, 0.35 closes, and 0.4 is asked for; one draw is off by 0.001 on the mean of all parts."""
    before, after = (np.full(len(PARTS), x) for x in (whole, 0.65 * whole))
    noise = np.tile(np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])[:, None] * 9.1e-4, len(PARTS))
    assert closed_by(Open(before, after, noise, noise)) == carries


@pytest.mark.parametrize(
    ("names", "part", "left", "carries"),
    [
        (("fog",), "other echoes", 0.8, True),
        (("fog",), "range", 0.8, True),
        (("walk_error", "motion"), "area", 0.8, True),
        (("range_scale",), "area", 0.8, True),
        (("range_scale",), "range", 0.8, False),
    ],
)
def test_where_the_summaries_have_closed_no_threshold_takes_a_name_back(
    names: tuple[str, ...], part: str, left: float, carries: bool
) -> None:
    """A fog whose overlap is another leaves much of the veil's echoes, and has closed 99 % of the distance; a scale of
    the range has one form, and what it leaves of the ranges is another's."""
    before = np.full(len(PARTS), 2.0)
    after = np.full(len(PARTS), 0.02)
    after[PARTS.index(part)] = left * 2.0
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (6, len(PARTS)))
    assert not closed_by(Open(before, after, noise, noise), names)
    assert closed_by(Open(before, after, noise, noise, settled=True), names) == carries
    scattering = noise + np.where(np.arange(len(PARTS)) == 0, 9.0, 0.0)
    assert not closed_by(Open(before, after, noise, scattering, settled=True), names), "chance is no explanation"
