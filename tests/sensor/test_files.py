"""Sensor files with faults: each is one line, with the file and the line that holds what is wrong."""

import numpy as np
import pytest

from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.model import load_model
from lidarcheck.model.chain import check_complete
from lidarcheck.model.files.sensor_file import load_sensor

GOOD = """\
name = "mine"
source = "a note"
detector = "linear"
frame_rate_hz = 10
[sweep]
direction = "left"
[range]
max_m = 100
[linear]
signal_at_1m = 1e5
[beams]
kind = "channels"
elevation_deg = [1, 0, -1]
fire_time_us = [0, 1, 2]
columns = 100
[features]
I = {law = "log", bits = 8}
"""
GRID = GOOD.replace('kind = "channels"', 'kind = "grid"\nlayers = 16\npoints = 1000').replace(
    "elevation_deg = [1, 0, -1]\nfire_time_us = [0, 1, 2]\ncolumns = 100",
    "elevation_deg = {first = -15, step = 2}\nazimuth_deg = {first = -180, step = 0.36}",
)
TABLE = GOOD.replace('kind = "channels"', 'kind = "table"\nfile = "beams.csv"').replace(
    "elevation_deg = [1, 0, -1]\nfire_time_us = [0, 1, 2]\ncolumns = 100\n", ""
)
HEAD = "Layer,Point,elevation_deg,azimuth_deg\n"
RADIANS = str([round(-0.26 + 0.035 * k, 4) for k in range(16)])


def said(tmp_path, text):
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    with pytest.raises((ConfigError, InputError)) as caught:
        load_sensor(tmp_path / "mine.toml")
    (line,) = caught.value.lines()
    assert "; " in line
    return line.replace(f"{tmp_path}/", "")


@pytest.mark.parametrize("text", [GOOD, GRID], ids=["channels", "grid"])
def test_without_a_fault_the_file_is_read(tmp_path, text):
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    assert load_sensor(tmp_path / "mine.toml").name == "mine"


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        # Lists of the wrong length or all zero.
        ("[0, 1, 2]", "[0, 1]", 14, "beams.fire_time_us has 2 values, elevation_deg has 3"),
        ("[1, 0, -1]", "[0, 0, 0]", 13, "beams.elevation_deg is 0 throughout"),
        ("[1, 0, -1]", "[]", 13, "beams.elevation_deg is empty"),
        ("[1, 0, -1]", "5", 13, "beams.elevation_deg = 5 is a whole number"),
        ("columns = 100", "columns = 100\nring = [0, 1]", 16, "beams.ring has 2 values"),
        ("columns = 100", "columns = 100\nring = [0, 1, 1]", 16, "beams.ring needs 3 numbers, each once"),
        # Angles in the wrong unit.
        ("[1, 0, -1]\nfire_time_us = [0, 1, 2]", RADIANS, 13, "these look like radians"),
        ("[1, 0, -1]", "[1, 0, -91]", 13, "beams.elevation_deg[2] = -91 is out of range"),
        # Unknown keys, two tables for one detector.
        ("direction =", "directon =", 6, "unknown key sweep.directon; did you mean direction?"),
        ("source =", "sorce =", 2, "unknown key sorce; did you mean source?"),
        ("bits = 8", "bit = 8", 17, "unknown key features.I.bit; did you mean bits?"),
        ("[features]", "[spad_array]\nspads = 3\n[features]", 16, '[spad_array] stands beside detector = "linear"'),
        ("[linear]", "[photon_histogram]", 9, '[photon_histogram] stands beside detector = "linear"'),
        ('"linear"', '"lineer"', 3, 'did you mean "linear"?'),
        # What does not fit together.
        ("columns = 100", "columns = 100\nazimuth_step_deg = 1", 15, "azimuth_step_deg, and has both"),
        ("columns = 100", "azimuth_step_deg = 0.7", 15, "gives 514.286 columns"),
        ("columns = 100", "columns = 100\nazimuth_deg = {first = 0, last = -360}", 16, "let last be 360"),
        ("columns = 100", "columns = 100\nazimuth_deg = {first = 0, last = 400}", 16, "spans 400 degrees"),
        ("columns = 100", "columns = 100\nlayers = 3", 16, 'beams.layers means nothing with kind = "channels"'),
        ("max_m = 100", "max_m = 100\nmin_m = 200", 9, "range.min_m = 200 is not below range.max_m = 100"),
        ('"log"', '"logg"', 17, "there is no law 'logg'; did you mean log?"),
        ("bits = 8", "bits = 8, knee = 3", 17, "knee means nothing to the law log"),
        ('"log"', '"attenuation"', 17, "the law attenuation needs per_m"),
        ("bits = 8", "min = 3, max = 2", 17, "min = 3 is not below max = 2"),
        ("frame_rate_hz = 10", 'frame_rate_hz = 10\nkeep = "first_last"', 5, "keeps two echoes, returns = 1"),
        ("signal_at_1m = 1e5", 'signal_at_1m = 1e5\nrange_law = "powr"', 11, 'did you mean "power"?'),
        ('name = "mine"\n', "", 1, "name is missing"),
    ],
)  # fmt: skip
def test_a_fault_of_a_sensor_file_is_one_line_with_its_place(tmp_path, old, new, line, says):
    assert GOOD.count(old) >= 1
    found = said(tmp_path, GOOD.replace(old, new, 1))
    assert found.startswith(f"error: mine.toml:{line}: ")
    assert says in found


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("layers = 16\n", "", 11, "beams.layers is missing"),
        ("{first = -15, step = 2}", "{first = -15, step = 20}", 15, "the last of 16 layers is 285 degrees steep"),
        ("{first = -15, step = 2}", "{first = -15, step = 0}", 15, "step is 0"),
        ("{first = -180, step = 0.36}", "{first = -180}", 16, "beams.azimuth_deg has no step"),
        (
            "{first = -15, step = 2}\nazimuth_deg = {first = -180, step = 0.36}",
            "{first = -0.26, step = 0.035}\nazimuth_deg = {first = -3.1416, step = 0.00628}",
            16,
            "these look like radians; write degrees",
        ),
    ],
)
def test_a_fault_of_a_grid_is_one_line_with_its_place(tmp_path, old, new, line, says):
    found = said(tmp_path, GRID.replace(old, new, 1))
    assert found.startswith(f"error: mine.toml:{line}: ")
    assert says in found


def rows(*beams):
    return HEAD + "".join(f"{row}\n" for row in beams)


@pytest.mark.parametrize(
    ("beams", "line", "says"),
    [
        # Holes.
        (rows("0,0,1,2", "0,2,1,3"), 3, "Layer 0 has a Point 2, but no Point 1"),
        (rows("0,0,1,2", "2,0,1,3"), 3, "there is no Layer 1 before it"),
        (rows("0,0,1,2", "0,50000,1,3"), 3, "more holes than beams"),
        # Two rows for one beam.
        (rows("0,0,1,2", "0,1,1,3", "0,0,1,4"), 4, "Layer 0, Point 0 is there a second time, after row 1"),
        # Numbers that are none.
        (rows("0,0,1,2", "0,1,nan,3"), 3, "elevation_deg is no number"),
        (rows("0,0,1,2", "0,1,x,3"), 3, "'elevation_deg' is 'x', not a number"),
        (rows("0,0,1,2", "0,1.5,1,3"), 3, "Point is no whole number from 0"),
        (rows("0,0,1,2", "-1,1,1,3"), 3, "Layer is no whole number from 0"),
        (rows("0,0,1,2", "0,1,100,3"), 3, "elevation_deg lies beyond -90 to 90 degrees"),
        # Columns.
        (HEAD.replace(",azimuth_deg", "") + "0,0,1\n", 1, "the beam table has no column azimuth_deg"),
        (HEAD.replace("\n", ",tim_s\n") + "0,0,1,2,3\n", 1, "has no column 'tim_s'; did you mean time_s?"),
        # The wrong unit, nothing at all.
        (
            rows(*(f"{i},{j},{-0.4 + 0.025 * i},{-3.1 + 0.062 * j}" for i in range(32) for j in range(100))),
            1,
            "these look like radians",
        ),
        (rows(*(f"0,{j},0,0" for j in range(9))), 1, "all angles of the beam table are 0"),
    ],
)  # fmt: skip
def test_a_fault_of_a_beam_table_is_one_line_of_that_table(tmp_path, beams, line, says):
    (tmp_path / "beams.csv").write_text(beams, encoding="utf-8")
    found = said(tmp_path, TABLE)
    assert found.startswith(f"error: beams.csv:{line}: ")
    assert says in found


def test_an_empty_table_and_a_missing_one_are_named(tmp_path):
    (tmp_path / "beams.csv").write_text(HEAD, encoding="utf-8")
    assert said(tmp_path, TABLE).startswith("error: beams.csv: ")
    assert said(tmp_path, TABLE.replace("beams.csv", "gone.csv")).startswith("error: gone.csv: there is no such file")


def test_a_beam_table_of_parquet_names_the_row(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {"Layer": [0, 0], "Point": [0, 0], "elevation_deg": [1.0, 2.0], "azimuth_deg": [0.0, 1.0]}
    pq.write_table(pa.table(columns), tmp_path / "beams.parquet")
    found = said(tmp_path, TABLE.replace("beams.csv", "beams.parquet"))
    assert found.startswith("error: beams.parquet: row 2: Layer 0, Point 0 is there a second time")


def test_a_good_beam_table_is_read_in_any_order_of_rows(tmp_path):
    (tmp_path / "beams.csv").write_text(rows("1,0,5,6", "0,1,3,4", "0,0,1,2"), encoding="utf-8")
    (tmp_path / "mine.toml").write_text(TABLE, encoding="utf-8")
    beams = load_sensor(tmp_path / "mine.toml").beams
    elevation, azimuth = beams.angles_deg([0, 0, 1], [0, 1, 0])
    assert np.array_equal(elevation, [1.0, 3.0, 5.0])
    assert np.array_equal(azimuth, [2.0, 4.0, 6.0])


LISTS = "elevation_deg,fire_time_us,ring\n5,0,2\n-5,1,0\n0,2,1\n"
FROM_FILE = GOOD.replace("elevation_deg = [1, 0, -1]\nfire_time_us = [0, 1, 2]", 'file = "lists.csv"')


def test_lists_of_channels_may_stand_in_a_file(tmp_path):
    (tmp_path / "lists.csv").write_text(LISTS, encoding="utf-8")
    (tmp_path / "mine.toml").write_text(FROM_FILE, encoding="utf-8")
    channels = load_sensor(tmp_path / "mine.toml").beams.channels
    assert channels.elevation_deg == (5.0, -5.0, 0.0)
    assert channels.fire_time_us == (0.0, 1.0, 2.0)
    assert channels.ring == (2, 0, 1)


@pytest.mark.parametrize(
    ("old", "new", "place", "says"),
    [
        ("-5,1,0", "-95,1,0", "lists.csv:3", "elevation_deg = -95"),
        ("-5,1,0", "-5,1,0.5", "lists.csv:3", "ring = 0.5; use a whole number"),
        ("-5,1,0", "-5,nan,0", "lists.csv:3", "fire_time_us = nan"),
        ("ring", "rings", "lists.csv:1", "there is no list 'rings' of channels"),
        ("0,2,1", "0,2,2", "mine.toml:11", "beams.ring needs 3 numbers, each once"),
    ],
)
def test_a_fault_of_a_file_of_lists_is_one_line(tmp_path, old, new, place, says):
    (tmp_path / "lists.csv").write_text(LISTS.replace(old, new), encoding="utf-8")
    found = said(tmp_path, FROM_FILE)
    assert found.startswith(f"error: {place}: ")
    assert says in found


def test_a_list_is_given_once(tmp_path):
    (tmp_path / "lists.csv").write_text(LISTS, encoding="utf-8")
    found = said(tmp_path, FROM_FILE.replace("columns = 100", "columns = 100\nfire_time_us = 3"))
    assert found.startswith("error: mine.toml:15: beams.fire_time_us stands in the sensor file and in lists.csv")


@pytest.mark.parametrize(
    ("overrides", "line", "says"),
    [
        ("[sensor.beams]\ncolumns = 10\nazimuth_step_deg = 3\n", 5, "and has both"),
        ("[sensor]\nthreshold = 3\n[sensor.range]\nmin_m = 500\n", 7, "is not below"),
        ("[sensor]\nmax_range_m = 3\n[sensor.range]\nmax_m = 50\n", 7, "max_range_m and range.max_m are one number"),
        ("[sensor.features.I]\nlaw = 'x'\n", 5, "there is no law 'x'"),
        ("[sensor]\nnear_m = 3\nthreshold = -3\n", 6, "threshold = -3 is out of range"),
        ("[sensor.beams]\nfire_time_us = [1, 2]\n", 5, "has 2 values"),
    ],
)
def test_a_fault_of_a_models_override_is_one_line_of_the_model(tmp_path, overrides, line, says):
    (tmp_path / "mine.toml").write_text(GOOD, encoding="utf-8")
    model = tmp_path / "model.toml"
    model.write_text('variant = "mine.toml"\n[materials.1]\nreflectance = 0.5\n' + overrides, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_model(model)
    (found,) = caught.value.lines()
    assert found.startswith(f"error: {model}:{line}: ")
    assert says in found


def test_a_fault_of_the_sensor_file_is_named_there_when_a_model_is_read(tmp_path):
    (tmp_path / "mine.toml").write_text(GOOD.replace("[0, 1, 2]", "[0, 1]"), encoding="utf-8")
    model = tmp_path / "model.toml"
    model.write_text('variant = "mine.toml"\n', encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_model(model)
    (found,) = caught.value.lines()
    assert found.startswith(f"error: {tmp_path / 'mine.toml'}:14: ")


def test_what_a_calibration_does_not_say_is_missing_until_something_is_simulated(tmp_path):
    text = GOOD.replace("columns = 100\n", "").replace("frame_rate_hz = 10\n", "")
    (tmp_path / "sensor.toml").write_text(text, encoding="utf-8")
    sensor = load_sensor(tmp_path / "sensor.toml")
    assert set(sensor.missing) >= {"beams.columns", "frame_rate_hz"}
    with pytest.raises(UsageError, match=r"lacks .*frame_rate_hz"):
        check_complete(sensor)
