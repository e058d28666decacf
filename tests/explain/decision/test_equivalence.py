"""The contest between names that explain the data nearly as well."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.equivalence import Polished, Rival, contest, rivals
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.refine import Judged
from lidarcheck.explain.search.selection import SearchData
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale

OFFSET = make("range_offset", {"offset_m": 0.12})
FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 12)}


@pytest.fixture(scope="module")
def bench() -> SearchData:
    measured = frames(model(OFFSET), 4, **FINE)
    simulator, select = Simulator(measured[:2], model(), 3), Simulator(measured[2:], model(), 4)
    return SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))


def fitted(simulator: Simulator, name: str):
    """The fit of one effect alone, from its first start."""
    probe = fixed_probes([name])[0]
    return fit(simulator, [probe], [probe.start()], rounds=2)


def trial(bench: SearchData, name: str, gain: float) -> FittedCandidate:
    found = fitted(bench.simulator, name)
    return FittedCandidate(name, 1, found, gain, 1.0, 1000.0, 100.0)


@pytest.mark.long
def test_the_nearer_name_takes_the_place(bench: SearchData) -> None:
    scale = Scale.of((*bench.simulator.frames, *bench.select.frames), model(), 5)
    right, wrong = (fitted(bench.simulator, name) for name in ("range_offset", "range_scale"))
    for now, other in ((wrong, right), (right, wrong)):
        found = contest(scale, model(), now, [Rival(other.names()[0], 0, other, 260.0 if now is right else -260.0)], 7)
        assert found.fit.names() == found.last.names() == ("range_offset",)
        assert found.equals["range_offset"] == ()
        assert found.last.effects()[0].settings()["offset_m"] == pytest.approx(0.12, abs=0.01)


@pytest.mark.parametrize(("chance", "name"), [(0.01, "range_scale"), (0.3, "range_offset")])
def test_what_a_random_rival_hits_upon_by_chance_takes_no_place(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, chance: float, name: str
) -> None:
    """Its gap varies from seed to seed by more than it is the smaller."""
    right, other = (fitted(bench.simulator, name) for name in ("range_offset", "range_scale"))
    verdicts = {"range_offset": (0.1, 0.01), "range_scale": (0.05, chance)}
    monkeypatch.setattr(
        "lidarcheck.explain.decision.equivalence.judged",
        lambda _scale, _model, fit, _seed: Judged(bench.simulator, fit, *verdicts[fit.names()[0]]),
    )
    scale = Scale.of(bench.select.frames, model(), 5)
    assert contest(scale, model(), right, [Rival("range_scale", 0, other, 0.0)], 7).fit.names() == (name,)


@pytest.mark.parametrize(
    ("general", "special", "name"),
    [(0.08, 0.1, "signal_gain"), (0.04, 0.1, "layer_gain"), (0.1, 0.08, "signal_gain"), (0.02, 0.1, "layer_gain")],
)
@pytest.mark.parametrize("accepted", ["signal_gain", "layer_gain"])
def test_what_can_do_all_that_another_does_must_leave_much_less(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, general: float, special: float, name: str, accepted: str
) -> None:
    """Whichever of them was accepted; and what is near because it can do the same is no equal. What it can do is one
    where its score is the same."""
    found = judged_as(bench, monkeypatch, accepted, {"layer_gain": (general, 0.005), "signal_gain": (special, 0.005)})
    assert found.fit.names() == (name,)
    assert found.equals[name] == (() if name == "signal_gain" else ("signal_gain",))


@pytest.mark.parametrize(
    ("accepted", "walk", "name"),
    [
        ("range_offset", 0.085, "range_offset"),
        ("range_offset", 0.07, "walk_error"),
        ("walk_error", 0.085, "walk_error"),
        ("walk_error", 0.13, "range_offset"),
    ],
)
def test_a_walk_that_is_alike_at_all_amplitudes_takes_no_offset_s_place(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, accepted: str, walk: float, name: str
) -> None:
    """It must leave less than 0.8 of what the offset leaves, 0.1; one that was accepted keeps its place."""
    found = judged_as(bench, monkeypatch, accepted, {"walk_error": (walk, 0.001), "range_offset": (0.1, 0.001)})
    assert found.fit.names() == (name,)


@pytest.mark.parametrize(
    ("moved", "distance", "name"),
    [
        (0.085, 1000.0, "range_offset"),
        (0.07, 1000.0, "motion"),
        (0.07, 1500.0, "range_offset"),
        (0.095, 700.0, "motion"),
        (0.105, 700.0, "range_offset"),
    ],
)
def test_nor_does_a_motion_in_a_narrow_view(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, moved: float, distance: float, name: str
) -> None:
    """Nor one that is nearer beam by beam, and farther by summaries; one that is much nearer by these must only leave
    no more."""
    verdicts = {"motion": (moved, 0.001), "range_offset": (0.1, 0.001)}
    found = judged_as(bench, monkeypatch, "range_offset", verdicts, {"motion": distance})
    assert found.fit.names() == (name,)


@pytest.mark.parametrize(
    ("left", "distance", "name"),
    [(0.09, 1200.0, "fog"), (0.09, 1300.0, "rain"), (0.07, 1300.0, "fog"), (0.105, 700.0, "rain")],
)
def test_a_rival_whose_summaries_are_farther_must_leave_much_less(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, left: float, distance: float, name: str
) -> None:
    """Farther by more than 250 than the accepted one's 1000: less than 0.8 of its 0.1."""
    verdicts = {"fog": (left, 0.001), "rain": (0.1, 0.001)}
    assert judged_as(bench, monkeypatch, "rain", verdicts, {"fog": distance}).fit.names() == (name,)


def judged_as(
    bench: SearchData,
    monkeypatch: pytest.MonkeyPatch,
    accepted: str,
    verdicts: dict[str, tuple[float, float]],
    distances: Mapping[str, float] = MappingProxyType({}),
    farther: float = 0.0,
) -> Polished:
    """The contest of two names of which each is judged so: what it leaves, and by how much that varies; and how far its
    summaries are, 1000 where nothing is said."""
    gain = fixed_probes(["signal_gain"])[0]
    fits = {
        one: Fit((replace(gain, name=one),), (gain.start(),), distances.get(one, 1000.0), np.zeros((1, 3)))
        for one in verdicts
    }
    monkeypatch.setattr(
        "lidarcheck.explain.decision.equivalence.judged",
        lambda _scale, _model, fit, _seed: Judged(bench.simulator, fit, *verdicts[fit.names()[0]]),
    )
    scale = Scale.of(bench.select.frames, model(), 5)
    other = next(one for one in fits if one != accepted)
    return contest(scale, model(), fits[accepted], [Rival(other, 0, fits[other], farther)], 7)


def test_without_rivals_the_accepted_name_stays(bench: SearchData) -> None:
    scale = Scale.of(bench.select.frames, model(), 5)
    now = fitted(bench.simulator, "range_offset")
    found = contest(scale, model(), now, [], 7)
    assert found.fit is now
    assert found.equals == {}


def test_rivals_are_other_names_of_the_round_that_explain_nearly_as_much(bench: SearchData) -> None:
    names = {"range_offset": 1000.0, "range_scale": 990.0, "signal_gain": 100.0}
    trials = [trial(bench, name, gain) for name, gain in names.items()]
    found = rivals(bench, trials[1].fit, [trials[1], trials[0], trials[2]], lambda *_: None)
    assert [one.name for one in found] == ["range_offset"]
    assert found[0].farther < 0.0
    beside = rivals(bench, trials[0].fit, trials, lambda *_: None)
    assert [(one.name, one.near, one.farther > 300.0) for one in beside] == [("range_scale", False, True)]
    assert "signal_gain" not in [one.name for one in beside]


@pytest.mark.parametrize(("gain", "less", "found"), [(400.0, 180.0, 1), (400.0, 100.0, 0), (4000.0, 3300.0, 0)])
def test_names_that_explain_less_by_no_more_than_chance_are_rivals(
    bench: SearchData, gain: float, less: float, found: int
) -> None:
    """However small a part of what the accepted one explains that is."""
    both = ((name, size) for name, size in (("range_offset", gain), ("pulse_shape", less)))
    trials = [replace(trial(bench, name, size), select_after=1000.0) for name, size in both]
    assert len(rivals(bench, trials[0].fit, trials, lambda *_: None)) == found


@pytest.mark.parametrize(
    ("explained", "left", "found"),
    [(500.0, 1000.0, ["pulse_shape"]), (90.0, 1000.0, []), (500.0, 100.0, [])],
    ids=["overlooked", "explained less", "little is left"],
)
def test_a_name_that_explained_more_in_an_earlier_round_is_tried_where_much_is_left(
    bench: SearchData, explained: float, left: float, found: list[str]
) -> None:
    """Beside the first effect, whose fit has taken up a part of its own, it explained less than the second one."""
    first, second, other = (trial(bench, name, 600.0) for name in ("signal_gain", "range_offset", "pulse_shape"))
    both = fit(bench.simulator, [*first.fit.probes, *second.fit.probes], [*first.fit.x, *second.fit.x], rounds=1)
    now = replace(both, distance=bench.simulator.floor_distance + left)
    second = replace(second, fit=both, round=2, gain=200.0, select_after=900.0)
    trials = [first, replace(other, gain=explained, select_after=1000.0 - explained), second]
    assert [one.name for one in rivals(bench, now, trials, lambda *_: None) if one.place == 1] == found


def test_a_rival_that_is_far_in_an_effect_s_place_is_not_judged_and_told(bench: SearchData) -> None:
    scale = Scale.of(bench.select.frames, model(), 5)
    now, other = fitted(bench.simulator, "range_offset"), fitted(bench.simulator, "range_scale")
    found = contest(scale, model(), now, [Rival("range_scale", 0, other, 900.0, near=False)], 7)
    assert found.fit is now
    assert found.compared == {}
    assert found.behind == {"range_offset": {"range_scale": 900.0}}


@pytest.mark.parametrize(("less", "found"), [(600.0, ["range_scale"]), (300.0, [])])
@pytest.mark.parametrize("round_", [1, 2])
def test_what_is_taken_for_a_name_is_compared_with_it_whichever_came_first(
    bench: SearchData, round_: int, less: float, found: list[str]
) -> None:
    """The catalogue says that an offset and a scale are taken for each other; half as much must have been explained."""
    own = trial(bench, "range_offset", 1000.0)
    other = replace(trial(bench, "range_scale", less), round=round_, select_before=1000.0, select_after=1000.0 - less)
    own = replace(own, select_before=1000.0, select_after=0.0)
    assert [one.name for one in rivals(bench, own.fit, [own, other], lambda *_: None)] == found


@pytest.mark.parametrize("accepted", ["range_offset", "range_scale"])
@pytest.mark.parametrize(("other", "alike"), [(0.1, True), (0.9, False)])
def test_what_these_data_cannot_tell_apart_is_shown_with_what_would(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, accepted: str, other: float, alike: bool
) -> None:
    """An offset and a scale that leave as much, whichever was accepted; and all that was tried stands in the report."""
    rival = "range_scale" if accepted == "range_offset" else "range_offset"
    found = judged_as(bench, monkeypatch, accepted, {accepted: (0.1, 0.001), rival: (other, 0.001)}, farther=260.0)
    assert found.fit.names() == (accepted,)
    assert found.equals[accepted] == ((rival,) if alike else ())
    [told] = found.rivals
    assert (told.names, told.gap) == ((rival,), other)
    assert ("one target at two ranges far apart" in told.why_not) == alike


@pytest.mark.parametrize("accepted", ["range_offset", "range_scale"])
@pytest.mark.parametrize(("farther", "alike"), [(-70.0, True), (240.0, True), (260.0, False)])
def test_an_equal_score_is_shown_whatever_beams_say(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, accepted: str, farther: float, alike: bool
) -> None:
    """A scale leaves less of the gap, and the summaries of an offset are as near, or nearer by chance."""
    rival = "range_scale" if accepted == "range_offset" else "range_offset"
    verdicts = {accepted: (0.1, 0.001), rival: (0.9, 0.001)}
    found = judged_as(bench, monkeypatch, accepted, verdicts, farther=farther)
    assert found.equals[accepted] == ((rival,) if alike else ())
    assert found.rivals[0].score == -0.5 * farther


def test_a_name_that_lost_its_place_is_compared_in_its_turn(bench: SearchData, monkeypatch: pytest.MonkeyPatch) -> None:
    """A motion is nearer by its summaries and leaves no less to speak of: the offset stays in sight."""
    verdicts = {"motion": (0.095, 0.001), "range_offset": (0.1, 0.001)}
    found = judged_as(bench, monkeypatch, "range_offset", verdicts, {"motion": 700.0})
    assert found.fit.names() == ("motion",)
    assert found.equals["motion"] == ("range_offset",)
    assert [told.names for told in found.rivals] == [("range_offset",)]


def test_what_is_far_stands_in_the_report_with_the_reason(bench: SearchData) -> None:
    scale = Scale.of(bench.select.frames, model(), 5)
    now, far, usual = (fitted(bench.simulator, name) for name in ("range_offset", "range_scale", "signal_gain"))
    others = [Rival("range_scale", 0, far, 900.0, False), Rival("signal_gain", 0, usual, 20.0, False, True)]
    found = contest(scale, model(), now, others, 7).rivals
    assert [(told.names, told.score) for told in found] == [(("signal_gain",), -10.0), (("range_scale",), -450.0)]
    assert [told.why_not for told in found] == [
        "it is no more than a usual error", "its summaries are farther than those with range_offset",
    ]  # fmt: skip


@pytest.mark.parametrize(("name", "found"), [("range_offset", ["range_offset"]), ("walk_error", [])])
def test_the_same_error_of_range_of_another_kind_is_a_rival(bench: SearchData, name: str, found: list[str]) -> None:
    """Whether echoes are moved or the light is, the summaries hardly tell."""
    trials = [trial(bench, name, 1000.0)]
    for t in [*trials]:
        probes = (replace(t.fit.probes[0], variant="light"),)
        trials.append(replace(t, gain=990.0, fit=replace(t.fit, probes=probes)))
    assert [one.name for one in rivals(bench, trials[0].fit, trials, lambda *_: None)] == found


@pytest.mark.parametrize(("left", "takes"), [(0.02, True), (0.095, False)], ids=["nearer", "by chance"])
def test_an_effect_of_another_kind_stands_for_it_where_it_is_nearer(
    bench: SearchData, monkeypatch: pytest.MonkeyPatch, left: float, takes: bool
) -> None:
    """Another name is then compared with that."""
    plain = fitted(bench.simulator, "range_offset")
    light = replace(plain, probes=(replace(plain.probes[0], variant="light"),))
    walk = fitted(bench.simulator, "walk_error")
    verdicts = {"": left, "light": 0.1}

    def judge(_scale: Scale, _model: object, fit: Fit, _seed: int) -> Judged:
        of = 0.03 if fit.names() == ("walk_error",) else verdicts[fit.probes[0].variant]
        return Judged(bench.simulator, replace(fit, distance=1000.0), of, 0.005)

    monkeypatch.setattr("lidarcheck.explain.decision.equivalence.judged", judge)
    others = [Rival("range_offset", 0, plain, 0.0), Rival("walk_error", 0, walk, 1.0)]
    found = contest(Scale.of(bench.select.frames, model(), 5), model(), light, others, 7)
    assert (found.fit is plain) == takes
    assert found.fit.names() == (("range_offset",) if takes else ("walk_error",))
    alone = contest(Scale.of(bench.select.frames, model(), 5), model(), light, others[:1], 7)
    assert (alone.fit is plain) == takes
    assert alone.equals == {}
    assert alone.compared == {}


@pytest.mark.parametrize(("gain", "near"), [(1.03, False), (1.1, True)])
def test_a_rival_that_is_no_more_than_a_usual_error_is_not_near(gain: float, near: bool) -> None:
    measured = frames(model(make("signal_gain", {"gain": gain})), 4, **FINE)
    simulator, select = Simulator(measured[:2], model(), 3), Simulator(measured[2:], model(), 4)
    bench = SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))
    both = [trial(bench, name, 1000.0) for name in ("range_offset", "signal_gain")]
    [found] = rivals(bench, both[0].fit, both, lambda *_: None)
    assert (found.name, found.near) == ("signal_gain", near)
    assert found.farther < 0.0
