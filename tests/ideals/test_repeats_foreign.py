"""Repeats that another program has made, from the contracts alone: the estimate holds there as well."""

import numpy as np
import pytest

from hidden.foreign.cases import setting
from hidden.foreign.chain import headings, nominal
from hidden.foreign.orders import CaseOrder
from hidden.foreign.readout import scan_text
from lidarcheck.formats import load_scan
from lidarcheck.ideals.repeats.workflow import repeats_of
from lidarcheck.sensor import shipped
from lidarcheck.sensor.document import stated_numbers
from repeats_kit import certain, names


@pytest.mark.parametrize("variant", ["VLP-16", "XT32"])
def test_the_estimate_holds_on_frames_of_another_simulator(variant, tmp_path):
    s = setting(CaseOrder(0, "null", 11, (), "medium", variant, "street"))
    beams, sensor = s.beams(0), shipped(variant)
    scans = []
    for k in range(5):
        file = tmp_path / f"frame_{k}.txt"
        file.write_text(scan_text(s.echoes(0, (), repeat=k), beams, s.device, headings(beams)))
        scans.append(load_scan(file, sensor=sensor))
    [hits] = nominal(s.scene(0), s.device, beams)
    table = np.full((sensor.beams.layers, sensor.beams.points), np.nan)
    table[beams.layer, beams.point] = hits.range_m
    found = repeats_of(names(5), scans, sensor, stated_numbers(sensor))
    for one in found.ideals:
        rows = certain(one.ideal)
        z = one.ideal.distance_m[rows] - table[one.ideal.layer[rows], one.ideal.point[rows]]
        z = z / one.ideal.extra["DistanceError"][rows]
        assert rows.sum() > 400
        assert abs(z.mean()) < 0.1
        assert z.std() == pytest.approx(1.0, abs=0.08)
        assert np.abs(z).max() < 7.0
