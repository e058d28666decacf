"""Clouds that name no beams: a sensor's file and rings, times or directions tell them."""

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats import load_scan
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.table import Table
from lidarcheck.sensor import shipped


def cloud(name, columns):
    """Echoes of every seventh column of a sensor, at ranges from 5 to 50 m, as a driver writes them."""
    sensor = shipped(name)
    layer, point = sensor.beams.every()
    rows = point % 7 == 0
    layer, point = layer[rows], point[rows]
    range_m = np.linspace(5.0, 50.0, len(layer)).round(2)
    x, y, z = sensor.beams.positions_m(layer, point, range_m).T
    time_s = sensor.beams.fire_time_s(layer, point) - (sensor.sweep.duration_s if sensor.time_zero == "last" else 0.0)
    every = {"x": x, "y": y, "z": z, "ring": layer.astype(np.uint16), "time": time_s}
    every["intensity"] = np.arange(len(x)) % 200
    every["t"] = np.rint(1e9 * time_s).astype(np.int64)
    return sensor, layer, point, Table({key: every[key] for key in ("x", "y", "z", "intensity", *columns)})


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("XT32", ("ring", "time")),
        ("XT32", ("ring",)),
        ("XT32", ()),
        ("OS1-128", ("ring", "t")),
        ("OS1-128", ("ring",)),
        ("HDL-32E", ("ring", "time")),
        ("VLP-16", ("ring", "time")),
    ],
)
def test_beams_are_found_by_what_the_cloud_says(name, columns, tmp_path):
    sensor, layer, point, table = cloud(name, columns)
    write_table(table, tmp_path / "cloud.parquet")
    scan = load_scan(tmp_path / "cloud.parquet", sensor=sensor)
    assert np.array_equal(scan.layer, layer)
    assert np.array_equal(scan.point, point)
    assert set(scan.defaulted) >= {"Layer", "Point"}
    assert scan.geometry.verdict == "not checked"


def test_a_ring_that_is_none_of_the_sensor_s_is_one_line(tmp_path):
    sensor, _, _, table = cloud("XT32", ("ring",))
    write_table(table.with_column("ring", table.columns["ring"] + 40), tmp_path / "cloud.parquet")
    with pytest.raises(InputError) as caught:
        load_scan(tmp_path / "cloud.parquet", sensor=sensor)
    assert len(caught.value.lines()) == 1
    assert "ring" in str(caught.value)


def test_features_are_read_by_their_aliases(tmp_path):
    sensor, _, _, table = cloud("XT32", ("ring", "time"))
    write_table(table, tmp_path / "cloud.csv")
    scan = load_scan(tmp_path / "cloud.csv", sensor=sensor)
    assert scan.feature_names == ("INTENSITY",)
    assert np.array_equal(scan.feature("INTENSITY"), table.columns["intensity"])
