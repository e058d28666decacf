"""From a sensor file to a sensor: defaults, overrides, what is missing, what makes two sensors the same."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.sensor import Linear, PhotonHistogram, Sensor, SpadArray, sensor_of, shipped
from lidarcheck.sensor.document import own

BEAMS = {"kind": "channels", "elevation_deg": [1.0, -1.0], "columns": 90}
LEAST = {"name": "least", "detector": "linear", "frame_rate_hz": 20, "beams": BEAMS, "linear": {"signal_at_1m": 1e5}}


def test_what_a_file_leaves_out_has_the_default_of_the_table():
    sensor = sensor_of(LEAST)
    assert isinstance(sensor, Linear)
    assert (sensor.max_echoes, sensor.keep, sensor.strength) == (1, "strongest", "")
    assert (sensor.return_order, sensor.duplicate_return) == ("range", "drop")
    assert (sensor.handedness, sensor.time_unit, sensor.time_zero, sensor.deskewed) == ("right", "auto", "auto", False)
    assert (sensor.min_range_m, sensor.max_range_m) == (0.0, 300.0)
    assert (sensor.range_resolution_m, sensor.range_offset_m) == (0.01, 0.0)
    assert sensor.min_separation_m is None
    assert sensor.separation_m == pytest.approx(0.299792458 * 5.0 / 2.0)
    sweep, beams = sensor.sweep, sensor.beams
    assert (sweep.order, sweep.duration_s, sweep.direction) == ("columns", 0.05, "left")
    assert (sweep.common_receiver, sweep.fire_time_in_azimuth) == (False, True)
    assert (beams.first_deg, beams.span_deg, beams.step_deg) == (0.0, 360.0, 4.0)
    assert beams.repeats
    channels = beams.channels
    zeros = ("azimuth_offset_deg", "origin_m", "side_m", "height_m", "range_offset_m", "fire_time_us", "column_shift")
    assert all(getattr(channels, name) == (0, 0) for name in zeros)
    assert channels.ring == (0, 1)
    assert (sensor.footprint_deg, sensor.footprint, sensor.sub_rays) == ((0.0, 0.0), "gaussian", (1, 1))
    assert (sensor.source, sensor.features, sensor.missing) == ((), (), ())


def test_the_detectors_have_their_defaults():
    linear = sensor_of(LEAST)
    numbers = {"near_m": 0, "threshold": 5.5, "noise": 1, "excess": 0, "relative": 0, "pulse_fwhm_ns": 5,
               "range_floor_m": 0.01, "edge_factor": 1, "range_law": "physical", "range_power": 1, "range_slope": 0,
               "walk_m_per_decade": 0, "recovery_ns": 0}  # fmt: skip
    assert {name: getattr(linear, name) for name in numbers} == numbers
    assert (linear.false_rate_hz, linear.walk_reference, linear.saturation) == (None, None, None)
    chip = {"signal_at_1m": 1e-4, "spads": 9, "shots": 100, "bins": 64, "bin_ns": 0.5}
    histogram = sensor_of({**LEAST, "detector": "photon_histogram", "photon_histogram": chip, "linear": None})
    assert isinstance(histogram, PhotonHistogram)
    numbers = {"first_bin_ns": 0, "readout": "all", "dead_bins": 1, "background_per_ns": 0, "cover_glass": 0,
               "pulse_fwhm_ns": 1, "pulse_file": "", "threshold_sigma": 5, "coates": False}  # fmt: skip
    assert {name: getattr(histogram, name) for name in numbers} == numbers


def test_defaults_that_follow_from_other_keys():
    flash = sensor_of({**LEAST, "sweep": {"order": "flash"}})
    assert flash.sweep.common_receiver
    assert not sensor_of({**LEAST, "sweep": {"order": "flash", "common_receiver": False}}).sweep.common_receiver
    right = sensor_of({**LEAST, "sweep": {"direction": "right"}})
    assert (right.beams.span_deg, right.beams.step_deg) == (-360.0, -4.0)
    begun = sensor_of({**LEAST, "beams": {**BEAMS, "azimuth_deg": {"first": 30}}})
    assert (begun.beams.first_deg, begun.beams.span_deg) == (30.0, 360.0)
    wide = sensor_of({**LEAST, "beams": {**BEAMS, "footprint_deg": {"horizontal": 0.2}}})
    assert (wide.footprint_deg, wide.sub_rays) == ((0.2, 0.0), (3, 3))
    features = {"A": {"law": "log", "bits": 8}, "B": {"law": "log"}, "C": {"law": "log", "step": 0.5, "max": 10}}
    a, b, c = sensor_of({**LEAST, "features": features}).features
    assert [feature.step for feature in (a, b, c)] == [1.0, 0.0, 0.5]
    assert [feature.most for feature in (a, b, c)] == [255.0, None, 10.0]
    assert sensor_of({**LEAST, "source": "one"}).source == ("one",)
    assert sensor_of({**LEAST, "source": ("one", "two")}).source == ("one", "two")


def test_a_scalar_stands_for_every_channel():
    lists = {"azimuth_offset_deg": 0.5, "height_m": 0.1, "fire_time_us": 7, "column_shift": 2}
    channels = sensor_of({**LEAST, "beams": {**BEAMS, **lists}}).beams.channels
    assert all(getattr(channels, name) == (value, value) for name, value in lists.items())


def test_missing_numbers_are_named_and_the_geometry_is_there():
    sensor = sensor_of({key: value for key, value in LEAST.items() if key != "linear"})
    assert sensor.missing == ("signal_at_1m",)
    assert len(sensor.beams.every()[0]) == 180
    law = {"signal_at_1m": 1e5, "range_law": "power"}
    assert sensor_of({**LEAST, "linear": law}).missing == ("range_at_threshold_m",)
    assert sensor_of({**LEAST, "linear": {**law, "range_at_threshold_m": 0.1}}).missing == ()
    chip = sensor_of({**LEAST, "detector": "photon_histogram", "photon_histogram": {"bins": 64}, "linear": None})
    assert set(chip.missing) == {"signal_at_1m", "spads", "shots", "bin_ns"}


def test_numbers_are_overridden_flat_and_by_table():
    flat = Sensor.of("XT32", threshold=7.0, returns=1, keep="first", frame_rate_hz=20)
    assert (flat.threshold, flat.max_echoes, flat.keep, flat.frame_rate_hz) == (7.0, 1, "first", 20.0)
    assert Sensor.of("XT32", range={"max_m": 50, "step_m": 0.001}).max_range_m == 50.0
    assert Sensor.of("XT32", max_range_m=50.0).max_range_m == 50.0
    assert Sensor.of("SLIM", range_resolution_m=0.5).range_resolution_m == 0.5
    assert Sensor.of("SLIM", max_echoes=1).max_echoes == Sensor.of("SLIM", returns=1).max_echoes == 1
    beams = Sensor.of("XT32", beams={"azimuth_deg": {"first": 0, "last": -360}}).beams
    assert (beams.first_deg, beams.layers) == (0.0, 32)
    knee = Sensor.of("XT32", features={"INTENSITY": {"knee": 110}}).feature("INTENSITY")
    assert (knee.numbers["knee"], knee.bits) == (110, 8)
    assert Sensor.of("XT32", sweep={"fire_time_in_azimuth": True}).sweep.direction == "right"


@pytest.mark.parametrize(
    "overrides",
    [
        {"max_range_m": 50.0, "range": {"max_m": 60}},
        {"range_resolution_m": 0.1, "range": {"step_m": 0.2}},
        {"max_echoes": 2, "returns": 1},
    ],
)
def test_two_names_of_one_number_are_refused(overrides):
    with pytest.raises(UsageError, match="are one number; give one of them"):
        Sensor.of("XT32", **overrides)


def test_what_is_overridden_is_known_and_its_variant_too():
    changed = Sensor.of("XT32", threshold=7.0, beams={"footprint_deg": {"horizontal": 0.1, "vertical": 0.1}})
    assert changed.overrides()["threshold"] == 7.0
    assert changed.overrides()["beams"] == {"footprint_deg": {"horizontal": 0.1, "vertical": 0.1}}
    assert own(changed) == shipped("XT32")
    with pytest.raises(UsageError, match="a sensor has no number 'treshold'; did you mean threshold"):
        Sensor.of("XT32", treshold=3)


@pytest.mark.parametrize("name", ["xt-32", "Xt32", "VLP16", "livox"])
def test_a_name_spelled_otherwise_is_guessed(name):
    near = {"xt-32": "XT32", "Xt32": "XT32", "VLP16": "VLP-16", "livox": "Livox"}[name]
    with pytest.raises(UsageError, match=f"there is no sensor variant '{name}'; did you mean {near}"):
        Sensor.of(name)


def test_a_detector_is_asked_for_by_its_class():
    assert isinstance(Linear.of("XT32"), Linear)
    with pytest.raises(UsageError, match="PandarXT-32 has the detector linear, not spad_array"):
        SpadArray.of("XT32")
    with pytest.raises(UsageError, match=r"OS-1-128 .* reports no PEAK; it reports REFLECTIVITY, AMBIENT"):
        shipped("OS1-128").feature("PEAK")


def test_the_window_of_detection_follows_the_pulse_and_the_floor():
    half_pulse = 0.299792458 * 5.0 / 2.0
    assert shipped("XT32").window_m == pytest.approx(half_pulse)
    assert Sensor.of("XT32", range_floor_m=0.4).window_m == pytest.approx(2.0)
    assert shipped("SMART").window_m == pytest.approx(0.749481, abs=1e-6)
    assert shipped("TMF8820").window_m == pytest.approx(half_pulse * 0.6 / 5.0)


def test_sensors_are_equal_and_hash_alike_when_all_their_numbers_are():
    one, other = sensor_of(LEAST), sensor_of({**LEAST, "linear": {"signal_at_1m": 1e5}})
    assert one == other
    assert hash(one) == hash(other)
    assert len({one, other, sensor_of({**LEAST, "linear": {"signal_at_1m": 2e5}})}) == 2
    assert sensor_of({**LEAST, "beams": {**BEAMS, "height_m": 0.1}}) != one
    assert sensor_of({**LEAST, "features": {"A": {"law": "log"}}}) != one
    assert Sensor.of("SMART") != Sensor.of("SLIM")
    assert hash(Sensor.of("SLIM", threshold=10)) != hash(Sensor.of("SLIM"))
    again = pickle.loads(pickle.dumps(one))
    assert again == one
    assert hash(again) == hash(one)
    assert replace(one, threshold=6.0).beams is one.beams


def test_a_table_of_a_features_law_is_read_with_its_file():
    table = {"amplitude": np.array([1.0, 10.0]), "value": np.array([0.0, 3.0])}
    features = {"A": {"law": "table", "file": "a.csv"}}
    sensor = sensor_of({**LEAST, "features": features}, columns=lambda name: table)
    assert sensor.feature("A").table == ((1.0, 10.0), (0.0, 3.0))
    for wrong in ({"a": table["amplitude"]}, {"a": np.array([2.0, 1.0]), "b": table["value"]}):
        with pytest.raises(UsageError, match=r"features\.A: its table"):
            sensor_of({**LEAST, "features": features}, columns=lambda name, wrong=wrong: wrong)
    with pytest.raises(UsageError, match=r"the table a\.csv cannot be read here"):
        sensor_of({**LEAST, "features": features})


def test_a_pulse_is_read_and_normalised():
    numbers = {"signal_at_1m": 1e-4, "spads": 9, "shots": 100, "bins": 64, "bin_ns": 0.5, "pulse_file": "p.csv"}
    document = {**LEAST, "detector": "photon_histogram", "photon_histogram": numbers, "linear": None}
    sensor = sensor_of(document, columns=lambda name: {"counts": np.array([1.0, 2.0, 1.0])})
    assert sensor.pulse == (0.25, 0.5, 0.25)
    assert math.isclose(sum(sensor.pulse), 1.0)
    with pytest.raises(UsageError, match=r"pulse_file = p\.csv: no pulse"):
        sensor_of(document, columns=lambda name: {"counts": np.zeros(3)})
