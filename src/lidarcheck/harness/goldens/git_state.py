"""Whether what a golden would be made from is committed."""

from __future__ import annotations

import getpass
import subprocess
from pathlib import Path

from lidarcheck.harness.goldens.provenance import external_files, package_directory, source_files
from lidarcheck.harness.scenario.scenario import Scenario

__all__ = ["acceptor", "uncommitted"]

_TIMEOUT_S = 30.0
_NAMED = 3


def uncommitted(scenario: Scenario) -> tuple[str, str]:
    """(files with uncommitted changes, a note): of the model's source, the scenario, its model and what they name.

    Files that no git repository holds count as clean, and the note says so.
    """
    package = package_directory()
    model = scenario.model
    files = {scenario.path} | ({model.file} if model.file else set())
    files |= set(external_files(model.external)) if model.external else set()
    files |= set(scenario.files)
    files |= {Path(curve.file) for effect in model.effects for curve in effect.curves()}
    changed, notes = [], []
    for directory, paths in [*((file.parent, [file]) for file in sorted(files)), (package, source_files())]:
        found = _status(directory, paths)
        if found is None:
            notes.append(str(directory))
        else:
            changed += found
    note = f"not in a git repository, taken as clean: {', '.join(dict.fromkeys(notes))}" if notes else ""
    names = list(dict.fromkeys(changed))
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more, note


def acceptor(directory: Path) -> str:
    """Who accepts a golden here: git's user.name and user.email, else the login name; one line, never empty."""
    try:
        name, mail = (_config(directory, key) for key in ("user.name", "user.email"))
    except (OSError, subprocess.SubprocessError):
        name = mail = ""
    known = " ".join(part for part in (name, f"<{mail}>" if mail else "") if part)
    try:
        return known or getpass.getuser()
    except (OSError, KeyError, ImportError):
        return "unknown"


def _config(directory: Path, key: str) -> str:
    """A value of git's configuration on one line; empty where it is not set."""
    git = ["git", "-C", str(directory), "config", "--get", key]
    done = subprocess.run(git, capture_output=True, check=False, timeout=_TIMEOUT_S)
    return " ".join(done.stdout.decode("utf-8", "replace").split())


def _status(directory: Path, files: list[Path]) -> list[str] | None:
    """Those of `files` that differ from what is committed, and what was deleted beside them; None without git."""
    git = ["git", "--no-optional-locks", "-C", str(directory)]
    try:
        top = _output([*git, "rev-parse", "--show-toplevel"])
        text = _output([*git, "status", "--porcelain", "-z", "-uall", "--no-renames", "--", "."])
    except (OSError, subprocess.SubprocessError):
        return None
    entries = [(entry[:2], Path(top.strip()) / entry[3:]) for entry in text.split("\0") if entry]
    known = {file.resolve() for file in files}
    many = len(files) > 1
    return [
        path.name if not many else path.relative_to(directory.resolve()).as_posix()
        for state, path in entries
        if path.resolve() in known or ("D" in state and many and path.suffix in (".py", ".toml"))
    ]


def _output(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, check=True, timeout=_TIMEOUT_S)
    return done.stdout.decode("utf-8", "surrogateescape")
