"""`lidarcheck gap --history`: the edits that were made in the terminal interface, with the numbers found with each."""

from __future__ import annotations

import json as json_module
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.core.outputs import write_result
from lidarcheck.cli.core.terminal import Column, emit, table
from lidarcheck.errors import InputError
from lidarcheck.figures.words import squeezed

if TYPE_CHECKING:
    from lidarcheck.session.kept_history import NotedEdit

__all__ = ["show_history"]

_WIDEST = 48
"""Columns of what an edit did; JSON has all of it."""


def show_history(places: Sequence[Path], json: str | None) -> int:
    """Print what was noted in each project; nothing is computed."""
    from lidarcheck.session.kept_history import read_history

    edits: list[NotedEdit] = []
    for place in places:
        if not place.is_dir():
            raise InputError("is no directory of a project", file=place, fix="name one in which edits were made")
        edits += read_history(place)
    if not edits:
        what = "has no edit with a number"
        raise InputError(what, file=places[0], fix="lidarcheck tui notes them while tables and models are edited")
    if json is not None:
        document = {"format": 1, "edits": [_document(one) for one in edits]}
        write_result(json, json_module.dumps(document, indent=2, ensure_ascii=False) + "\n")
    if json != "-":
        columns = [Column("when"), Column("edit", True), Column("file"), Column("what"), Column("measurement"),
                   Column("number"), Column("sd", True), Column("step", True), Column("word")]  # fmt: skip
        emit(table(columns, [row for one in edits for row in _rows(one)]))
    return 0


def _document(one: NotedEdit) -> dict[str, Any]:
    about = {name: getattr(one, name) for name in ("began", "edit", "when", "file", "what", "undone")}
    return {**about, "numbers": list(one.numbers.values())}


def _rows(one: NotedEdit) -> list[list[str]]:
    when = time.strftime("%Y-%m-%d %H:%M", time.localtime(one.when or one.began))
    what = f"{squeezed(one.what, _WIDEST, '..')}{', taken back' if one.undone else ''}"
    about = [when, str(one.edit), one.file, what]
    rows: list[list[str]] = []
    for (name, kind), number in one.numbers.items():
        step = number.get("difference")
        judged = ["", ""] if step is None else [f"{float(step):+.2g}", str(number.get("word", ""))]
        rows.append([*(about if not rows else ["", "", "", ""]), name, kind, f"{number['value']:.2g}", *judged])
    return rows
