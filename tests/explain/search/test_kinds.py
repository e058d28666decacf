"""Of each name one kind of start is fitted first; the others only where they may still be the nearest."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lidarcheck.effects.search import Probe
from lidarcheck.explain.search import selection as forward
from lidarcheck.explain.search.screening import Screened
from lidarcheck.explain.search.selection import Search, SearchData, run_round
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.workers import WorkerPool

NOTHING = Fit((), (), 10_000.0, np.zeros((1, 3)))
FLOOR = 500.0
PLACE: Any = SimpleNamespace(shared=None, floor_distance=FLOOR, distance=lambda shown: 9000.0)
BENCH = SearchData(PLACE, PLACE, 1.0, 10_000.0, WorkerPool())


def start(name: str, variant: str = "") -> tuple[float, Screened]:
    return 1.0, Screened(replace(fixed_probes([name])[0], variant=variant), np.zeros(3), 1.0)


STARTS = [start("fog", "far"), start("signal_gain"), start("fog", "near"), start("fog"), start("crosstalk", "weak")]


def fitted(monkeypatch: pytest.MonkeyPatch, left: dict[str, float]) -> tuple[list[tuple[str, str]], list[str]]:
    """What is fitted, (name, variant), in a round where a name leaves so much; and what is told."""
    asked: list[tuple[str, str]] = []
    on_progress: list[str] = []

    def tried(simulator: None, select: None, now: Fit, before: object, least: float, probe: Probe) -> Any:
        asked.append((probe.name, probe.variant))
        return Fit((probe,), (probe.start(),), left[probe.name], np.zeros((1, 3))), 100.0, 50.0, None, None

    monkeypatch.setattr(forward, "tried", tried)
    monkeypatch.setattr(forward, "_promising", lambda *_: STARTS)
    monkeypatch.setattr(forward, "select_shown", lambda *_: np.zeros((1, 3)))
    trials = run_round(BENCH, Search(NOTHING, NOTHING), [], 1, lambda step, i, n: on_progress.append(f"{step} {i}/{n}"))
    assert [(one.name, one.probe.variant) for one in trials] == asked
    return asked, on_progress


FIRST = [("fog", "far"), ("signal_gain", ""), ("crosstalk", "weak")]


def test_other_kinds_of_what_is_far_behind_a_name_that_explains_all_are_spared(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, on_progress = fitted(monkeypatch, {"fog": 4800.0, "signal_gain": FLOOR - 1.0, "crosstalk": 9000.0})
    assert asked == FIRST
    assert on_progress == ["round 1 1/5", "round 1 2/5", "round 1 3/5"]


@pytest.mark.parametrize(
    ("fog", "signal_gain"),
    [
        (4800.0, FLOOR + 1.0),  # no name has explained all
        (FLOOR + 900.0, FLOOR - 1.0),  # another kind may come as near
        (FLOOR - 1.0, 4800.0),  # the name itself has
    ],
)
def test_where_they_may_be_the_nearest_they_are_fitted(
    monkeypatch: pytest.MonkeyPatch, fog: float, signal_gain: float
) -> None:
    asked, on_progress = fitted(monkeypatch, {"fog": fog, "signal_gain": signal_gain, "crosstalk": 9000.0})
    assert asked == [*FIRST, ("fog", "near"), ("fog", "")]
    assert on_progress[-1] == "round 1 5/5"
