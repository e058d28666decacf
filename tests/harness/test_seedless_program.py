"""A program that ignores its seed has no chance between seeds: no golden is made of it, and none is held against it."""

import sys
from pathlib import Path

import pytest

from lidarcheck.cli.core.entry import main
from lidarcheck.errors import InputError
from lidarcheck.harness.check import check
from lidarcheck.harness.review.accept import accept
from lidarcheck.harness.review.review import review
from scenario_texts import kpis, wall_scenario

pytestmark = pytest.mark.usefixtures("trusting")

PROGRAM = """\
import random, sys
ideal, ini, scan = sys.argv[1:]
seed = int(open(ini).read().split("=")[1])
draw = random.Random(0 if {seedless} else seed)
out = ["RANGE Point Layer EchoNumber WIDTH AREA PEAK"]
lines = open(ideal).read().splitlines()
names = lines[0].lstrip("/").split()
for line in lines[1:]:
    row = dict(zip(names, line.split()))
    if len(row) > 2:
        out.append(f"{{row['Distance']}} {{row['Point']}} {{row['Layer']}} 1 9 {{draw.gauss({area}, 5)}} 5")
open(scan, "w").write("\\n".join(out) + "\\n")
"""
WORDS = "gives the same echoes for 8 seeds in the scenario wall: it ignores its seed"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    models = tmp_path / "scenarios" / "models"
    models.mkdir(parents=True)
    command = f'[external]\ncommand = ["{sys.executable}", "-S", "post.py", "{{ideal}}", "{{ini}}", "{{scan}}"]\n'
    (models / "model.toml").write_text(command)
    wall = wall_scenario((250, 252), (470, 489), 20.0, "models/model.toml") + kpis(area_mean=2)
    (tmp_path / "scenarios" / "wall.toml").write_text(wall)
    return tmp_path


def program(project: Path, *, seedless: bool, area: int = 100) -> None:
    file = project / "scenarios" / "models" / "post.py"
    file.write_text(PROGRAM.format(seedless=seedless, area=area))


def test_no_golden_is_made_of_identical_seeds(project, capsys):
    program(project, seedless=True)
    assert main(["review", str(project / "scenarios"), "--accept", "all", "--reason", "first", "-q"]) == 2
    error = capsys.readouterr().err
    assert f"model.toml: the program {WORDS}" in error
    assert "let it draw its noise from {seed}, or from PostPro.Seed in {ini}" in error
    assert len(error.splitlines()) == 1
    assert not (project / "goldens").exists()


def test_a_program_that_uses_its_seed_has_goldens(project):
    program(project, seedless=False)
    accept(review([project / "scenarios"]), ["all"], reason="first")
    assert not check([project / "scenarios"]).failed
    program(project, seedless=True, area=101)
    with pytest.raises(InputError, match=WORDS):
        check([project / "scenarios"])


def test_an_older_golden_of_identical_seeds_is_still_found_identical(project, monkeypatch):
    """Made before such programs were refused: the same echoes need no chance to be the same."""
    program(project, seedless=True)
    with monkeypatch.context() as older:
        older.setattr("lidarcheck.harness.scenario_run.ScenarioRun.need_chance", lambda _run: None)
        accept(review([project / "scenarios"]), ["all"], reason="first")
    assert not check([project / "scenarios"]).failed
    assert review([project / "scenarios"]).settled
    with pytest.raises(InputError, match=WORDS):
        check([project / "scenarios"], seed=3)
