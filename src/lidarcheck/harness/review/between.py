"""Two releases side by side, KPI by KPI: two folders of goldens, or `goldens/release/` at two revisions of git."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.harness.goldens.file import golden_of, load_golden, refuse_proposal
from lidarcheck.harness.goldens.golden import Golden
from lidarcheck.harness.layout import toml_files

__all__ = ["Change", "changes_between"]

_TIMEOUT_S = 30.0
_PLACE = "goldens/release/"


@dataclass(frozen=True, slots=True)
class Change:
    """A KPI in two releases; `old` or `new` is None where it is not there. The words are those of the newer golden."""

    scenario: str
    kpi: str
    unit: str
    old: float | None
    new: float | None
    tolerance: float
    requirement: str
    accepted_by: str
    accepted_date: str
    reason: str

    @property
    def difference(self) -> float | None:
        """New minus old; None where there is only one."""
        return None if self.old is None or self.new is None else self.new - self.old


def changes_between(first: str, second: str, project: Path) -> tuple[Change, ...]:
    """Every KPI of two releases, by scenario; `project` is whose revisions are meant.

    `InputError` for what is neither a folder of goldens nor a revision with `goldens/release/`, `GoldenError` for a
    golden that cannot be read.
    """
    before, after = (_goldens(name, project) for name in (first, second))
    found = []
    for scenario in sorted(before.keys() | after.keys()):
        old = before[scenario].kpis if scenario in before else {}
        new = after[scenario].kpis if scenario in after else {}
        for name in dict.fromkeys((*new, *old)):
            was, now = old.get(name), new.get(name)
            kpi = now or was
            assert kpi is not None
            means = [None if one is None else one.reference.mean for one in (was, now)]
            told = (kpi.spec.requirement, kpi.accepted_by, kpi.accepted_date, kpi.reason)
            found.append(Change(scenario, name, kpi.spec.unit, means[0], means[1], kpi.spec.tolerance, *told))
    return tuple(found)


def _goldens(name: str, project: Path) -> Mapping[str, Golden]:
    folder = Path(name)
    if not folder.is_dir():
        return _at_revision(name, project)
    folder = next((place for place in (folder / _PLACE, folder) if toml_files(place)), folder)
    found = {path.stem: load_golden(path) for path in toml_files(folder)}
    if not found:
        raise InputError("holds no goldens", file=name, fix="give a folder of goldens, or a revision of git")
    return found


def _at_revision(name: str, project: Path) -> Mapping[str, Golden]:
    fix = f"give a folder of goldens, or a revision of git that has {_PLACE}"
    try:
        revision = _git(project, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}").strip()
        listed = _git(project, "ls-tree", "-z", "--name-only", revision, "--", _PLACE).split("\0")
        texts = {path: _git(project, "show", f"{revision}:./{path}") for path in listed if path.endswith(".toml")}
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        raise InputError("is no folder, and no revision of git here", file=name, fix=fix) from error
    if not texts:
        raise InputError(f"has no goldens in {_PLACE}", file=name, fix=fix)
    found = {}
    for path, text in texts.items():
        file = Path(f"{name}:{path}")
        found[file.stem] = golden_of(text, file, release=True)
        refuse_proposal(found[file.stem], file)
    return found


def _git(project: Path, *words: str) -> str:
    done = subprocess.run(["git", "-C", str(project), *words], capture_output=True, check=True, timeout=_TIMEOUT_S)
    return done.stdout.decode("utf-8").replace("\r\n", "\n")
