"""Where a command writes, and what a person sees."""

import json
import math
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.cli.core.outputs import check_writable, json_text, write_result
from lidarcheck.cli.core.terminal import Column, progress, stage, table
from lidarcheck.errors import InputError
from scenario_texts import TRIANGLE_PLY


def test_a_place_that_can_be_written_is_left_alone(tmp_path):
    check_writable(tmp_path / "a.json", option="--json")
    assert list(tmp_path.iterdir()) == []


def test_a_directory_is_no_file(tmp_path):
    with pytest.raises(InputError, match="is a directory"):
        check_writable(tmp_path, option="--json")


def test_a_directory_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"its directory does not exist; make .*nowhere first"):
        check_writable(tmp_path / "nowhere" / "a.json", option="--json")


def test_a_file_below_a_file(tmp_path):
    (tmp_path / "f").write_text("")
    with pytest.raises(InputError, match="its directory does not exist"):
        check_writable(tmp_path / "f" / "a.json", option="--json")


@pytest.mark.parametrize("name", ["old.json", "new.json"])
def test_read_only(tmp_path, monkeypatch, name):
    # The superuser may write anywhere, so the answer is faked.
    (tmp_path / "old.json").write_text("{}")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(InputError, match="cannot be written"):
        check_writable(tmp_path / name, option="--json")


def test_a_result_goes_to_standard_output(capsys):
    check_writable("-", option="--json")
    write_result("-", "{}\n")
    assert capsys.readouterr().out == "{}\n"


def test_a_result_replaces_a_file(tmp_path):
    target = tmp_path / "a.json"
    target.write_text("old")
    write_result(target, "ü\n")
    assert target.read_text(encoding="utf-8") == "ü\n"
    assert list(tmp_path.iterdir()) == [target]


def test_a_pipe_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    check_writable(pipe, option="--json")
    write_result(pipe, "{}\n")
    assert os.read(reader, 100) == b"{}\n"
    os.close(reader)
    assert pipe.is_fifo()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_device_stays_a_device():
    with pytest.raises(InputError, match="cannot write: No space left"):
        write_result("/dev/full", "{}\n")
    assert Path("/dev/full").is_char_device()


def test_json_holds_what_the_package_returns():
    @dataclass(frozen=True)
    class Result:
        name: str
        values: tuple
        path: Path

    result = Result("a", (np.float64(0.5), math.nan, np.int32(3), np.array([1.0, np.inf]), True, None), Path("x"))
    assert json.loads(json_text({1: result})) == {
        "1": {"name": "a", "values": [0.5, None, 3, [1.0, None], True, None], "path": "x"}
    }


COLUMNS = (Column("kpi"), Column("value", right=True))
ROWS = (("ks", "0.1"), ("wasserstein", "12"))


def test_a_table_is_plain_where_nobody_watches():
    assert table(COLUMNS, ROWS) == "kpi          value\nks             0.1\nwasserstein     12\n"


def test_a_table_fits_a_terminal_and_shows_markup_as_it_is(monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setenv("NO_COLOR", "1")
    drawn = table(COLUMNS, [("[red]a", "1"), ("b " * 40, "2")], styles=("red", ""))
    assert "[red]a" in drawn
    assert "\x1b[3" not in drawn
    assert max(len(re.sub(r"\x1b\[\d+m", "", line)) for line in drawn.splitlines()) <= 40


WIDE = (Column("distance [m]", right=True), Column("feature"), *(Column(f"number {i}", right=True) for i in range(9)))


@pytest.mark.parametrize("width", [80, 40, 24])
def test_a_narrow_terminal_breaks_no_number(width, monkeypatch):
    """The columns go on below, behind those that say what a row is of."""
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", str(width))
    rows = [(f"{10 + i}.5", f"feature {i}", *(f"-{i}{j}.123456" for j in range(9))) for i in range(3)]
    drawn = re.sub(r"\x1b\[\d+m", "", table(WIDE, rows))
    assert max(map(len, drawn.splitlines())) <= width
    words = drawn.split()
    assert {cell for row in rows for cell in row[2:]} <= set(words)
    blocks = len(drawn.split("\n\n"))
    assert blocks > 1
    assert words.count("11.5") == blocks
    if width > 24:
        assert drawn.count("feature 2") == blocks


def test_progress_is_silent_where_nobody_watches(capsys):
    with progress("checking") as show:
        show(1, 3, "a")
    with stage("reading"):
        pass
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("option", ["--html", "--json", "--junit"])
def test_a_report_never_replaces_a_scenario(option, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").mkdir()
    wall = tmp_path / "scenarios" / "wall.toml"
    wall.write_text("#")
    assert main(["check", "wall", option, "scenarios/wall.toml"]) == 2
    assert "is the name of a scenario, golden or model" in capsys.readouterr().err
    assert wall.read_text() == "#"


MESH_SCENE = """\
[materials.1]
reflectance = 0.5

[[scene.objects]]
shape = "mesh"
file = "mesh.ply"
position_m = [9.0, 0.0, 0.0]
material = 1

[scene.sampling]
layers = [255, 264]
points = [470, 489]
"""
MODEL = """\
variant = "SMART"

[materials.1]
reflectance = 0.5

[[effects]]
name = "blooming_vertical"
lut = "lut.txt"
"""
LUT = "PostPro.LUT_blooming_X = -6, 0, 6\nPostPro.LUT_blooming_Y = 0.01, 1, 0.02\n"
EXTERNAL = '[external]\ncommand = ["cp", "table.txt", "{scan}"]\n'


@pytest.fixture
def simulation(tmp_path, monkeypatch):
    """A directory with an ideal scan, a model with a table, and a scene with a mesh, made current."""
    monkeypatch.chdir(tmp_path)
    files = {"scene.toml": MESH_SCENE, "mesh.ply": TRIANGLE_PLY, "model.toml": MODEL, "lut.txt": LUT}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert main(["scene", "scene.toml", "--out", "ideal.txt", "--quiet"]) == 0
    return [*files, "ideal.txt"]


def _refused(arguments, name, capsys):
    before = Path(name).read_bytes()
    assert main(["simulate", *arguments]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert "would replace another file of this command; name another for --out" in said
    assert Path(name).read_bytes() == before


@pytest.mark.parametrize("name", ["scene.toml", "mesh.ply", "model.toml", "lut.txt", "ideal.txt"])
def test_an_echo_file_never_replaces_what_it_was_simulated_from(simulation, name, capsys):
    given = ["ideal.txt", "--model", "model.toml", "--scene", "scene.toml", "--quiet", "--out"]
    assert set(simulation) == {"scene.toml", "mesh.ply", "model.toml", "lut.txt", "ideal.txt"}
    Path("link.txt").symlink_to(name)
    _refused([*given, "link.txt"], name, capsys)
    if not name.endswith(".toml"):  # which is no format of echoes
        _refused([*given, name], name, capsys)
    assert main(["simulate", *given, "echoes.ply"]) == 0
    assert Path("echoes.ply").exists()


def test_a_table_is_kept_without_a_scene(simulation, capsys):
    _refused(["ideal.txt", "--model", "model.toml", "--out", "lut.txt"], "lut.txt", capsys)


def test_a_file_of_an_external_model_is_kept(simulation, capsys):
    Path("table.txt").write_text("//X Y Z\n")
    Path("external.toml").write_text(EXTERNAL)
    _refused(["ideal.txt", "--model", "external.toml", "--out", "table.txt"], "table.txt", capsys)


def test_signs_that_an_output_cannot_hold_are_spelled_out():
    code = "from lidarcheck.cli import main; import sys; main(['info', 'none']); print('−6.2…5.7° ✓ ∅ ü')"
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout == "-6.2...5.7 deg ok - \\xfc\n"


def test_help_is_wrapped_once(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["panels", "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert "  --ideal PATH...: What the beams meet: one ideal scan for all frames, or one" in lines
    assert "      for each frame, named as these." in lines
    assert any("[default: 4 85]" in line for line in lines)
