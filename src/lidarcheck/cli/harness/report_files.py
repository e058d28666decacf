"""The results that a release report collects, found in directories."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lidarcheck.cli.core.workflow_output import PAGE, RESULT
from lidarcheck.cli.explain.files import PAGE as EXPLAIN_PAGE
from lidarcheck.cli.explain.files import REPORT as EXPLAIN_REPORT
from lidarcheck.errors import InputError
from lidarcheck.figures.html.foreign import foreign_in
from lidarcheck.figures.html.page import main_of
from lidarcheck.figures.html.release import Outcome
from lidarcheck.formats.limits import RESULT_BYTES, check_bytes

__all__ = ["CHECK", "checks_in", "outcomes_in"]

CHECK = "check.json"
_KEYS = {"workflow": str, "lidarcheck": str, "summary": str, "provenance": dict}
_DEEPEST = 5


def outcomes_in(directories: Sequence[Path]) -> tuple[list[Outcome], list[str]]:
    """(the results found, what was found amiss, a line each), in the directories' and the files' order.

    A result is the `result.json` of a workflow, or the `report.json` of `explain`. `InputError`: a directory that is
    none, or a file that cannot be read.
    """
    outcomes: dict[Path, Outcome] = {}
    amiss: list[str] = []
    for directory in directories:
        if not directory.is_dir():
            what = "is not a directory" if directory.exists() else "there is no such directory"
            raise InputError(what, file=directory, fix="give the directories that workflows wrote with --out")
        before = len(outcomes) + len(amiss)
        for file in _named(directory, (RESULT, EXPLAIN_REPORT)):
            if file.resolve() in outcomes:
                continue
            found = _outcome(file)
            if isinstance(found, str):
                amiss.append(found)
            else:
                outcomes[file.resolve()] = found
        if len(outcomes) + len(amiss) == before and not _named(directory, (CHECK,)):
            amiss.append(f"{directory}: no result of a workflow in it")
    return list(outcomes.values()), amiss


def checks_in(directories: Sequence[Path]) -> list[Path]:
    """The files called check.json, which `lidarcheck check --json` may have written."""
    return [file for directory in directories if directory.is_dir() for file in _named(directory, (CHECK,))]


def _named(directory: Path, names: Sequence[str]) -> list[Path]:
    """Files of these names, some directories deep, none in a hidden one."""
    found = []
    for path in sorted(path for name in names for path in directory.rglob(name)):
        inside = path.relative_to(directory).parts
        if path.is_file() and len(inside) <= _DEEPEST and not any(part.startswith(".") for part in inside):
            found.append(path)
    return found


def _outcome(file: Path) -> Outcome | str:
    """The result, or what speaks against its being one."""
    try:
        check_bytes(file.stat().st_size, file, RESULT_BYTES)
        document = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror or error}", file=file, fix="check its permissions") from error
    except ValueError:
        return f"{file}: is not JSON, left out"
    if isinstance(document, dict) and file.name == EXPLAIN_REPORT and {"verdict", "effects", "gap"} <= document.keys():
        return _explained(file, document)
    if not isinstance(document, dict) or any(not isinstance(document.get(key), kind) for key, kind in _KEYS.items()):
        return f"{file}: is not the result of a workflow, left out"
    page, note = _page(file, document.get("page"))
    note = "; ".join(filter(None, (_old(file, document), note)))
    return Outcome(
        workflow=document["workflow"],
        title=str(document.get("title") or document["workflow"]),
        summary=document["summary"],
        version=document["lidarcheck"],
        file=file,
        provenance={str(name): str(words) for name, words in document["provenance"].items()},
        page=page,
        note=note,
    )


def _old(file: Path, document: dict[str, Any]) -> str:
    """What of the files that a result was computed from has changed since; empty where nothing has."""
    from lidarcheck.session.origin import COMPUTED_FROM, changed_since

    changed = changed_since(document.get(COMPUTED_FROM), file.resolve().parents[:_DEEPEST])
    more = f" and {len(changed) - 3} more" if len(changed) > 3 else ""
    return f"OLD: {', '.join(changed[:3])}{more} changed since it was computed" if changed else ""


def _page(file: Path, record: Any) -> tuple[str, str]:
    """(the page beside a result, why it is not shown): only the one that was written with it."""
    if not isinstance(record, dict) or not isinstance(record.get("sha256"), str):
        return "", "the result has no page"
    beside = file.with_name(PAGE)
    if not beside.is_file():
        return "", f"{beside} is gone"
    content = beside.read_bytes()
    if hashlib.sha256(content).hexdigest() != record["sha256"]:
        return "", f"{beside} is of another run, or was edited"
    text = content.decode("utf-8")
    foreign = foreign_in(main_of(text, ""))
    return (text, "") if not foreign else ("", f"{beside} holds {foreign}, which lidarcheck does not write")


def _explained(file: Path, document: dict[str, Any]) -> Outcome:
    """The gap workflow's result in the words of the others."""
    effects = document["effects"] if isinstance(document["effects"], list) else []
    names = [str(effect.get("name")) for effect in effects if isinstance(effect, dict)]
    gap = document["gap"] if isinstance(document["gap"], dict) else {}
    sizes = [
        f"{words} {size:.4g}" for words in ("before", "after", "floor") if (size := _size(gap.get(words))) is not None
    ]
    found = f": {', '.join(names)}" if names else ""
    beside = file.with_name(EXPLAIN_PAGE)
    return Outcome(
        workflow="explain",
        title="What the model lacks",
        summary=f"Verdict {document['verdict']}{found}. Gap {', '.join(sizes) or 'unknown'}.",
        version="",
        file=file,
        provenance={},
        note="; ".join(filter(None, (_old(file, document), f"its page is {beside}" if beside.is_file() else ""))),
    )


def _size(value: Any) -> float | None:
    """A gap's size, as a number or with its interval."""
    if isinstance(value, dict):
        value = value.get("value")
    return float(value) if isinstance(value, int | float) else None
