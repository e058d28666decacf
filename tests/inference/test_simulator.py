"""What a simulator keeps of its simulations saves time and changes nothing."""

import numpy as np
import pytest

from explain_core_kit import ROAD, WALL, frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model import incremental as again

CROSSTALK = make("crosstalk", {"sides": 0.1, "corners": 0.05})
DIRT = make("blockage", {"transmission": 0.5, "first_layer": 240, "last_layer": 250})


@pytest.fixture
def beams(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many beams each simulation runs."""
    found: list[int] = []
    simulated = again.echoes_of

    def counted(light, *args, **kwargs):  # type: ignore[no-untyped-def]
        found.append(len(light))
        return simulated(light, *args, **kwargs)

    monkeypatch.setattr(again, "echoes_of", counted)
    return found


def simulator() -> Simulator:
    return Simulator(frames(model(), 2), model(), 3)


@pytest.mark.parametrize(
    ("effects", "off", "part"),
    [
        ((CROSSTALK,), Nuisance(materials={ROAD: 1.0}), (0.0, 0.6)),
        ((CROSSTALK, DIRT), Nuisance(), (0.0, 0.6)),
        ((CROSSTALK,), Nuisance(yaw=1.0), (0.9, 1.1)),
        ((make("crosstalk", {"sides": 0.2, "corners": 0.05}),), Nuisance(), (0.9, 1.1)),
        ((CROSSTALK, make("walk_error", {})), Nuisance(), (0.0, 0.0)),
    ],
    ids=["one material", "a patch", "the pose", "other detectors", "the readout"],
)
def test_only_beams_that_differ_from_what_is_kept_are_simulated(
    beams: list[int], effects: tuple[Effect, ...], off: Nuisance, part: tuple[float, float]
) -> None:
    used = simulator()
    whole = sum(len(frame.ideal) for frame in used.frames)
    used.shows(model(CROSSTALK), 1)
    used.shows(model(CROSSTALK), 1, Nuisance(materials={WALL: -2.0}))
    beams.clear()
    shown = used.shows(model(*effects), 1, off)
    assert part[0] * whole <= sum(beams) <= part[1] * whole
    assert np.array_equal(shown, simulator().shows(model(*effects), 1, off))


def test_no_more_than_a_few_simulations_are_kept() -> None:
    used = simulator()
    first = used.shows(model(CROSSTALK), 1)
    for k in range(20):
        used.shows(model(make("dead_time", {"shift_ns": 0.1 * k})), 1)
    assert len(used._simulations._unread) <= 12
    assert np.array_equal(used.shows(model(CROSSTALK), 1), first)
