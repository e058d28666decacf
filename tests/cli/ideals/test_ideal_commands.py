"""`ideal from-snippet` and `ideal from-map` as a user runs them, and what they say to what is wrong."""

import json
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_ideal, save_scan
from lidarcheck.scan import Scan
from lidarcheck.sensor import shipped

XT32 = shipped("XT32")
LAYER, POINT = XT32.beams.every()
POSE = "time,name,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n0,one,0,0,0,0,0,0\n5,two,-1,0,0,0,0,0\n"
ROOM = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
10 -2 -2
10 2 -2
10 2 2
10 -2 2
4 0 1 2 3
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with a scan of a wall at x = 10 m, 4 m wide and high, a map of it and poses before it."""
    monkeypatch.chdir(tmp_path)
    u = XT32.beams.directions(LAYER, POINT)
    with np.errstate(divide="ignore"):
        distance = 10.0 / u[:, 0]
    xyz = u * distance[:, None]
    on = (distance > 0.0) & (np.abs(xyz[:, 1:]) < 2.0).all(axis=1)
    noise = 0.01 * np.random.default_rng(1).standard_normal(np.count_nonzero(on))
    scan = Scan.from_beams(
        LAYER[on], POINT[on], distance[on] + noise, features={"INTENSITY": np.full(len(noise), 30.0)}, beams=XT32.beams
    )
    save_scan(scan, "wall.parquet")
    Path("map.ply").write_text(ROOM, encoding="utf-8")
    Path("poses.csv").write_text(POSE, encoding="utf-8")
    return tmp_path


def test_a_wall_is_cut_out_and_cast(place, capsys):
    words = "ideal from-snippet wall.parquet --region 9,11,-1.5,1.5,-1.5,1.5 --sensor XT32 --out ideal.parquet"
    assert main([*words.split(), "--json", "facts.json"]) == 0
    out, err = capsys.readouterr()
    facts = json.loads(Path("facts.json").read_text())
    assert facts["pose_from"] == "fit"
    assert f"{facts['beams']} beams meet it" in out
    assert 'pose_from = "fit"' in err
    ideal = load_ideal("ideal.parquet", XT32)
    on = ideal.distance_m > 0.0
    assert np.abs(ideal.distance_m[on] * XT32.beams.directions(LAYER, POINT)[on, 0] - 10.0).max() < 0.01
    assert np.isnan(ideal.distance_m[~on]).all()
    assert facts["beams"] == np.count_nonzero(on) > 500


def test_a_map_gives_a_frame_for_each_pose(place, capsys):
    words = "ideal from-map map.ply --poses poses.csv --sensor XT32 --material 3 --out ideals"
    assert main(words.split()) == 0
    assert 'ideals_from = "map"' in capsys.readouterr().err
    for name, x in (("one", 10.0), ("two", 11.0)):
        ideal = load_ideal(f"ideals/{name}.parquet", XT32)
        on = ideal.distance_m > 0.0
        assert np.abs(ideal.distance_m[on] * XT32.beams.directions(LAYER, POINT)[on, 0] - x).max() < 1e-6
        assert (ideal.distance_m[~on] == 0.0).all()
        assert set(ideal.material_id[on]) == {3}


SNIPPET = "ideal from-snippet wall.parquet --sensor XT32 --out i.parquet "
MAP = "ideal from-map map.ply --poses poses.csv --sensor XT32 --out ideals "
WRONG = {
    SNIPPET: "error: neither --region nor --beams is given",
    SNIPPET + "--region 1,2,3": "error: --region 1,2,3 is not 6 numbers",
    SNIPPET + "--region 1,0,0,1,0,1": "error: --region 1,0,0,1,0,1 is empty",
    SNIPPET + "--beams 3,1,0,5": "error: --beams 3,1,0,5 names no beams",
    SNIPPET + "--beams 0,31,0,1999 --fit": "error: --fit needs --target-pose",
    SNIPPET + "--beams 0,31,0,1999 --mesh map.ply": "error: --mesh needs --target-pose",
    SNIPPET + "--beams 0,31,0,1999 --size 1,1": "error: --size is of a plane whose --target-pose is given",
    SNIPPET + "--region 20,21,0,1,0,1": "error: wall.parquet: 0 echoes lie in the region",
    "ideal from-snippet wall.parquet --region 9,11,0,1,0,1 --out i.las --sensor XT32": "error: i.las: LAS holds",
    "ideal from-snippet wall.parquet --region 9,11,0,1,0,1 --out i.txt": "needs --sensor or --model",
    "ideal from-snippet wall.parquet --region 9,11,0,1,0,1 --out wall.parquet --sensor XT32": "wall.parquet",
    "ideal from-map none.ply --poses poses.csv --sensor XT32 --out ideals": "error: none.ply: there is no such file",
    "ideal from-map poses.csv --poses poses.csv --sensor XT32 --out ideals": "no column X, Y, Z",
    "ideal from-map map.ply --poses poses.csv --sensor Livox --out ideals": "give the measured scans with --rays",
    MAP + "--swept": "error: poses.csv: the poses end before the sweep of the frame at 5 s does",
    MAP + "--cell 0.1": "error: map.ply: --cell is of a cloud",
    MAP + "--material -1": "error: --material -1 is out of range",
}


@pytest.mark.parametrize("words", WRONG)
def test_what_is_wrong_is_one_line_and_nothing_is_written(place, capsys, words):
    before = sorted(place.rglob("*"))
    assert main(words.split()) == 2
    err = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert len(err) == 1
    assert WRONG[words] in err[0]
    assert sorted(place.rglob("*")) == before
