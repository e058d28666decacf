"""docs/own-recording.md runs as it stands, on a recording of a small sensor in a room."""

import json
import re
import shlex
from pathlib import Path

import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_ideal
from lidarcheck.model import load_model
from recording_kit import WALLS, write_recording

PAGE = (Path(__file__).resolve().parents[1] / "docs/own-recording.md").read_text(encoding="utf-8")
COMMANDS = [line.strip() for line in PAGE.splitlines() if line.startswith("    lidarcheck ")]
SLOW = ("lidarcheck quickstart", "lidarcheck explain")


def write_files(place):
    for name, text in re.findall(r"```(?:toml|text) (\S+)\n(.*?)```", PAGE, re.DOTALL):
        (place / name).write_text(text, encoding="utf-8")
    write_recording(place / "recording", frames=6, columns=90)


def jobs(command):
    """One core: to start processes takes longer than this small work."""
    return ["--jobs", "1"] if command.startswith((*SLOW, "lidarcheck case check")) else []


def test_the_steps_of_the_page_run_one_after_the_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_files(tmp_path)
    said = {}
    for command in COMMANDS:
        if command.startswith(SLOW):
            continue
        assert main([*shlex.split(command)[1:], *jobs(command)]) == 0, (command, capsys.readouterr())
        said[command.split(" --")[0]] = capsys.readouterr().out
    assert len(said) == 8
    assert "frames 0 to 5 stand still: 6 of 6" in said["lidarcheck still recording"]
    assert "100.0 % on their beams" in said["lidarcheck sensor check rest/frame_000.csv"]
    fitted = json.loads(Path("repeats/repeats.json").read_text())["laws"]["fitted"]
    assert fitted["range_floor_m"]["value"] == pytest.approx(0.01, rel=0.1)
    assert load_model("repeats/model.toml").sensor.noise == pytest.approx(2.4, rel=0.4)
    assert re.match(r"\d+ of \d+ effects can be shown by these data: \w", said["lidarcheck case check case"])
    wall = load_ideal("panel.parquet", load_model("panel.toml").sensor)
    on = wall.distance_m > 0.0
    direction = wall.beams.directions(wall.layer[on], wall.point[on])
    assert abs((wall.distance_m[on] * direction[:, 0]).mean() - WALLS[0]) < 0.003
    hall = load_ideal("hall/frame_000.parquet", load_model("panel.toml").sensor)
    assert hall.distance_m[hall.distance_m > 0.0].min() == pytest.approx(WALLS[0], abs=0.1)


def test_every_source_of_the_contract_is_told():
    for command in ("from-repeats", "from-snippet", "from-map"):
        assert f"`ideal {command}`" in PAGE
        assert any(f"ideal {command}" in line for line in COMMANDS)


@pytest.mark.long
def test_the_whole_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_files(tmp_path)
    for command in COMMANDS:
        assert main([*shlex.split(command)[1:], *jobs(command)]) == 0, (command, capsys.readouterr())
    assert Path("first/report.html").is_file()
    assert json.loads(Path("found/report.json").read_text())["verdict"] == "no_gap"
