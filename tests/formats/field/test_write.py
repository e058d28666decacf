"""Frames written as PointCloud2, OSI and text: another program reads what was written, and so does this one."""

import sys
from pathlib import Path

import numpy as np
import pytest

from bag_kit import CLOUD, PERIOD_NS, START_NS, Message, cdr_cloud, write_ros2
from lidarcheck.cli import main
from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.formats.table import Table

ROWS = 30


def columns(frame):
    rng = np.random.default_rng(frame)
    xyz = {axis: rng.uniform(2, 20, ROWS).astype(np.float32) for axis in "xyz"}
    for column in xyz.values():
        column[4] = np.nan  # a beam without a return
    return {**xyz, "intensity": rng.uniform(0, 255, ROWS).astype(np.float32), "ring": np.arange(ROWS, dtype=np.uint16)}


@pytest.fixture
def bag(tmp_path):
    messages = [
        Message("/points", CLOUD, START_NS + n * PERIOD_NS, cdr_cloud(columns(n), height=3, frame="top"))
        for n in range(4)
    ]
    return write_ros2(tmp_path / "drive", messages)


@pytest.mark.parametrize("suffix", ["mcap", "bag"])
def test_another_program_reads_the_bag_that_was_written(suffix, bag, tmp_path):
    from rosbags.highlevel import AnyReader

    target = tmp_path / f"out.{suffix}"
    assert main(["convert", str(bag), str(target), "--quiet"]) == 0
    with AnyReader([target]) as reader:
        topics = list(reader.topics)
        messages = [(time, reader.deserialize(content, one.msgtype)) for one, time, content in reader.messages()]
    assert topics == ["/points"]
    assert [time for time, _ in messages] == [START_NS + n * PERIOD_NS for n in range(4)]
    for number, (time, cloud) in enumerate(messages):
        assert cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec == time
        assert (cloud.height, cloud.width) == (3, 10)
        assert [field.name for field in cloud.fields] == ["x", "y", "z", "intensity", "ring"]
        record = np.dtype([("xyzi", "<f4", 4), ("ring", "<u2")])
        rows = cloud.data.view(record)
        own = columns(number)
        assert np.array_equal(rows["xyzi"].T, np.stack([own[n] for n in ("x", "y", "z", "intensity")]), equal_nan=True)
        assert np.array_equal(rows["ring"], own["ring"])


def test_osi_that_was_written_is_read_by_its_own_library(bag, tmp_path):
    from osi_utilities import MessageType, SingleTraceReader

    target = tmp_path / "out_sd.osi"
    assert main(["convert", str(bag), str(target), "--quiet"]) == 0
    reader = SingleTraceReader()
    reader.set_message_type(MessageType.SENSOR_DATA)
    assert reader.open(target)
    data = [one.message for one in reader]
    reader.close()
    assert len(data) == 4
    assert [one.timestamp.seconds * 10**9 + one.timestamp.nanos for one in data] == [
        START_NS + n * PERIOD_NS for n in range(4)
    ]
    detections = data[1].feature_data.lidar_sensor[0].detection
    own = columns(1)
    place = detections[0].position
    assert place.distance * np.sin(place.elevation) == pytest.approx(float(own["z"][0]), abs=1e-6)
    assert place.distance * np.cos(place.elevation) * np.sin(place.azimuth) == pytest.approx(
        float(own["y"][0]), abs=1e-6
    )
    assert detections[0].intensity == pytest.approx(float(own["intensity"][0]))
    assert detections[4].classification == 2
    back = read_table(f"{target}#@1")
    assert back.columns["X"][np.arange(ROWS) != 4] == pytest.approx(own["x"][np.arange(ROWS) != 4], abs=1e-5)


@pytest.mark.parametrize("suffix", ["csv", "txt"])
def test_text_has_a_column_of_frames(suffix, bag, tmp_path):
    target = tmp_path / f"out.{suffix}"
    assert main(["convert", str(bag), str(target), "--quiet", "--drop-empty"]) == 0
    table = read_table(target)
    assert np.array_equal(table.columns["Frame"], np.repeat(np.arange(4), ROWS - 1))
    expected = np.concatenate([np.delete(columns(n)["y"], 4) for n in range(4)])
    assert np.array_equal(table.columns["y"].astype(np.float32), expected)


def test_a_file_of_one_frame_cannot_hold_a_bag(bag, tmp_path, capsys):
    assert main(["convert", str(bag), str(tmp_path / "out.pcd")]) == 2
    assert "there are several frames, and a .pcd file holds one; split them" in capsys.readouterr().err
    assert not (tmp_path / "out.pcd").exists()
    assert main(["convert", f"{bag}#/points@2", str(tmp_path / "out.pcd"), "--quiet"]) == 0
    assert np.array_equal(read_table(tmp_path / "out.pcd").columns["y"], columns(2)["y"], equal_nan=True)
    assert main(["split", str(bag), "--out", str(tmp_path / "frames"), "--quiet"]) == 0
    files = sorted(path.name for path in (tmp_path / "frames").iterdir())
    assert files == [f"drive_{n:06d}.pcd" for n in range(4)]


def test_folders_and_ideal_scans(bag, tmp_path, capsys):
    (tmp_path / "frames").mkdir()
    for number in range(3):
        own = {**columns(0), "n": np.full(ROWS, number)}
        write_table(Table(own), tmp_path / "frames" / f"frame_{number}.pcd")
    assert main(["convert", str(tmp_path / "frames"), str(tmp_path / "out.mcap"), "--quiet"]) == 0
    assert [int(read_table(f"{tmp_path}/out.mcap#@{n}").columns["n"][0]) for n in range(3)] == [0, 1, 2]
    ideal = Table({"Layer": np.arange(3), "Point": np.arange(3), "Distance": np.ones(3), "MaterialID": np.ones(3, int)})
    write_table(ideal, tmp_path / "ideal.txt")
    assert main(["convert", str(tmp_path / "ideal.txt"), str(tmp_path / "ideal.mcap"), "--quiet"]) == 2
    assert "is an ideal scan, and the format holds points alone" in capsys.readouterr().err
    assert not (tmp_path / "ideal.mcap").exists()


def test_a_frame_that_cannot_be_read_leaves_nothing_behind(tmp_path, capsys):
    messages = [Message("/points", CLOUD, START_NS + n, cdr_cloud(columns(n))) for n in range(4)]
    messages.append(Message("/points", CLOUD, START_NS + 9, b"\0\1\0\0" + bytes(9)))
    bag = write_ros2(tmp_path / "a", messages)
    before = {path.name for path in tmp_path.iterdir()}
    for suffix in ("mcap", "bag", "csv", "osi"):
        assert main(["convert", str(bag), str(tmp_path / f"out.{suffix}"), "--quiet"]) == 2
    assert {path.name for path in tmp_path.iterdir()} == before
    assert capsys.readouterr().err.count("a message is damaged") == 4


def test_a_missing_package_is_named(bag, tmp_path, monkeypatch, capsys):
    for name in [name for name in sys.modules if name.partition(".")[0] == "rosbags"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)
    assert main(["convert", str(bag), str(tmp_path / "out.mcap"), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert 'to write a bag needs the package rosbags; install it: pip install "lidarcheck[bags]"' in said
    assert main(["info", str(bag), "--quiet"]) == 0  # reading needs none


def test_the_source_is_not_written_over(bag):
    content = Path(bag).read_bytes()
    assert main(["convert", f"{bag}#/points", str(bag), "--quiet"]) == 2
    assert Path(bag).read_bytes() == content
