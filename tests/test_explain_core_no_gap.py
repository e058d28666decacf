"""What usual errors of gain, table and pose explain is no gap, unless one effect explains much of the little left."""

import numpy as np
import pytest

from explain_core_kit import PANEL, ROAD, WALL, frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.explain import fit as fitting
from lidarcheck.explain.candidates import fixed_probes
from lidarcheck.explain.fit import Fit, fit_nuisance
from lidarcheck.explain.forward import Bench
from lidarcheck.explain.lab import Lab
from lidarcheck.explain.nuisances import Nuisance
from lidarcheck.explain.screen import Screened, chance_level, screen
from lidarcheck.explain.search import find_effects

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 8)}
DARK_WALL = Nuisance(materials={WALL: -1.0})
NAMES = ("dropout", "timing_jitter", "walk_error")


def searched(*hidden: Effect) -> tuple[tuple[str, ...], Bench, list[Screened]]:
    """What the search finds in frames of a wall a little darker than the table has it, and of these effects."""
    measured = frames(DARK_WALL.model(model(*hidden)), 4, **FINE)
    lab, select = Lab(measured[:3], model(), 3), Lab(measured[3:], model(), 4)
    screened = screen(lab, fixed_probes(NAMES))
    start = lab.distance(np.zeros((1, len(lab.measured))))
    bench = Bench(lab, select, chance_level(lab, screened), start)
    return find_effects(bench, screened, lambda *_: None).fit.names(), bench, screened


def test_a_usual_error_of_the_table_is_no_effect() -> None:
    assert searched()[0] == ()


@pytest.mark.parametrize("share", [0.02, 0.03])
def test_few_lost_beams_stand_out_of_a_rest_that_is_small_enough_for_chance(share: float) -> None:
    found, bench, _ = searched(make("dropout", {"share": share}))
    assert found == ("dropout",)
    assert bench.start < 3.0 * bench.lab.floor_distance


def test_the_nuisances_are_fitted_to_their_end_in_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A table off by what it may be: of 1700 above the floor, two single steps leave 150, two doubled ones 30."""
    off = Nuisance(materials={WALL: 2.4, PANEL: -2.4, ROAD: 2.4})
    how = {"layers": range(230, 290), "points": range(320, 640, 4)}
    lab = Lab(frames(off.model(model()), 3, **how), model(), 3)
    shown = np.zeros((1, len(lab.measured)))
    plain = Fit((), (), lab.distance(shown), shown)

    def left() -> float:
        return fit_nuisance(lab, plain, rounds=2).distance - lab.floor_distance

    doubled = left()
    monkeypatch.setattr(fitting, "_DOUBLED", 0)
    assert left() > 100.0
    assert doubled < 0.5 * left()
