"""`lidarcheck sensor check` and `sensor guess`: exit codes, what is printed and written, and one line for bad input."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from lidarcheck.cli import main
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.table import Table
from lidarcheck.model.files.sensor_file import load_sensor
from sensor_beams import VLP16, Channels, document, shoot

BEAMS = replace(VLP16, fire_us=0.0, elevation=VLP16.elevation + 0.02 * np.arange(16))


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(name: str, *, ring: bool = True, every: int = 2, scale: float = 1.0, mirror: float = 1.0) -> None:
    shot = shoot(BEAMS, every=every, keep=0.9)
    columns = dict(zip("XYZ", (shot.position * [scale, scale * mirror, scale]).T, strict=True))
    if ring:
        columns |= {"Layer": shot.layer, "Point": shot.point}
    write_table(Table({name: np.ascontiguousarray(column) for name, column in columns.items()}), name)


def sensor_file(beams: Channels, name: str = "s.toml") -> None:
    Path(name).write_text(tomli_w.dumps(document(beams)), encoding="utf-8")


def test_a_scan_that_fits_ends_with_0_and_one_that_does_not_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    written("right.pcd")
    written("wrong.pcd", mirror=-1.0)
    sensor_file(BEAMS)
    assert main(["sensor", "check", "right.pcd", "--sensor", "s.toml"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("fits: 100.0 % of 12")
    assert "the worst 8 of 16 layers; --all shows all" in out
    assert main(["sensor", "check", "right.pcd", "--sensor", "s.toml", "--all"]) == 0
    assert "the worst" not in capsys.readouterr().out
    assert main(["sensor", "check", "wrong.pcd", "--sensor", "s.toml"]) == 1
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("does not fit: Y is mirrored")
    assert first.endswith('set handedness = "left" in the sensor\'s file')


def test_check_prints_json(capsys: pytest.CaptureFixture[str]) -> None:
    written("right.pcd")
    sensor_file(BEAMS)
    assert main(["sensor", "check", "right.pcd", "--sensor", "s.toml", "--json"]) == 0
    (frame,) = json.loads(capsys.readouterr().out)["frames"]
    assert (frame["verdict"], frame["share"], len(frame["layers"])) == ("fits", 1.0, 16)


def test_a_guess_is_a_sensor_file_that_its_scan_fits(capsys: pytest.CaptureFixture[str]) -> None:
    written("scan.pcd")
    assert main(["sensor", "guess", "scan.pcd", "--rate", "10", "--out", "guess.toml"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("16 rings by the column Layer; 12")
    assert "columns of 0.2 deg, 1800.000 a turn: they repeat" in out
    assert "turns to the right; column 0 looks at 0 deg" in out
    assert "guess.toml: written" in err
    guessed = load_sensor("guess.toml")
    assert guessed.beams.layers == 16
    assert guessed.missing == ("signal_at_1m",)
    assert main(["sensor", "check", "scan.pcd", "--sensor", "guess.toml"]) == 0
    assert main(["sensor", "guess", "scan.pcd", "--rate", "10", "--out", "guess.toml"]) == 2
    assert "guess.toml: is there already" in capsys.readouterr().err


def test_a_guess_from_x_y_z_alone_says_what_the_scans_do_not(capsys: pytest.CaptureFixture[str]) -> None:
    written("scan.csv", ring=False)
    assert main(["sensor", "guess", "scan.csv", "--json"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert np.allclose([ring["elevation_deg"] for ring in found["rings"]], BEAMS.elevation, atol=1e-3)
    assert (found["told_by"], found["turns"], found["frame_rate_hz"]) == ("elevations", "right", None)
    assert "the scans do not say frame_rate_hz" in err


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["guess", "few.csv"], "few.csv: 28 rows without a column of the rings are too few to show elevations; name"),
        (["guess", "mm.csv"], "mm.csv: X, Y, Z are not in m: the ranges fit in cm or mm; write them in m"),
        (
            ["guess", "right.csv", "--ring", "laser"],
            "right.csv: no column 'laser' with the rings; its columns are X, Y",
        ),
        (["guess", "right.csv", "right.csv"], "right.csv is named twice"),
        (["guess", "right.csv", "--out", "guess.txt"], "--out guess.txt is no TOML file; end its name in .toml"),
        (["guess", "right.csv", "--rate", "-1"], "--rate -1 is out of range"),
        (["check", "right.csv", "--sensor", "none.toml"], "none.toml: "),
        (["check", "flat.csv", "--sensor", "s.toml"], "flat.csv: no column Z: the beams are checked by X, Y, Z"),
        (
            ["check", "ring.csv", "--sensor", "s.toml"],
            "ring.csv: a row has ring 16, the sensor's 16 channels have 0 to",
        ),
        (
            ["check", "layer.csv", "--sensor", "s.toml"],
            "layer.csv: a row has Layer 99, the sensor's 16 channels have 0",
        ),
        (["guess", "nan.csv"], "nan.csv:3: "),
        (["check", "empty.csv", "--sensor", "s.toml"], "empty.csv: no row has an echo; give a scan with echoes"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    here: Path, capsys: pytest.CaptureFixture[str], command: list[str], said: str
) -> None:
    written("right.csv", ring=False)
    written("few.csv", ring=False, every=900)
    written("mm.csv", ring=False, scale=1000.0)
    shot = shoot(BEAMS, every=100)
    x, y, z = np.ascontiguousarray(shot.position.T)
    write_table(Table({"X": x, "Y": y}), "flat.csv")
    write_table(Table({"X": x, "Y": y, "Z": z, "ring": shot.layer + 1}), "ring.csv")
    write_table(Table({"X": x, "Y": y, "Z": z, "Layer": np.where(shot.layer == 3, 99, shot.layer)}), "layer.csv")
    write_table(Table({"X": x, "Y": y, "Z": z, "ring": np.where(np.arange(len(x)) == 1, 0.5, 1.0)}), "nan.csv")
    write_table(Table({"X": x * 0.0, "Y": x * 0.0, "Z": x * 0.0}), "empty.csv")
    sensor_file(BEAMS)
    before = sorted(here.iterdir())
    assert main(["sensor", *command]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert said in err
    assert sorted(here.iterdir()) == before
