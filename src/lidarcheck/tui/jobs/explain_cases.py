"""The cases of a project, what an earlier run has found in each, and taking the model that it wrote over."""

from __future__ import annotations

import contextlib
import difflib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lidarcheck.cases.case import CASE_FILE, case_model
from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.explain.files import KEPT, MODEL, PAGE, REPORT
from lidarcheck.explain.report.explanation import Explanation
from lidarcheck.explain.report.load import load_explanation
from lidarcheck.explain.report.model_diff import model_diff, rewritten_text
from lidarcheck.formats.atomic import write_text
from lidarcheck.model.files.model_file import load_model
from lidarcheck.session.digests import Digests
from lidarcheck.session.own_files import content_hash, file_key, make_own_directory, own_directory
from lidarcheck.session.project import Project
from lidarcheck.trust.places import own_place

__all__ = [
    "Adoption",
    "CaseState",
    "adoption",
    "case_files",
    "look_at",
    "make_results_directory",
    "results_directory",
    "take_back",
    "take_over",
]

_TAKEN = "accepted.json"


@dataclass(frozen=True)
class CaseState:
    """A case. `name`: as it is shown; `fault`: why it cannot be explained, or its results cannot be read.

    `found`: what the last run found, None where none has; `read`: the digests of what it read, by path; `changed`:
    files that hold something else now; `diff`: its model beside the case's; `kept`: an interrupted run can go on;
    `page`: its report.html, if it is there.
    """

    name: str
    path: Path
    out: Path
    model: Path | None = None
    fault: str = ""
    found: Explanation | None = None
    read: Mapping[str, str] = field(default_factory=dict)
    changed: tuple[str, ...] = ()
    diff: tuple[str, ...] = ()
    kept: bool = False
    page: Path | None = None

    @property
    def state(self) -> str:
        """What is known of it, in a few words."""
        if self.fault:
            return "FAULT, see below"
        kept = "stopped, r goes on" if self.kept else ""
        if self.found is None:
            return kept or "not run"
        names = ", ".join(finding.name for finding in self.found.findings)
        no_gap = f"no gap {self.found.nothing_more}".rstrip()
        words = {"no_gap": no_gap, "explained": f"explained: {names}", "unknown": "unknown"}[self.found.verdict]
        return f"{words}{f'; {kept}' if kept else ''}"


def case_files(project: Project) -> list[Path]:
    """The cases of a project, also those with a fault."""
    return [entry.path for entry in project.of("case", sound=False)]


def results_directory(root: Path, case: Path) -> Path:
    """Where the results of a case are kept in the project."""
    named = case.absolute().parent if case.name == CASE_FILE else case
    return own_directory(root) / "explain" / file_key(named)


def make_results_directory(root: Path, case: Path) -> Path:
    """The same, the directory around it made; `InputError` where that cannot be."""
    out = results_directory(root, case)
    make_own_directory(root)
    try:
        own_place(out, root).parent.mkdir(exist_ok=True)
    except OSError as error:
        what = f"cannot make the directory: {error.strerror}"
        raise InputError(what, file=out.parent, fix="make the project's directory writable") from error
    return out


def look_at(root: Path, case: Path, disk: Digests | None = None) -> CaseState:
    """A case with what an earlier run has left; a fault is in it."""
    out, name = results_directory(root, case), case.relative_to(root)
    shown = name.parent.as_posix() if case.name == CASE_FILE and name.parent != Path() else name.as_posix()
    try:
        model = case_model(case)
    except LidarcheckError as error:
        return CaseState(shown, case, out, fault=error.lines()[0].removeprefix("error: "))
    kept, page = (out / KEPT).is_dir(), out / PAGE
    state = CaseState(shown, case, out, model, kept=kept, page=page if page.is_file() else None)
    if not (out / REPORT).is_file():
        return state
    try:
        before = load_model(model)
        found = load_explanation(out / REPORT, out / MODEL, before)
        read = {os.path.realpath(case.parent / name): digest for name, digest in found.hashes.items()}
        of = (disk or Digests()).of
        changed = tuple(name for name, path in zip(found.hashes, read, strict=True) if of(path) != read[path])
        diff = tuple(model_diff(before, found.model))
    except LidarcheckError as error:
        return CaseState(shown, case, out, model, error.lines()[0].removeprefix("error: "), kept=kept)
    return CaseState(shown, case, out, model, "", found, read, changed, diff, kept, state.page)


@dataclass(frozen=True)
class Adoption:
    """A model that is about to be taken over: the new text of a file, and what was there; None for a new file.

    `diff`: how the file changes beside the case's model; `rewritten`: why comments and layout could not be kept.
    """

    target: Path
    text: str
    before: str | None
    diff: tuple[str, ...]
    rewritten: str


def adoption(state: CaseState, target: Path) -> Adoption:
    """What taking a case's explained model over into a file would change; `UsageError` where that is refused."""
    if state.found is None or state.model is None:
        raise UsageError(f"{state.name} has not been explained", fix="r explains it")
    if state.found.verdict == "no_gap":
        raise UsageError("no gap was found, so that the model stays as it is", fix="there is nothing to accept")
    source = _text_of(state.model)
    if state.model.relative_to(state.path.parent).as_posix() in state.changed:
        fix = "explain the case again, or take back what changed"
        raise UsageError(f"{state.model.name} has changed since it was explained", fix=fix)
    same = target.exists() and target.samefile(state.model)
    if target.exists() and not same:
        raise UsageError(f"{target} is there already", fix="give another name")
    if not target.parent.is_dir():
        raise InputError("its directory does not exist", file=target, fix="make it first")
    text, rewritten = rewritten_text(state.model, state.found.model, target)
    difference = list(difflib.unified_diff(source.splitlines(), text.splitlines(), n=2, lineterm=""))[2:]
    return Adoption(target, text, source if same else None, tuple(difference), rewritten)


def take_over(state: CaseState, change: Adoption) -> None:
    """Write it, at once or not at all, and keep what was there; `UsageError` if the file has changed meanwhile."""
    now = _text_of(change.target) if change.target.exists() else None
    if now != change.before:
        raise UsageError(f"{change.target} has changed meanwhile", fix="look at the difference again")
    record = {"target": str(change.target), "before": change.before, "after": content_hash(change.text.encode())}
    write_text(state.out / _TAKEN, json.dumps(record) + "\n")
    write_text(change.target, change.text)


def take_back(state: CaseState, root: Path) -> Path:
    """Undo the last `take_over` of a case of the project `root`.

    `UsageError` where there is none, where the file was changed since, or lies outside of the project: the record is a
    file that anybody may have committed.
    """
    try:
        record = json.loads((state.out / _TAKEN).read_text(encoding="utf-8"))
        target, before, after = Path(record["target"]), record["before"], record["after"]
    except (OSError, ValueError, KeyError, TypeError):
        raise UsageError("nothing was accepted here", fix="there is nothing to take back") from None
    if not target.resolve().is_relative_to(root.resolve()):
        raise UsageError(
            f"{target} is not in {root}, where something was accepted", fix="there is nothing to take back"
        )
    if not target.is_file() or content_hash(target.read_bytes()) != after:
        fix = "compare it with version control; what was there before is kept"
        raise UsageError(f"{target} has changed since it was accepted", fix=f"{fix} in {state.out / _TAKEN}")
    if before is None:
        target.unlink()
    else:
        write_text(target, str(before))
    with contextlib.suppress(OSError):
        (state.out / _TAKEN).unlink()
    return target


def _text_of(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read: {error}", file=path, fix="check the file") from error
