"""No program of a model runs unless the user trusts it: by no command, after no change, by no way round."""

import importlib.util
import py_compile
import subprocess
import sys
from pathlib import Path

import pytest

from lidarcheck.cli import main
from lidarcheck.errors import ConfigError, LidarcheckError
from lidarcheck.model.files.model_file import load_model
from lidarcheck.permissions import Permissions, given, granted
from lidarcheck.trust.program_text import hash_of
from lidarcheck.trust.programs import require_trust
from lidarcheck.trust.user_file import user_file_path
from lidarcheck.tui.jobs.explain_process import command_of
from lidarcheck.workers import Processes
from stranger_kit import hash_in, ran, stranger

SIMULATE = ["simulate", "ideal.txt", "--model", "models/model.toml", "--out", "scan.txt", "-q"]


@pytest.fixture
def project(tmp_path, monkeypatch):
    """The stranger's project, made current; the user's configuration is elsewhere."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    root = tmp_path / "project"
    root.mkdir()
    monkeypatch.chdir(root)
    return stranger(root)


def program(root):
    external = load_model(root / "models" / "model.toml").external
    assert external is not None
    return external


def configure(text):
    user_file_path().parent.mkdir(parents=True, exist_ok=True)
    user_file_path().write_text(text)


COMMANDS = [
    SIMULATE,
    ["simulate", "ideal.txt", "ideal2.txt", "--model", "models/model.toml", "--out", "frames", "-q"],
    ["check", "-q"],
    ["check", "wall", "--model", "models/model.toml", "-q"],
    ["review", "-q"],
    ["review", "--accept", "all", "--reason", "x", "-q"],
    ["scenes", "compare", "scan.csv", "--ideal", "ideal.txt", "--model", "models/model.toml", "-q"],
    ["vehicles", "compare", "scan.csv", "--vehicle", "car", "--ideal", "ideal.txt", "--model", "models/model.toml"],
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: "-".join(command[:2]))
def test_no_command_runs_a_strangers_program(project, command, capsys):
    (project / "ideal2.txt").write_text((project / "ideal.txt").read_text())
    (project / "scan.csv").write_text("Layer,Point,RANGE,EchoNumber,WIDTH,AREA,PEAK\n250,470,20.0,1,9,100,5\n")
    assert main(command) == 2
    assert "runs a program that you do not trust" in capsys.readouterr().err
    assert ran(project) == []


READERS = [
    ["ghosts", "find", "scan.csv", "--ideal", "ideal.txt", "--model", "models/model.toml", "-q"],
    ["compare", "scan.csv", "scan.csv", "--model", "models/model.toml", "-q"],
    ["info", "models/model.toml"],
]


@pytest.mark.parametrize("command", READERS, ids=lambda command: command[0])
def test_what_only_reads_a_model_runs_nothing(project, command):
    (project / "scan.csv").write_text("Layer,Point,RANGE,EchoNumber,WIDTH,AREA,PEAK\n250,470,20.0,1,9,100,5\n")
    main(command)
    assert ran(project) == []


@pytest.mark.parametrize("command", [SIMULATE, ["check", "-q"], ["review", "-q"]], ids=lambda command: command[0])
def test_the_refusal_is_one_line_with_what_would_run_the_hash_and_the_line_to_add(project, command, capsys):
    assert main(command) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert "model.toml: runs a program that you do not trust: " in line
    assert f"{sys.executable} -S ../tool/post.py '{{ideal}}' '{{ini}}' '{{scan}}'" in line
    own = hash_of(program(project))
    assert hash_in(line) == own
    assert f'add to {user_file_path()} the line trust = ["{own}"]' in line
    assert f"LIDARCHECK_TRUST={own}" in line


def test_the_line_to_add_is_enough(project, capsys):
    main(SIMULATE)
    configure(f'trust = ["{hash_in(capsys.readouterr().err)}"]\n')
    assert main(SIMULATE) == 0
    assert ran(project) == ["as trusted"]


@pytest.mark.parametrize("word", ["all", "the hash", "one of several"])
def test_the_environment_trusts(project, word, monkeypatch):
    own = hash_of(program(project))
    monkeypatch.setenv("LIDARCHECK_TRUST", {"all": "all", "the hash": own}.get(word, f"{'0' * 64}, {own}"))
    assert main(SIMULATE) == 0


def test_another_hash_is_no_trust(project, monkeypatch):
    monkeypatch.setenv("LIDARCHECK_TRUST", "0" * 64)
    configure(f'trust = ["{"1" * 64}"]\n')
    assert main(SIMULATE) == 2
    assert ran(project) == []


def test_the_flag_trusts_one_command_and_not_the_next(project):
    assert main([*SIMULATE, "--trust"]) == 0
    assert ran(project) == ["as trusted"]
    assert main([*SIMULATE[:-3], "--out", "other.txt", "-q"]) == 2
    assert not given().trust


def test_a_check_with_the_flag_runs_all_seeds(project):
    assert main(["check", "-q", "--trust"]) == 1  # there is no golden
    assert set(ran(project)) == {"as trusted"}


def test_what_is_no_hash_is_said(project, monkeypatch, capsys):
    monkeypatch.setenv("LIDARCHECK_TRUST", "\x1b]0;x\x07yes")
    assert main(SIMULATE) == 2
    assert "is no program's hash" in capsys.readouterr().err
    monkeypatch.delenv("LIDARCHECK_TRUST")
    configure('trust = ["all"]\n')
    with pytest.raises(ConfigError, match="not the hash of a program"):
        require_trust(program(project))
    configure("trusted = []\n")
    with pytest.raises(LidarcheckError, match=r"unknown key trusted; did you mean trust\?"):
        require_trust(program(project))


def test_no_configuration_is_read_from_a_project(project):
    own = hash_of(program(project))
    for name in ("config.toml", "lidarcheck.toml", ".lidarcheck/config.toml", "lidarcheck/config.toml"):
        (project / name).parent.mkdir(exist_ok=True)
        (project / name).write_text(f'trust = ["{own}"]\n')
    (project / "pyproject.toml").write_text(f'[tool.lidarcheck]\ntrust = ["{own}"]\n[tool.pytest.ini_options]\n')
    assert main(SIMULATE) == 2
    assert ran(project) == []


def test_the_plugin_of_pytest_runs_no_program_and_a_project_cannot_make_it(project):
    (project / "goldens").mkdir()
    (project / "pytest.ini").write_text("[pytest]\naddopts = -p no:cacheprovider\nlidarcheck_trust = all\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-W", "ignore", "scenarios"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stdout
    assert "runs a program that you do not trust" in done.stdout
    assert ran(project) == []


def edit(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


PARTS = {
    "the table": lambda root: edit(
        root / "models/model.toml", (root / "models/model.toml").read_text() + "timeout_s = 5\n"
    ),
    "an argument that is a file": lambda root: edit(root / "tool/post.py", "print(1)\n"),
    "what it imports": lambda root: edit(root / "tool/helper.py", 'WORD = "as changed"\n'),
    "what it would import first": lambda root: edit(root / "tool/random.py", "print(1)\n"),
    "a package beside it": lambda root: edit(root / "tool/sub/deep/code.py", "print(1)\n"),
    "compiled code beside it": lambda root: edit(root / "tool/helper2.pyc", "x"),
    "a program disguised as a point cloud": lambda root: edit(root / "tool/random.py", "# .PCD v0.7\nprint(1)\n"),
    "a program disguised as text of points": lambda root: edit(root / "tool/go.txt", "X Y Z\n1 2 3\nrm -rf x\n"),
    "a folder that a link brings": lambda root: (
        edit(root / ".lidarcheck/code/a.py", "print(1)\n"),
        (root / "tool/sub").symlink_to("../.lidarcheck/code"),
    ),
}


@pytest.mark.parametrize("part", PARTS)
def test_a_program_that_changed_is_trusted_no_longer(project, part, monkeypatch):
    monkeypatch.setenv("LIDARCHECK_TRUST", hash_of(program(project)))
    require_trust(program(project))
    PARTS[part](project)
    with pytest.raises(LidarcheckError, match="runs a program that you do not trust"):
        require_trust(program(project))


def test_settings_and_modules_are_part_of_the_program(project, monkeypatch):
    model = project / "models/model.toml"
    model.write_text('[external]\ncommand = ["python3", "-m", "sensor", "{ini}", "{scan}"]\nini = "s.ini"\n')
    (project / "models/s.ini").write_text("a = 1\n")
    (project / "models/sensor.py").write_text("print(1)\n")
    seen = {hash_of(program(project))}
    (project / "models/s.ini").write_text("a = 2\n")
    seen.add(hash_of(program(project)))
    (project / "models/sensor.py").write_text("print(2)\n")  # named by no argument: found where the command runs
    seen.add(hash_of(program(project)))
    assert len(seen) == 3


FUNCTION = """\
import pathlib
from own import words

def simulate(ideal, seed):
    (pathlib.Path(__file__).parents[2] / "tool" / "ran.log").open("a").write(words.WORD + "\\n")
    return {"Layer": ideal["Layer"], "Point": ideal["Point"], "RANGE": ideal["Distance"], "AREA": seed + ideal["Layer"]}
"""
MODULE = {
    "the function": lambda models: edit(models / "own/model.py", FUNCTION + "\n"),
    "what it imports": lambda models: edit(models / "own/words.py", 'WORD = "as changed"\n'),
    "what it would import first": lambda models: edit(models / "own/model/__init__.py", "print(1)\n"),
    "compiled code beside it": lambda models: edit(models / "own/words2.pyc", "x"),
    "its settings": lambda models: edit(models / "s.ini", "a = 2\n"),
}


@pytest.fixture
def module(project):
    """The stranger's project with a Python function as its model; its models' folder."""
    models = project / "models"
    edit(models / "own/__init__.py", "")
    edit(models / "own/model.py", FUNCTION)
    edit(models / "own/words.py", 'WORD = "as trusted"\n')
    edit(models / "s.ini", "a = 1\n")
    edit(models / "model.toml", '[external]\nmodule = "own.model:simulate"\nini = "s.ini"\n')
    return models


def test_a_module_runs_only_where_its_package_is_trusted(module, project, monkeypatch, capsys):
    assert main(SIMULATE) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "model.toml: runs a program that you do not trust: own.model:simulate in " in line
    assert hash_in(line) == hash_of(program(project))
    assert ran(project) == []
    configure(f'trust = ["{hash_in(line)}"]\n')
    assert main(SIMULATE) == 0
    assert ran(project) == ["as trusted"]


@pytest.mark.parametrize("part", MODULE)
def test_a_module_that_changed_is_trusted_no_longer(module, project, part, monkeypatch):
    monkeypatch.setenv("LIDARCHECK_TRUST", hash_of(program(project)))
    require_trust(program(project))
    MODULE[part](module)
    with pytest.raises(LidarcheckError, match="runs a program that you do not trust"):
        require_trust(program(project))


def test_nothing_beside_a_trusted_package_is_imported(module, project, monkeypatch):
    """What lies beside the package is in no hash; it must not come in the place of what the package imports."""
    monkeypatch.setenv("LIDARCHECK_TRUST", hash_of(program(project)))
    for name in ("pathlib", "words", "numpy", "sitecustomize"):
        for folder in (module, module / "own" / "__pycache__", project):
            edit(folder / f"{name}.py", f"open({str(project / 'tool/ran.log')!r}, 'a').write('stranger\\n')\n")
    assert main(SIMULATE) == 0
    assert ran(project) == ["as trusted"]


def test_a_package_that_a_link_brings_from_outside_is_refused(module, project, tmp_path, monkeypatch, capsys):
    (module / "own").rename(tmp_path / "elsewhere")
    (module / "own").symlink_to(tmp_path / "elsewhere")
    monkeypatch.setenv("LIDARCHECK_TRUST", "all")
    assert main(SIMULATE) == 2
    assert "leads out of the project" in capsys.readouterr().err
    assert ran(project) == []


def test_an_installed_module_is_trusted_by_its_text(module, project, tmp_path, monkeypatch, capsys):
    (module / "own").rename(tmp_path / "own")
    monkeypatch.syspath_prepend(str(tmp_path))
    before = hash_of(program(project))
    edit(tmp_path / "own/words.py", "WORD = 'other'\n")
    assert hash_of(program(project)) != before
    (tmp_path / "own").rename(tmp_path / "gone")
    assert main(SIMULATE) == 2
    assert "own.model:simulate cannot be found: there is no module own; put it beside" in capsys.readouterr().err


def test_a_server_is_a_program(project, capsys):
    model = project / "models/model.toml"
    before = hash_of(program(project))
    model.write_text(f'[external]\ncommand = ["{sys.executable}", "-S", "../tool/post.py"]\nserver = true\n')
    assert main(SIMULATE) == 2
    line = capsys.readouterr().err
    assert f"runs a program that you do not trust: {sys.executable} -S ../tool/post.py in " in line
    assert hash_in(line) != before
    assert ran(project) == []


SCAN = "// X Y Z Layer Point\n1.5 2 -3e2 1 nan\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("tool/__pycache__/x.pyc", "x"),
        ("tool/.git/config", "x"),
        ("tool/.lidarcheck/proposals/x.toml", "x"),
        ("tool/scan.txt", SCAN),
        ("tool/ideal.csv", "Layer,Point,Distance,MaterialID,IncidenceAngle\n1,2,3,4,5\n"),
        ("tool/scan.pcd", "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\n"),
        ("tool/goldens/wall.toml", "x = 1\n"),
        ("tool/found/report.html", "x"),
        ("tool/found/result.json", "{}"),
        ("tool/ran.log", "x"),
        ("scenarios/other.toml", "x = 1\n"),
        ("README.md", "x"),
    ],
)
def test_what_is_no_program_changes_no_hash(project, name, text):
    before = hash_of(program(project))
    edit(project / name, text)
    assert hash_of(program(project)) == before


def test_the_same_program_elsewhere_has_the_same_hash(project, tmp_path):
    other = tmp_path / "clone"
    other.mkdir()
    assert hash_of(program(stranger(other))) == hash_of(program(project))


def test_compiled_code_that_no_hash_covers_is_not_run(project, monkeypatch):
    """A committed __pycache__ may hold code that Python takes without looking at the text beside it."""
    monkeypatch.setenv("LIDARCHECK_TRUST", hash_of(program(project)))
    trusted = (project / "tool/helper.py").read_text()
    (project / "tool/helper.py").write_text('WORD = "as compiled"\n')
    compiled = importlib.util.cache_from_source(str(project / "tool/helper.py"))
    py_compile.compile(
        str(project / "tool/helper.py"), compiled, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH
    )
    (project / "tool/helper.py").write_text(trusted)
    assert main(SIMULATE) == 0
    assert ran(project) == ["as trusted"]


def test_workers_begin_with_what_their_starter_permits():
    roots = (Path("/there"),)
    with granted(Permissions(trust=True, roots=roots)), Processes(2) as pool:
        assert pool.submit(given)() == Permissions(trust=True, roots=roots)
    with Processes(2) as pool:
        assert pool.submit(given)() == Permissions()


def test_the_terminal_hands_on_what_was_permitted(tmp_path):
    command = ["lidarcheck", "explain", "case", "--out", "out", "--progress", "json"]
    assert command_of(Path("case"), Path("out"), program=["lidarcheck"]) == command
    with granted(Permissions(trust=True, roots=(tmp_path,))):
        assert command_of(Path("case"), Path("out"), program=["lidarcheck"]) == [
            *command,
            "--trust",
            f"--root={tmp_path}",
        ]


def test_every_command_that_takes_a_model_can_be_told_to_trust(capsys):
    commands = [
        "simulate", "compare", "explain", "check", "review", "panels", "vehicles compare", "scenes compare",
        "ghosts find", "ghosts fit", "calibrate", "bloom fit", "bloom show", "tui",
    ]  # fmt: skip
    for command in commands:
        assert main([*command.split(), "--help"]) == 0
        said = capsys.readouterr().out
        assert "--trust" in said, command
        assert "--root" in said, command
        assert "whatever a pull request brings" in " ".join(said.split()), command
    for command in ("convert", "split", "lut show"):
        assert main([*command.split(), "--help"]) == 0
        assert "--trust" not in capsys.readouterr().out


def test_a_root_is_a_folder(project, capsys):
    assert main([*SIMULATE, "--root", "nowhere"]) == 2
    assert "--root nowhere is no folder" in capsys.readouterr().err
