"""A view that looks elsewhere shows no other echoes in the midst of surfaces."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.explain.decision.answer import Answer, closes, objection
from lidarcheck.explain.decision.inner_echoes import shows_inside
from lidarcheck.explain.decision.model_check import Open
from lidarcheck.inference.wasserstein import PARTS, Scale

FINE = {"layers": range(230, 290, 2), "points": range(400, 560, 2)}
SHAKEN = make("vibration", {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.1})
WIDE = make("beam_divergence", {"vertical_deg": 0.1, "horizontal_deg": 0.2})
TURNED = make("boresight", {"yaw_deg": 0.2, "pitch_deg": 0.1})
FOREIGN = make("interference", {"share": 0.04, "signal": 8.0})


@pytest.mark.parametrize("named", [SHAKEN, WIDE, TURNED], ids=lambda effect: effect.name)
@pytest.mark.parametrize("besides", [(), (FOREIGN,)], ids=["alone", "foreign pulses besides"])
def test_foreign_pulses_lie_in_the_midst_of_surfaces(named: Effect, besides: tuple[Effect, ...]) -> None:
    seen = Scale.of(frames(model(named, *besides), 3, **FINE), model(), 5)
    assert shows_inside(seen, model(named), [named.name]) == bool(besides)
    assert not shows_inside(seen, model(named, *besides), [named.name])


def test_it_is_asked_only_where_all_names_look_elsewhere() -> None:
    seen = Scale.of(frames(model(SHAKEN, FOREIGN), 3, **FINE), model(), 5)
    assert not shows_inside(seen, model(SHAKEN), ["vibration", "fog"])
    assert not shows_inside(seen, model(), [])


def test_echoes_in_the_midst_of_surfaces_speak_against_names_whatever_these_close() -> None:
    nothing, noise = np.zeros(len(PARTS)), np.full((4, len(PARTS)), 0.01)
    answer = Answer("explained", (), (), "", Open(nothing + 1.0, nothing, noise, noise))
    assert closes(answer)
    against = dataclasses.replace(answer, inside=True)
    assert not closes(against)
    assert objection(against) == "echoes stay in the midst of surfaces, where no edge is"
