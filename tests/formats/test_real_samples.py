"""The printed rows of the traffic sign, in both header orders, through the commands that people use."""

import itertools
import json
from pathlib import Path

import pytest

from lidarcheck.cli import main
from places import shared_path

SAMPLES = ("1_25m.txt", "2_45m.txt")


@pytest.mark.parametrize("name", SAMPLES)
def test_info_knows_the_sign_and_its_ghost(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info", str(shared_path(f"samples/{name}")), "--json"]) == 0
    known = json.loads(capsys.readouterr().out)
    assert known["kind"] == "scan"
    assert known["rows"] == 8


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("way", [[], ["pcd"], ["parquet"], ["csv"], ["laz"], ["ply"]])
def test_the_rows_come_back(name: str, way: list[str], tmp_path: Path) -> None:
    source = shared_path(f"samples/{name}")
    steps = [source, *(tmp_path / f"scan.{suffix}" for suffix in way), tmp_path / "back.txt"]
    for one, other in itertools.pairwise(steps):
        assert main(["convert", str(one), str(other)]) == 0
    if not way:
        assert steps[-1].read_bytes() == source.read_bytes(), "text to text changes nothing"
    names = source.read_text().splitlines()[0].lstrip("/").casefold().split()
    back = steps[-1].read_text().splitlines()
    assert sorted(back[0].lstrip("/").casefold().split()) == sorted(names)
    order = [back[0].lstrip("/").casefold().split().index(column) for column in names]
    for old, new in zip(source.read_text().splitlines()[2:], back[2:], strict=True):
        values = [float(new.split()[i]) for i in order]
        # LAS and LAZ hold positions to a micrometre.
        assert values == pytest.approx([float(cell) for cell in old.split()], abs=5.1e-7 if way == ["laz"] else 0.0)


def test_the_two_distances_compare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "kpis.json"
    arguments = [str(shared_path(f"samples/{name}")) for name in SAMPLES]
    assert main(["compare", *arguments, "--json", str(out)]) == 0
    text = json.dumps(json.loads(out.read_text()))
    assert "wasserstein" in text
    assert "PEAK" in capsys.readouterr().out
