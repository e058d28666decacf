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
from lidarcheck.session.edited_model import EditedModel
from lidarcheck.session.own_files import content_hash, file_key, make_own_directory, own_directory
from lidarcheck.session.project import Project
from lidarcheck.session.takeover import ModelTakeover, model_takeover
from lidarcheck.trust.places import own_place

__all__ = [
    "Adoption",
    "CaseState",
    "Taken",
    "adopted",
    "adoption",
    "case_files",
    "check_unchanged",
    "forget_taken",
    "last_taken",
    "look_at",
    "make_results_directory",
    "note_taken",
    "remove_taken",
    "results_directory",
    "write_adopted",
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
    """A model that is about to be written to a new file. `diff`: how it differs from the case's; `rewritten`: why
    comments and layout could not be kept.
    """

    target: Path
    text: str
    diff: tuple[str, ...]
    rewritten: str


def check_adoptable(state: CaseState) -> None:
    """Refuse what there is nothing to take over of, or of another model than the case has now."""
    if state.found is None or state.model is None:
        raise UsageError(f"{state.name} has not been explained", fix="r explains it")
    if state.found.verdict == "no_gap":
        raise UsageError("no gap was found, so that the model stays as it is", fix="there is nothing to accept")
    if state.model.relative_to(state.path.parent).as_posix() in state.changed:
        fix = "explain the case again, or take back what changed"
        raise UsageError(f"{state.model.name} has changed since it was explained", fix=fix)


def adoption(state: CaseState, target: Path) -> Adoption:
    """What taking a case's explained model over into a new file would write; `UsageError` where that is refused."""
    check_adoptable(state)
    assert state.found is not None
    assert state.model is not None
    if target.exists():
        raise UsageError(f"{target} is there already", fix="give another name")
    if not target.parent.is_dir():
        raise InputError("its directory does not exist", file=target, fix="make it first")
    text, rewritten = rewritten_text(state.model, state.found.model, target)
    source = _text_of(state.model)
    difference = list(difflib.unified_diff(source.splitlines(), text.splitlines(), n=2, lineterm=""))[2:]
    return Adoption(target, text, tuple(difference), rewritten)


def adopted(state: CaseState, file: EditedModel) -> ModelTakeover:
    """What taking a case's explained model over into the file that it is of changes; `UsageError` where it is refused.

    The file is the case's own model, or the one that the case's is a copy of.
    """
    check_adoptable(state)
    assert state.model is not None
    return model_takeover(file, state.model, state.out / MODEL, edit_words(state))


def edit_words(state: CaseState) -> str:
    """What the edit is called that takes its model over."""
    return f"accept {state.name}"


def write_adopted(state: CaseState, change: Adoption) -> None:
    """Write the new file, at once or not at all; `UsageError` if there is one by now."""
    if change.target.exists():
        raise UsageError(f"{change.target} has changed meanwhile", fix="look at the difference again")
    note_taken(state, change.target, None, change.text.encode())
    write_text(change.target, change.text)


def note_taken(state: CaseState, target: Path, before: bytes | None, after: bytes) -> None:
    """Keep what a file was before a model was taken over into it; None for a new file."""
    text = None if before is None else before.decode("utf-8")
    record = {"target": str(target), "before": text, "after": content_hash(after)}
    write_text(state.out / _TAKEN, json.dumps(record) + "\n")


@dataclass(frozen=True)
class Taken:
    """What was taken over last: into which file, what that was before (None for a new file), and its SHA-256 after."""

    target: Path
    before: bytes | None
    after: str


def last_taken(state: CaseState, root: Path) -> Taken:
    """What was taken over last of a case of the project `root`.

    `UsageError` where that is nothing, or the file lies outside of the project: the record is a file that anybody may
    have committed.
    """
    try:
        record = json.loads((state.out / _TAKEN).read_text(encoding="utf-8"))
        before = record["before"]
        taken = Taken(Path(record["target"]), None if before is None else str(before).encode(), str(record["after"]))
    except (OSError, ValueError, KeyError, TypeError):
        raise UsageError("nothing was accepted here", fix="there is nothing to take back") from None
    if not taken.target.resolve().is_relative_to(root.resolve()):
        what = f"{taken.target} is not in {root}, where something was accepted"
        raise UsageError(what, fix="there is nothing to take back")
    return taken


def check_unchanged(state: CaseState, taken: Taken, content: bytes | None) -> None:
    """Refuse to take back what was changed since; `content`: what the file holds, None for no file."""
    if content is None or content_hash(content) != taken.after:
        fix = "compare it with version control; what was there before is kept"
        raise UsageError(f"{taken.target} has changed since it was accepted", fix=f"{fix} in {state.out / _TAKEN}")


def remove_taken(state: CaseState, taken: Taken) -> None:
    """Take back a new file."""
    check_unchanged(state, taken, taken.target.read_bytes() if taken.target.is_file() else None)
    taken.target.unlink()
    forget_taken(state)


def forget_taken(state: CaseState) -> None:
    """There is nothing to take back any more."""
    with contextlib.suppress(OSError):
        (state.out / _TAKEN).unlink()


def _text_of(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read: {error}", file=path, fix="check the file") from error
