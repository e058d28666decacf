"""What usual errors of gain, table and pose explain is no gap, unless one effect explains much of the little left."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from explain_core_kit import PANEL, ROAD, WALL, frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.effects.geometry.surfaces import LocalSurfaces
from lidarcheck.explain.decision import needless
from lidarcheck.explain.decision.needless import without_any
from lidarcheck.explain.search.merit import CHANCE
from lidarcheck.explain.search.screening import Screened, chance_level, screen
from lidarcheck.explain.search.search import _beside_usual, backward, find_effects, without
from lidarcheck.explain.search.selection import Search, SearchData
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference import nuisance_fit, optimiser
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.nuisance_fit import fit_nuisance
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.stages import Surfaces

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 8)}
DARK_WALL = Nuisance(materials={WALL: -1.0})
NAMES = ("dropout", "timing_jitter", "walk_error")


def searched(*hidden: Effect) -> tuple[tuple[str, ...], SearchData, list[Screened]]:
    """What the search finds in frames of a wall a little darker than the table has it, and of these effects."""
    measured = frames(DARK_WALL.model(model(*hidden)), 4, **FINE)
    simulator, select = Simulator(measured[:3], model(), 3), Simulator(measured[3:], model(), 4)
    screened = screen(simulator, fixed_probes(NAMES))
    start = simulator.distance(np.zeros((1, len(simulator.measured))))
    bench = SearchData(simulator, select, chance_level(simulator, screened), start)
    return find_effects(bench, screened, lambda *_: None).fit.names(), bench, screened


def test_a_usual_error_of_the_table_is_no_effect() -> None:
    assert searched()[0] == ()


@pytest.mark.long
def test_few_lost_beams_stand_out_of_a_rest_that_is_small_enough_for_chance() -> None:
    """One in 80, 37 to 50 of these: half as many are found of six drawings in nine, these of all nine."""
    found, bench, _ = searched(make("dropout", {"share": 0.012}))
    assert found == ("dropout",)
    assert bench.start < 3.0 * bench.simulator.floor_distance


@pytest.mark.parametrize(
    ("nuisance", "asked"),
    [
        (Nuisance(), 150.0),  # nothing was fitted first
        (Nuisance(materials={WALL: 1.2}), 0.4 * CHANCE),
        (Nuisance(materials={WALL: 2.5}), 150.0),  # no usual error: it has taken up a part of the effect
    ],
)
def test_beside_usual_errors_an_effect_must_explain_a_part_of_what_chance_may_leave(
    nuisance: Nuisance, asked: float
) -> None:
    simulator: Any = SimpleNamespace(floor_distance=800.0)
    small, large = SearchData(simulator, simulator, 10.0, 1600.0), SearchData(simulator, simulator, 10.0, 3800.0)
    first = Fit((), (), 1000.0, np.zeros((1, 3)), nuisance=nuisance)
    assert _beside_usual(large, first).worth == pytest.approx(150.0)
    assert _beside_usual(small, first).worth == pytest.approx(asked if asked < 150.0 else 40.0)


def test_the_nuisances_are_fitted_to_their_end_in_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pose and tables off by what they may be: two single steps leave 100 above the floor, two doubled ones none."""
    off = Nuisance(yaw=-1.5, pitch=1.0, materials={WALL: -2.0, PANEL: 2.0, ROAD: 1.5})
    how = {"layers": range(230, 290), "points": range(320, 640, 4)}
    simulator = Simulator(frames(off.calibrated(model(), own_surface=True), 3, **how), model(), 3)
    shown = np.zeros((1, len(simulator.measured)))
    plain = Fit((), (), simulator.distance(shown), shown)

    def left() -> float:
        return fit_nuisance(simulator, plain, rounds=2).distance - simulator.floor_distance

    assert left() < -50.0
    monkeypatch.setattr(nuisance_fit, "_ANEW", 0)
    assert left() < -50.0, "the first slopes serve"
    monkeypatch.setattr(optimiser, "_DOUBLINGS", 0)
    assert left() > 50.0


def test_a_pose_and_tables_that_move_the_same_ranges_are_told_apart() -> None:
    """A wall that recedes and a road: the pose moves their ranges, which their reflectances must not make up for. On a
    level road a pitch and the sensor's height do nearly the same, and share it."""
    off = Nuisance(yaw=1.5, pitch=1.0, materials={WALL: -1.2, ROAD: 1.5})
    measured = frames(off.calibrated(model(), own_surface=True), 3, layers=range(230, 290), points=range(320, 640, 4))
    simulator = Simulator(measured, model(), 3)
    shown = np.zeros((1, len(simulator.measured)))
    found = fit_nuisance(simulator, Fit((), (), simulator.distance(shown), shown), rounds=2)
    assert found.distance < simulator.floor_distance
    assert found.nuisance.yaw == pytest.approx(1.5, abs=0.15)
    seen = Surfaces(measured[0].ideal)
    _, (true,) = off.posed(model(), [seen])
    _, (fitted,) = found.nuisance.posed(model(), [seen])
    road = (seen.ideal.material_id == ROAD) & (seen.ideal.distance_m < 40.0)
    road &= LocalSurfaces.of(seen.ideal).known  # in a corner of the view no beams beside tell the plane that turns
    moved, by_fit = (one.ideal.distance_m[road] - seen.ideal.distance_m[road] for one in (true, fitted))
    np.testing.assert_allclose(by_fit, moved, rtol=0.4, atol=1e-3)
    assert found.nuisance.materials[WALL] == pytest.approx(-1.2, abs=0.2)


@pytest.mark.long
@pytest.mark.parametrize(("gain", "named"), [(0.90, True), (0.98, False)])
def test_what_only_tables_at_their_limits_would_explain_keeps_its_name(gain: float, named: bool) -> None:
    """Tables that are off by what they may be at most explain nearly all of a gain of 0.9."""
    measured = frames(model(make("signal_gain", {"gain": gain})), 4, **FINE)
    simulator, select = Simulator(measured[:3], model(), 3), Simulator(measured[3:], model(), 4)
    bench = SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))
    probe = fixed_probes(["signal_gain"])[0]
    now = fit(simulator, [probe], [probe.start()], rounds=6)
    fewer = without(simulator, now, 0)
    assert fewer.nuisance.usual == (not named)
    assert fewer.distance - now.distance < 150.0
    found = backward(replace(bench, start=bench.start + 20000.0), now, lambda *_: None)
    assert found.names() == (("signal_gain",) if named else ())


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "name", "kept"),
    [
        ((), "vibration", False),
        ((make("dropout", {"share": 0.012}),), "dropout", True),
        ((make("vibration", {"yaw_deg": 0.06, "frequency_hz": 30.0}),), "vibration", True),
        ((make("beam_divergence", {"vertical_deg": 0.05, "horizontal_deg": 0.15}),), "incidence_falloff", True),
    ],
    ids=["usual errors are all", "beams are lost", "a view that shakes", "usual errors leave all other echoes"],
)
def test_a_name_that_comes_no_nearer_beam_by_beam_than_usual_errors_is_none(
    hidden: tuple[Effect, ...], name: str, kept: bool
) -> None:
    measured = frames(DARK_WALL.model(model(*hidden)), 4, **FINE)
    simulator, select = Simulator(measured[:3], model(), 3), Simulator(measured[3:], model(), 4)
    bench = SearchData(simulator, select, 10.0, simulator.distance(np.zeros((1, len(simulator.measured)))))
    probe = fixed_probes([name])[0]
    named = fit(simulator, [probe], [probe.start()], rounds=4)
    found = without_any(bench, Scale.of(measured, model(), 5), Search(named, named), 7)
    assert found.fit.names() == ((name,) if kept else ())


@pytest.mark.parametrize(
    ("left", "alone", "nearer"),
    [
        ((0.004, 0.010), (0.004, 0.040), False),
        ((0.004, 0.010), (0.060, 0.010), True),
        ((0.004, 0.200), (0.060, 0.010), False),
        ((0.004, 0.010), (0.004, 0.100), True),
    ],
    ids=["noise of rare echoes", "losses", "more is left of all", "echoes"],
)
def test_a_name_comes_nearer_only_where_a_part_of_the_gap_closes_by_more_than_chance(
    left: tuple[float, float], alone: tuple[float, float], nearer: bool
) -> None:
    """Of losses chance makes 0.004, of other echoes 0.02: a mean over both is the noise of the other echoes."""
    noise = np.array([[0.004, 0.02]]) * np.array([[-1.0], [0.0], [1.0]])

    def judged(parts: tuple[float, float]) -> Any:
        nuisance = SimpleNamespace(parts=np.array(parts))
        last = SimpleNamespace(model=lambda case: case, nuisance=nuisance)
        return SimpleNamespace(left=float(np.mean(parts)), last=last)

    seen: Any = SimpleNamespace(excess_by_part=lambda _case, nuisance: (nuisance.parts, noise))
    assert needless._nearer(seen, model(), judged(left), judged(alone)) == nearer


@pytest.mark.parametrize(
    ("off", "usual", "conceivable"),
    [
        ({1: 1.2, 2: 1.2}, True, True),
        ({1: 1.7, 2: 1.7}, False, True),
        ({1: 2.3, 2: 2.3}, False, False),
        ({1: 1.7, 2: 1.7, 3: 1.7, 4: 1.7, 5: 1.7, 6: 1.7}, False, False),
        ({1: 2.5, 2: -2.5}, False, False),
    ],
    ids=["a gain's error", "two of a kind", "too much for two", "too much for six", "at the limit"],
)
def test_few_reflectances_may_be_off_to_one_side_by_more_than_many(
    off: dict[int, float], usual: bool, conceivable: bool
) -> None:
    found = Nuisance(materials=off)
    assert (found.usual, found.conceivable) == (usual, conceivable)


@pytest.mark.parametrize(
    ("names", "may"),
    [(("vibration",), True), (("signal_gain",), False), (("vibration", "layer_gain"), False)],
    ids=["another", "the same", "its kin"],
)
def test_reflectances_off_to_one_side_may_be_all_where_no_name_says_the_same(names: tuple[str, ...], may: bool) -> None:
    assert needless._may_be(Nuisance(materials={1: 1.7, 2: 1.7}), names) == may
    assert needless._may_be(Nuisance(materials={1: 1.2, 2: 1.2}), names)
