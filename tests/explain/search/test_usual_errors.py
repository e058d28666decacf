"""Usual errors of pose, height and table on other sensors' grids: they are found, and explain all that they do."""

import numpy as np

from hidden.foreign.cases import write_case
from hidden.foreign.orders import CaseOrder, plan
from lidarcheck.cases.case import load_case
from lidarcheck.explain.search.merit import CHANCE
from lidarcheck.explain.search.selection import start_fit
from lidarcheck.inference.nuisances import HEIGHT_ERROR_M, Nuisance
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model.stages import Surfaces

ROAD = 1


def test_a_road_moves_in_one_piece_also_at_the_ends_of_a_sector_of_staggered_channels(tmp_path):
    write_case(CaseOrder(0, "null", 7, (), "medium", "SLIM-channels", "street"), tmp_path / "case", frames=3)
    case = load_case(tmp_path / "case")
    ideal = case.frames[0].ideal
    road = (ideal.material_id == ROAD) & (ideal.distance_m > 0.0)
    down = -ideal.beams.directions(ideal.layer, ideal.point)[road, 2]
    _, [higher] = Nuisance(height=0.3).posed(case.model, [Surfaces(ideal)])
    longer_m = (higher.ideal.distance_m - ideal.distance_m)[road]
    near = ideal.distance_m[road] < 30.0
    assert road.sum() > 500
    np.testing.assert_allclose(longer_m[near], 0.3 * HEIGHT_ERROR_M / down[near], atol=3e-3)
    _, [turned] = Nuisance(pitch=-1.3, height=0.3).posed(case.model, [Surfaces(ideal)])
    assert np.all(turned.ideal.distance_m[road] > 0.0), "no ray passes between a road that moved and one that did not"


def test_an_error_that_stands_out_by_a_hundred_standard_deviations_is_explained_to_chance(tmp_path):
    order = plan(60, 13)[46]
    assert (order.variant, order.kind) == ("XT32", "null_nuisance")
    write_case(order, tmp_path / "case", frames=4)
    case = load_case(tmp_path / "case")
    simulator = Simulator(case.frames[:3], case.model, 1)
    plain = simulator.distance(np.zeros((1, len(simulator.measured))))
    assert plain > 5.0 * simulator.floor_distance
    found = start_fit(simulator, nuisances=True)
    assert found.distance < simulator.floor_distance + CHANCE
    assert found.nuisance.usual
