"""`lidarcheck ghosts` as a user calls it."""

import json
from pathlib import Path

import numpy as np
import pytest

from ghost_frames import Recipe, made
from lidarcheck.cli import main
from lidarcheck.formats import load_scan
from lidarcheck.model import load_model
from merging import merge


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """Two datasets, one of a sign without ghost, one of the other variant; all with ideal scan and model."""
    place = tmp_path_factory.mktemp("ghosts")
    recipes = {
        "1_25m": Recipe(seed=61, ratio=2e-4, layers=range(244, 284), points=range(464, 500)),
        "2_45m": Recipe(seed=62, range_m=45.0, ratio=2e-4, layers=range(244, 284), points=range(464, 500)),
        "none": Recipe(seed=63, range_m=60.0, ghost_share=0.0, layers=range(244, 284), points=range(464, 500)),
        "smart": Recipe(seed=64, variant="SMART", ratio=4e-4, layers=range(244, 284), points=range(464, 500)),
    }
    for name, recipe in recipes.items():
        frame = made(recipe)
        (place / f"{name}.txt").write_text(frame.scan_text)
        (place / f"{name}_ideal.txt").write_text(frame.ideal_text)
        (place / f"{recipe.variant}.toml").write_text("# my sensor\n" + frame.model_text)
    return place


@pytest.fixture
def here(files, tmp_path, monkeypatch):
    """The files, made current; results go to `out` beside them."""
    for path in files.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def failed(capsys, *arguments):
    """The error of a call that must fail, and that nothing was written by it."""
    before = sorted(Path().rglob("*"))
    assert main(["ghosts", *arguments]) == 2
    assert sorted(Path().rglob("*")) == before
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    return err


def test_find_writes_what_is_left_and_the_numbers(here, capsys):
    assert main(["ghosts", "find", "1_25m.txt", "2_45m.txt", "--out", "out", "--quiet"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith("2 signs")
    assert "2_45m" in out
    result = json.loads(Path("out/result.json").read_text())
    datasets = result["result"]["datasets"]
    assert [d["name"] for d in datasets] == ["1_25m", "2_45m"]
    for d in datasets:
        part = load_scan(f"out/{d['name']}_ghosts.pcd")
        assert np.count_nonzero(part.extra["Label"] == 1) == d["sign_echoes"] > 50
        assert np.count_nonzero(part.extra["Label"] == 2) == d["ghost_echoes"] > 50
    assert Path("out/report.html").read_text().startswith("<!doctype html>")
    assert list(Path("out/pictures").glob("*.png"))


def test_find_beside_what_the_model_shows(here, capsys):
    given = ["--ideal", "1_25m_ideal.txt", "--model", "SLIM.toml", "--json", "-"]
    assert main(["ghosts", "find", "1_25m.txt", *given]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert result["simulated"][0]["ghost_echoes"] == 0  # the model has no ghosts yet
    assert result["simulated"][0]["sign_echoes"] == pytest.approx(result["datasets"][0]["sign_echoes"], rel=0.1)


def test_find_beside_simulated_scans(here, capsys):
    assert main(["ghosts", "find", "1_25m.txt", "--simulated", "1_25m.txt"]) == 0
    row = next(line for line in capsys.readouterr().out.splitlines() if "ghost  AREA" in line)
    assert row.split()[-1] == "0.0"


def test_scans_of_one_name_get_numbers(here, capsys):
    Path("other").mkdir()
    Path("other/1_25m.txt").write_bytes(Path("1_25m.txt").read_bytes())
    assert main(["ghosts", "find", "1_25m.txt", "other/1_25m.txt", "--out", "out"]) == 0
    assert sorted(path.name for path in Path("out").glob("*.pcd")) == ["1_25m_1_ghosts.pcd", "1_25m_2_ghosts.pcd"]


def test_fit_writes_the_model_with_the_effect(here, capsys):
    scans, ideals = ["1_25m.txt", "2_45m.txt"], ["1_25m_ideal.txt", "2_45m_ideal.txt"]
    assert main(["ghosts", "fit", *scans, "--ideal", *ideals, "--model", "SLIM.toml", "--out", "out"]) == 0
    assert capsys.readouterr().out.startswith("retro_ghost: strength 0.000")
    text = Path("out/model.toml").read_text()
    assert text.startswith(Path("SLIM.toml").read_text().rstrip())
    effect = load_model("out/model.toml").effects[0]
    assert effect.strength == pytest.approx(2e-4, rel=0.05)
    assert effect.extra_m == pytest.approx(0.3, abs=0.01)
    parameters = json.loads(Path("out/result.json").read_text())["result"]["parameters"]
    assert parameters["exponent"]["low"] <= effect.exponent <= parameters["exponent"]["high"]
    # The fitted model shows what was measured.
    given = ["--ideal", "2_45m_ideal.txt", "--model", "out/model.toml", "--json", "-"]
    assert main(["ghosts", "find", "2_45m.txt", *given]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    real, simulated = result["datasets"][0]["signs"][0], result["simulated"][0]["signs"][0]
    assert simulated["ghost_area_median"] == pytest.approx(real["ghost_area_median"], rel=0.05)
    assert simulated["offset_m"] == pytest.approx(real["offset_m"], abs=0.03)


FIT = ("--ideal", "1_25m_ideal.txt", "--model", "SLIM.toml", "--out", "out")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("find", "smart.txt", "--model", "SLIM.toml"), "that is how SMART saturates, not SLIM"),
        (("find", "1_25m.txt", "--model", "SMART.toml"), "PEAK reaches 236"),
        (("find", "1_25m.txt", "--range-m", "45"), "there is no sign at 45 m"),
        (("find", "1_25m.txt", "--range-m", "0.1"), "use 0.5 to 300 m"),
        (("find", "1_25m.txt", "--range-m", "25", "45"), "1 scans and 2 ranges"),
        (("find", "1_25m.txt", "--bright", "0"), "--bright 0 is out of range"),
        (("find", "1_25m.txt", "--bright", "20000"), "no sign: the brightest of"),
        (("find", "1_25m.txt", "--ideal", "1_25m_ideal.txt"), "--ideal needs --model"),
        (("find", "1_25m.txt", "--ideal", "2_45m_ideal.txt", "--model", "SLIM.toml"), "sign of 160 beams at 45.00 m"),
        (("find", "1_25m.txt", "--simulated", "1_25m.txt", "2_45m.txt"), "1 scans and 2 files for --simulated"),
        (("find", "1_25m_ideal.txt"), "this is an ideal scan, not echoes"),
        (("find", "absent.txt"), "absent.txt"),
        (("find", "1_25m.txt", "--out", "1_25m.txt"), "is not a directory"),
        (("find", "1_25m.txt", "--out", "a/b"), "its directory does not exist"),
        (("fit", "1_25m.txt", "2_45m.txt", *FIT), "2 scans and 1 files for --ideal"),
        (("fit", "none.txt", "--ideal", "none_ideal.txt", *FIT[2:]), "no dataset has a ghost"),
        (("fit", "smart.txt", "--ideal", "smart_ideal.txt", *FIT[2:]), "SMART saturates"),
    ],
)
def test_what_is_refused(here, capsys, arguments, said):
    assert said in failed(capsys, *arguments)


def test_the_model_that_is_read_is_not_replaced(here, capsys):
    Path("SLIM.toml").rename("model.toml")
    said = failed(capsys, "fit", "1_25m.txt", "--ideal", "1_25m_ideal.txt", "--model", "model.toml", "--out", ".")
    assert "would replace a file of this command" in said


def test_a_scan_counts_once_in_a_fit(here, capsys):
    argv = ("1_25m.txt", "1_25m.txt", "--ideal", "1_25m_ideal.txt", "1_25m_ideal.txt", "--model", "SLIM.toml")
    assert "1_25m.txt is named twice" in failed(capsys, "fit", *argv, "--out", "out")


def test_one_distance_is_named_once(here, capsys):
    argv = ("1_25m.txt", "--ideal", "1_25m_ideal.txt", "--model", "SLIM.toml", "--out", "out", "-q")
    assert main(["ghosts", "fit", *argv]) == 0
    assert "exponent is not told by signs at 25.0 m: it was left" in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["find", "fit"])
def test_an_interrupt_while_the_pictures_are_drawn_leaves_nothing(here, verb, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("lidarcheck.figures.files.result_folder.draw_pictures", interrupted)
    argv = ("1_25m.txt", "--ideal", "1_25m_ideal.txt", "--model", "SLIM.toml", "--out", "out", "-q")
    assert main(["ghosts", verb, *argv]) == 130
    assert not Path("out").exists()


def test_find_shows_its_steps(here, capsys):
    assert main(["ghosts", "find", "1_25m.txt", "--steps"]) == 0
    out = capsys.readouterr().out
    assert "1_25m: step by step" in out
    assert "the search at twice the range" in out


def test_frames_of_a_merged_file_are_datasets_of_their_own(here, capsys):
    merge(["1_25m.txt", "2_45m.txt"], "drive.csv", number="frame_id", first=1)
    assert main(["ghosts", "find", "drive.csv", "--out", "out", "--quiet"]) == 0
    assert capsys.readouterr().out.startswith("2 signs")
    assert sorted(path.name for path in Path("out").glob("*.pcd")) == [
        "drive_000001_ghosts.pcd",
        "drive_000002_ghosts.pcd",
    ]
    assert main(["ghosts", "find", "1_25m.txt", "--out", "one", "--quiet"]) == 0
    merged, one = load_scan("out/drive_000001_ghosts.pcd"), load_scan("one/1_25m_ghosts.pcd")
    assert np.array_equal(merged.range_m, one.range_m)
    assert np.array_equal(merged.extra["Label"], one.extra["Label"])
