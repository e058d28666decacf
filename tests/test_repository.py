"""What holds for the repository as a whole: quick starts, documented commands, clean files, scripts that run."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lidarcheck.cli.core.app import COMMANDS, make_app

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ("ci/bootstrap", "ci/demo", "ci/test", ".ci/run")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")


def loaded_by(statement):
    """The modules in memory after a statement in a fresh interpreter."""
    program = f"import sys\n{statement}\nprint('\\n' + ' '.join(sys.modules))"
    ran = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    return set(ran.stdout.splitlines()[-1].split())


def test_a_cold_import_loads_nothing_heavy():
    packages = (path for path in (ROOT / "src/lidarcheck").iterdir() if (path / "__init__.py").is_file())
    names = sorted(path.name for path in packages if path.name not in ("model", "effects", "plots", "tui"))
    modules = loaded_by("import lidarcheck, " + ", ".join(f"lidarcheck.{name}" for name in names))
    assert not modules & {"scipy.stats", "numba", "pyarrow", "matplotlib", "laspy", "sklearn"}


def test_help_loads_nothing_heavy():
    statement = "from lidarcheck.cli import main; main(['--help']); main(['simulate', '--help']); main(['check', '-h'])"
    assert not loaded_by(statement) & {"numpy", "scipy", "sklearn", "numba", "pyarrow", "matplotlib", "pydantic"}


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_runs_from_anywhere(name):
    script = ROOT / name
    assert os.access(script, os.X_OK)
    assert subprocess.run(["bash", "-n", script], check=False).returncode == 0
    assert "set -euo pipefail" in script.read_text(encoding="utf-8")


def test_what_ci_test_checks_beside_the_rest_is_there():
    """Nobody reads what that check says."""
    names = re.search(r"^late=\((.*)\)$", (ROOT / "ci/test").read_text(encoding="utf-8"), re.MULTILINE)[1].split()
    assert names
    assert all((ROOT / f"scenarios/{name}.toml").is_file() for name in names)


def options_of(command):
    """Every option that the parser knows for a command."""
    app = make_app()
    for word in command.split():
        app = app[word]
    arguments = app.assemble_argument_collection()
    return {name for argument in arguments for name in argument.names if name.startswith("-")}


@pytest.mark.parametrize("command", [command.name for command in COMMANDS])
def test_the_documentation_has_every_command_and_option(command):
    text = (ROOT / "docs/command-line.md").read_text(encoding="utf-8")
    section = re.search(rf"^## {command}$(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert section, f"docs/command-line.md has no section {command}"
    common = text[: text.index("\n## ")]
    missing = {name for name in options_of(command) if name not in section[1] and name not in common}
    assert not missing


@pytest.mark.parametrize("command", [command.name for command in COMMANDS])
def test_the_documentation_names_no_option_that_there_is_not(command):
    text = (ROOT / "docs/command-line.md").read_text(encoding="utf-8")
    section = re.search(rf"^## {command}$(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    known = options_of(command) | {"--help", "--version", "--install-completion", "--shell"}
    assert section
    assert set(OPTION.findall(section[1])) <= known


def tracked_files():
    """What a clone would hold: tracked, or new and not ignored; everything where there is no git."""
    try:
        command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
        listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()]


# Spelled in parts, so that this file does not find itself.
FORBIDDEN = {
    "a machine's path": r"(?<![\w.])/(?:work|root|home|Users|opt)/" + r"(?!\w*\.)\w",
    "a registry's host": r"https?://[\w.:-]*(?:pypi|pythonhosted|artifactory|nexus|index)" + r"[\w.:-]*/",
    "an index option": r"--(?:extra-)?index" + r"-url|--find" + r"-links|--trusted" + r"-host",
    "a marker of unfinished work": r"\b(?:TO" + r"DO|FIX" + r"ME|X" + r"XX)\b",
    "a merge conflict": r"^(?:<{7}|>{7}) ",
}


def test_no_file_holds_what_belongs_to_one_machine():
    found = []
    for path in tracked_files():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        for what, pattern in FORBIDDEN.items():
            for match in re.finditer(pattern, text, re.MULTILINE):
                line = text.count("\n", 0, match.start()) + 1
                found.append(f"{path.relative_to(ROOT)}:{line}: {what}: {match[0]}")
    assert not found


def test_every_locked_requirement_has_a_hash():
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    entries = re.findall(r"^[A-Za-z0-9][^\n]*(?:\n[ \t]+[^\n]*)*", text, re.MULTILINE)
    assert len(entries) > 20
    assert [entry.splitlines()[0] for entry in entries if "==" not in entry or "--hash=sha256:" not in entry] == []


def test_the_lock_has_every_dependency():
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    asked = [*project["project"]["dependencies"], *project["dependency-groups"]["dev"]]
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8").lower()
    names = [re.match(r"[\w.-]+", text)[0].lower() for text in asked]
    assert [name for name in names if not re.search(rf"^{re.escape(name)}(?:\[\w+\])?==", lock, re.MULTILINE)] == []


def test_no_source_file_is_longer_than_a_reader_can_hold():
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in (ROOT / "src").rglob("*.py")}
    assert {str(path.relative_to(ROOT)): count for path, count in lengths.items() if count > 360} == {}


def test_the_module_runs_as_a_program():
    ran = subprocess.run([sys.executable, "-m", "lidarcheck", "--version"], check=False, capture_output=True, text=True)
    assert ran.returncode == 0
    assert Path(ROOT / "src/lidarcheck/__main__.py").is_file()
