"""`lidarcheck compare` of two scans: the verdict, what is written, and when it fails."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

from chance_kit import null
from lidarcheck.cli.core.entry import main
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import shipped


def moved(scan: Scan, gain: float) -> Scan:
    return Scan.from_beams(
        scan.layer, scan.point, scan.range_m, echo_number=scan.echo_number, width_ns=scan.width_ns,
        area=(scan.area * gain).round(), peak=scan.peak,
    )  # fmt: skip


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """A frame, one that is alike, and one with 10 % more AREA."""
    monkeypatch.chdir(tmp_path)
    (pair,) = null("plain", 2, 12, 480)
    save_ideal(pair.ideal, Path("ideal.parquet"))
    for name, scan in (("real", pair.measured), ("sim", pair.simulated), ("bright", moved(pair.measured, 1.1))):
        save_scan(scan, Path(f"{name}.parquet"))


def run(*words):
    return main(["compare", *words, "-q"])


def test_the_last_line_is_the_verdict(scans, capsys):
    assert run("real.parquet", "sim.parquet", "--ideal", "ideal.parquet", "--json", "k.json") == 0
    header, *lines = capsys.readouterr().out.splitlines()
    assert header.split() == ["KPI", "of", "value", "chance", "unit", "verdict", "measured", "simulated"]
    document = json.loads(Path("k.json").read_text())
    assert lines[-1] == document["chance"]["closing"]
    assert lines[-1].startswith("None of ")
    assert any(line.startswith("not judged, an exchange of the sides says nothing of it:") for line in lines)
    verdicts = [one for one in document["chance"]["kpis"] if not one["not_judged"]]
    assert len(verdicts) == document["chance"]["judged"]
    assert all(one["chance"] > 0.0 for one in verdicts)
    assert document["chance"]["exchanges"] == 499
    # The verdict stands within 80 columns, whatever follows.
    assert max(header.index("verdict") + len("stands out"), *map(len, lines[-6:])) <= 80


def test_what_differs_is_named(scans, capsys):
    assert run("bright.parquet", "sim.parquet", "--ideal", "ideal.parquet") == 0
    lines = capsys.readouterr().out.splitlines()
    assert " KPIs stand out from chance: AREA" in lines[-1]
    (area,) = [line for line in lines if line.split()[:2] == ["dvm_bias", "AREA"]]
    assert "stands out" in area


def test_out_holds_json_csv_and_the_picture(scans, capsys):
    assert run("bright.parquet", "sim.parquet", "--ideal", "ideal.parquet", "--out", "found", "--json", "k.json") == 0
    assert sorted(path.name for path in Path("found").iterdir()) == ["chance.svg", "kpis.csv", "result.json"]
    assert Path("found/result.json").read_text() == Path("k.json").read_text()
    document = json.loads(Path("k.json").read_text())
    rows = list(csv.DictReader(Path("found/kpis.csv").read_text(encoding="utf-8").splitlines()))
    assert {(row["kpi"], row["of"]) for row in rows} == {(o["kpi"], o["of"]) for o in document["chance"]["kpis"]}
    (ks,) = [row for row in rows if (row["kpi"], row["of"]) == ("ks", "AREA")]
    assert float(ks["value"]) == document["features"]["AREA"]["ks"]
    assert math.isfinite(float(ks["chance_95"]))
    picture = Path("found/chance.svg").read_text(encoding="utf-8")
    assert document["chance"]["closing"] in picture
    assert picture.count("stands out") == sum(o["stands_out"] for o in document["chance"]["kpis"])


@pytest.mark.parametrize(
    ("condition", "code"),
    [
        ("any", 1),
        ("dvm_bias:AREA>5", 1),
        ("dvm_bias:area > 5", 1),
        ("dvm_bias:AREA>5000", 0),
        ("ks>0.05", 1),
        ("ks>0.99", 0),
        ("detection_probability:80-90 m>0.9", 0),
    ],
)
def test_fail_on(scans, condition, code, capsys):
    command = ("bright.parquet", "sim.parquet", "--ideal", "ideal.parquet", "--fail-on", condition, "--json", "k.json")
    assert run(*command) == code
    (outcome,) = json.loads(Path("k.json").read_text())["fail_on"]
    assert outcome["met"] == bool(code)
    line = f"--fail-on {outcome['condition']}: {'met' if code else 'not met'}: {outcome['by']}"
    assert capsys.readouterr().out.splitlines()[-2] == line


def test_of_several_conditions_one_is_enough(scans, capsys):
    asked = ("--fail-on", "ks>0.99", "--fail-on", "dvm_bias:AREA>5")
    assert run("bright.parquet", "sim.parquet", *asked) == 1
    assert run("real.parquet", "sim.parquet", "--fail-on", "any", "--fail-on", "ks>0.99") == 0


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("wasserstien:AREA>1", "there is no KPI wasserstien; did you mean wasserstein?"),
        ("everything", "is no condition; write any, or KPI>NUMBER"),
        ("ks:AREA>much", "is no condition"),
        ("ks>1e999", "has no limit"),
        ("ks:ARAE>1", 'ks has no "ARAE"; did you mean AREA?'),
        ("walk_offset>1", "walk_offset was not compared; give --ideal"),
        ("ks:range_residual>1", "range_residual was not compared: needs the ideal scan"),
        ("ghost:count_ratio>1", "ghost was not compared: need the ideal scan and a model"),
    ],
)
def test_a_condition_that_cannot_be_checked_is_refused(scans, condition, words, capsys):
    assert run("real.parquet", "sim.parquet", "--fail-on", condition, "--out", "found") == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.startswith("error: --fail-on ")
    assert len(error.splitlines()) == 1
    assert not Path("found").exists()


def test_any_needs_something_that_is_judged(scans, capsys):
    for name in ("real", "sim"):
        from lidarcheck.formats import load_scan

        scan = load_scan(Path(f"{name}.parquet"))
        save_scan(scan.take(scan.point < 16), Path(f"few_{name}.parquet"))
    assert run("few_real.parquet", "few_sim.parquet", "--fail-on", "any") == 2
    assert "no KPI could be judged; compare more beams or frames" in capsys.readouterr().err
    assert run("few_real.parquet", "few_sim.parquet") == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("No KPI could be judged: ")


def test_features_and_beams_of_a_named_sensor(tmp_path, monkeypatch, capsys):
    """A feature of its own name, on beams whose origins turn with the head; files that its beams alone explain."""
    monkeypatch.chdir(tmp_path)
    sensor = shipped("OS1-128")
    layer, point = (grid.ravel() for grid in np.meshgrid(np.arange(0, 128, 8), np.arange(192), indexing="ij"))
    n, rng = len(layer), np.random.default_rng(4)
    distance_m = 8.0 + 0.02 * point
    save_ideal(IdealScan(layer, point, distance_m, np.ones(n), np.zeros(n), beams=sensor.beams), Path("ideal.parquet"))
    for name, gain in (("real", 1.2), ("sim", 1.0), ("again", 1.0)):
        value = np.rint(gain * rng.normal(60.0, 4.0, n))
        range_m = distance_m + sensor.beams.range_offset_m(layer) + 0.008 * rng.integers(-1, 2, n)
        features = {"REFLECTIVITY": value, "AMBIENT": np.rint(rng.normal(20.0, 3.0, n))}
        number = np.ones(n, dtype=np.int32)
        scan = Scan.from_beams(layer, point, range_m, echo_number=number, features=features, beams=sensor.beams)
        save_scan(scan, Path(f"{name}.parquet"))
    options = ("--sensor", "OS1-128", "--ideal", "ideal.parquet", "--json", "k.json")
    assert run("real.parquet", "sim.parquet", *options, "--fail-on", "dvm_bias:REFLECTIVITY>6") == 1
    assert capsys.readouterr().out.splitlines()[-1].endswith("stand out from chance: REFLECTIVITY.")
    document = json.loads(Path("k.json").read_text())
    assert list(document["features"]) == ["range_residual", "REFLECTIVITY", "AMBIENT"]
    assert document["features"]["REFLECTIVITY"]["dvm_bias"] == pytest.approx(12.0, abs=0.5)
    assert abs(document["features"]["range_residual"]["mean_measured"]) < 0.002
    assert document["direction"]["azimuth"]["bias_measured"] == 0.0
    assert run("again.parquet", "sim.parquet", *options, "--fail-on", "any") == 0
    assert run("real.parquet", "sim.parquet", "--sensor", "OS1") == 2
    assert "there is no sensor variant 'OS1'" in capsys.readouterr().err
    Path("model.toml").write_text('variant = "OS1-128"\n', encoding="utf-8")
    assert run("real.parquet", "sim.parquet", "--sensor", "OS1-128", "--model", "model.toml") == 2
    assert "give one of them" in capsys.readouterr().err
