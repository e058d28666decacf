"""Fewer bytes say the same: a terminal that reads them shows the same cells in the same looks."""

import random
import re

import pytest

from lidarcheck.tui.few_bytes import FewBytes, seven_bit_text
from lidarcheck.tui.pasted import Pasted

SGR = ("1;38;5;110;48;5;16", "38;5;251;48;5;16", "7;38;2;200;204;208;48;2;16;20;24", "31", "1", "4;39;49", "97;100")


class Terminal:
    """Cells as (character, look), of what is written to it; it knows what is sent and no more."""

    def __init__(self, rows=6, columns=30):
        self.cells, self.size = {}, (rows, columns)
        self.row = self.column = 1
        self.look = ("", "", frozenset())

    def seen(self):
        """The cells by what is seen of them: of a blank its back, and lines or reverse."""
        return {
            place: (letter, look if letter != " " or look[2] & {"4", "7"} else look[1])
            for place, (letter, look) in self.cells.items()
        }

    def write(self, data):
        data = re.sub(r"\x1b\[\?2026[hl]", "", data)
        for numbers, kind, newline, text in re.findall(r"\x1b\[([0-9;]*)([A-Za-z])|(\r?\n)|([^\x1b\r\n]+)", data):
            if kind == "H":
                self.row, self.column = (int(n or 1) for n in numbers.split(";"))
            elif kind == "C":
                self.column += int(numbers)
            elif kind == "m":
                self._sgr(numbers)
            elif kind == "X":
                for at in range(int(numbers)):
                    self.cells[self.row, self.column + at] = (" ", self.look)
            elif newline:
                self.row, self.column = self.row + 1, 1
            for letter in text:
                self.cells[self.row, self.column] = (letter, self.look)
                self.column += 1
        return self

    def _sgr(self, numbers):
        front, back, flags = self.look
        parts = iter((numbers or "0").split(";"))
        for part in parts:
            if part in ("38", "48"):
                kind = next(parts)
                said = (part, kind, *(next(parts) for _ in range(1 if kind == "5" else 3)))
                front, back = (said, back) if part == "38" else (front, said)
            elif part == "0":
                front, back, flags = "", "", frozenset()
            elif part in ("39", "49"):
                front, back = ("", back) if part == "39" else (front, "")
            elif part[0] in "39" and len(part) == 2:
                front = part
            elif part[0] in "41" and len(part) > 1:
                back = part
            else:
                flags |= {part}
        self.look = (front, back, flags)


def as_textual_writes(rng):
    """A run of updates: moves, styled pieces, each reset behind it, ends of lines."""
    parts = ["\x1b[?2026h"]
    for _ in range(rng.randrange(1, 12)):
        parts.append(f"\x1b[{rng.randrange(1, 6)};{rng.randrange(1, 12)}H")
        for _ in range(rng.randrange(1, 4)):
            text = "".join(rng.choice("ab |#─⣿é") * rng.choice((1, 1, 1, 12)) for _ in range(rng.randrange(1, 5)))
            parts.append(f"\x1b[{rng.choice(SGR)}m{text}\x1b[0m")
            if rng.random() < 0.3:
                parts.append(f"\x1b[{rng.randrange(1, 6)};{rng.randrange(1, 12)}H")
        parts.append(rng.choice(["\r\n", "", "x", "\n\r\n"]))
    return "".join([*parts, "\x1b[?2026l"])


@pytest.mark.parametrize("erases", [(False, False), (True, False), (True, True)])
def test_the_same_cells_in_the_same_looks(erases):
    rng, few, sent, asked = random.Random(7), FewBytes(False, *erases), 0, 0
    one, other = Terminal(), Terminal()
    for at in range(300):
        if at % 20 == 19:
            few.forget()
        data = as_textual_writes(rng)
        short = few(data)
        one.write(data)
        other.write(short)
        assert one.seen() == other.seen(), (data, short)
        assert other.look == ("", "", frozenset())
        sent, asked = sent + len(short), asked + len(data)
    assert sent < 0.85 * asked


@pytest.mark.parametrize(
    ("data", "short"),
    [
        # What lies between the pieces of one line, and behind a line, says nothing.
        ("\x1b[2;3H\x1b[1;31mab\x1b[0m\x1b[2;5H\x1b[1;31mcd\x1b[0m\x1b[2;9H\r\n", "\x1b[2;3H\x1b[1;31mabcd\x1b[m"),
        ("\x1b[31ma\x1b[0m\x1b[31;4mb\x1b[0m", "\x1b[31ma\x1b[4mb\x1b[m"),
        ("\x1b[31;4ma\x1b[0m\x1b[31mb\x1b[0mc", "\x1b[4;31ma\x1b[0;31mb\x1b[mc"),
        # What is not known here goes through, in the look and at the place that were set.
        ("\x1b[31m\x1b[2;2H\x1b[Kx\x1b[0m", "\x1b[2;2H\x1b[31m\x1b[Kx\x1b[m"),
        ("\x1b]52;c;aGk=\x07\x1b[?25l", "\x1b]52;c;aGk=\x07\x1b[?25l"),
        # A letter of another width may stand elsewhere than we think: the next place is told.
        ("\x1b[1;1H漢\x1b[1;3Hx", "\x1b[1;1H漢\x1b[1;3Hx"),
    ],
)
def test_what_is_left_out(data, short):
    assert FewBytes()(data) == short


def test_what_is_shown_already_is_not_sent_again():
    few = FewBytes(erases=True)
    begin, end = "\x1b[?2026h", "\x1b[?2026l"
    line = f"\x1b[2;1H\x1b[31mab\x1b[0m{' ' * 20}\x1b[32mcd\x1b[0m"
    assert few(line) == "\x1b[2;1H\x1b[31mab\x1b[20X\x1b[20C\x1b[32mcd\x1b[m"
    assert [few(one) for one in (begin, line, end)] == ["", "", ""]
    assert few(line.replace("b", "x")) == "\x1b[2;2H\x1b[31mx\x1b[m"
    assert few(f"{begin}{line.replace('b', 'y')}{end}") == f"{begin}\x1b[2;2H\x1b[31my{end}\x1b[m"
    for gone in ("\x1b[?1049h", "\x1b[2J", "\x1b[2;1H漢"):
        few(gone)
        assert few(line).endswith("ab\x1b[20X\x1b[20C\x1b[32mcd\x1b[m"), gone
    few.forget()
    assert few(line).startswith("\x1b[2;1H\x1b[31mab")


def test_ascii_fills_the_same_cells():
    few = FewBytes(seven_bit=True)
    text = few("\x1b[1;1H\x1b[31m─┼│ ⣿⠁ ▄ 25 °C … é µm 漢 σ ✓\x1b[0m")
    assert text.isascii()
    assert "-+| ## # 25 oC . e um ?? s ?" in text
    assert len(seven_bit_text("éß漢→")) == 5  # one wide letter


def test_what_is_pasted_comes_whole_and_as_text():
    start, end, pasted = "\x1b[200~", "\x1b[201~", Pasted()
    assert pasted("ab\x1b[A") == "ab\x1b[A"
    assert pasted(f"a{start}x\x1b[31m") == "a"
    assert pasted("q\x03\x9b\n\ty\x1b[20") == ""
    assert pasted(f"1~b{start}{end}") == f"{start}x[31mq\n\ty{end}b{start}{end}"
    assert pasted("q") == "q"
