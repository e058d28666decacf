"""What lies outside the sensor's gate is no echo, and what is left is numbered from 1, whatever moved it."""

import dataclasses

import numpy as np
import pytest

from lidarcheck.cases.same_scene import Surfaces, compare_scenes
from lidarcheck.cli import main
from lidarcheck.effects import make
from lidarcheck.errors import UsageError
from lidarcheck.formats import load_scan, save_ideal, save_scan
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.model import save_model, simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, shipped

WHITE = {1: Material("white", 0.8)}


def two_surfaces(sensor, near_m, far_m):
    """Beams whose light is shared by a near and a far surface."""
    layer, point = (np.repeat(column[:200], 2) for column in sensor.beams.every())
    distance = np.tile([near_m, far_m], 200)
    return IdealScan(layer, point, distance, np.ones(400, dtype=np.int32), np.zeros(400), beams=sensor.beams)


@pytest.mark.parametrize("name", ["SLIM", "XT32"])
@pytest.mark.parametrize("effects", [(), (make("range_offset", {"offset_m": 0.02}),)], ids=["detector", "readout"])
def test_echoes_before_the_gate_are_gone_and_the_others_count_from_1(name, effects):
    sensor = dataclasses.replace(shipped(name), min_range_m=15.0)
    scan = simulate(two_surfaces(sensor, 10.0, 30.0), Model(sensor, WHITE, effects), seed=1)
    assert len(scan) == 200
    assert np.all(scan.range_m > 29.0)
    assert np.all(scan.echo_number == 1)


def test_an_echo_that_is_moved_behind_the_sensor_or_past_the_gate_is_none():
    sensor = shipped("XT32")
    for near_m, far_m, offset_m, kept_m in ((5.0, 30.0, -9.0, 21.0), (10.0, 40.0, 9.0, 19.0)):
        gate = dataclasses.replace(sensor, max_range_m=45.0)
        model = Model(gate, WHITE, (make("range_offset", {"offset_m": offset_m}),))
        scan = simulate(two_surfaces(gate, near_m, far_m), model, seed=1)
        assert len(scan) == 200
        assert np.all(np.abs(scan.range_m - kept_m) < 1.0)
        assert np.all(scan.echo_number == 1)


@pytest.mark.parametrize("name", ["SLIM", "XT32"])
def test_an_echo_that_a_walk_moves_to_no_range_is_none_and_the_file_can_be_written(name, tmp_path):
    """X, Y, Z of 0 say in a file that a beam had no echo."""
    sensor = shipped(name)
    walk = make("walk_error", {"per_decade_m": 0.0, "shifts_m": (-9.0,)})
    model = Model(sensor, WHITE, (walk,))
    scan = simulate(two_surfaces(sensor, 5.0, 30.0), model, seed=1)
    assert len(scan) == 200
    assert np.all(np.abs(scan.range_m - 21.0) < 1.0)
    assert np.all(scan.echo_number == 1)
    save_scan(scan, tmp_path / "scan.csv", sensor)


def test_avalanches_that_lie_before_the_shot_are_no_rows_of_a_file(tmp_path):
    """A SPAD array hears them at 0, of its dark counts alone."""
    sensor = shipped("SLIM")
    layer, point = (column[:20_000] for column in sensor.beams.every())
    nothing = np.zeros(len(layer))
    ideal = IdealScan(layer, point, nothing, np.ones(len(layer), dtype=np.int32), nothing, beams=sensor.beams)
    model = Model(sensor, WHITE, (make("dark_counts", {"rate_per_ns": 0.0005}),))
    scan = simulate(ideal, model, seed=1)
    assert np.any(scan.range_m == 0.0), "there are such"
    save_ideal(ideal, tmp_path / "ideal.parquet")
    save_model(model, tmp_path / "model.toml")
    files = [str(tmp_path / name) for name in ("ideal.parquet", "model.toml", "scan.parquet")]
    assert main(["simulate", files[0], "--model", files[1], "--out", files[2], "--seed", "1", "-q"]) == 0
    assert len(load_scan(files[2])) == np.sum(scan.range_m > 0.0)


def test_what_is_read_as_two_sensors_is_not_compared():
    one, other = shipped("XT32"), shipped("HDL-32E")
    ideal = two_surfaces(one, 10.0, 30.0)
    strange = dataclasses.replace(simulate(ideal, Model(one, WHITE), seed=1), beams=other.beams)
    with pytest.raises(UsageError, match="another"):
        pair_with_ideal(ideal, strange)
    found = compare_scenes(strange, Surfaces.of(ideal))
    assert found is not None
    assert found.refused


def test_frames_whose_columns_do_not_repeat_are_one_sensor_s():
    beams = shipped("HDL-32E").beams
    assert beams.with_phase(0.05).alike(beams)
    assert not beams.alike(shipped("XT32").beams)


def test_what_is_timed_before_the_shot_is_reported_at_the_sensor_and_not_behind_it():
    sensor = dataclasses.replace(shipped("SMART"), threshold=4, background_per_ns=6e-3, max_range_m=3.0)
    layer, point = (column[:2000] for column in sensor.beams.every())
    nothing = np.zeros(2000)
    ideal = IdealScan(layer, point, nothing, nothing.astype(np.int32), nothing, beams=sensor.beams)
    scan = simulate(ideal, Model(sensor, WHITE), seed=1)
    assert np.count_nonzero(scan.range_m == 0.0) > 20
    assert np.all(scan.x_m >= 0.0)
