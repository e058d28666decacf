"""Objects that move each on its own: their speeds are read off the ranges; the ground and walls are none of them."""

import numpy as np
import pytest

from explain_core_kit import PANEL, ROAD, SIGN, WALL, frames, model, street
from lidarcheck.effects import make
from lidarcheck.effects.search import Probe
from lidarcheck.explain.search.starts import located_probes
from lidarcheck.inference.simulator import Simulator

FINE = {"layers": range(230, 290), "points": range(320, 640, 4), "sign": True}
STILL = {"forward_m_s": 0.0}


NEAR = {"layers": range(246, 282), "points": range(370, 560, 2), "sign": True}


def several(how: dict[str, object] = FINE, **moving: object) -> list[Probe]:
    simulator = Simulator(frames(model(make("motion", STILL | moving)), 2, **how), model(), 3)
    return [probe for probe in located_probes(simulator, ["motion"]) if probe.variant == "several objects"]


def test_two_objects_that_move_apart_have_speeds_of_their_own() -> None:
    [probe] = several(movers=(PANEL, SIGN), movers_forward_m_s=(12.0, -9.0))
    found = dict(zip(probe.settings["movers"], probe.settings["movers_forward_m_s"], strict=True))
    assert found == {PANEL: pytest.approx(12.0, abs=1.0), SIGN: pytest.approx(-9.0, abs=1.0)}
    assert probe.effect().settings()["forward_m_s"] == 0.0
    assert probe.scaled(0.5).effect().settings()["objects"] == pytest.approx(0.5)


def test_a_near_object_may_fill_a_fifth_of_the_view() -> None:
    ideal = street(0, **NEAR)
    assert np.mean(ideal.object_id == PANEL) > 0.18
    [probe] = several(NEAR, movers=(PANEL, SIGN), movers_forward_m_s=(12.0, -9.0))
    assert set(probe.settings["movers"]) == {PANEL, SIGN}


@pytest.mark.parametrize(
    "moving",
    [
        {"movers": (PANEL,), "movers_forward_m_s": (12.0,)},
        {"movers": (WALL, ROAD), "movers_forward_m_s": (-9.0, 12.0)},
        {"objects": 0.0},
    ],
    ids=["one", "what fills the view", "none"],
)
def test_one_object_or_what_fills_the_view_is_no_traffic(moving: dict[str, object]) -> None:
    assert several(**moving) == []
