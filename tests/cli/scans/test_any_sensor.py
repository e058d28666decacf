"""Files of other sensors on the command line: read as `--sensor` has them, written in the hand of their files."""

from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_scan, save_scan
from lidarcheck.scan import Scan
from lidarcheck.sensor import shipped


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """A scan of the driving simulator's sensor, whose files are left-handed, and one of an XT32."""
    monkeypatch.chdir(tmp_path)
    for name in ("CARLA", "XT32"):
        sensor = shipped(name)
        layer, point = np.divmod(np.arange(0, 32 * 170, 5, dtype=np.int32), 170)
        scan = Scan.from_beams(
            layer, point, 5.0 + 0.01 * layer, features={"INTENSITY": 0.5 + 0.0 * layer}, beams=sensor.beams
        )
        save_scan(scan, f"{name}.parquet", sensor)
    return tmp_path


def test_info_says_how_a_file_is_read(scans, capsys):
    assert main(["info", "CARLA.parquet", "--sensor", "CARLA"]) == 0
    out = capsys.readouterr().out
    assert "carla ray_cast, 32 layers x 175 points, left-handed, Y is negated, INTENSITY is INTENSITY" in out
    assert "checked: 100.0 %" in out
    assert "missing columns  EchoNumber\n" in out
    assert main(["info", "XT32.parquet", "--sensor", "OS1-128"]) == 0
    out = capsys.readouterr().out
    assert "REFLECTIVITY is not there" in out
    assert "the beams are another sensor's" in out


def test_convert_places_and_writes_in_the_sensors_hand(scans):
    sensor = shipped("CARLA")
    before = load_scan("CARLA.parquet", sensor=sensor)
    assert main(["convert", "CARLA.parquet", "same.pcd", "--sensor", "CARLA"]) == 0
    assert np.allclose(load_scan("same.pcd", sensor=sensor).y_m, before.y_m, atol=1e-6)
    # A millimetre file that is turned by 180 degrees: placed in the sensor's own frame, written left-handed again.
    turned = Scan.from_beams(before.layer, before.point, 1000.0 * before.range_m, beams=before.beams)
    flipped = Scan(**{**vars(turned), "x_m": -turned.x_m, "y_m": -turned.y_m})
    save_scan(flipped, "turned.csv", sensor)
    declared = ["--unit", "mm", "--pose", "0,0,0,0,0,180"]
    assert main(["convert", "turned.csv", "back.parquet", "--sensor", "CARLA", *declared]) == 0
    back = load_scan("back.parquet", sensor=sensor)
    assert np.allclose(back.y_m, before.y_m, atol=1e-6)
    assert np.allclose(back.x_m, before.x_m, atol=1e-6)


def test_a_sensor_beside_a_model_is_refused_and_no_output_replaces_its_file(scans, capsys):
    Path("model.toml").write_text('variant = "XT32"\n[materials.1]\nname = "panel"\nreflectance = 0.5\n')
    assert main(["compare", "XT32.parquet", "XT32.parquet", "--model", "model.toml", "--sensor", "XT32"]) == 2
    assert "--sensor stands beside --model" in capsys.readouterr().err
    text = (Path(__file__).parents[3] / "src/lidarcheck/sensors/XT32.toml").read_text()
    Path("xt.toml").write_text(text)
    asked = ["ghosts", "find", "XT32.parquet", "--sensor", "xt.toml", "--json", "xt.toml"]
    assert main(asked) == 2
    assert Path("xt.toml").read_text() == text


def test_a_blooming_profile_of_a_linear_detector_is_refused_in_a_line(scans, capsys):
    Path("model.toml").write_text(
        'variant = "XT32"\n[materials.1]\nname = "sign"\nreflectance = 0.8\nkind = "retro"\nretro_gain = 900\n'
    )
    Path("lut.ini").write_text("PostPro.LUT_blooming_X = 0, 3, 6\nPostPro.LUT_blooming_Y = 0.1, 0.01, 0.001\n")
    asked = ["bloom", "fit", "XT32.parquet", "--model", "model.toml", "--lut", "lut.ini", "--out", "out"]
    assert main(asked) == 2
    err = capsys.readouterr().err
    assert err.startswith("error: model.toml")
    assert "blooming is fitted to the PEAK, AREA and WIDTH of a spad_array" in err
    assert len(err.splitlines()) == 1
