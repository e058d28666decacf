"""Beside a bright target: what a sensor without SPADs shows, from scans and from tables."""

import json
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.model import load_model, simulate
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import shipped

MODEL = """variant = "XT32"
[materials.1]
name = "wall"
reflectance = 0.5
[materials.2]
name = "sign"
reflectance = 0.8
kind = "retro"
retro_gain = 900.0
"""
BLOOM = """
[[effects]]
name = "blooming_horizontal"
core_left = 0.0005
core_right = 0.00005
"""
AT_M, MIDDLE = 25.0, 500


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """A sign of 5 x 3 beams straight ahead, a wall far behind it, and what a model with bloom shows of both."""
    monkeypatch.chdir(tmp_path)
    beams = shipped("XT32").beams
    layer, point = (np.ravel(a).astype(np.int32) for a in np.mgrid[8:24, MIDDLE - 60 : MIDDLE + 61])
    sign = (np.abs(point - MIDDLE) <= 2) & (np.abs(layer - 15) <= 1)
    ideal = IdealScan(layer, point, np.where(sign, AT_M, 60.0), np.where(sign, 2, 1), np.zeros(len(layer)), beams=beams)
    Path("model.toml").write_text(MODEL)
    Path("bloom.toml").write_text(MODEL + BLOOM)
    model = load_model("bloom.toml")
    save_ideal(ideal, "ideal.parquet")
    save_scan(simulate(ideal, model, seed=1), "real.parquet", model.sensor)
    return tmp_path


def shown(*asked):
    assert main(["bloom", "show", *asked, "--model", "model.toml", "--axis", "horizontal", "--json", "out.json"]) == 0
    return json.loads(Path("out.json").read_text())["result"]["profiles"][0]


@pytest.mark.parametrize("told", [["--ideal", "ideal.parquet"], []])
def test_light_beside_the_target_over_the_offset_in_points(bench, told):
    found = shown("real.parquet", "--simulated", "real.parquet", *told)
    one = found["measured"]
    offset, value = np.array(one["offset_points"]), np.array(one["INTENSITY"])
    assert one["distance_m"] == pytest.approx(AT_M, abs=0.05)
    assert value[offset == 0.0] == 255.0
    # More light to the left, which an XT32 counts with falling numbers: positive offsets.
    left, right = (value[(offset * way > 0) & (np.abs(offset) <= 4)] for way in (1, -1))
    assert left.mean() > 3.0 * right.mean() > 0.0
    assert found["simulated"]["INTENSITY"] == one["INTENSITY"]


def test_a_profile_as_a_table(bench):
    Path("profile.csv").write_text("offset_points,range_m,intensity\n-1,25.1,20\n0,25.0,255\n2,25.3,\n1,25.2,40\n")
    one = shown("profile.csv")["measured"]
    assert one["offset_points"] == [-1.0, 0.0, 1.0, 2.0]
    assert one["INTENSITY"][:3] == [20.0, 255.0, 40.0]
    assert one["INTENSITY"][3] is None
    assert one["echoes"] == [1, 1, 1, 0]
    assert one["distance_m"] == pytest.approx(25.15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("offset_columns,PEAK\n0,236\n", "counts SPAD rows or columns"),
        ("offset_points,PEAK\n0,236\n", "has none of INTENSITY"),
        ("offset_points,INTENSITY\n0,much\n", ":2: 'much' is not a number"),
        ("offset_points,INTENSITY\n0,255\n", "has no ranges"),
    ],
)
def test_tables_that_say_too_little(bench, capsys, text, said):
    Path("profile.csv").write_text(text)
    asked = ["bloom", "show", "profile.csv", "--model", "model.toml", "--axis", "horizontal"]
    assert main(asked) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


def test_what_is_of_spad_arrays_is_refused(bench, capsys):
    assert main(["bloom", "show", "real.parquet", "--model", "model.toml", "--signal", "6000"]) == 2
    assert "--signal is of SPAD arrays" in capsys.readouterr().err
    Path("spads.toml").write_text(MODEL.replace("XT32", "SLIM"))
    Path("profile.csv").write_text("offset_layers,PEAK\n0,236\n")
    assert main(["bloom", "show", "profile.csv", "--model", "spads.toml"]) == 2
    assert "counts beams, and SLIM is a SPAD array" in capsys.readouterr().err
