"""What the simulations of a search show is what `simulate` shows, whatever was kept of other models."""

import numpy as np
import pytest

from hidden.foreign.cases import write_case
from hidden.foreign.orders import CaseOrder
from lidarcheck.cases.case import load_case
from lidarcheck.effects import make
from lidarcheck.inference.observed.beam_table import beams_of
from lidarcheck.inference.simulations import Simulations
from lidarcheck.model import simulate

SEED = 3


@pytest.fixture(scope="module")
def chip(tmp_path_factory):
    """A histogram chip before a board; its case, and simulations that keep what its own model shows."""
    place = tmp_path_factory.mktemp("chip") / "case"
    write_case(CaseOrder(0, "null", 7, (), "medium", "TMF8820-short", "bench"), place, frames=3)
    case = load_case(place)
    simulations = Simulations(case.frames, SEED)
    simulations.keep_own(case.model, 1)
    return case, simulations


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("range_offset", {"offset_m": -0.0125}),
        ("range_scale", {"fraction": -0.015}),
        ("timing_jitter", {"sigma_ns": 0.2}),
        ("walk_error", {"per_decade_m": 0.02}),
        ("signal_gain", {"gain": 0.8}),
    ],
)
def test_an_effect_of_the_readout_that_acts_on_a_histogram_s_light_is_simulated(chip, name, settings):
    case, simulations = chip
    model = case.model.with_(make(name, settings))
    for frame, found, plain in zip(
        case.frames, simulations.scans(model, 0), simulations.scans(case.model, 0), strict=True
    ):
        wanted = simulate(frame.ideal, model, seed=SEED << 16, frame=frame.number)
        np.testing.assert_array_equal(found.range_m, wanted.range_m)
        np.testing.assert_array_equal(found.histograms.counts, wanted.histograms.counts)
        assert not np.array_equal(found.range_m, plain.range_m) or not np.array_equal(
            found.histograms.counts, plain.histograms.counts
        )


def test_a_zone_of_many_rays_meets_surfaces_that_a_pulse_tells_apart(chip):
    """An echo that is off by a centimetre would else lie on the surface of another of its rays."""
    case, _ = chip
    ideal = case.frames[0].ideal
    beams = beams_of([ideal], case.model)
    assert len(ideal) > 60 * len(beams), "many rays a zone"
    for zone in range(len(beams)):
        surfaces = beams.hit_m[beams.hit_beam == zone]
        own = (ideal.layer == beams.layer[zone]) & (ideal.point == beams.point[zone]) & (ideal.distance_m > 0.0)
        assert 1 <= len(surfaces) <= 3
        assert np.all(np.diff(surfaces) > beams.view.reach_m)
        assert ideal.distance_m[own].min() < surfaces[0] < ideal.distance_m[own].max()
