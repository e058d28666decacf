"""`lidarcheck sensor show` and `list`: what a sensor file says, in words, numbers and pictures."""

import json
from importlib import resources
from pathlib import Path

import pytest

from lidarcheck.cli import main
from lidarcheck.figures.pages.sensor import document, page
from lidarcheck.sensor import shipped, shipped_names


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def out_of(capsys, *arguments):
    assert main(["sensor", *arguments]) == 0
    return capsys.readouterr().out


def test_every_shipped_sensor_is_listed_with_its_rate(capsys):
    lines = out_of(capsys, "list").splitlines()
    assert [line.split()[0] for line in lines[1:]] == list(shipped_names())
    assert "640,000" in next(line for line in lines if line.startswith("XT32"))
    facts = json.loads(out_of(capsys, "list", "--json"))
    assert {fact["name"]: fact["beams_a_second"] for fact in facts}["OS1-128"] == 1310720.0
    assert all(fact["source"] for fact in facts)


def test_the_tables_say_what_the_file_says(capsys):
    text = " ".join(out_of(capsys, "show", "VLP-16", "--no-plot").split())
    for part in (
        "16 layers x 1809 points, 28,935 beams a frame, 289,352 a second, from 0.4 to 100 m",
        "Columns do not repeat",
        "from column to column 55.296 us",
        "fire time turns the azimuth yes",
        "threshold 5.84 amplitude",
        "duplicate_return repeat",
        "INTENSITY calibrated_reflectivity, knee 100 1 255 intensity",
        "ros-drivers/velodyne",
    ):
        assert part in text
    # 0.1 K / T of the description: detected in half of the shots where S is the threshold.
    assert "A white surface of 10 % is detected in half of the shots at 88.85 m." in text
    assert "┤" not in text


def test_the_pattern_is_drawn_in_the_terminal(capsys):
    text = out_of(capsys, "show", "XT32")
    assert "16 columns in the middle" in text
    assert "A whole frame" in text
    assert "Firing within a column" in text


@pytest.mark.parametrize("name", shipped_names())
def test_every_shipped_sensor_is_shown(name, capsys):
    text = out_of(capsys, "show", name, "--no-plot")
    sensor = shipped(name)
    assert all(fact.split(",")[0] in text for fact in sensor.source)
    assert all(feature.name in text for feature in sensor.features)
    assert ("no pattern" in text) == (name == "Livox")


def test_json_has_the_numbers_of_each_channel(capsys):
    found = json.loads(out_of(capsys, "show", "OS1-128", "--json"))
    beams = shipped("OS1-128").beams
    assert found["beams"]["of_layer"]["azimuth_offset_deg"] == list(beams.channels.azimuth_offset_deg)
    assert found["beams"]["beams_a_frame"] == 128 * 1024
    assert found["beams"]["elevation_deg"] == [-21.95, 20.47]
    assert found["numbers"]["noise"] == 4.0
    assert found["numbers"]["saturation"] is None
    assert found["words"]["range_law"] == "physical"
    assert [feature["law"] for feature in found["features"]] == ["calibrated_reflectivity", "background"]
    assert found["missing"] == []


def test_what_is_missing_for_simulate_is_said_first(here, capsys):
    text = resources.files("lidarcheck").joinpath("sensors/XT32.toml").read_text(encoding="utf-8")
    Path("mine.toml").write_text(text.replace("signal_at_1m = 461000, ", ""))
    shown = out_of(capsys, "show", "mine.toml", "--no-plot")
    assert "Missing for simulate: linear.signal_at_1m. Write it into the file, or into a model's [sensor]." in shown
    assert "detected in half" not in shown
    assert json.loads(out_of(capsys, "show", "mine.toml", "--json"))["missing"] == ["signal_at_1m"]


@pytest.mark.parametrize(("suffix", "begins"), [(".png", b"\x89PNG"), (".svg", b"<svg"), (".html", b"<!")])
def test_pictures_are_written(here, suffix, begins, capsys):
    out_of(capsys, "show", "TMF8820", "--no-plot", "--out", f"a{suffix}")
    assert Path(f"a{suffix}").read_bytes().lstrip().lower().startswith(begins.lower())


def test_figures_show_the_beams_themselves():
    sensor = shipped("VLP-16")
    figures = page(sensor).figures()
    block, frame, spacing, firing = figures
    assert len(block.curves[0].x) == 16 * 16
    assert sorted(set(block.curves[0].y)) == list(range(-15, 16, 2))
    assert 10_000 < len(frame.curves[0].x) <= 20_000
    assert set(spacing.curves[0].y) == {2.0}
    assert dict(zip(firing.curves[0].y, firing.curves[0].x, strict=True))[15.0] == pytest.approx(34.56)
    assert all(curve.dots for figure in figures for curve in figure.curves)
    assert page(shipped("Livox")).figures() == ()


def test_what_cannot_be_shown_is_one_line(here, capsys):
    Path("mine.toml").write_text("name = 3\n")
    for arguments, says in (
        (["XT33"], "did you mean XT32?"),
        (["gone.toml"], "gone.toml: there is no such file"),
        (["XT32", "--out", "a.jpg"], "--out a.jpg is no name of a picture"),
        (["Livox", "--out", "a.png"], "no beams of its own to draw"),
        (["mine.toml", "--out", "mine.toml"], "--out mine.toml is no name of a picture"),
    ):
        assert main(["sensor", "show", *arguments]) == 2
        said = capsys.readouterr()
        assert says in said.err
        assert said.err.count("\n") == 1
        assert not Path("a.png").exists()


def test_no_number_of_the_document_is_lost():
    found = document(shipped("TMF8820"))
    assert found["numbers"]["bin_ns"] == 0.26
    assert found["words"]["readout"] == "first"
    assert found["timing"]["order"] == "flash"
