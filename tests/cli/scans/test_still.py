"""`still` takes the frames in which the scene stands still, as they are, and says why there are none."""

import json
from pathlib import Path

import numpy as np
import pytest

from bag_kit import CLOUD, PERIOD_NS, START_NS, Message, cdr_cloud, write_ros2
from lidarcheck.cli import main
from lidarcheck.formats.recognise import read_table
from recording_kit import frame, write_frame


@pytest.fixture
def drive(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("drive").mkdir()
    for k in range(7):
        write_frame(Path(f"drive/f_{k}.csv"), k, place_m=(0.4 * max(2 - k, 0), 0.0, 0.0))
    return tmp_path


def test_the_run_is_copied(drive, capsys):
    assert main(["still", "drive", "--out", "rest", "--json", "facts.json"]) == 0
    assert "frames 2 to 6 stand still: 5 of 7 that were looked at" in capsys.readouterr().out
    assert sorted(path.name for path in Path("rest").iterdir()) == [f"f_{k}.csv" for k in range(2, 7)]
    assert Path("rest/f_4.csv").read_bytes() == Path("drive/f_4.csv").read_bytes()
    facts = json.loads(Path("facts.json").read_text())
    assert (facts["first"], facts["last"], facts["period_s"]) == (2, 6, None)


def test_enough_is_enough(drive):
    assert main(["still", "drive", "--out", "rest", "--most", "3", "-q"]) == 0
    assert len(list(Path("rest").iterdir())) == 3


def refused(words, capsys):
    assert main(words.split()) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert len(lines) == 1
    assert not Path("rest").exists()
    return lines[0]


def test_nothing_stands_still(drive, capsys):
    for k in range(3, 7):
        write_frame(Path(f"drive/f_{k}.csv"), k, place_m=(0.0, 0.4 * k, 0.0))
    assert "nothing stands still: no two of 7 frames in a row agree; record some seconds" in refused(
        "still drive --out rest", capsys
    )


def test_two_sensors_in_one_recording(drive, capsys):
    for k in range(7):
        write_frame(Path(f"drive/f_{k}.csv"), k, place_m=(2.0 * (k % 2), 0.0, 0.0))
    assert "the frames of two sensors take turns" in refused("still drive --out rest", capsys)


def test_one_frame_and_none(drive, capsys):
    assert "is a single frame" in refused("still drive/f_1.csv --out rest", capsys)
    Path("empty").mkdir()
    assert "empty: holds no frame" in refused("still empty --out rest", capsys)


def clouds(topic, places, first=0):
    """Messages of a topic, a frame for each place, as a driver writes them: x, y, z, intensity, ring."""
    for k, place_m in enumerate(places):
        layer, _, xyz, value = frame(k, place_m=place_m)
        columns = {name: xyz[:, i].astype(np.float32) for i, name in enumerate("xyz")}
        columns |= {"intensity": value.astype(np.float32), "ring": layer.astype(np.uint16)}
        time_ns = START_NS + (2 * k + first) * PERIOD_NS // 2
        yield Message(topic, CLOUD, time_ns, cdr_cloud(columns, stamp_ns=time_ns))


def test_a_bag_is_read_frame_by_frame(tmp_path, monkeypatch, capsys):
    pytest.importorskip("rosbags")
    monkeypatch.chdir(tmp_path)
    bag = write_ros2(tmp_path / "drive", clouds("/points", [(0.8, 0, 0), (0.4, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)]))
    assert main(["still", str(bag), "--out", "rest", "--json", "facts.json"]) == 0
    assert "frames 2 to 4 stand still: 3 of 5 that were looked at, 0.1 s apart" in capsys.readouterr().out
    assert json.loads(Path("facts.json").read_text())["period_s"] == pytest.approx(0.1)
    table = read_table(sorted(Path("rest").iterdir())[0])
    assert {"x", "y", "z", "ring"} <= set(table.names)


def test_two_sensors_of_a_bag_are_told_by_their_topics_or_by_their_turns(tmp_path, monkeypatch, capsys):
    pytest.importorskip("rosbags")
    monkeypatch.chdir(tmp_path)
    there = [(0.0, 0.0, 0.0)] * 4
    both = [*clouds("/left", there), *clouds("/right", [(2.0, 0.0, 0.0)] * 4, 1)]
    bag = write_ros2(tmp_path / "two", sorted(both, key=lambda one: one.time_ns))
    said = refused(f"still {bag} --out rest", capsys)
    assert "/left" in said
    assert "/right" in said
    assert main(["still", f"{bag}#/right", "--out", "right", "-q"]) == 0
    one = [message._replace(topic="/points") for message in both]
    mixed = write_ros2(tmp_path / "one", sorted(one, key=lambda one: one.time_ns))
    assert "the frames of two sensors take turns" in refused(f"still {mixed} --out rest", capsys)
