"""Names that come near the best of a round are compared when their fits have ended."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lidarcheck.explain.search import selection as forward
from lidarcheck.explain.search import trial as trials
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.selection import Search, accept, best_of, neck_and_neck
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.workers import WorkerPool

NOTHING = Fit((), (), 10_000.0, np.zeros((1, 3)))
BENCH: Any = SimpleNamespace(
    simulator=SimpleNamespace(shared="fit"), select=SimpleNamespace(shared="select"), pool=WorkerPool(), level=1.0
)


def trial(name: str, gain: float, variant: str = "") -> FittedCandidate:
    probe = replace(fixed_probes([name])[0], variant=variant)
    fit = Fit((probe,), (probe.start(),), 10_000.0 - gain, np.zeros((1, 3)))
    return FittedCandidate(name, 1, fit, gain, 1.0, gain, 0.0, gain)


@pytest.fixture
def ended(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """What is fitted to the end, (name, variant); a scale then explains more than a motion does."""
    asked: list[tuple[str, str]] = []

    def to_the_end(simulator: str, select: str, before: object, now: Fit) -> Any:
        assert (simulator, select) == ("fit", "select")
        probe = now.probes[-1]
        asked.append((probe.name, probe.variant))
        left = 100.0 if probe.name == "range_scale" else now.distance
        return replace(now, distance=left), left, 9000.0, None, None

    monkeypatch.setattr(forward, "to_the_end", to_the_end)
    monkeypatch.setattr(forward, "select_shown", lambda select, at: np.zeros((1, 3)))
    return asked


def test_the_best_is_the_best_at_the_end(ended: list[tuple[str, str]]) -> None:
    trials = [trial("motion", 9000.0), trial("range_scale", 8900.0), trial("range_offset", 6000.0)]
    found = neck_and_neck(BENCH, Search(NOTHING, NOTHING), trials)
    assert ended == [("motion", ""), ("range_scale", "")]
    assert [one.name for one in found] == ["motion", "range_scale", "range_offset"]
    assert [one.end is one.fit for one in found] == [True, True, False]
    assert found[1].gain == 9900.0
    assert max(found, key=lambda one: one.merit).name == "range_scale"
    assert found[2] is trials[2]


def test_one_that_is_hardly_ahead_at_the_end_does_not_overtake(
    ended: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(forward, "_OVERTAKES", 1.2)
    trials = [trial("fog", 9000.0), trial("range_scale", 8900.0)]
    found = neck_and_neck(BENCH, Search(NOTHING, NOTHING), trials)
    assert [one.merit for one in found] == [one.merit for one in trials]
    assert [one.end and one.end.distance for one in found] == [1000.0, 100.0]  # for `accept`


def test_of_each_name_the_best_kind_is_fitted_on(ended: list[tuple[str, str]]) -> None:
    trials = [trial("range_scale", 8800.0, "light"), trial("range_scale", 8900.0), trial("motion", 9000.0)]
    neck_and_neck(BENCH, Search(NOTHING, NOTHING), trials)
    assert sorted(ended) == [("motion", ""), ("range_scale", "")]


def test_a_plainer_name_of_the_relatives_is_fitted_on_from_farther_and_need_only_be_as_near(
    ended: list[tuple[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(forward, "_OVERTAKES", 1.2)
    scale = replace(trial("range_scale", 7000.0), select_before=9000.0)
    trials = [trial("motion", 9000.0), scale, trial("timing_jitter", 8000.0)]
    found = neck_and_neck(BENCH, Search(NOTHING, NOTHING), trials)
    assert ended == [("motion", ""), ("range_scale", "")]
    assert best_of(found).name == "range_scale"
    assert found[2] is trials[2]


@pytest.mark.parametrize("gains", [[9000.0], [9000.0, 6000.0], []])
def test_where_nothing_comes_near_nothing_is_fitted_on(ended: list[tuple[str, str]], gains: list[float]) -> None:
    trials = [trial(name, gain) for name, gain in zip(("motion", "range_scale"), gains, strict=False)]
    assert neck_and_neck(BENCH, Search(NOTHING, NOTHING), trials) == trials
    assert not ended


def test_a_fit_that_has_ended_is_accepted_as_it_is() -> None:
    one = trial("motion", 9000.0)
    end = replace(one.fit, distance=500.0)
    assert accept(BENCH, Search(NOTHING, NOTHING), replace(one, end=end)).fit is end


@pytest.mark.parametrize(
    ("gain", "name"), [(900.0, "boresight"), (700.0, "vibration")], ids=["nearly as much", "much less"]
)
def test_the_special_case_that_explains_nearly_as_much_is_the_better_name(gain: float, name: str) -> None:
    trials = [trial("vibration", 1000.0), trial("boresight", gain), trial("motion", 990.0)]
    assert best_of(trials).name == name


def test_beside_a_view_that_wanders_what_lasts_is_fitted_to_the_end(ended: list[tuple[str, str]]) -> None:
    """A turn past edges, or one that lasts, is fitted less well at first than what follows every column."""
    names = {"boresight": 6000.0, "motion": 5900.0, "beam_divergence": 6100.0}
    trials = [trial("vibration", 9000.0, "wander"), *(trial(name, gain) for name, gain in names.items())]
    found = neck_and_neck(BENCH, Search(NOTHING, NOTHING), trials)
    assert ended == [("vibration", "wander"), ("boresight", ""), ("motion", "")]
    assert best_of(found).name == "vibration"


@pytest.mark.parametrize(
    ("variant", "gain", "name"),
    [("wander", 900.0, "motion"), ("wander", 700.0, "vibration"), ("", 900.0, "vibration")],
    ids=["nearly as much", "much less", "a view that shakes"],
)
def test_a_turn_that_lasts_is_the_better_name_for_a_view_that_wanders(variant: str, gain: float, name: str) -> None:
    assert best_of([trial("vibration", 1000.0, variant), trial("motion", gain)]).name == name


@pytest.mark.parametrize(
    ("distances", "ends_at"), [([900.0, 700.0, 690.0], 700.0), ([900.0, 890.0], 900.0), ([900.0, 700.0, 500.0], 500.0)]
)
def test_numbers_and_nuisances_are_fitted_in_turn_while_that_brings_much(
    distances: list[float], ends_at: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = iter(distances)
    monkeypatch.setattr(trials, "finished", lambda simulator, now: now)
    monkeypatch.setattr(trials, "fit_nuisance", lambda simulator, now: replace(now, distance=next(left)))
    monkeypatch.setattr(trials, "on_select", lambda select, before, found: found)
    simulator: Any = None
    assert trials.to_the_end(simulator, simulator, np.zeros((1, 3)), NOTHING).distance == ends_at  # type: ignore[attr-defined]
