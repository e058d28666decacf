"""Data sets: what a frame is declared to be holds wherever it is read; faults are said with their lines."""

import json
from pathlib import Path

import numpy as np
import pytest

from bag_kit import CLOUD, PERIOD_NS, START_NS, Message, cdr_cloud, write_ros2
from lidarcheck.cases.dataset import load_dataset
from lidarcheck.cases.source import files_in, frames_in, ideal_of, scan_of
from lidarcheck.cli import main
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats.geometry import Placement
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.table import Table
from lidarcheck.model.files.sensor_file import load_sensor
from reference_grid import beam_directions

MODEL = 'variant = "{}"\n[materials.1]\nname = "wall"\nreflectance = 0.5\nkind = "lambertian"\n'


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def rows():
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(250, 270), np.arange(470, 490), indexing="ij"))
    return layer, point, 20.0 + 0.01 * (layer - 250)


def write_scan(name, mirror=1.0, unit=1.0, moved=0.0):
    layer, point, distance = rows()
    xyz = beam_directions(layer, point).T * distance * unit
    features = {name: np.full(len(layer), 50.0) for name in ("WIDTH", "AREA", "PEAK")}
    columns = {"X": xyz[0] + moved, "Y": mirror * xyz[1], "Z": xyz[2], "Layer": layer, "Point": point, **features}
    write_table(Table({**columns, "EchoNumber": np.ones(len(layer), int)}), name)


def write_ideal(name="ideal.txt"):
    layer, point, distance = rows()
    columns = {"Layer": layer, "Point": point, "Distance": distance, "MaterialID": np.ones(len(layer), int)}
    write_table(Table({**columns, "IncidenceAngle": np.zeros(len(layer))}), name)


def write_set(text, name="dataset.toml"):
    Path(name).write_text(text)
    return Path(name)


def test_a_frame_lies_as_the_data_set_declares():
    for name, kind in {"a.txt": {}, "b.txt": {"mirror": -1.0, "unit": 1000.0}, "c.txt": {"moved": 1.5}}.items():
        write_scan(name, **kind)
    write_ideal()
    frames = (
        '[[frames]]\nmeasured = "a.txt"\nideal = "ideal.txt"\ndistance_m = 20\nclass = "wall"\nrepeat = 0\ntime = 0\n'
    )
    frames += '[[frames]]\nmeasured = "b.txt"\nideal = "ideal.txt"\nunit = "mm"\nmirror = "y"\n'
    frames += '[[frames]]\nmeasured = "c.txt"\nideal = "ideal.txt"\npose = {x_m = -1.5}\n'
    Path("mask.csv").write_text("Layer,Point\n250,470\n251,471\n")
    place = write_set('[dataset]\nsensor = "SLIM"\nmask = "mask.csv"\n' + frames)
    found = load_dataset(place)
    first = found.frames[0]
    assert (first.distance_m, first.kind, first.repeat, first.time_s) == (20.0, "wall", 0, 0.0)
    scans = [scan_of(frame) for frame in frames_in("dataset.toml")]
    layer, point, distance = rows()
    kept = ~((layer == 250) & (point == 470)) & ~((layer == 251) & (point == 471))
    for scan in scans:
        assert scan.layer.tolist() == layer[kept].tolist()
        assert scan.range_m == pytest.approx(distance[kept], abs=1e-3)
    ideals = [ideal_of(frame) for frame in frames_in(Path(), "ideal")]
    assert [len(ideal) for ideal in ideals] == [398, 398, 398]
    assert {str(file) for file in files_in("dataset.toml")} == {"dataset.toml", "a.txt", "b.txt", "c.txt", "ideal.txt"}
    one = frames_in("dataset.toml")[1]
    with pytest.raises(
        UsageError, match=r"unit cm is declared on the command line, unit mm, y mirrored in dataset.toml"
    ):
        scan_of(one, Placement(unit="cm"))
    with pytest.raises(UsageError, match=r"the command's sensor is OS-1-128 .*, that of dataset\.toml is SLIM"):
        scan_of(one, sensor=load_sensor("OS1-128"))


def test_commands_take_a_data_set(capsys):
    write_scan("a.txt")
    write_scan("b.txt", unit=1000.0)
    write_ideal()
    frame = '[[frames]]\nmeasured = "{}.txt"\nideal = "ideal.txt"\n'
    write_set('[dataset]\nsensor = "SLIM"\n' + frame.format("a") + frame.format("b") + 'unit = "mm"\n')
    assert main(["info", "dataset.toml", "--json", "--quiet"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["rows"], told["kind"]) == (800, "scan")
    Path("sim").mkdir()
    for name in ("a", "b"):
        write_scan(f"sim/{name}.txt")
    assert main(["compare", "dataset.toml", "sim", "--ideal", "dataset.toml", "--json", "-", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    medians = {(row["kpi"], row["of"]): row["median"] for row in found["over_frames"]}
    assert medians["wasserstein", "range_residual"] == pytest.approx(0.0, abs=1e-6)
    assert main(["convert", "dataset.toml", "all.csv", "--quiet"]) == 0
    assert len(Path("all.csv").read_text().splitlines()) == 801


FAULTS = {
    "an unknown key": (
        '[dataset]\nsensors = "SLIM"\n[[frames]]\nmeasured = "a.txt"\n',
        ":2: unknown key dataset.sensors; did",
    ),
    "no frame": ('[dataset]\nsensor = "SLIM"\n', ":1: the data set has no frame; add [[frames]] with `measured`"),
    "no file": ('[[frames]]\nmeasured = "z.txt"\n', ':2: measured = "z.txt": there is no such file; paths start from'),
    "another project": ('[[frames]]\nmeasured = "../z.txt"\n', ':2: "../z.txt" leads out of the project'),
    "the same twice": (
        '[[frames]]\nmeasured = "a.txt"\n' * 2,
        ':4: frame 1 names "a.txt" as measured, as frame 0 does',
    ),
    "both": ('[[frames]]\nmeasured = "a.txt"\nideal = "./a.txt"\n', ':3: frame 0 names "a.txt" both as ideal and as'),
    "a negative repeat": ('[[frames]]\nmeasured = "a.txt"\nrepeat = -1\n', ":3: frames[0].repeat = -1 is out of range"),
    "another sensor": (
        '[dataset]\nsensor = "OS1-128"\nmodel = "SLIM.toml"\n[[frames]]\nmeasured = "a.txt"\n',
        ":2: sensor = 'OS1-128' is OS-1-128 122246000293, the variant of SLIM.toml is SLIM; name the model's variant",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_wrong_is_said_with_its_line(fault):
    text, words = FAULTS[fault]
    write_scan("a.txt")
    Path("SLIM.toml").write_text(MODEL.format("SLIM"))
    with pytest.raises((ConfigError, InputError)) as error:
        load_dataset(write_set(text))
    assert f"dataset.toml{words}" in str(error.value)


def test_all_faults_are_said_at_once():
    with pytest.raises(ConfigError) as error:
        load_dataset(write_set('[[frames]]\nmeasured = "x.txt"\n[[frames]]\nmeasured = "y.txt"\n'))
    assert [line.split(":")[2] for line in error.value.lines()] == ["2", "4"]


def test_a_unit_has_its_own_calibration():
    angles = np.linspace(10, -10, 8)
    for unit, shift in (("one", 0.0), ("two", 0.4)):
        lines = [f"{k + 1},{angle + shift:.3f},0.0" for k, angle in enumerate(angles)]
        Path(f"{unit}.csv").write_text("Channel,Elevation,Azimuth\n" + "\n".join(lines) + "\n")
    text = 'format = 1\nname = "eight"\ndetector = "linear"\nframe_rate_hz = 10\n[beams]\nkind = "channels"\n'
    text += f"elevation_deg = {angles.tolist()}\ncolumns = 360\n[linear]\nrange_floor_m = 0.02\n"
    Path("eight.toml").write_text(text)
    for unit, shift in (("one", 0.0), ("two", 0.4)):
        elevation = np.deg2rad(np.tile(angles + shift, 90))
        azimuth = np.deg2rad(np.repeat(np.arange(90.0), 8))
        xyz = [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
        columns = {axis: 20.0 * own for axis, own in zip("XYZ", xyz, strict=True)}
        columns |= {"Layer": np.tile(np.arange(8), 90), "Point": np.repeat(np.arange(90), 8)}
        write_table(Table(columns), f"{unit}.pcd")
    frame = '[[frames]]\nmeasured = "{0}.pcd"\ncalibration = "{0}.csv"\n'
    write_set('[dataset]\nsensor = "./eight.toml"\n' + frame.format("one") + frame.format("two"))
    elevations = [scan_of(frame).beams.channels.elevation_deg[0] for frame in frames_in("dataset.toml")]
    assert elevations == pytest.approx([10.0, 10.4])


def test_frames_of_a_bag_are_named_one_by_one(tmp_path):
    layer, point, distance = rows()
    xyz = (beam_directions(layer, point).T * distance).astype(np.float32)
    own = dict(zip("xyz", xyz, strict=True))
    bag = write_ros2(tmp_path / "b", [Message("/p", CLOUD, START_NS + n * PERIOD_NS, cdr_cloud(own)) for n in range(3)])
    write_set('[[frames]]\nmeasured = "b/b.mcap#/p@2"\n[[frames]]\nmeasured = "b/b.mcap#/p@0"\n')
    assert [str(frame) for frame in frames_in("dataset.toml")] == ["b/b.mcap#/p@2", "b/b.mcap#/p@0"]
    assert len(scan_of(frames_in("dataset.toml")[0])) == len(layer)
    write_set(f'[[frames]]\nmeasured = "b/{bag.name}#/p@3"\n')
    with pytest.raises(InputError, match="has no frame 3: it holds 3; name one of 0 to 2"):
        frames_in("dataset.toml")
    write_set(f'[[frames]]\nmeasured = "b/{bag.name}"\n')
    with pytest.raises(InputError, match=r"holds 3 frames, where one is wanted; name one, as 'b/b\.mcap#/p@0'"):
        frames_in("dataset.toml")


def test_scan_writes_what_names_say(tmp_path, capsys):
    own = {axis: np.ones(3, np.float32) for axis in "xyz"}
    write_ros2(tmp_path / "set" / "drive", [
        *[Message("/p", CLOUD, START_NS + n * PERIOD_NS, cdr_cloud(own)) for n in range(2)],
        Message("/rear", CLOUD, START_NS, cdr_cloud(own)),
    ])  # fmt: skip
    for name in ("sign_25m_r1", "sign_25m_r2", "sign_25m_r10", "panel_10.5m", "Pedestrian 7p5m"):
        write_scan(f"set/{name}.txt")
    write_ideal("set/sign_25m_ideal.txt")
    Path("set/notes.md").write_text("nothing")
    Path("set/broken.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert main(["dataset", "scan", "set", "--sensor", "SLIM"]) == 0
    said = capsys.readouterr().err
    assert "not taken: drive/drive.mcap#/rear (1 frames)" in said
    assert "broken.mcap: the MCAP has no topic" in said
    found = {str(one.measured): one for one in load_dataset("set").frames}
    told = {name: (one.distance_m, one.kind, one.repeat) for name, one in found.items()}
    assert told == {
        "set/Pedestrian 7p5m.txt": (7.5, "Pedestrian", None),
        "set/panel_10.5m.txt": (10.5, "panel", None),
        "set/sign_25m_r1.txt": (25.0, "sign", 0),
        "set/sign_25m_r2.txt": (25.0, "sign", 1),
        "set/sign_25m_r10.txt": (25.0, "sign", 2),
        "set/drive/drive.mcap#/p@0": (None, "drive", 0),
        "set/drive/drive.mcap#/p@1": (None, "drive", 1),
    }
    assert found["set/sign_25m_r2.txt"].ideal == Path("set/sign_25m_ideal.txt")
    assert found["set/drive/drive.mcap#/p@1"].time_s == pytest.approx(0.1)
    assert main(["dataset", "scan", "set"]) == 2
    assert "set/dataset.toml: is there already; name another with --out" in capsys.readouterr().err


def test_scan_of_a_folder_without_scans(tmp_path, capsys):
    Path("empty").mkdir()
    assert main(["dataset", "scan", "empty"]) == 2
    assert "empty: holds no scan; name a folder of" in capsys.readouterr().err
    assert list(Path("empty").iterdir()) == []
