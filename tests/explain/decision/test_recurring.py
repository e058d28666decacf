"""Effects that strike at random are not named where the same columns are struck in every frame."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import at_ranges, frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.answer import Answer, closes, objection
from lidarcheck.explain.decision.model_check import Open
from lidarcheck.explain.decision.recurring import recurs
from lidarcheck.inference.wasserstein import PARTS, Scale
from lidarcheck.scan import Scan
from lidarcheck.workers import WorkerPool

FINE = {"layers": range(230, 290, 2), "points": range(400, 560, 4)}
RANDOM = {
    "interference": {"share": 0.1, "signal": 8.0},
    "interference in lines": {"share": 0.1, "signal": 8.0, "columns": 0.1, "column_span_m": 5.0},
    "dropout": {"share": 0.1},
    "dropout in blocks": {"share": 0.1, "block_points": 4, "block_layers": 12},
    "vibration": {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.1, "memory_columns": 100},
    "vibration in phase": {"pitch_deg": 0.1, "yaw_deg": 0.1, "frequency_hz": 800.0},
}


def stuck(scan: Scan) -> Scan:
    """Three columns whose echoes all report one range: lost where they belong, and too many elsewhere."""
    return at_ranges(scan, np.where((scan.point >= 440) & (scan.point < 452), 33.0, scan.range_m))


@pytest.mark.parametrize("form", RANDOM)
def test_true_effects_strike_elsewhere_in_every_frame(form: str) -> None:
    name = form.split(" ")[0]
    true = model(make(name, RANDOM[form]))
    seen = Scale.of(frames(true, 3, **FINE), model(), 5)
    assert not recurs(seen, true, name, WorkerPool())


@pytest.mark.parametrize("form", RANDOM)
def test_columns_that_stick_are_the_same_in_every_frame(form: str) -> None:
    name = form.split(" ")[0]
    seen = Scale.of(frames(model(), 3, changed=stuck, **FINE), model(), 5)
    assert recurs(seen, model(make(name, RANDOM[form])), name, WorkerPool())


@pytest.mark.parametrize("columns", [1.0, 0.05], ids=["everywhere", "in columns"])
@pytest.mark.parametrize("true", ["blooming_vertical", "interference"])
def test_echoes_that_gather_around_a_sign_at_its_range_are_no_foreign_pulses(
    true: str, columns: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a sign that stands elsewhere in every frame, so that no columns are struck again."""
    monkeypatch.setattr("lidarcheck.explain.decision.recurring._agreement", lambda _count: 0.0)
    foreign = make("interference", {"share": 0.1, "signal": 8.0, "columns": columns, "column_span_m": 5.0})
    cause = make("blooming_vertical", {"skirt_up": 2e-3, "skirt_down": 2e-3}) if true != "interference" else foreign
    seen = Scale.of(frames(model(cause), 3, sign=True, **FINE, seed=3), model(), 5)
    assert recurs(seen, model(foreign), "interference", WorkerPool()) == (true == "blooming_vertical")


@pytest.mark.parametrize("true", ["retro_ghost", "interference"])
def test_echoes_on_beams_that_meet_one_material_are_no_foreign_pulses(
    true: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lidarcheck.explain.decision.recurring._agreement", lambda _count: 0.0)
    foreign = make("interference", {"share": 0.05, "signal": 8.0})
    cause = foreign if true == "interference" else make("retro_ghost", {})
    seen = Scale.of(frames(model(cause), 3, sign=True, **FINE, seed=3), model(), 5)
    assert recurs(seen, model(foreign), "interference", WorkerPool()) == (true == "retro_ghost")


def test_effects_that_do_not_strike_at_random_may_recur() -> None:
    seen = Scale.of(frames(model(), 3, changed=stuck, **FINE), model(), 5)
    assert not recurs(seen, model(make("range_offset", {"offset_m": 0.1})), "range_offset", WorkerPool())


def test_what_recurs_speaks_against_a_name_whatever_it_closes() -> None:
    nothing, noise = np.zeros(len(PARTS)), np.full((4, len(PARTS)), 0.01)
    answer = Answer("explained", (), (), "", Open(nothing + 1.0, nothing, noise, noise))
    assert closes(answer)
    against = dataclasses.replace(answer, recurring=("interference",))
    assert not closes(against)
    places = "the same columns in every frame, beside bright targets, or on one material"
    assert objection(against) == f"interference would strike {places}"
    assert objection(answer) == "too much stays open on the frames seen"
