"""What is sent to the terminal in fewer bytes, with the same cells: those alone that it does not show yet, looks and
places where they change, and characters in ASCII where the terminal has no more.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from typing import NamedTuple

from rich.cells import cell_len

__all__ = ["FewBytes", "seven_bit_text"]

_TOKEN = re.compile(
    r"\x1b\[([0-9;]*)([Hm])|\x1b\[\?2026[hl]|\x1b(?:\[[0-?]*[ -/]*[@-~]|[^\[])|\r?\n|[^\x1b\r\n]+|\r", re.DOTALL
)
_ONE_WIDE = re.compile(r"[ -~\u00a1-\u00ac\u00ae-\u02ff\u2500-\u259f\u2800-\u28ff]*")
_CHANGES = re.compile(r"\x1b(?:\[[0-9;]*[@JKLMPSTXbr]|\[\?(?:3|47|69|1047|1049)[hl]|\[!p|[cDEM])")
"""What changes cells, or may, without writing into them."""
_SEEN_ON_BLANKS = frozenset(("4", "7", "9", "21", "53"))
"""Flags that are seen where there is no character: lines and reverse."""
_GAP, _ERASED = 3, 9
"""So many cells are written again rather than skipped, and so many blanks erased rather than written."""
_BEGIN, _END = "\x1b[?2026h", "\x1b[?2026l"
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

    @property
    def seen_on_blanks(self) -> _Look:
        """What of it is seen where there is no character."""
        return _Look("", self.back, self.flags & _SEEN_ON_BLANKS) if not self.flags & _SEEN_ON_BLANKS else self


_Place = tuple[int, int]
_Cell = tuple[str, _Look]


@dataclass
class FewBytes:
    """`seven_bit`: characters are ASCII. `erases`: the terminal can erase cells, and with `coloured` in the colour that
    is set. A call leaves no look behind: between two of them somebody else may write, not into cells though.
    """

    seven_bit: bool = False
    erases: bool = False
    coloured: bool = False

    def __post_init__(self) -> None:
        self._rows: dict[int, dict[int, _Cell]] = {}
        self._begun = False

    def forget(self) -> None:
        """What the terminal shows is not known any more, as after another size."""
        self._rows.clear()

    def __call__(self, text: str) -> str:
        """What is sent in the place of `text`."""
        self._sent: list[str] = []
        self._look, self._wanted = _Look(), _Look()
        self._at: _Place | None = None
        self._here: _Place | None = None
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
            self._here = (int(row or 1), int(column or 1))
        elif text in ("\n", "\r\n") and self._here is not None:
            self._here = (self._here[0] + 1, 1)
        elif text == _BEGIN:
            self._begun = True  # said when there is something to say
        elif text == _END:
            self._sent.extend([] if self._begun else [_END])
            self._begun = False
        elif text[0] in "\x1b\r\n":
            self._hand_on(text)
        else:
            self._show(seven_bit_text(text) if self.seven_bit else text)

    def _hand_on(self, text: str) -> None:
        """What is not known here. It may erase, in the look and at the place that are set; where it leaves the cursor
        is not asked.
        """
        self._put(self._here, self._wanted, text)
        self._at = self._here = None
        if _CHANGES.fullmatch(text):
            self.forget()

    def _show(self, text: str) -> None:
        """Characters in the look that is wanted, those that are not there yet."""
        known = _ONE_WIDE.match(text) if self._here is not None else None
        narrow = known[0] if known is not None else ""
        if narrow and self._here is not None:
            self._show_narrow(self._here, narrow)
            self._here = (self._here[0], self._here[1] + len(narrow))
        if len(narrow) < len(text):
            # A letter of another width may stand elsewhere than we think, and take cells with it.
            if self._here is not None:
                self._rows.pop(self._here[0], None)
            else:
                self.forget()
            self._put(self._here, self._wanted, text[len(narrow) :])
            self._at = self._here = None

    def _show_narrow(self, place: _Place, text: str) -> None:
        row, first = place
        shown, blank = self._rows.setdefault(row, {}), (" ", self._wanted.seen_on_blanks)
        cells = [blank if letter == " " else (letter, self._wanted) for letter in text]
        other = [at for at, cell in enumerate(cells) if shown.get(first + at) != cell]
        shown.update(enumerate(cells, first))
        while other:
            end = next((n for n in range(1, len(other)) if other[n] - other[n - 1] > _GAP + 1), len(other))
            self._put_run((row, first + other[0]), text[other[0] : other[end - 1] + 1])
            other = other[end:]

    def _put_run(self, place: _Place, text: str) -> None:
        """Cells of one row in the look that is wanted; long runs of blanks are erased."""
        row, column = place
        for part in re.findall(rf" {{{_ERASED},}}|(?:(?! {{{_ERASED}}}).)+", text) if self._erasing else [text]:
            look = self._wanted
            if part.isspace() and look.seen_on_blanks == self._look.seen_on_blanks:
                look = self._look  # whose other colour no blank shows
            if len(part) >= _ERASED and part.isspace() and self._erasing:
                self._put((row, column), look, f"\x1b[{len(part)}X")
            else:
                self._put((row, column), look, part)
                self._at = (row, column + len(part))
            column += len(part)

    @property
    def _erasing(self) -> bool:
        """Whether blanks in the look that is wanted can be erased."""
        wanted = self._wanted
        return self.erases and (self.coloured or not wanted.back) and not wanted.flags & _SEEN_ON_BLANKS

    def _put(self, place: _Place | None, look: _Look, text: str) -> None:
        """Go there, take the look, and send the text, behind which the cursor is not known, or where it was."""
        if self._begun:
            self._sent.append(_BEGIN)
            self._begun = False
        if place is not None and place != self._at:
            self._sent.append(self._move(self._at, place))
            self._at = place
        if look != self._look:
            self._sent.append(f"\x1b[{look.codes_after(self._look)}m")
            self._look = look
        self._sent.append(text)

    @staticmethod
    def _move(at: _Place | None, to: _Place) -> str:
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
