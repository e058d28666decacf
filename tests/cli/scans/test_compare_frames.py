"""`lidarcheck compare` of two directories of frames, and what it takes of memory."""

import json
import shutil
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from command_kit import simulate
from lidarcheck.cli.core.entry import main
from lidarcheck.formats import load_scan
from lidarcheck.kpi.compare import compare
from lidarcheck.kpi.over_frames import OverFrames


@pytest.fixture
def frames(bench_dir):
    """Three measured frames and three simulated ones, in two formats."""
    for k in range(3):
        for side, suffix, seed in (("real", ".txt", k), ("sim", ".pcd", 10 + k)):
            Path(side).mkdir(exist_ok=True)
            assert simulate(f"{side}/frame_{k}{suffix}", "--seed", str(seed), "-q") == 0
    return bench_dir


def test_directories_are_compared_frame_by_frame(frames, capsys):
    assert main(["compare", "real", "sim", "--ideal", "ideal.txt", "--json", "kpis.json", "-q"]) == 0
    header, *rows = capsys.readouterr().out.splitlines()
    assert header.split() == ["KPI", "of", "median", "chance", "unit", "verdict", "frames", "5", "%", "95", "%"]
    found = json.loads(Path("kpis.json").read_text())
    assert [Path(one["measured"]).name for one in found["frames"]] == ["frame_0.txt", "frame_1.txt", "frame_2.txt"]
    assert [Path(one["simulated"]).name for one in found["frames"]] == ["frame_0.pcd", "frame_1.pcd", "frame_2.pcd"]
    assert rows[-1] == found["chance"]["closing"]
    assert rows[-1].endswith("chance between frames is not in it.")
    assert len(rows) > len(found["over_frames"])
    areas = [one["features"]["AREA"]["wasserstein"] for one in found["frames"]]
    (area,) = [k for k in found["over_frames"] if (k["kpi"], k["of"]) == ("wasserstein", "AREA")]
    assert area["frames"] == 3
    assert area["median"] == pytest.approx(np.median(areas))
    assert area["low"] <= area["median"] <= area["high"] <= max(areas)
    assert "detection_probability" in {k["kpi"] for k in found["over_frames"]}


def test_each_frame_may_have_an_ideal_scan(frames, capsys):
    Path("ideals").mkdir()
    for k in range(3):
        shutil.copy("ideal.txt", f"ideals/frame_{k}.txt")
    assert main(["compare", "real", "sim", "--ideal", "ideals", "--json", "-", "-q"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert main(["compare", "real", "sim", "--ideal", "ideal.txt", "--json", "-", "-q"]) == 0
    other = json.loads(capsys.readouterr().out)
    assert one.pop("computed_from")["key"] != other.pop("computed_from")["key"]
    assert other == one


def test_frames_of_several_scenes_are_said(frames, capsys):
    """The wall of the last frame stands elsewhere."""
    Path("ideals").mkdir()
    for k in range(3):
        shutil.copy("ideal.txt", f"ideals/frame_{k}.txt")
    assert main(["compare", "real", "sim", "--ideal", "ideals", "-q"]) == 0
    assert "another scene" not in capsys.readouterr().out
    file = Path("ideals/frame_2.txt")
    file.write_text(file.read_text().replace(" 30.0 ", " 30.6 "))
    assert main(["compare", "real", "sim", "--ideal", "ideals", "--json", "kpis.json", "-q"]) == 0
    assert "1 of 3 frames show another scene than the first: each KPI is of all of them." in capsys.readouterr().out
    assert json.loads(Path("kpis.json").read_text())["other_scenes"] == 1


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (lambda: Path("sim/frame_1.pcd").unlink(), "real/frame_1.txt: has no frame beside it in sim"),
        (lambda: Path("real/frame_2.txt").unlink(), "sim/frame_2.pcd: has no frame beside it in real"),
        (lambda: shutil.copy("sim/frame_1.pcd", "sim/frame_1.PCD.pcd"), "has no frame beside it"),
        (lambda: shutil.copy("real/frame_1.txt", "real/frame_1.csv"), "is named as frame_1.csv"),
        (lambda: [path.unlink() for path in Path("sim").iterdir()], "sim: holds no frame"),
        (lambda: Path("sim/frame_1.pcd").write_text("no cloud"), "sim/frame_1.pcd"),
    ],
)
def test_frames_without_a_partner_are_refused(frames, break_it, words, capsys):
    break_it()
    assert main(["compare", "real", "sim", "-q"]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.startswith("error: ")
    assert len(error.splitlines()) == 1


def test_a_frame_beside_a_directory_of_several_is_refused(frames, capsys):
    assert main(["compare", "real", "sim/frame_0.pcd"]) == 2
    assert "real/frame_1.txt: has no frame beside it in sim/frame_0.pcd, nor have 1 more" in capsys.readouterr().err


def test_memory_does_not_grow_with_the_frames(frames):
    """What is kept of a frame are some hundred numbers, not its echoes."""
    one, other = load_scan(Path("real/frame_0.txt")), load_scan(Path("sim/frame_0.pcd"))
    found = compare(one, other)
    together = OverFrames()
    together.add(found)
    tracemalloc.start()
    for _ in range(1000):
        together.add(found)
    grown = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert grown < 1000 * 40 * 64
    assert together.kpis()[0].frames == 1001
