"""A column of beams that sees past a panel's edge is one error of the pose, and not many missing echoes."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import PANEL, WALL, model, street
from lidarcheck.cases.frame import Frame
from lidarcheck.inference import simulator as simulating
from lidarcheck.inference.observed.edges import EXTRA, runs_along, runs_past, with_beams_of
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model import simulate
from lidarcheck.scan import IdealScan

WHERE = {"layers": range(246, 279, 2), "points": range(360, 480, 6)}
LEFT_POINT = max(p for p in WHERE["points"] if abs(p - 420) < 36)
INNER_POINT = 420
PANEL_POINTS = [p for p in WHERE["points"] if abs(p - 420) < 36]


def met(*points: int, layers: range = range(253, 272)) -> IdealScan:
    """The street, but these beams of the panel meet the wall behind it."""
    ideal = street(0, **WHERE)
    beside = {int(a): d for a, p, d in zip(ideal.layer, ideal.point, ideal.distance_m, strict=True) if p == 360}
    past = np.isin(ideal.point, points) & (ideal.material_id == PANEL) & np.isin(ideal.layer, layers)
    wall_m = np.array([beside[int(a)] for a in ideal.layer])
    return dataclasses.replace(
        ideal,
        distance_m=np.where(past, wall_m, ideal.distance_m),
        material_id=np.where(past, WALL, ideal.material_id),
    )


def lab_of(true: IdealScan, lost: int | None = None) -> Simulator:
    frames = []
    for k in range(2):
        ideal = street(k, **WHERE)
        scan = simulate(true if k == 0 else ideal, model(), seed=5, frame=k, threads=1)
        if lost is not None and k == 0:
            scan = scan.take(~((scan.point == lost) & (scan.range_m < 10.0)))
        frames.append(Frame(k, ideal, scan, 0.1 * k))
    return Simulator(frames, model(), 3)


def wider(columns: int) -> IdealScan:
    """The street, but the panel reaches so many columns farther to the left."""
    ideal = street(0, **WHERE)
    hidden = (ideal.material_id == WALL) & np.isin(ideal.layer, range(253, 272))
    hidden &= (ideal.point > LEFT_POINT) & (ideal.point <= LEFT_POINT + 6 * columns)
    return dataclasses.replace(
        ideal,
        distance_m=np.where(hidden, 8.0, ideal.distance_m),
        material_id=np.where(hidden, PANEL, ideal.material_id),
    )


def found(simulator: Simulator, *, deep: bool = False) -> list[set[tuple[int, int]]]:
    """Layer and point of each run's beams."""
    simulated = [simulator.observations(simulator.model, 1000 + k) for k in range(4)]
    runs = runs_past(simulator.beams, simulator.measured_observations, simulated, deep=deep)
    return [{(int(simulator.beams.layer[i]), int(simulator.beams.point[i])) for i in run} for run in runs]


def past_beams(true: IdealScan) -> set[tuple[int, int]]:
    changed = true.material_id != street(0, **WHERE).material_id
    return set(zip(true.layer[changed].tolist(), true.point[changed].tolist(), strict=True))


def test_a_column_that_sees_past_the_edge_is_one_run() -> None:
    true = met(LEFT_POINT)
    runs = found(lab_of(true))
    assert len(past_beams(true)) > 5
    assert len(runs) == 1
    assert runs[0] == past_beams(true)


def test_echoes_of_another_surface_that_are_taken_for_the_own_one_are_past_it() -> None:
    """What stands a little behind the panel is near enough to be an echo of the panel that is far off."""
    simulator = lab_of(street(0, **WHERE))
    feature = simulator.measured_observations.feature.copy()
    edge = past_beams(met(LEFT_POINT))
    at = [(a, p) in edge for a, p in zip(simulator.beams.layer.tolist(), simulator.beams.point.tolist(), strict=True)]
    column = np.array(at) & (simulator.beams.frame == 0)
    feature[column, 0] += 2.5
    simulator.measured_observations = dataclasses.replace(simulator.measured_observations, feature=feature)
    assert found(simulator) == [edge]
    feature[column, 0] -= 2.0
    assert found(simulator) == []


def test_what_comes_to_stand_before_more_than_the_outermost_beams_is_at_the_border_as_well() -> None:
    """Near by, a sensor that stands a centimetre higher sees a panel's edge two beams from where the scan has it."""
    columns = [{(a, p) for a, p in past_beams(wider(2)) if p == LEFT_POINT + 6 * k} for k in (1, 2)]
    assert min(map(len, columns)) > 5
    simulator = lab_of(wider(2))
    assert found(simulator) == [columns[0]]
    assert sorted(map(sorted, found(simulator, deep=True))) == sorted(map(sorted, columns))
    assert len(found(lab_of(wider(1)), deep=True)) == 1


@pytest.mark.parametrize(
    "simulator",
    [
        pytest.param(lambda: lab_of(street(0, **WHERE)), id="nothing is off"),
        pytest.param(lambda: lab_of(met(INNER_POINT)), id="not at the edge"),
        pytest.param(lambda: lab_of(met(LEFT_POINT, layers=range(253, 272, 8))), id="only some of the column"),
        pytest.param(lambda: lab_of(street(0, **WHERE), lost=LEFT_POINT), id="lost and not past it"),
        pytest.param(lambda: lab_of(met(*PANEL_POINTS)), id="the whole surface and not its border"),
    ],
)
def test_what_is_no_run(simulator) -> None:
    assert found(simulator()) == []


def test_a_run_counts_as_one_error(monkeypatch) -> None:
    """With the runs as noise a column past the edge costs about 1 / EDGE_ERROR^2, without it ten times more."""
    zero = np.zeros(1)
    plain = lab_of(street(0, **WHERE))
    past = lab_of(met(LEFT_POINT))
    usual = plain.distance(zero + np.zeros((1, len(plain.measured))))
    forgiven = past.distance(np.zeros((1, len(past.measured))))
    monkeypatch.setattr(simulating, "EDGE_ERROR", 0.0)
    strict = lab_of(met(LEFT_POINT))
    counted = strict.distance(np.zeros((1, len(strict.measured))))
    assert forgiven - usual < 40.0
    assert counted - usual > 10.0 * (forgiven - usual)


def test_observations_are_mixed_beam_by_beam() -> None:
    simulator = lab_of(street(0, **WHERE))
    one, other = (simulator.observations(simulator.model, seed) for seed in (1, 2))
    rows = np.flatnonzero(np.random.default_rng(1).random(len(simulator.beams)) < 0.3)
    mixed = with_beams_of(one, other, rows)
    for i in range(len(simulator.beams)):
        source = other if i in set(rows.tolist()) else one
        assert mixed.detected[i] == source.detected[i]
        assert mixed.strayed[i] == source.strayed[i]
        np.testing.assert_array_equal(mixed.feature[i], source.feature[i])
        for name in EXTRA:
            mine = getattr(mixed, name)[mixed.extra_beam == i]
            np.testing.assert_array_equal(mine, getattr(source, name)[source.extra_beam == i])
    assert (np.diff(mixed.extra_beam) >= 0).all()


def test_a_run_along_a_border_is_found_whatever_its_beams_see() -> None:
    ideal = street(0, **WHERE)
    simulator = lab_of(ideal)
    runs = [
        {(int(simulator.beams.layer[i]), int(simulator.beams.point[i])) for i in run}
        for run in runs_along(simulator.beams)
    ]
    column = past_beams(met(LEFT_POINT))
    # The corners are in the runs along the upper and the lower border.
    assert max(len(column & run) for run in runs) >= len(column) - 2
    assert not any((p, q) for run in runs for p, q in run if q == INNER_POINT and 255 < p < 270)


@pytest.mark.parametrize(("point", "as_far"), [(LEFT_POINT, False), (INNER_POINT, True)])
def test_along_edges_nothing_is_far_that_a_part_of_a_beam_decides(point: int, as_far: bool) -> None:
    """A column at the panel's border that reads a metre less: any angle may do that there, none inside the panel.

    Of the distance, 0.4 to 0.7 is left inside the panel and at most 0.2 at its border, in twelve seeds each.
    """
    simulator = lab_of(street(0, **WHERE))
    shown = np.zeros((1, len(simulator.measured)))
    off = simulator.measured_observations.feature.copy()
    column = (simulator.beams.point == point) & (simulator.beams.material_id == PANEL) & (simulator.beams.frame == 0)
    off[column, 0] -= 1.0
    simulator.measured_observations = dataclasses.replace(simulator.measured_observations, feature=off)
    simulator.measured = simulator.summaries.of(simulator.measured_observations)
    plain = simulator.distance(shown) - simulator.floor_distance
    along = simulator.distance(shown, metric=simulator.along_edges(simulator.model, 800)) - simulator.floor_distance
    assert plain > 50.0
    assert (along > 0.3 * plain) == as_far
