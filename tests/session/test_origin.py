"""What a command's results say that they were computed from, and what is said when that is not there any more."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from bench_kit import make_bench
from lidarcheck.cli import main
from lidarcheck.errors import InputError
from lidarcheck.formats import load_scan, save_scan
from lidarcheck.formats.source import read_source
from lidarcheck.reading import reading
from lidarcheck.session.origin import changed_since, origin
from lidarcheck.session.own_files import content_hash

REAL, SIM, IDEAL = "car_16m_SMART_real.pcd", "car_16m_SMART_sim.pcd", "ideal_car_16m.parquet"


@pytest.fixture
def bench(tmp_path, monkeypatch):
    root = make_bench(tmp_path / "bench")
    monkeypatch.chdir(root)
    return root


def compared(*words):
    assert main(["compare", REAL, SIM, "--ideal", IDEAL, *words, "--json", "out.json"]) == 0
    return json.loads(Path("out.json").read_text())["computed_from"]


def test_compare_says_what_it_read(bench):
    found = compared()
    assert found["files"] == {name: content_hash((bench / name).read_bytes()) for name in (REAL, SIM, IDEAL)}
    assert found["asked"] == ["compare", REAL, SIM, "--ideal", IDEAL]
    assert set(found["code"]) >= {"source", "arithmetic", "numpy", "numba", "lidarcheck"}
    assert compared()["key"] == found["key"]
    assert compared("--quiet")["key"] == found["key"]  # it changes no number
    shutil.copy(REAL, "again.pcd")
    scan = load_scan(SIM)
    save_scan(scan.take(np.arange(len(scan)) % 10 > 0), SIM)
    assert compared()["key"] != found["key"]
    assert changed_since(found) == [SIM]


def test_the_table_that_a_model_names_counts(bench):
    lut = bench / "models/a_lut.ini"
    lut.write_text("PostPro.LUT_blooming_X = 0, 10\nPostPro.LUT_blooming_Y = 1, 0.1\n")
    with (bench / "models/SMART.toml").open("a") as stream:
        stream.write('\n[[effects]]\nname = "blooming_vertical"\nlut = "a_lut.ini"\n')
    first = compared("--model", "models/SMART.toml")
    assert "models/a_lut.ini" in first["files"]
    lut.write_text(lut.read_text().replace("0.1", "0.2"))
    assert compared("--model", "models/SMART.toml")["key"] != first["key"]
    assert changed_since(first) == ["models/a_lut.ini"]


def test_a_workflows_page_and_numbers_have_one_key_and_report_says_when_it_is_old(bench, capsys):
    command = ["vehicles", "compare", REAL, "--simulated", SIM, "--out", "found", "--vehicle", "car"]
    assert main(command) == 0, capsys.readouterr().err
    result = json.loads((bench / "found/result.json").read_text())
    key = result["computed_from"]["key"]
    assert result["provenance"]["computed from"] == f"sha256 {key}"
    assert key in (bench / "found/report.html").read_text()
    assert main(["report", "found", "--out", "release.html", "--json", "release.json"]) in (0, 1)
    assert "OLD" not in (bench / "release.json").read_text()
    shutil.copy("car_22m_SMART_real.pcd", REAL)
    main(["report", "found", "--out", "release.html", "--json", "release.json"])
    assert f"OLD: {REAL} changed since it was computed" in (bench / "release.json").read_text()


def test_results_of_versions_that_said_nothing_are_not_judged():
    assert changed_since(None) == changed_since({}) == changed_since({"files": 3}) == []


def test_a_file_that_changes_while_a_command_runs_is_no_origin(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("1\n")
    assert origin(["compare"]) is None  # nobody notes
    with reading():
        read_source(path)
        path.write_text("1, and more\n")
        with pytest.raises(InputError, match="changed while the command ran"):
            origin(["compare"])
