"""What is sent to the terminal in fewer bytes, with the same cells: looks and places are told where they change, and
characters are ASCII where the terminal has no more.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import NamedTuple

from rich.cells import cell_len

__all__ = ["FewBytes", "seven_bit_text"]

_TOKEN = re.compile(
    r"\x1b\[([0-9;]*)([Hm])|\x1b\[\?2026[hl]|\x1b(?:\[[0-?]*[ -/]*[@-~]|[^\[])|\r\n|[^\x1b\r]+|\r", re.DOTALL
)
_ONE_WIDE = re.compile(r"[ -~\u00a1-\u00ac\u00ae-\u02ff\u2500-\u259f\u2800-\u28ff]*")
_PLAIN = {
    **dict.fromkeys("┌┐└┘├┤┬┴┼╭╮╯╰", "+"), **dict.fromkeys("─━╌┄", "-"), **dict.fromkeys("│┃╎┆", "|"),
    **dict.fromkeys("▀▄█▌▐▘▝▖▗▚▞▛▜▙▟▁▂▃▅▆▇░▒▓●■", "#"), **dict.fromkeys("–—−", "-"), **dict.fromkeys("·•", "."),
    "…": ".", "°": "o", "µ": "u", "μ": "u", "×": "x", "±": "~", "²": "2", "³": "3", "→": ">", "←": "<",
    "↑": "^", "↓": "v",
    "‘": "'", "’": "'", "“": '"', "”": '"', "≤": "<", "≥": ">", "σ": "s", "Δ": "D",
}  # fmt: skip


class _Look(NamedTuple):
    """Of cells: colours of front and back and all else, each as the parameters that say it; empty as the terminal has
    it by itself.
    """

    front: str = ""
    back: str = ""
    flags: frozenset[str] = frozenset()

    def with_codes(self, codes: str) -> _Look:
        """This look after a sequence of parameters."""
        front, back, flags, numbers = self.front, self.back, self.flags, codes.split(";") if codes else ["0"]
        at = 0
        while at < len(numbers):
            number = int(numbers[at] or 0)
            size = {5: 3, 2: 5}.get(int(numbers[at + 1] or 0), 1) if number in (38, 48) and at + 1 < len(numbers) else 1
            part = ";".join(numbers[at : at + size])
            at += size
            if number == 0:
                front, back, flags = "", "", frozenset()
            elif number in (38, *range(30, 38), *range(90, 98)):
                front = part
            elif number in (48, *range(40, 48), *range(100, 108)):
                back = part
            elif number in (39, 49):
                front, back = ("" if number == 39 else front), ("" if number == 49 else back)
            else:
                flags |= {part}
        return _Look(front, back, flags)

    def codes_after(self, before: _Look) -> str:
        """The parameters that make this look of the one before."""
        lost = (before.front and not self.front) or (before.back and not self.back) or before.flags - self.flags
        front = self.front if lost or self.front != before.front else ""
        back = self.back if lost or self.back != before.back else ""
        flags = sorted(self.flags if lost else self.flags - before.flags)
        whole = [part for part in (*flags, front, back) if part]
        return ";".join(["0", *whole] if lost and whole else whole)


@dataclass
class FewBytes:
    """`seven_bit`: characters are ASCII. Between two calls somebody else may write: a call leaves no look behind."""

    seven_bit: bool = False

    def __call__(self, text: str) -> str:
        """What is sent in the place of `text`."""
        self._sent: list[str] = []
        self._look, self._wanted = _Look(), _Look()
        self._at: tuple[int, int] | None = None
        self._to: tuple[int, int] | None = None
        for token in _TOKEN.finditer(text):
            self._take(token)
        if self._look != _Look():
            self._sent.append("\x1b[m")
        return "".join(self._sent)

    def _take(self, token: re.Match[str]) -> None:
        text, (numbers, kind) = token[0], token.groups()
        if kind == "m":
            self._wanted = self._wanted.with_codes(numbers)
        elif kind == "H":
            row, _, column = numbers.partition(";")
            self._to = (int(row or 1), int(column or 1))
        elif text == "\r\n" and (self._to or self._at) is not None:
            row, _ = self._to or self._at or (1, 1)
            self._to = (row + 1, 1)
        elif text.startswith("\x1b[?2026"):
            self._sent.append(text)
        elif text[0] in "\x1b\r":
            # It may erase, in the look and at the place that are set; where it leaves the cursor is not asked.
            self._set_look_and_place()
            self._sent.append(text)
            self._at = None
        else:
            self._set_look_and_place()
            shown = seven_bit_text(text) if self.seven_bit else text
            self._sent.append(shown)
            known = self._at is not None and _ONE_WIDE.fullmatch(shown) is not None
            self._at = (self._at[0], self._at[1] + len(shown)) if known and self._at is not None else None

    def _set_look_and_place(self) -> None:
        if self._to is not None and self._to != self._at:
            self._sent.append(self._move(self._at, self._to))
            self._at = self._to
        self._to = None
        if self._wanted != self._look:
            codes = self._wanted.codes_after(self._look)
            self._sent.append(f"\x1b[{codes}m")
            self._look = self._wanted

    @staticmethod
    def _move(at: tuple[int, int] | None, to: tuple[int, int]) -> str:
        if at is not None and at[0] == to[0] and to[1] > at[1]:
            return f"\x1b[{to[1] - at[1]}C"
        if at is not None and to == (at[0] + 1, 1):
            return "\r\n"
        return f"\x1b[{to[0]};{to[1]}H"


def seven_bit_text(text: str) -> str:
    """A text in ASCII that fills the same cells."""
    return text if text.isascii() else "".join(_plain(letter) for letter in text)


def _plain(letter: str) -> str:
    if letter.isascii() or letter in _PLAIN:
        return _PLAIN.get(letter, letter)
    if "\u2801" <= letter <= "\u28ff":
        return "#"
    base = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode()
    cells = cell_len(letter)
    return base if len(base) == cells and base.isprintable() else "?" * cells
