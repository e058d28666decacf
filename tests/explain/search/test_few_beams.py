"""A chip of nine zones shows some hundred ranges, which tell a search where to begin."""

from dataclasses import replace

import pytest

from hidden.foreign.cases import write_case
from hidden.foreign.orders import CaseOrder
from lidarcheck.cases.case import load_case
from lidarcheck.effects import make
from lidarcheck.explain.search.starts import located_probes
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model import simulate


def test_a_scale_of_a_chip_s_ranges_is_read_off_the_data(tmp_path):
    write_case(CaseOrder(0, "null", 7, (), "medium", "TMF8820-short", "bench"), tmp_path / "case", frames=24)
    case = load_case(tmp_path / "case")
    truth = case.model.with_(make("range_scale", {"fraction": -0.015}))
    frames = [replace(f, measured=simulate(f.ideal, truth, seed=9, frame=f.number)) for f in case.frames]
    simulator = Simulator(frames, case.model, 1)
    [start, *_] = located_probes(simulator, ["range_scale"])
    assert start.effect().settings()["fraction"] == pytest.approx(-0.015, abs=0.004)
    before, after = (simulator.distance(simulator.shows(m, 2)) for m in (case.model, case.model.with_(start.effect())))
    assert after < 0.2 * before
