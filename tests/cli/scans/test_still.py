"""`still` takes the frames in which the scene stands still, as they are, and says why there are none."""

import json
from pathlib import Path

import pytest

from lidarcheck.cli import main
from recording_kit import write_frame


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
