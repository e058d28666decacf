"""`case make` and `case check`: a case from files, whole or nothing, and what its data can show."""

import json
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from explain_kit import MODEL, ideal_scan, write_case
from lidarcheck.cases.case import load_case
from lidarcheck.cli import main
from lidarcheck.effects.finding import catalogue
from lidarcheck.formats import load_ideal, load_scan, save_ideal, save_scan
from lidarcheck.model import load_model, simulate

FRAMES = 4


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Measured frames and ideal scans in folders of their own, and a model with a sensor file and a curve beside it."""
    place = tmp_path_factory.mktemp("drive")
    (place / "model.toml").write_text(MODEL.format(variant="SMART"), encoding="utf-8")
    model = load_model(place / "model.toml")
    for name in ("real", "ideals"):
        (place / name).mkdir()
    for k in range(FRAMES):
        ideal = ideal_scan(k)
        save_ideal(ideal, place / f"ideals/drive_{k:02d}.parquet")
        save_scan(simulate(ideal, model, seed=5, frame=k), place / f"real/drive_{k:02d}.txt")
    return place


@pytest.fixture
def here(drive, tmp_path, monkeypatch):
    shutil.copytree(drive, tmp_path / "d")
    monkeypatch.chdir(tmp_path / "d")
    return tmp_path / "d"


MAKE = "case make --measured real --ideal ideals --model model.toml --out case"


def test_a_case_is_made_that_explain_reads(here, capsys):
    assert main([*MAKE.split(), "--json", "made.json"]) == 0
    out, err = capsys.readouterr()
    assert "lidarcheck case check case" in err
    assert out.count("drive_") == 2 * FRAMES
    case = load_case("case")
    assert len(case.frames) == FRAMES
    assert [frame.time_s for frame in case.frames] == pytest.approx([k / 25 for k in range(FRAMES)])
    assert (here / "case/measured/drive_02.txt").read_bytes() == (here / "real/drive_02.txt").read_bytes()
    assert len(json.loads(Path("made.json").read_text())["frames"]) == FRAMES


def test_frames_of_one_file_are_written_apart(here):
    scans = [load_scan(f"real/drive_{k:02d}.txt") for k in range(FRAMES)]
    lines = ["X Y Z Layer Point EchoNumber WIDTH AREA PEAK Frame"]
    for k, scan in enumerate(scans):
        for row in range(len(scan)):
            xyz = f"{scan.x_m[row]:.3f} {scan.y_m[row]:.3f} {scan.z_m[row]:.3f}"
            more = f"{scan.layer[row]} {scan.point[row]} {scan.echo_number[row]} {scan.width_ns[row]:g}"
            lines.append(f"{xyz} {more} {scan.area[row]:g} {scan.peak[row]:g} {k}")
    Path("drive.txt").write_text("\n".join(lines) + "\n")
    words = MAKE.replace("--measured real", "--measured drive.txt") + " --period 0.5"
    assert main(words.split()) == 0
    case = load_case("case")
    assert [frame.time_s for frame in case.frames] == pytest.approx([0.5 * k for k in range(FRAMES)])
    assert [len(frame.measured) for frame in case.frames] == [len(scan) for scan in scans]


def test_keys_of_the_case_are_written(here):
    words = f"{MAKE} --unit mm --mirror y --pose 0,0,1.5,0,0,90 --ideals-from map --pose-from fit --parts 2,1,1"
    assert main([*words.split(), "-q"]) == 0
    document = tomllib.loads(Path("case/case.toml").read_text())
    assert document["ideals_from"], document["pose_from"] == ("map", "fit")
    assert [frame["part"] for frame in document["frames"]] == ["fit", "fit", "select", "verify"]
    first = document["frames"][0]
    assert (first["unit"], first["mirror"]) == ("mm", "y")
    assert first["pose"] == {"x_m": 0, "y_m": 0, "z_m": 1.5, "roll_deg": 0, "pitch_deg": 0, "yaw_deg": 90}


def test_one_ideal_scan_serves_all_frames_and_stands_there_once(here):
    words = MAKE.replace("--ideal ideals", "--ideal ideals/drive_00.parquet")
    assert main([*words.split(), "-q"]) == 0
    document = tomllib.loads(Path("case/case.toml").read_text())
    assert {frame["ideal"] for frame in document["frames"]} == {"ideal/drive_00.parquet"}
    assert [path.name for path in Path("case/ideal").iterdir()] == ["drive_00.parquet"]


def test_the_model_brings_what_it_names(here):
    sensor = Path("src_sensor.toml")
    sensor.write_text(
        (Path(__file__).parents[3] / "src/lidarcheck/sensors/XT32.toml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    Path("parts").mkdir()
    sensor.rename("parts/mine.toml")
    Path("model.toml").write_text(MODEL.format(variant="parts/mine.toml"), encoding="utf-8")
    assert main([*MAKE.split(), "-q", "--link"]) == 0
    assert load_model("case/model.toml").sensor.name == "PandarXT-32"
    assert Path("case/parts/mine.toml").samefile("parts/mine.toml")


def test_what_a_data_set_declares_comes_along(here):
    lines = ['[dataset]\nmask = "mask.csv"']
    for k in range(FRAMES):
        one = [f'measured = "real/drive_{k:02d}.txt"', f'ideal = "ideals/drive_{k:02d}.parquet"', f"time = {3 * k}.5"]
        lines += ["[[frames]]", *one, "pose = {z_m = 0.0, yaw_deg = 360.0}"]
    Path("dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    Path("mask.csv").write_text("Layer,Point\n255,480\n255,481\n", encoding="utf-8")
    words = "case make --measured dataset.toml --ideal dataset.toml --model model.toml --out case -q"
    assert main(words.split()) == 0
    document = tomllib.loads(Path("case/case.toml").read_text())
    assert [frame["time"] for frame in document["frames"]] == [0.5, 3.5, 6.5, 9.5]
    assert document["frames"][0]["pose"]["yaw_deg"] == 360.0
    case = load_case("case")
    before = ideal_scan(2)
    assert len(case.frames[2].ideal) == len(before) - 2
    assert not ((case.frames[2].measured.layer == 255) & (case.frames[2].measured.point == 480)).any()


def test_a_program_comes_with_its_text_and_its_right_to_run(here):
    Path("own").mkdir()
    Path("own/sim.py").write_text("import helper\n", encoding="utf-8")
    Path("own/helper.py").write_text("", encoding="utf-8")
    Path("own/run.sh").write_text("#!/bin/sh\nexec python3 sim.py\n", encoding="utf-8")
    Path("own/run.sh").chmod(0o755)
    Path("own/model.toml").write_text('[external]\ncommand = ["./run.sh", "{ideal}", "{scan}"]\n', encoding="utf-8")
    assert main([*MAKE.replace("model.toml", "own/model.toml").split(), "-q"]) == 0
    assert {path.name for path in Path("case").iterdir() if path.is_file()} == {
        "case.toml", "model.toml", "run.sh", "sim.py", "helper.py"
    }  # fmt: skip
    assert Path("case/run.sh").stat().st_mode & 0o111


WRONG = {
    MAKE.replace("ideals", "none"): "error: none",
    MAKE.replace(
        "--out case", "--out real"
    ): "error: real: is no case, and not empty; name another directory for --out",
    f"{MAKE} --parts 1,1,1": "the parts 1,1,1 are not three numbers whose sum is 4",
    f"{MAKE} --pose-from fit": "--pose-from is of --ideals-from snippet or map",
    f"{MAKE} --repeats 3": "--repeats is of --ideals-from repeats",
    MAKE.replace("--model model.toml", "--model real/drive_00.txt"): "error: real/drive_00.txt",
    MAKE.replace("--ideal ideals", "--ideal ideals/drive_00.parquet ideals/drive_01.parquet"): "has no frame beside it",
}


@pytest.mark.parametrize("words", WRONG)
def test_what_is_wrong_is_one_line_and_nothing_is_written(here, words, capsys):
    before = sorted(here.rglob("*"))
    assert main(words.split()) == 2
    err = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert len(err) == 1
    assert WRONG[words] in err[0]
    assert sorted(here.rglob("*")) == before


def test_a_case_that_is_there_is_replaced_only_when_asked(here, capsys):
    assert main([*MAKE.split(), "-q"]) == 0
    text = Path("case/case.toml").read_text()
    assert main([*MAKE.split(), "--period", "2"]) == 2
    assert "is there already; name another directory, or replace it with --force" in capsys.readouterr().err
    assert Path("case/case.toml").read_text() == text
    assert main([*MAKE.split(), "--period", "2", "--force", "-q"]) == 0
    assert load_case("case").frames[1].time_s == 2.0


def test_a_model_that_names_a_file_elsewhere_stays_where_it_is(here, capsys):
    Path("models").mkdir()
    shutil.copyfile(Path(__file__).parents[3] / "src/lidarcheck/sensors/XT32.toml", "mine.toml")
    Path(".git").mkdir()
    Path("models/model.toml").write_text(MODEL.format(variant="../mine.toml"), encoding="utf-8")
    assert main(MAKE.replace("model.toml", "models/model.toml").split()) == 2
    assert "not below its folder; move it beside the model" in capsys.readouterr().err
    assert not Path("case").exists()


def test_the_check_says_first_what_can_be_shown(tmp_path, capsys):
    case = write_case(tmp_path / "case", frames=3)
    assert main(["case", "check", str(case), "--json", str(tmp_path / "c.json"), "-q", "--jobs", "1"]) == 0
    out = capsys.readouterr().out
    found = json.loads((tmp_path / "c.json").read_text())
    shown, not_testable = found["shown"], found["not_testable"]
    assert out.startswith(
        f"{len(shown)} of {len(catalogue())} effects can be shown by these data: {', '.join(shown)}\n"
    )
    assert sorted([*shown, *not_testable]) == sorted(catalogue())
    assert {"walk_error", "signal_gain", "range_offset"} <= set(shown)
    assert not_testable["retro_ghost"] == "no retro-reflector is in view"
    assert all(f"{name} " in out and why in out for name, why in not_testable.items())
    assert sum(len(numbers) for numbers in found["parts"].values()) == 3
    assert 0.0 < found["distance"]["floor"] < 10.0 * found["distance"]["before"]
    assert "geometry checked" in out


def test_two_frames_show_nothing_and_say_so(tmp_path, capsys):
    case = write_case(tmp_path / "case", frames=2)
    assert main(["case", "check", str(case), "-q"]) == 1
    out = capsys.readouterr().out
    assert out.startswith(f"0 of {len(catalogue())} effects can be shown by these data\n")
    assert "fewer than 3 frames" in out


def test_a_case_that_cannot_be_read_is_not_checked(tmp_path, capsys):
    case = write_case(tmp_path / "case", frames=3)
    scan = load_scan(case / "m0.txt")
    save_scan(scan.take(np.zeros(0, dtype=int)), case / "m0.txt")
    save_scan(scan.take(np.zeros(0, dtype=int)), case / "m1.txt")
    assert main(["case", "check", str(case)]) == 2
    assert capsys.readouterr().err.count("error: ") == 1


def test_a_case_whose_beams_all_meet_edges_is_one_line(tmp_path, capsys):
    case = write_case(tmp_path / "case", frames=3)
    for k in range(3):
        ideal = load_ideal(case / f"i{k}.txt")
        save_ideal(replace(ideal, extra={"Edge": np.ones(len(ideal), dtype=np.int32)}), case / f"i{k}.txt")
    text = (case / "case.toml").read_text()
    (case / "case.toml").write_text('ideals_from = "map"\n' + text)
    assert main(["case", "check", str(case), "-q"]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert len(lines) == 1
    assert "no beam can be judged: each meets an edge" in lines[0]
