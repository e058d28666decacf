"""What is calibrated besides the names: only what comes nearer, number by number, with its own share of the gap."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.calibration import Calibration, calibrated, entries, with_shares
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.intervals import Gap, Interval
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale, gap_of
from lidarcheck.workers import WorkerPool

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 8)}
OFF = Nuisance(materials={1: 2.5, 2: -2.5})


@pytest.fixture(scope="module")
def wrong_table() -> Scale:
    """Frames of a sensor that sees two materials brighter and darker than the table has them."""
    return Scale.of(frames(OFF.model(model()), 2, **FINE), model(), 5)


def test_errors_of_the_table_are_put_right_where_that_comes_nearer(wrong_table: Scale) -> None:
    there = calibrated(wrong_table, model(), OFF, WorkerPool()).model
    assert there.materials == OFF.model(model()).materials
    assert there.effects == ()


def test_the_pose_is_left_alone_where_only_the_table_comes_nearer(wrong_table: Scale) -> None:
    both = Nuisance(yaw=2.5, pitch=2.5, materials=OFF.materials)
    there = calibrated(wrong_table, model(), both, WorkerPool()).model
    assert there.materials == OFF.model(model()).materials
    assert there.effects == ()


@pytest.mark.parametrize("off", [Nuisance(), Nuisance(materials={1: -2.5, 2: 2.5})])
def test_what_comes_no_nearer_is_not_written(wrong_table: Scale, off: Nuisance) -> None:
    believed = model()
    assert calibrated(wrong_table, believed, off, WorkerPool()).model is believed


def test_a_pose_that_is_off_need_not_move_edges() -> None:
    """All ranges are those of a turned view, and no beam looks past an edge that it did not look past before."""
    off = Nuisance(yaw=-2.0, pitch=2.0)
    measured = Scale.of(frames(off.calibrated(model(), own_surface=True), 2, **FINE), model(), 5)
    there = calibrated(measured, model(), off, WorkerPool())
    assert [effect.settings()["own_surface"] for effect in there.model.effects] == [1]
    assert there.left[0] < 0.2 * measured.excess_by_part(model())[0][0]
    known = model(make("boresight", {"yaw_deg": 1.0, "pitch_deg": 0.0}))
    turned = off.calibrated(known, own_surface=True).effects[0].settings()
    assert (turned["yaw_deg"], turned["own_surface"]) == (pytest.approx(0.97), 0)


def test_each_number_has_its_interval_and_its_share_of_the_gap(wrong_table: Scale) -> None:
    put_right = calibrated(wrong_table, model(), OFF, WorkerPool())
    simulator = Simulator(wrong_table.frames, model(), 3)
    shown = np.zeros((1, len(simulator.measured)))
    found, models = entries(simulator, Fit((), (), simulator.distance(shown), shown), model(), put_right)
    assert [one.name for one in found] == ["materials.1.reflectance", "materials.2.reflectance"]
    for one, number in zip(found, (1, 2), strict=True):
        assert one.was == model().materials[number].reflectance
        assert one.value == OFF.model(model()).materials[number].reflectance
        assert one.low < one.value < one.high
        assert one.high - one.low < 0.4 * one.value, "no wider than usual errors are"
    assert models[0] == model()
    assert models[-1] == put_right.model
    unseen = Scale.of(frames(OFF.model(model()), 3, seed=5, **FINE)[2:], model(), 8)
    gap = gap_of(unseen, [("", model()), ("calibration", put_right.model)])
    shares = [one.gap_share for one in with_shares(unseen, found, models, gap, WorkerPool())]
    excess = gap.before.value - gap.floor.value
    # `gap.closed` is cut off at 1; what a right model leaves is below the floor as often as above it.
    assert sum(shares) == pytest.approx((gap.before.value - gap.after.value) / excess, abs=0.05)
    assert shares[0] > 0.3, "the wall is most of what is seen"


def test_where_there_is_no_gap_nothing_has_a_share_of_it(wrong_table: Scale) -> None:
    put_right = calibrated(wrong_table, model(), OFF, WorkerPool())
    simulator = Simulator(wrong_table.frames, model(), 3)
    shown = np.zeros((1, len(simulator.measured)))
    found, models = entries(simulator, Fit((), (), 0.0, shown), model(), put_right)
    none = Gap(*(Interval(0.1, 0.1, 0.1) for _ in range(3)))
    assert all(np.isnan(one.gap_share) for one in with_shares(wrong_table, found, models, none, WorkerPool()))


def test_what_changes_in_no_digit_is_no_number(wrong_table: Scale) -> None:
    put_right = Calibration(model(), Nuisance(materials={1: 2.5, 2: 1e-9}), False, np.zeros(6), np.zeros((6, 6)))
    simulator = Simulator(wrong_table.frames, model(), 3)
    shown = np.zeros((1, len(simulator.measured)))
    found, models = entries(simulator, Fit((), (), 0.0, shown), model(), put_right)
    assert [one.name for one in found] == ["materials.1.reflectance"]
    assert len(models) == 2


def test_a_pose_is_told_by_its_angles() -> None:
    off = Nuisance(yaw=-2.0, pitch=2.0)
    measured = frames(off.calibrated(model(), own_surface=True), 2, **FINE)
    put_right = calibrated(Scale.of(measured, model(), 5), model(), off, WorkerPool())
    simulator = Simulator(measured, model(), 3)
    shown = np.zeros((1, len(simulator.measured)))
    found, models = entries(simulator, Fit((), (), 0.0, shown), model(), put_right)
    assert [(one.name, one.was, one.value) for one in found] == [
        ("boresight.yaw_deg", 0.0, pytest.approx(-0.03)), ("boresight.pitch_deg", 0.0, pytest.approx(0.03)),
    ]  # fmt: skip
    assert models[-1] == put_right.model
