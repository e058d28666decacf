"""The entries of the first and the last line: whole ones only, and which of them is where."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from lidarcheck.tui.actions import SCREENS, Action, actions_of, key_name
from lidarcheck.tui.widgets.lines import Line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["Entry", "entry_at", "key_entries", "line_of", "tab_entries"]

_ALWAYS = ("help", "palette", "quit")
"""Their place at the right end of the last line is theirs alone."""
_GAP = 2
_LONGEST, _SHORT = 99, 4
"""Letters of a screen's name, and where that is too long for the line."""


class Entry(NamedTuple):
    """`text`, from the column `start` on; `action`: what a click does, as of an `Action`."""

    text: str
    role: Role
    start: int
    action: Action | None

    @property
    def end(self) -> int:
        """The column after it."""
        return self.start + len(self.text)


def line_of(entries: Sequence[Entry]) -> Line:
    """The entries in their columns."""
    found: list[tuple[str, Role]] = []
    at = 0
    for entry in entries:
        if entry.start > at:
            found.append((" " * (entry.start - at), "dim"))
        found.append((entry.text, entry.role))
        at = entry.end
    return tuple(found)


def entry_at(entries: Sequence[Entry], column: int) -> Entry | None:
    """The entry under a column."""
    return next((entry for entry in entries if entry.start <= column < entry.end), None)


def tab_entries(seen: str, running: Collection[str], width: int, *, bracketed: bool, labelled: bool) -> list[Entry]:
    """The screens, with as much of their names as there is room for; `running`: those where something runs.

    `bracketed`: the one that is seen stands in brackets; `labelled`: the letters to jump to them are in the place of
    their keys.
    """
    shortened = [{name: place.short[:most] for name, place in SCREENS.items()} for most in (_LONGEST, _SHORT)]
    for names in (*shortened, {seen: SCREENS[seen].short}, {}):
        entries: list[Entry] = []
        at = int(bracketed)
        for name, place in SCREENS.items():
            key = key_name(place.key)
            head = f"{place.label:>{len(key)}}" if labelled else key
            words = f"{head}{f' {names[name]}' if name in names else ''}{'~' if name in running else ''}"
            action = next((one for one in actions_of("") if one.name == name), None)
            here = bracketed and name == seen
            role: Role = "cursor" if labelled else "focus" if name == seen else "dim"
            entries.append(Entry(f"[{words}]" if here else words, role, at - here, action))
            at = entries[-1].end + (0 if here else 1)
        if entries[-1].end <= width:
            return entries
    return [entry for entry in entries if entry.end <= width]


def key_entries(actions: Sequence[Action], width: int) -> list[Entry]:
    """The keys of the actions that have a word for it, cut from their end; then, always, help, find and quit."""
    always = [action for name in _ALWAYS for action in actions if action.name == name and not action.screen]
    last = [f"{key_name(action.keys[0])} {action.short}" for action in always]
    # Where there is no room for all three, finding goes first: help names it.
    while last and len((" " * _GAP).join(last)) > width:
        del last[len(last) // 2], always[len(always) // 2]
    at = max(width - len((" " * _GAP).join(last)), 0)
    entries: list[Entry] = []
    room, start = at - _GAP, 0
    for action in actions:
        text = (
            action.short if " " in action.short else f"{key_name(action.keys[0])} {action.short}" if action.keys else ""
        )
        if not action.short or action in always or action.name in SCREENS:
            continue
        if start + len(text) > room:
            break
        entries.append(Entry(text, "dim", start, action))
        start = entries[-1].end + _GAP
    for action, text in zip(always, last, strict=True):
        entries.append(Entry(text, "dim", at, action))
        at = entries[-1].end + _GAP
    return entries
