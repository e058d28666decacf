"""What speaks against saying that there is no gap: lost and added echoes, each beyond chance, and nothing usual."""

from types import SimpleNamespace

import numpy as np
import pytest

from explain_core_kit import WALL, frames, model
from lidarcheck.effects import make
from lidarcheck.explain import steps
from lidarcheck.explain.decision.against_no_gap import rates_beyond_chance, still_tells
from lidarcheck.explain.decision.answer import Answer
from lidarcheck.explain.report.explanation import Finding
from lidarcheck.inference.classifier import Chance, Classifier
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.workers import WorkerPool

WORDS = "30 of 5000 surfaces that are surely seen are lost, by chance 0.1"
FINE = {"layers": range(230, 290), "points": range(320, 640, 3)}
USUAL = Nuisance(yaw=1.0, pitch=-1.0, materials={WALL: 1.0})


def simulator(true, **how) -> Simulator:
    return Simulator(frames(true, 1, **{**FINE, **how}), model(), 4)


def test_a_loss_of_one_beam_in_two_hundred_is_seen() -> None:
    words = rates_beyond_chance(simulator(model(make("dropout", {"share": 0.005}))), Nuisance())
    assert "surely seen are lost" in words
    lost = int(words.split()[0])
    assert 8 <= lost <= 40


def test_foreign_echoes_on_one_beam_in_a_hundred_are_seen() -> None:
    words = rates_beyond_chance(simulator(model(make("interference", {"share": 0.01}))), Nuisance())
    assert "echoes of no surface are there" in words
    assert "lost" not in words


@pytest.mark.parametrize("true", [model(), USUAL.calibrated(model())], ids=["nothing", "usual errors"])
def test_neither_where_nothing_is_missing(true) -> None:
    for seed in range(3):
        assert rates_beyond_chance(simulator(true, seed=50 + seed), Nuisance()) == ""


def test_usual_errors_are_not_what_a_classifier_tells_and_a_form_is() -> None:
    """Ranges that scatter more are nothing of gain, reflectances or pose."""
    said = []
    for true in (USUAL.calibrated(model(), own_surface=True), model(make("timing_jitter", {"sigma_ns": 0.5}))):
        select = simulator(true)
        classifier = Classifier.of(select.frames, model(), 4)
        chance = Chance(model(), 0.03 / 2.6 * np.sqrt(classifier.drawn.sum()))
        said.append(still_tells(select, classifier, Nuisance(), chance))
    assert said[0] == ""
    assert said[1].startswith("a classifier tells")


@pytest.mark.parametrize(("words", "verdict"), [(WORDS, "unknown"), ("", "no_gap")])
def test_what_speaks_against_no_gap_makes_it_unknown_and_is_said(
    words: str, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    finding = Finding("unknown", {}, 1.0, (), "AREA depends on range", "", ())
    monkeypatch.setattr(steps, "against_no_gap", lambda *_: words)
    monkeypatch.setattr(steps.Workflow, "_unknown", lambda *_: Answer("unknown", (finding,), (("", model()),), ""))
    run = steps.Workflow(model(), 1, (), WorkerPool(), lambda *_: None)
    bench = SimpleNamespace(select=SimpleNamespace(frames=frames(model(), 1), seed=4))
    search = SimpleNamespace(fit=SimpleNamespace(nuisance=Nuisance()))
    answer = run.doubt_no_gap(bench, None, search, Answer("no_gap", (), (("", model()),), ""))  # type: ignore[arg-type]
    assert answer.verdict == verdict
    assert [one.where for one in answer.findings] == ([f"{WORDS}; AREA depends on range"] if words else [])
    named = Answer("explained", (finding,), (("", model()),), "")
    assert run.doubt_no_gap(bench, None, search, named) is named  # type: ignore[arg-type]
