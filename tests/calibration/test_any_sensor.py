"""Panels, ghosts, vehicles and free numbers of sensors that are no SPAD arrays, on the scenes that come along."""

import re
from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.calibration.echoes import amplitude, place_of
from lidarcheck.calibration.ghosts.data import check_fit, with_ghost
from lidarcheck.calibration.ghosts.workflow import find_ghosts
from lidarcheck.calibration.panels.settings import PanelSettings
from lidarcheck.calibration.panels.workflow import Arrangement, PanelFrame, characterise
from lidarcheck.calibration.parameters.parameters import calibrating, free_parameters, known_names
from lidarcheck.calibration.scenes.frame import simulated_frame
from lidarcheck.calibration.scenes.workflow import compare_scene
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.pages.ghosts import find_document, find_page
from lidarcheck.figures.pages.panels import page
from lidarcheck.model import Model, simulate
from lidarcheck.scan import Scan
from lidarcheck.scenes.files.file import builtin_path, load_scene
from lidarcheck.sensor import Material, shipped

RETRO = Material("sign", 0.8, "retro", 982.0)
MATERIALS = {number: Material(f"material {number}", 0.3) for number in range(1, 26)}
MATERIALS |= {1: Material("panel 10 %", 0.1), 2: Material("panel 50 %", 0.5), 3: Material("panel 80 %", 0.8), 17: RETRO}
NEAR = PanelSettings(range_m=(4.0, 12.0), trim_layers=1)


def cast(scene, name, ahead_deg):
    """What a sensor's beams up to so far from straight ahead meet of a scene."""
    sensor = shipped(name)
    ideal = load_scene(builtin_path(scene)).scene.ideal(sensor)
    _, azimuth = ideal.beams.angles_deg(ideal.layer, ideal.point)
    return sensor, ideal.take(np.abs((azimuth + 180.0) % 360.0 - 180.0) <= ahead_deg)


@pytest.fixture(scope="module", params=["XT32", "OS1-128"])
def hall(request):
    sensor, ideal = cast("lab_c", request.param, 75.0)
    model = Model(sensor, MATERIALS)
    scans = [simulate(ideal, model, seed=seed) for seed in range(3)]
    frames = [PanelFrame(str(i), lambda scan=scan: scan) for i, scan in enumerate(scans)]
    return sensor, ideal, characterise([Arrangement(ideal, frames[:2], frames[2:])], NEAR, sensor=sensor)


def test_panels_lie_on_the_beams_that_meet_them(hall):
    _, ideal, found = hall
    beam = ideal.beams.index(ideal.layer, ideal.point)
    assert len(found.panels) == 6
    for panel in found.panels:
        rows = np.isin(beam, ideal.beams.index(panel.layer, panel.point))
        assert set(ideal.material_id[rows & (ideal.distance_m < panel.range_m + 0.5)]) == {panel.material}
        assert len(np.unique(ideal.object_id[rows])) == 1
        assert panel.range_m == pytest.approx([5.0, 10.0][panel.range_m > 7.0], abs=0.1)


def test_panels_show_the_features_of_the_sensor(hall):
    sensor, _, found = hall
    strength = sensor.features[0].name
    for panel, noise in zip(found.panels, found.noise, strict=True):
        assert noise.measured.detection > 0.99
        assert noise.measured.means[strength] == pytest.approx(100.0 * MATERIALS[panel.material].reflectance, rel=0.03)
        assert noise.walk.feature == strength
        assert abs(noise.measured.bias_m) < 0.01
    words = [figure.quantity for figure in page(found).figures() if hasattr(figure, "quantity")]
    assert strength in words
    assert not {"AREA", "PEAK"} & set(words)


def test_beams_without_neighbours_are_refused_in_a_line():
    with pytest.raises(UsageError, match="no neighbours by their numbers"):
        place_of(shipped("Livox").beams, np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32))


@pytest.fixture(scope="module")
def sign():
    sensor, ideal = cast("sign_ghost_25m", "XT32", 40.0)
    model = Model(sensor, MATERIALS)
    return model, ideal, simulate(ideal, with_ghost(model, strength=5e-5), seed=1)


def test_a_sign_and_its_ghost_by_a_calibrated_reflectivity(sign):
    model, _, scan = sign
    found = find_ghosts(scan, sensor=model.sensor)
    assert len(found.signs) == 1
    one = found.signs[0]
    # 0.8 x 982 x 5e-5 of a white surface at twice the range: R^2 makes that 16 %.
    assert found.brightness.column == "INTENSITY"
    assert one.range_m == pytest.approx(25.0, abs=0.1)
    assert one.ratio.range_ratio == pytest.approx(2.0, abs=0.03)
    assert np.median(found.values(2, "INTENSITY")) == pytest.approx(100 * 0.8 * 982 * 5e-5 * 4, abs=2.0)
    assert not one.cut
    document = find_document([found])[0]["signs"][0]
    assert document["sign_INTENSITY_median"] == 255.0
    header = find_page([found]).sections[0].tables[1].header
    assert header[3] == "INTENSITY"
    assert "PEAK" not in header


def test_a_ghost_as_bright_as_can_be_told_is_a_ghost_and_no_second_sign(sign):
    model, ideal, _ = sign
    bright = simulate(ideal, with_ghost(model, strength=0.004), seed=1)
    found = find_ghosts(bright, sensor=model.sensor)
    assert len(found.signs) == 1
    assert found.signs[0].has_ghost


def test_a_fit_of_ghosts_needs_spads(sign):
    with pytest.raises(InputError, match="PandarXT-32 has the detector linear"):
        check_fit(sign[0])


def test_a_sign_behind_the_sensor_is_one_sign_at_its_own_azimuth():
    sensor = shipped("XT32")
    layer = np.repeat(np.arange(12, 16, dtype=np.int32), 9)
    # Azimuth 90 - 0.18 Point: 1500 looks straight back.
    point = np.tile(np.arange(1496, 1505, dtype=np.int32), 4)
    scan = Scan.from_beams(
        layer, point, np.full(36, 20.0), features={"INTENSITY": np.full(36, 255.0)}, beams=sensor.beams
    )
    one = find_ghosts(scan, sensor=sensor).signs[0]
    assert abs(one.azimuth_deg) == pytest.approx(180.0, abs=0.2)
    assert one.width_m == pytest.approx(9 * np.deg2rad(0.18) * 20.0, rel=0.02)


def test_what_tells_the_strength_of_an_echo():
    ones = np.ones(1)
    scan = Scan.from_beams(np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32), ones)
    assert amplitude(scan)[0] == ""
    both = replace(scan, extra={"intensity": 2.0 * ones, "SIGNAL": ones})
    assert amplitude(both)[0] == "INTENSITY"
    sensor = shipped("OS1-128")
    assert amplitude(replace(both, extra={**both.extra, "reflectivity": 3.0 * ones}), sensor) == ("REFLECTIVITY", 3.0)
    chip = replace(scan, features={"CONFIDENCE": ones})
    assert amplitude(chip, shipped("TMF8820"))[0] == "CONFIDENCE"


@pytest.mark.parametrize(
    ("name", "free", "unknown"),
    [("XT32", "sensor.range_floor_m", "on_bins"), ("TMF8820", "cover_glass", "on_bins"), ("SLIM", "on_bins", "noise")],
)
def test_the_numbers_of_any_detector_may_be_free(name, free, unknown):
    model = Model(shipped(name), MATERIALS)
    assert free_parameters(model, [free])[0].name == free.removeprefix("sensor.")
    assert all(free_parameters(model, [one]) for one in known_names(model))
    with pytest.raises(UsageError, match="there is no parameter"):
        free_parameters(model, [unknown])


def test_the_signal_that_calibrates_a_feature_does_not_show_in_it():
    model = Model(shipped("XT32"), MATERIALS)
    assert "effects.signal_gain.gain" in calibrating(model)["signal_at_1m"]
    assert free_parameters(model, ["signal_at_1m"])[0].low > 0.0
    assert not calibrating(Model(shipped("SLIM"), MATERIALS))


def test_a_scene_shows_the_features_of_the_sensor():
    sensor, ideal = cast("sign_ghost_25m", "XT32", 20.0)
    real, model = (Model(sensor, {**MATERIALS, 5: Material("asphalt", rho)}) for rho in (0.3, 0.4))
    found = compare_scene([simulated_frame(simulate(ideal, real, seed=3), ideal, model)])
    assert not found.left_out
    assert found.features["INTENSITY"].mean_measured < found.features["INTENSITY"].mean_simulated
    worst = found.disagreements[0]
    assert worst.feature == "INTENSITY"
    assert re.match(r"INTENSITY [\d.]+ lower on object", worst.words)
    own = worst.measured - worst.simulated
    assert 100 * (0.3 - 0.4) < own < -1.0
