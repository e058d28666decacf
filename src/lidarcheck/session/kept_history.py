"""The edits of a project with the numbers that were found with them, for who asks later: a line for each that is noted.

A line that was not finished, or is none of ours, is left out.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.formats.atomic import write_bytes
from lidarcheck.session.journal import read_journal
from lidarcheck.session.own_files import own_directory, own_file

__all__ = ["KeptHistory", "NotedEdit", "read_history"]

_NAME = "history.jsonl"
_MOST_BYTES = 4_000_000
_KEPT = ("kind", "value", "low", "high", "key")
"""What is kept of a number."""
_LAST_S = 1e11
"""No clock shows as much [s since the epoch]."""


@dataclass
class NotedEdit:
    """An edit: when its session began and when it was made (seconds since the epoch), its number there, 0 for the files
    as they were read; of which file, what it did, whether it is taken back; what was found, by measurement and kind.
    """

    began: float
    edit: int
    when: float = 0.0
    file: str = ""
    what: str = ""
    undone: bool = False
    numbers: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)


class KeptHistory:
    """Appends to the file in the project's `.lidarcheck/tui/`; where that cannot be, nothing is noted."""

    def __init__(self, root: Path) -> None:
        self._root, self._is_cut = root, False

    def number(self, began: float, edit: Any, measurement: str, number: Any, step: Any) -> None:
        """A number was found with an edit; `edit`: an `open_files.Step`, `step`: the judgement, None where none is."""
        found = number.to_dict()
        judged = {} if step is None else {"difference": step.difference, "word": step.word}
        what = f"{edit.about}: {edit.what}" if edit.about else edit.what
        about = {"when": edit.when, "file": "" if edit.path is None else edit.path.name, "what": what}
        name = measurement.removesuffix(f", {number.kind}")
        kept = {"measurement": name, **{name: found[name] for name in _KEPT}, **judged}
        self._append({"began": began, "edit": edit.number, **about, "number": kept})

    def moved(self, began: float, edit: int, *, undone: bool) -> None:
        """An edit was taken back, or made again."""
        self._append({"began": began, "edit": edit, "undone": undone})

    def _append(self, record: Mapping[str, Any]) -> None:
        line = json.dumps(record, separators=(",", ":")) + "\n"
        with contextlib.suppress(OSError, InputError):  # edits are no less safe without it
            path = own_file(self._root, _NAME)
            if not self._is_cut:
                self._is_cut = True
                _cut(path)
            flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            descriptor = os.open(path, flags, 0o644)
            try:
                os.write(descriptor, line.encode())
            finally:
                os.close(descriptor)


def _cut(path: Path) -> None:
    """Leave the older half of a long file out."""
    if path.exists() and path.stat().st_size > _MOST_BYTES:
        _, _, later = path.read_bytes()[-_MOST_BYTES // 2 :].partition(b"\n")
        write_bytes(path, later)


def read_history(root: Path) -> list[NotedEdit]:
    """What was noted in a project, in the order of the edits; nothing where there is no file."""
    found: dict[tuple[float, int], NotedEdit] = {}
    for record in read_journal(own_directory(root) / _NAME):
        with contextlib.suppress(KeyError, TypeError, ValueError, OverflowError):
            key = _moment(record["began"]), int(record["edit"])
            one = found.setdefault(key, NotedEdit(*key))
            if "undone" in record:
                one.undone = bool(record["undone"])
                continue
            number = _number(record["number"])
            one.when, one.file, one.what = _moment(record["when"]), str(record["file"]), str(record["what"])
            one.numbers[number["measurement"], number["kind"]] = number
    return [found[key] for key in sorted(found) if found[key].numbers]


def _number(kept: Mapping[str, Any]) -> dict[str, Any]:
    """What was kept of a number; anybody may have written the file."""
    words = {name: str(kept[name]) for name in ("measurement", "kind", "key", "word") if name in kept}
    values = {name: float(kept[name]) for name in ("value", "low", "high", "difference") if kept.get(name) is not None}
    if not {"measurement", "kind", "value"} <= {*words, *values} or not all(map(math.isfinite, values.values())):
        raise ValueError("no number")
    return {**words, **values}


def _moment(seconds: Any) -> float:
    moment = float(seconds)
    if not 0.0 <= moment < _LAST_S:
        raise ValueError("no moment")
    return moment
