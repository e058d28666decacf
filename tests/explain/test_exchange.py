"""Where the select frames alone show a gap, they take part in the fit, and others select."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import PANEL, WALL, case, model
from lidarcheck.cases.case import Case
from lidarcheck.cases.split import Split, Unseen, exchanged
from lidarcheck.effects import make
from lidarcheck.explain.progress import ignore_progress
from lidarcheck.explain.steps import Workflow
from lidarcheck.explain.workflow import explain
from lidarcheck.workers import WorkerPool

OFFSET = make("range_offset", {"offset_m": 0.12})
SEED = 1


def of_role(role: str) -> Case:
    """Six frames, of which those of one role were measured with ranges off, and the others as the model has it."""
    right, off = case(model(), model(), 6), case(model(OFFSET), model(), 6)
    numbers = split(right).numbers()[role]
    frames = (wrong if wrong.number in numbers else one for one, wrong in zip(right.frames, off.frames, strict=True))
    return dataclasses.replace(right, frames=tuple(frames))


def run() -> Workflow:
    return Workflow(model(), SEED, (), WorkerPool(), ignore_progress)


def split(given: Case) -> Split:
    return run().split(given)


@pytest.mark.long
def test_the_select_frames_fit_where_they_alone_show_a_gap() -> None:
    given, doing = of_role("select"), run()
    first = doing.split(given)
    other, bench = doing.exchange_frames(first, doing.measure_residuals_and_floor(first))
    assert set(first.numbers()["select"]) < set(other.numbers()["fit"])
    assert set(other.numbers()["select"]) < set(first.numbers()["fit"])
    assert other.verify == first.verify
    assert bench.simulator.frames == other.fit
    assert bench.select.frames == other.select
    assert "the select frames alone show a gap" in next(step.words for step in doing.steps if step.name == "exchange")
    named = explain(given, seed=SEED, exclude=("motion", "vibration"))
    assert named.split == other.numbers()
    assert "range_offset" in [one.name for one in named.candidates]


@pytest.mark.parametrize("role", ["fit", "verify"])
def test_they_stay_where_the_frames_of_the_fit_show_it_or_none_of_both(role: str) -> None:
    given, doing = of_role(role), run()
    first = doing.split(given)
    bench = doing.measure_residuals_and_floor(first)
    assert doing.exchange_frames(first, bench) == (first, bench)
    assert [step.name for step in doing.steps].count("residuals") == 1


def test_what_selects_instead_is_what_the_fit_lacks_least() -> None:
    """Of three frames of the fit two show the panel: one of these selects, since the third one shows the wall alone."""
    frames = case(model(), model(), 6).frames

    def only(number: int, material: int) -> object:
        frame = frames[number]
        ideal = dataclasses.replace(frame.ideal, material_id=np.full(len(frame.ideal), material))
        return dataclasses.replace(frame, ideal=ideal)

    fit = (only(0, PANEL), only(1, WALL), only(2, PANEL))
    found = exchanged(Split(fit, (only(3, PANEL),), Unseen([only(4, WALL), only(5, PANEL)])))  # type: ignore[arg-type, list-item]
    assert found.numbers() == {"fit": (1, 2, 3), "select": (0,), "verify": (4, 5)}
