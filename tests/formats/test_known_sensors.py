"""Which shipped sensor made a scan, and what a guess supposes of its columns."""

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats.guess.features import guess_features, guess_returns
from lidarcheck.formats.guess.known import known_sensors
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.table import Table
from lidarcheck.model.files.sensor_file import load_sensor
from places import shared_path
from recording_kit import write_frame


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("reference_frames/SLIM_sign_echoes.txt", "SLIM"),
        ("reference_frames/SMART_lab_echoes.txt", "SMART"),
        ("reference_frames_any/xt32/echoes.csv", "XT32"),
        ("reference_frames_any/os1_128/echoes.csv", "OS1-128"),
    ],
)
def test_a_shipped_sensor_is_known_by_its_frame(file, name):
    assert [one for one, _ in known_sensors(read_table(shared_path(f"data/{file}")))] == [name]


def test_a_unit_with_angles_of_its_own_is_not_taken_for_its_model():
    assert known_sensors(read_table(shared_path("data/hesai_xt32/rotation_0.parquet"))) == []


def table(**columns):
    n = len(next(iter(columns.values())))
    return Table({**{name: np.ones(n) for name in "XYZ"}, **{k: np.asarray(v) for k, v in columns.items()}})


def test_columns_are_supposed_by_their_values():
    found, remarks = guess_features(
        [table(INTENSITY=[1, 200], SIGNAL=[5, 4000], REFLECTIVITY=[0.1, 0.7]), table(INTENSITY=[3, 9], SIGNAL=[1, 2])]
    )
    assert found == {
        "INTENSITY": {"law": "calibrated_reflectivity", "bits": 8},
        "SIGNAL": {"law": "affine", "bits": 16},
    }
    assert ["supposed" in one for one in remarks] == [True, True, True]
    assert guess_features([table(INTENSITY=[7, 7])]) == ({}, ())
    assert guess_returns([table(EchoNumber=[1, 2]), table(EchoNumber=[1, 1])]) == 2
    assert guess_returns([table(EchoNumber=[0, 1])]) == 2
    assert guess_returns([table(INTENSITY=[1])]) == 1


def test_a_guess_is_a_sensor_that_reads_the_frames(tmp_path, monkeypatch, capsys):
    """Layers without a row have a place all the same: what a file numbers is the channel."""
    monkeypatch.chdir(tmp_path)
    write_frame(tmp_path / "f.csv", 1)
    lines = (tmp_path / "f.csv").read_text().splitlines()
    kept = [lines[0], *(line for line in lines[1:] if line.split(",")[3] not in ("0", "7"))]
    (tmp_path / "f.csv").write_text("\n".join(kept) + "\n")
    assert main(["sensor", "guess", "f.csv", "--rate", "10", "--features", "--out", "s.toml"]) == 0
    sensor = load_sensor("s.toml")
    assert np.abs(np.array(sensor.beams.channels.elevation_deg) - np.linspace(-15, 15, 16)).max() < 0.01
    assert [feature.name for feature in sensor.features] == ["INTENSITY"]
    assert any("INTENSITY is supposed to be a calibrated reflectivity" in text for text in sensor.source)
    capsys.readouterr()
    assert main(["sensor", "check", "f.csv", "--sensor", "s.toml"]) == 0
    assert "100.0 % on their beams" in capsys.readouterr().out
