"""`lidarcheck sensor from`: what it writes is read again, and what it refuses leaves no file."""

import re

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.model.files.sensor_file import load_sensor
from sensor_import_kit import helios, hesai, imported, isaac, ouster, sensor, written


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_file_is_the_sensor_and_the_messages_say_what_it_lacks(here, capsys):
    file = written(here, "m.json", ouster())
    assert main(["sensor", "from", "m.json", "--out", "os1.toml"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert "os1.toml: written" in err
    assert "m.json does not say range.min_m, range.max_m, linear.signal_at_1m" in err
    own, expected = load_sensor("os1.toml"), sensor(imported(file))
    assert own.beams == expected.beams
    assert own.features == expected.features
    assert own.missing == ("signal_at_1m",)


def test_without_out_the_text_is_printed(here, capsys):
    written(here, "m.json", ouster())
    assert main(["sensor", "from", "m.json", "-q"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    (here / "printed.toml").write_text(out)
    assert load_sensor("printed.toml").beams.layers == 8


def test_a_table_of_beams_is_written_beside(here, capsys):
    written(here, "i.json", isaac(2))
    assert main(["sensor", "from", "i.json"]) == 2
    assert "give --out SENSOR.toml" in capsys.readouterr().err
    assert main(["sensor", "from", "i.json", "--out", "rotary.toml"]) == 0
    own, expected = load_sensor("rotary.toml"), sensor(imported(here / "i.json"))
    assert np.array_equal(own.beams.angles, expected.beams.angles)
    assert np.array_equal(own.beams.origins, expected.beams.origins)
    assert sorted(path.name for path in here.iterdir()) == ["i.json", "rotary.toml", "rotary_beams.csv"]


def test_what_is_needed_is_said_and_the_file_reads_once_it_is_there(here, capsys):
    written(here, "XT8.csv", hesai())
    assert main(["sensor", "from", "XT8.csv", "--out", "a.toml"]) == 0
    err = capsys.readouterr().err
    assert "does not say frame_rate_hz and beams.azimuth_step_deg: write it before the sensor file is used" in err
    text = (here / "a.toml").read_text()
    (here / "b.toml").write_text(re.sub(r"^# (frame_rate_hz|azimuth_step_deg)", r"\1", text, flags=re.MULTILINE))
    assert main(["sensor", "from", "XT8.csv", "--rate", "10", "--azimuth-step", "0.18", "--out", "c.toml"]) == 0
    assert load_sensor("b.toml").beams == load_sensor("c.toml").beams


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["m.json", "--out", "there.toml"], "error: there.toml: is there already"),
        (["m.json", "--out", "m.json"], "error: --out m.json is no TOML file"),
        (["m.json", "--out", "nowhere/a.toml"], "its directory does not exist"),
        (["m.json", "--rate", "0"], "error: --rate 0 is out of range"),
        (["m.json", "--rate", "10"], "error: --rate means nothing for Ouster metadata JSON"),
        (["gone.json"], "error: gone.json: there is no such file"),
        (["there.toml"], "error: there.toml: not a calibration that lidarcheck knows"),
        (["h.xml", "--model", "risley"], "give their directions with --pattern FILE"),
        (["i.json", "--out", "r.toml"], "error: r_beams.csv: is there already"),
    ],
)
def test_what_is_refused_leaves_no_file(here, capsys, arguments, said):
    written(here, "m.json", ouster())
    written(here, "h.xml", helios())
    written(here, "i.json", isaac(2))
    written(here, "r_beams.csv", "mine\n")
    written(here, "there.toml", "mine = 1\n")
    before = {path.name: path.read_bytes() for path in here.iterdir()}
    assert main(["sensor", "from", *arguments]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line
    assert {path.name: path.read_bytes() for path in here.iterdir()} == before


def test_a_file_that_describes_no_sensor_is_refused_before_it_is_written(here, capsys):
    document = isaac()
    document["profile"] |= {"nearRangeM": 50.0, "farRangeM": 20.0}
    written(here, "i.json", document)
    assert main(["sensor", "from", "i.json", "--out", "a.toml"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("error: i.json: no sensor: min_range_m = 50 is not below max_range_m = 20")
    assert not (here / "a.toml").exists()
