"""Hesai's fire-time CSV: when each channel fires, in five shapes.

All are a table of a row a channel, in the order of firing or not, below one or two header lines; the shapes differ in
what their columns stand for. With one column, or columns that say the same, that is the time. Else each column is of a
state: even and odd columns, an operational and an azimuth state, a loop, a distance; `state` names one by its header.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from lidarcheck.config.words import shown
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.sensors.csv_text import Row, rows_of
from lidarcheck.formats.sensors.imported import rounded
from lidarcheck.formats.sensors.values import MOST_CHANNELS
from lidarcheck.formats.source import read_text

__all__ = ["fire_times", "is_fire_table"]

_UNIT = re.compile(r"(?<![a-z])(ns|us|\u03bcs|\u00b5s)(?![a-z])", re.IGNORECASE)
_DRESS = re.compile(r"fire ?_?times?|\([^)]*\)|/[a-z\u03bc\u00b5]+$|state", re.IGNORECASE)
_SILENT = "-"
_MOST_US = 1000.0
_MOST_STATES = 64
_SHOWN_STATES = 12
_SHOWN_LETTERS = 40


def is_fire_table(first: Sequence[str]) -> bool:
    """Whether these cells are the first header of a fire-time table."""
    text = ",".join(first).lower()
    return "firetime" in text.replace(" ", "").replace("_", "") or text.startswith(("operational state", "loop"))


def fire_times(path: Path, channels: Sequence[int], state: str | None) -> tuple[list[int], list[float], list[str]]:
    """The channels that fire, as places in `channels`, their times [us], and remarks.

    `InputError` where the file is no such table, a channel is missing or stands twice; `UsageError` where it has
    several states and `state` names none of them.
    """
    head, body = _parts(rows_of(read_text(path), path), path)
    column = _column(head, body, state, path)
    by_channel = {row.whole(0): row for row in body}
    missing = next((channel for channel in channels if channel not in by_channel), None)
    if missing is not None or len(by_channel) > len(channels):
        other = "" if missing is not None else f"{len(by_channel)} channels, the angle table {len(channels)}"
        what = f"channel {missing} of the angle table has no fire time" if missing is not None else f"it has {other}"
        raise InputError(what, file=path, fix="name the fire times of the same model")
    rows = [by_channel[channel] for channel in channels]
    kept = [at for at, row in enumerate(rows) if row.cells[column] != _SILENT]
    if not kept:
        raise InputError(f"no channel fires in state {state}", file=path, fix="choose another with --state")
    raw = [rows[at].number(column, "the fire time") for at in kept]
    scale, remarks = _scale(head, raw)
    times = [rounded(time * scale, "us") for time in raw]
    late = next((at for at, time in enumerate(times) if abs(time) > _MOST_US), None)
    if late is not None:
        what = f"a fire time of {times[late]:g} us"
        raise rows[kept[late]].fault(what, "is the unit in the header right? ns and us are known")
    if len(kept) < len(rows):
        remarks.append(f"{len(rows) - len(kept)} of {len(rows)} channels do not fire in this state and are left out.")
    return kept, times, remarks


def _parts(rows: Sequence[Row], path: Path) -> tuple[list[Row], list[Row]]:
    """The header lines and the channels' rows."""
    count = next((at for at, row in enumerate(rows) if row.whole(0) is not None), len(rows))
    head, body = list(rows[:count]), list(rows[count:])
    if body and len(body[-1].cells) < 2:
        body.pop()  # a checksum
    if not 1 <= len(head) <= 4 or not 0 < len(body) <= MOST_CHANNELS:
        fix = "expect a header and a row a channel"
        raise InputError("not a table of fire times that lidarcheck knows", file=path, fix=fix)
    width = len(body[0].cells)
    if not 2 <= width <= _MOST_STATES + 1:
        raise body[0].fault(f"the row has {width} cells, 2 to {_MOST_STATES + 1} are read")
    seen: set[int | None] = set()
    for row in body:
        channel = row.whole(0)
        if channel is None:
            raise row.fault(f"the channel is {shown(row.cells[0])}, no whole number")
        if channel in seen:
            raise row.fault(f"channel {channel} stands twice", "remove one")
        seen.add(channel)
        if len(row.cells) != width:
            raise row.fault(f"the row has {len(row.cells)} cells, the first has {width}")
    return head, body


def _column(head: Sequence[Row], body: Sequence[Row], state: str | None, path: Path) -> int:
    """The column of the state; the only one, or the first where all say the same."""
    columns = range(1, len(body[0].cells))
    names = _names(head, columns)
    if state is None:
        if all(len({row.cells[at] for at in columns}) == 1 for row in body):
            return 1
        raise UsageError("fire times depend on the sensor's state", file=path, fix=f"give --state, {_known(names)}")
    wanted = _plain(state)
    found = [at for at, name in zip(columns, names, strict=True) if _plain(name) == wanted]
    if len(found) != 1:
        what = f"--state {state} is none of the file" if not found else f"--state {state} is {len(found)} columns"
        raise UsageError(what, file=path, fix=f"use {_known(names)}")
    return found[0]


def _known(names: Sequence[str]) -> str:
    more = f" ... ({len(names)} in all)" if len(names) > _SHOWN_STATES else ""
    return "one of " + " | ".join(name[:_SHOWN_LETTERS] for name in names[:_SHOWN_STATES]) + more


def _names(head: Sequence[Row], columns: Sequence[int]) -> list[str]:
    """What the headers say of each column, without the words for a fire time; numbers from 1 where that tells none."""

    def said(row: Row, at: int) -> str:
        return _DRESS.sub("", row.cells[at]).strip(" _") if at < len(row.cells) else ""

    names = [",".join(word for word in (said(row, at) for row in head) if word) for at in columns]
    return names if len(set(names)) == len(names) and all(names) else [str(at) for at in columns]


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", "", name.lower())


def _scale(head: Sequence[Row], raw: Sequence[float]) -> tuple[float, list[str]]:
    """From the file's unit to us, which a header names; else whole numbers above 1000 are ns."""
    for row in head:
        found = _UNIT.search(" ".join(row.cells).replace("_", " "))
        if found:
            return (1e-3 if found[1].lower() == "ns" else 1.0), []
    ns = max(map(abs, raw)) > _MOST_US and all(time == int(time) for time in raw)
    unit = "ns" if ns else "us"
    return (1e-3 if ns else 1.0), [f"The fire-time file names no unit; its numbers are those of {unit}."]
