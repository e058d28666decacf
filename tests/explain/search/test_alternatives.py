"""Other ways through the search, and fits that go on to their end, so that nothing is named for what they left open."""

from dataclasses import replace

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.explain.search import alternatives as detouring
from lidarcheck.explain.search.alternatives import other_ways, try_alternatives, with_fewer_related
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.screening import Screened, screen
from lidarcheck.explain.search.search import backward
from lidarcheck.explain.search.selection import Search, SearchData, accept, start_fit
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.explain.search.trial import select_distance
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator

GAIN, JITTER = make("signal_gain", {"gain": 0.4}), make("timing_jitter", {"sigma_ns": 0.5})
LONG = make("pulse_shape", {"stretch": 1.8})
NAMES = ("signal_gain", "timing_jitter", "incidence_falloff", "dark_counts")


def bench_of(*hidden: Effect, step: int = 12) -> SearchData:
    """Frames of every `step`th point."""
    measured = frames(model(*hidden), 4, layers=range(230, 290, 2), points=range(320, 640, step))
    simulator, select = Simulator(measured[:3], model(), 3), Simulator(measured[3:], model(), 4)
    return SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))


def fitted(bench: SearchData, name: str, rounds: int = 4) -> Fit:
    probe = fixed_probes([name])[0]
    return fit(bench.simulator, [probe], [probe.start()], rounds=rounds)


def trial(bench: SearchData, found: Fit, gain: float) -> FittedCandidate:
    """As if the fit had gained so much."""
    before = bench.select.distance(np.zeros((1, len(bench.select.measured))))
    return FittedCandidate(found.names()[0], 1, found, gain, 1.0, before, select_distance(bench.select, found))


def unasked(*_: object) -> None:
    pytest.fail("another way was tried")


@pytest.fixture(scope="module")
def both() -> SearchData:
    return bench_of(GAIN, JITTER)


@pytest.fixture(scope="module")
def screened(both: SearchData) -> list[Screened]:
    return screen(both.simulator, fixed_probes(NAMES))


def misled(bench: SearchData) -> Search:
    """A search whose first round took the wrong effect for the better one."""
    wrong, right = fitted(bench, "incidence_falloff"), fitted(bench, "signal_gain")
    trials = [trial(bench, wrong, 2.0 * bench.start), trial(bench, right, bench.start)]
    return Search(start_fit(bench.simulator, nuisances=False), wrong, trials)


@pytest.mark.long
def test_where_much_stays_open_the_search_begins_with_another_effect(
    both: SearchData, screened: list[Screened]
) -> None:
    on_progress: list[tuple[str, int, int]] = []
    before = misled(both)
    found = try_alternatives(both, before, screened, lambda *step: on_progress.append(step))
    assert found.fit.names() == ("signal_gain", "timing_jitter")
    assert found.fit.distance - both.simulator.floor_distance < 0.1 * (
        before.fit.distance - both.simulator.floor_distance
    )
    assert found.fit.effects()[0].settings()["gain"] == pytest.approx(0.4, abs=0.05)
    assert before.fit.names() == ("incidence_falloff",)
    assert on_progress == [("detour", 0, 1)]
    assert {t.round for t in found.trials} == {1, 2}


def test_no_other_way_is_taken_that_leads_no_nearer(both: SearchData, screened: list[Screened]) -> None:
    """What is left to begin with explains next to nothing, and the best of the first round is not asked again."""
    before = misled(both)
    right, dark = fitted(both, "signal_gain"), fitted(both, "dark_counts")
    before.fit, before.trials = right, [trial(both, right, both.start), trial(both, dark, both.start)]
    others = [one for one in screened if one.probe.name != "timing_jitter"]
    assert try_alternatives(both, before, others, lambda *_: None) is before


def test_where_little_stays_open_no_other_way_is_tried(screened: list[Screened]) -> None:
    bench = bench_of(GAIN)
    right, wrong = fitted(bench, "signal_gain"), fitted(bench, "incidence_falloff")
    found = Search(right, right, [trial(bench, right, 2.0 * bench.start), trial(bench, wrong, bench.start)])
    found.first = start_fit(bench.simulator, nuisances=False)
    assert try_alternatives(bench, found, screened, unasked) is found
    nothing = Search(found.first, found.first, [])
    assert try_alternatives(bench, nothing, screened, unasked) is nothing


@pytest.mark.long
def test_an_accepted_effect_is_fitted_to_the_end() -> None:
    """A first fit of few steps leaves a long pulse too short; what it leaves open is no effect of its own."""
    bench = bench_of(LONG)
    probe = next(p for p in fixed_probes(["pulse_shape"]) if p.settings["stretch"] == 1.3)
    short = fit(bench.simulator, [probe], [probe.start()], rounds=0)
    nothing = start_fit(bench.simulator, nuisances=False)
    found = accept(bench, Search(nothing, nothing), trial(bench, short, 1.0)).fit
    assert found.effects()[0].settings()["stretch"] == pytest.approx(1.8, abs=0.06)
    assert found.distance - bench.simulator.floor_distance < 100.0


def test_a_step_that_is_too_short_is_doubled_while_that_leads_nearer() -> None:
    """Summaries are compressed, and slopes promise too much: three plain steps came to 1.57, and left 1900 open."""
    bench = bench_of(LONG)
    probe = next(p for p in fixed_probes(["pulse_shape"]) if p.settings["stretch"] == 1.3)
    found = fit(bench.simulator, [probe], [probe.start()], rounds=3)
    assert found.effects()[0].settings()["stretch"] > 1.65
    assert found.distance - bench.simulator.floor_distance < 500.0


def test_an_effect_that_made_up_for_an_unfinished_fit_is_left_out_again() -> None:
    """Of half as many beams one in seven fits of the gain alone ends too early, and the pose goes to its limit."""
    bench = bench_of(GAIN, step=6)
    names = ("signal_gain", "incidence_falloff")
    probes = [fixed_probes([name])[0] for name in names]
    off = fit(bench.simulator, probes, [probe.start() for probe in probes], rounds=0)
    left = backward(bench, off, lambda *_: None)
    assert left.names() == ("signal_gain",)
    assert left.effects()[0].settings()["gain"] == pytest.approx(0.4, abs=0.05)


def test_the_other_ways_are_all_told_whatever_they_lead_to(both: SearchData, screened: list[Screened]) -> None:
    [way] = other_ways(both, misled(both), screened, lambda *_: None)
    assert way.fit.names() == ("signal_gain", "timing_jitter")
    nothing = start_fit(both.simulator, nuisances=False)
    assert not [*other_ways(both, Search(nothing, nothing), screened, unasked)]


def test_of_relatives_the_later_one_is_left_out() -> None:
    bench = bench_of(GAIN)
    probes = [fixed_probes([name])[0] for name in ("signal_gain", "dark_counts", "incidence_falloff")]
    three = fit(bench.simulator, probes, [probe.start() for probe in probes], rounds=1)
    [fewer] = with_fewer_related(bench, Search(three, three))
    assert fewer.fit.names() == ("signal_gain", "dark_counts")
    assert not [*with_fewer_related(bench, fewer)]


def test_each_other_way_is_told_with_its_own_trials_alone(
    both: SearchData, screened: list[Screened], monkeypatch: pytest.MonkeyPatch
) -> None:
    search = misled(both)
    right = search.trials[1]
    others = [right, replace(right)]

    def one_more(_bench: SearchData, found: Search, *_: object) -> Search:
        found.trials += [right]
        return found

    monkeypatch.setattr(detouring, "_others", lambda *_: others)
    monkeypatch.setattr(detouring, "onward", one_more)
    monkeypatch.setattr(detouring, "accept", lambda _bench, found, _trial: found)
    monkeypatch.setattr(detouring, "backward", lambda _bench, now, _told: now)
    ways = [*other_ways(both, search, screened, lambda *_: None)]
    began = sum(t.round == 1 for t in search.trials)
    assert [len(way.trials) for way in ways] == [began + 1, began + 1]


@pytest.mark.long
def test_a_way_is_searched_once_and_told_as_it_was_found(
    both: SearchData, screened: list[Screened], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, search = replace(both, ways=[]), misled(both)
    [way] = other_ways(bench, search, screened, lambda *_: None)
    found = way.fit
    way.fit = search.first  # what is made of it later changes nothing
    monkeypatch.setattr(detouring, "onward", unasked)
    [again] = other_ways(bench, search, screened, lambda *_: None)
    assert again.fit is found
    assert again.trials is way.trials
