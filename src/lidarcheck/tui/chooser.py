"""The chooser: anything that can be opened, found by letters of its kind, its name and what is said of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from textual import events
from textual.fuzzy import FuzzySearch

from lidarcheck.tui.widgets.lines import Line, line, printable
from lidarcheck.tui.widgets.listing import Listing
from lidarcheck.tui.widgets.typed import Typed

__all__ = ["PREFIXES", "Chooser", "Opening", "ranked"]

PREFIXES: Mapping[str, tuple[str, ...]] = {
    "@": ("measured",),
    "#": ("scenario", "case", "golden", "scene"),
    "%": ("lut", "settings", "model", "ideal", "recording"),
    "=": ("model", "table", "feature", "target", "effect", "source"),
    ":": ("action",),
}
"""The kinds that a first character narrows the list to."""
_MOST, _SHOWN, _WAYS = 5000, 200, 500
_KIND, _NAME = 9, 34


@dataclass(frozen=True)
class Opening:
    """Something to open. `words`: beside its name; `about`: what it is, before it is opened; `do`: opens it."""

    kind: str
    name: str
    words: str
    do: Callable[[], object]
    about: str = ""

    @property
    def key(self) -> str:
        """What it is remembered by."""
        return f"{self.kind} {self.name}"


class Chooser(Listing[Opening]):
    """`recent`: keys of what was opened last, which come first where nothing is typed. `marked`: what is opened
    together, one after the other, also while others are listed.
    """

    empty = "nothing is called so; without the first character all kinds are searched"
    keys = "@ measured  # scenario  % file  = choice  : action  Tab marks  ^G back"

    def __init__(self, openings: Sequence[Opening], recent: Sequence[str], typed: str = "") -> None:
        self._all = list(openings)[:_MOST]
        self._recent = list(recent)
        self.marked: list[Opening] = []
        self.typed = Typed(typed)
        super().__init__("", [])
        self.changed()

    def changed(self) -> None:
        """The best ones for what is typed."""
        text = self.typed.text if self.typed is not None else ""
        kinds = PREFIXES.get(text[:1])
        able = [one for one in self._all if kinds is None or one.kind in kinds]
        words = (text[1:] if kinds is not None else text).split()
        found = ranked(able, words, self._recent)
        self.title = f"Open: {len(found)} of {len(self._all)}"
        self.list_again(found[:_SHOWN])

    def key(self, event: events.Key) -> None:
        """Mark what is under the cursor, or not; Enter opens all that is marked."""
        if event.key == "tab" and self.items:
            item = self.items[self.number]
            self.marked = [one for one in self.marked if one is not item] + ([] if item in self.marked else [item])
            self.number = min(self.number + 1, len(self.items) - 1)
        elif event.key == "enter" and self.marked:
            self.dismiss(_all_of(self.marked))
        else:
            super().key(event)

    def row(self, item: Opening, width: int) -> Line:
        """Kind, name and words; a long name keeps its end."""
        name, room = printable(item.name), max(min(_NAME, width - _KIND - 2), 8)
        name = name if len(name) <= room else f"..{name[2 - room :]}"
        mark = "*" if item in self.marked else " "
        return ((f"{mark}{item.kind:{_KIND}}", "dim"), (f"{name:{room}} ", "text"), (item.words, "dim"))

    def last(self, _width: int) -> list[Line]:
        """What the marked one is."""
        if not self.items:
            return []
        one = self.items[self.number]
        return [line(f"{one.about or one.words or one.name}", "title")]


def _all_of(marked: Sequence[Opening]) -> Opening:
    """One that opens all of them, in the order in which they were marked."""

    def do() -> None:
        for one in marked:
            one.do()

    return Opening(marked[-1].kind, marked[-1].name, "", do)


def ranked(openings: Sequence[Opening], words: Sequence[str], recent: Sequence[str]) -> list[Opening]:
    """Those in which all words are found, the best first; of equals, and without words, those opened last first."""
    search = FuzzySearch()
    place = {key: -number for number, key in enumerate(recent)}
    found = []
    for number, one in enumerate(openings):
        scores = [_score(search, word, f"{one.name} {one.kind} {one.words}") for word in words]
        if all(scores):
            found.append((-sum(scores), -place.get(one.key, -len(recent) - 1), number, one))
    return [one for *_, one in sorted(found, key=lambda item: item[:3])]


def _score(search: FuzzySearch, word: str, text: str) -> float:
    """How well a word is found in a text, 0 where its letters are not there in order."""
    word, text = word.lower(), text.lower()
    places, at = [], -1
    for letter in word:
        at = text.find(letter, at + 1)
        if at < 0:
            return 0.0
        places.append(at)
    # All ways to find the letters are tried; with many of the same there are too many.
    if word in text or math.prod(text.count(letter) for letter in word) <= _WAYS:
        return search.match(word, text)[0]
    return search.score(text, places)
