"""docs/sensors.md names every key with its default; docs/adapt-sensor.md runs as it stands."""

import csv
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_ideal
from lidarcheck.model import load_model
from lidarcheck.model.files.sensor_file import load_sensor
from lidarcheck.sensor import schema, shipped_names
from lidarcheck.sensor.feature import LAWS

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/sensors.md").read_text(encoding="utf-8")
ADAPT = (ROOT / "docs/adapt-sensor.md").read_text(encoding="utf-8")


def section(title):
    return PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]


def cells(text):
    """The rows of a page's tables, cell by cell."""
    rows = [line.strip()[1:-1] for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row.split("|")] for row in rows]


def keys_of(text):
    """The keys that the first cells of a page's tables name."""
    return {key for row in cells(text) for key in re.findall(r"`([a-z_0-9]+)`", row[0])}


TABLES = {"The sensor": schema._Own, "`[beams]`: where the beams look": schema.BeamsTable,
          "`[sweep]`: when they are fired": schema.SweepTable, "`[range]`: the gate": schema._RangeTable}  # fmt: skip


@pytest.mark.parametrize("title", TABLES)
def test_every_key_of_a_table_is_told(title):
    known = set(TABLES[title].model_fields) - {"beams", "sweep", "range", "features", "materials"}
    told = keys_of(section(title))
    assert known - told == set()
    assert told - known - {"Layer", "Point", "time_s"} == set()


def as_written(default):
    """A default as a TOML file spells it."""
    if isinstance(default, bool):
        return str(default).lower()
    return f'"{default}"' if isinstance(default, str) else str(default)


@pytest.mark.parametrize("title", ["The sensor", "`[sweep]`: when they are fired"])
def test_plain_defaults_are_those_of_the_schema(title):
    fields = TABLES[title].model_fields
    defaults = {key: field.default for key, field in fields.items() if isinstance(field.default, bool | int | str)}
    expected = {key: as_written(default) for key, default in defaults.items() if default != ""}
    told = {key: row[2].split(",")[0].strip("`") for row in cells(section(title)) for key in keys_of(f"| {row[0]} |")}
    assert {key: told[key] for key in expected} == expected
    assert len(expected) >= 3


def test_every_number_of_every_detector_is_told_with_its_default():
    text = section("`[spad_array]`, `[linear]`, `[photon_histogram]`: the detector")
    rows = {row[0].strip("`"): row for row in cells(text)}
    for name, kind in schema.DETECTORS.items():
        required, others = rows[name][1], rows[name][2]
        for key in schema._DETECTOR_TABLES[name].model_fields:
            known = kind.__dataclass_fields__[key]
            if f"`{key}`" in required:
                assert key in kind.numbers()
                continue
            assert f"`{key}`" in others, key
            default = {"pulse_fwhm_ns": {"photon_histogram": 1}.get(name, 5)}.get(key, known.default)
            if isinstance(default, int | float) and not isinstance(default, bool) and key != "columns":
                assert f"`{key}` {default:g}" in others, key


def test_every_law_is_told_with_its_numbers():
    text = section("`[features.NAME]`: what is reported of an echo")
    for law, numbers in LAWS.items():
        row = next(row for row in cells(text) if f"`{law}`" in row[0] and len(row) == 2)
        assert all(f"`{number}`" in row[1] for number in numbers)
    assert set(schema.FeatureTable.model_fields) - set(re.findall(r"`([a-z_]+)`", text)) == set()


def test_every_shipped_sensor_is_told():
    text = section("The sensors that come with lidarcheck")
    told = {name.strip() for row in cells(text) for name in row[0].split(",")}
    assert set(shipped_names()) <= told


def test_the_files_of_the_page_are_read(tmp_path):
    whole, model = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "r16.toml").write_text(whole, encoding="utf-8")
    assert load_sensor(tmp_path / "r16.toml").missing == ()
    (tmp_path / "model.toml").write_text(model, encoding="utf-8")
    sensor = load_model(tmp_path / "model.toml").sensor
    assert (sensor.threshold, sensor.max_echoes, sensor.max_range_m) == (7.0, 1, 60.0)


def write_cloud(place):
    """A frame of the data sheet's sensor in a room, by the data sheet alone: x, y, z, ring, time."""
    ring = np.tile(np.arange(16), 1800)
    column = np.repeat(np.arange(1800), 16)
    time_s = column * 0.1 / 1800 + ring * 3e-6
    azimuth = np.deg2rad(180.0 - 3600.0 * time_s)
    elevation = np.deg2rad(-15.0 + 2.0 * ring)
    u = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1)
    range_m = np.round((np.array([9.0, 7.0, 3.0]) / np.maximum(np.abs(u), 1e-9)).min(axis=1) / 0.002) * 0.002
    xyz = u * range_m[:, None]
    with place.open("w", encoding="utf-8") as file:
        file.write("x,y,z,intensity,ring,time\n")
        for (x, y, z), r, t in zip(xyz.tolist(), ring.tolist(), time_s.tolist(), strict=True):
            file.write(f"{x:.5f},{y:.5f},{z:.5f},20,{r},{t:.7f}\n")


def test_a_sensor_is_adapted_as_the_page_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_cloud(tmp_path / "cloud.csv")
    for name, text in re.findall(r"```toml (\S+)\n(.*?)```", ADAPT, re.DOTALL):
        (tmp_path / name).write_text(text, encoding="utf-8")
    commands = [line.strip() for line in ADAPT.splitlines() if line.startswith("    lidarcheck ")]
    assert len(commands) == 7
    said = {}
    for command in commands:
        assert main(shlex.split(command)[1:]) == 0, (command, capsys.readouterr())
        said[command] = capsys.readouterr().out
    assert "28,800 beams a frame, 288,000 a second" in said["lidarcheck sensor show mine.toml"]
    assert "100.0 % on their beams" in said["lidarcheck sensor check cloud.csv --sensor mine.toml"]
    guessed = load_sensor("guess.toml").beams.channels
    assert np.abs(np.array(guessed.elevation_deg) - np.arange(-15.0, 16.0, 2.0)).max() < 0.01
    ideal = load_ideal("ideal.parquet", load_sensor("mine.toml"))
    assert len(ideal) == 16 * 1800
    with Path("frame.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {"X", "Y", "Z", "Layer", "Point", "EchoNumber", "INTENSITY"} <= set(rows[0])
    floor = [row for row in rows if abs(float(row["Z"]) + 1.8) < 0.05]
    assert len(floor) > 3000
