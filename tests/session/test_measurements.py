"""What of a project gives a number, and why the rest gives none."""

from pathlib import Path

import numpy as np
import pytest

from bag_kit import CLOUD, START_NS, Message, ros1_cloud, write_ros1
from lidarcheck.calibration.number.request import Request
from lidarcheck.cli import main
from lidarcheck.session.measurements import measurements
from lidarcheck.session.project import read_project
from number_kit import MODEL, project, table

SCAN = "X Y Z Layer Point EchoNumber WIDTH AREA PEAK\n50 0 0 260 480 1 9 100 50\n"
IDEAL = "Layer Point Distance MaterialID IncidenceAngle\n260 480 50 1 0\n"
PROFILE = "offset_spad_rows,range_m,PEAK,AREA,WIDTH_ns\n0,60,236,2124,9\n"


@pytest.fixture
def folder(tmp_path):
    for name, text in {
        "sign/real_69m.txt": SCAN, "sign/ideal_69m.txt": IDEAL, "sign/real_157m.txt": SCAN,
        "hall/frame_00.txt": SCAN, "hall/frame_01.txt": SCAN, "hall/ideal.txt": IDEAL,
        "car/car_10m.txt": SCAN, "car/ideal_car_10m.txt": IDEAL, "car/simulated_car_10m.txt": SCAN,
        "ghosts/1_25m.txt": SCAN, "ghosts/1_ideal.txt": IDEAL, "profile/vertical_60m.csv": PROFILE,
        "case/case.toml": 'model = "m.toml"\n[[frames]]\nideal = "ideal_1.txt"\nmeasured = "real_1.txt"\ntime = 0\n',
        "case/real_1.txt": SCAN, "case/ideal_1.txt": IDEAL,
        "set/dataset.toml": '[[frames]]\nmeasured = "a.txt"\nideal = "b.txt"\ndistance_m = 30\nclass = "van"\n'
        '[[frames]]\nmeasured = "c.txt"\n',
        "set/a.txt": SCAN, "set/b.txt": IDEAL, "set/c.txt": SCAN,
        "broken/dataset.toml": '[[frames]]\nmeasured = "gone.txt"\n', "broken/note.csv": PROFILE,
    }.items():  # fmt: skip
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_each_measurement_stands_with_its_ideal_scan_or_why_it_has_no_number(folder):
    found = {one.name: one for one in measurements(read_project(folder))}
    seen = {
        name: (one.kind, one.distance_m, [i.name for i in one.ideal], one.why_none("misfit"), one.why_none("gap"))
        for name, one in found.items()
    }
    broken = seen.pop("broken")
    assert broken[0] == "data set"
    assert "there is no such file" in broken[3]
    no_ideal = "no ideal scan: frame 1 of dataset.toml names none"
    assert seen == {
        "broken/note.csv": ("profile", None, [], "", "no ideal scan"),
        "car/car_10m.txt": ("car", 10.0, ["ideal_car_10m.txt"], "", ""),
        "case": ("case", None, [], "a case is explained by its gap", ""),
        "ghosts/1_25m.txt": ("scan", 25.0, ["1_ideal.txt"], "", ""),
        "hall/frame_00.txt..frame_01.txt": ("frames", None, ["ideal.txt"], "", ""),
        "profile/vertical_60m.csv": ("profile", 60.0, [], "", "no ideal scan"),
        "set/a.txt": ("van", 30.0, ["b.txt"], "", ""),
        "set/c.txt": ("scan", None, [], no_ideal, no_ideal),
        "sign/real_69m.txt": ("scan", 69.0, ["ideal_69m.txt"], "", ""),
        "sign/real_157m.txt": ("scan", 157.0, [], "", "no ideal scan"),
    }  # fmt: skip
    assert list(found).index("sign/real_69m.txt") < list(found).index("sign/real_157m.txt")
    asked = found["case"].request("gap", Path("m.toml"))
    assert asked == Request("gap", Path("m.toml"), case=folder / "case")
    assert folder / "case" / "case.toml" in asked.files


def test_the_command_and_whoever_asks_by_itself_get_one_number(tmp_path, capsys):
    import json

    from lidarcheck.calibration.number.entry import sample
    from lidarcheck.cli import main

    place = project(tmp_path / "project")
    (place / "edited.ini").write_text(table([4e-4 if y == 2e-4 else y for y in
                                             (5e-5, 5e-5, 2e-4, 4e-4, 1e-3, 1.0, 1e-3, 4e-4, 2e-4, 5e-5)]))  # fmt: skip
    [one] = measurements(read_project(place))
    words = ["gap", str(place), "--lut", str(place / "edited.ini"), "--before", str(place / "table.ini")]
    assert main([*words, "--at", "100", "--json", "-", "--quiet"]) == 0
    [found] = json.loads(capsys.readouterr().out)["measurements"]
    number = sample(one.request("misfit", place / "model.toml", lut=place / "edited.ini"))
    assert (found["misfit"]["value"], found["misfit"]["key"]) == (number.value, number.key)
    assert found["misfit"]["step"]["word"] == "worse"
    assert found["gap"]["value"] >= 0.0
    assert main([*words, "--at", "30", "--quiet"]) == 2
    assert "holds no measurement at 30 m" in capsys.readouterr().err
    (place / "other.toml").write_text(MODEL.format(variant="SLIM", axis="vertical"))
    assert main(["gap", str(place), "--quiet"]) == 2
    assert "any of 2 models could be meant; say which with --model" in capsys.readouterr().err
    assert main(["gap", str(place / "real_100m.parquet"), "--model", str(place / "model.toml"), "--quiet"]) == 2
    assert "no ideal scan; name its ideal scan with --ideal" in capsys.readouterr().err


def test_a_bag_says_what_makes_measurements_of_its_frames(tmp_path, monkeypatch):
    pytest.importorskip("rosbags")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my drives").mkdir()
    columns = {name: np.ones(3, np.float32) for name in ("x", "y", "z", "intensity")}
    write_ros1(tmp_path / "my drives/a.bag", [Message("/points", CLOUD, START_NS, ros1_cloud(columns))])
    (tmp_path / "cut.mcap").write_bytes(b"nothing")
    cut, bag = measurements(read_project(tmp_path))
    assert (bag.kind, bag.why) == ("bag", "lidarcheck dataset scan 'my drives' makes measurements of its frames")
    assert cut.why.startswith(("is no recording", "cannot tell", "not a"))
    assert main(["dataset", "scan", "my drives", "--quiet"]) == 0
    _, frame = measurements(read_project(tmp_path))
    assert frame.name == "my drives/a.bag#/points@0"
    assert frame.why.startswith("no ideal scan: frame 0 of dataset.toml")
