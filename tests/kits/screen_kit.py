"""What a program has drawn on a terminal: cells with their looks, from the bytes that it sent."""

import codecs
import re

from rich.cells import cell_len

_PART = re.compile(
    r"\x1b\[(?P<arguments>[0-9;:?<>=!]*)[ -/]*(?P<final>[@-~])"
    r"|\x1b[\]P_^](?P<text>.*?)(?:\x07|\x1b\\)"
    r"|\x1b[()][0-9A-Z]|\x1b[=>78cDEHMNOZ]"
    r"|(?P<control>[\x00-\x1a\x1c-\x1f\x7f])|(?P<char>[^\x1b])",
    re.DOTALL,
)


class Screen:
    """`cells[row][column]`: (character, SGR parameters in force, as text)."""

    def __init__(self, columns, rows):
        self.columns, self.rows = columns, rows
        self._decode = codecs.getincrementaldecoder("utf-8")("replace").decode
        self._rest, self._look = "", ""
        self.row = self.column = 0
        self.clear()

    def clear(self):
        self.cells = [[(" ", "")] * self.columns for _ in range(self.rows)]

    def feed(self, content):
        """Draw bytes; a sequence that is cut in two waits for its end."""
        text, at = self._rest + self._decode(content), 0
        while at < len(text):
            part = _PART.match(text, at)
            if part is None:
                if len(text) - at < 4096 and text[at] == "\x1b":
                    break
                at += 1
                continue
            at = part.end()
            if part["final"]:
                self._sequence(part["arguments"], part["final"])
            elif part["control"]:
                self._control(part["control"])
            elif part["char"]:
                self._put(part["char"])
        self._rest = text[at:]

    def _put(self, char):
        width = cell_len(char)
        if self.column + width > self.columns:
            self.column = 0
            self._down()
        for i in range(width):
            self.cells[self.row][self.column + i] = (char if i == 0 else "", self._look)
        self.column += width

    def _down(self):
        if self.row + 1 < self.rows:
            self.row += 1
        else:
            self.cells = [*self.cells[1:], [(" ", "")] * self.columns]

    def _control(self, char):
        if char == "\r":
            self.column = 0
        elif char == "\n":
            self._down()
        elif char == "\b":
            self.column = max(self.column - 1, 0)

    def _sequence(self, arguments, final):
        if arguments[:1] in ("?", ">", "<", "="):
            if final == "h" and "1049" in arguments:
                self.clear()
            return
        values = [int(one or 0) for one in re.split("[;:]", arguments) if one.isdigit() or not one]
        first = max(values[0], 1) if values else 1
        if final == "m":
            reset = arguments in ("", "0")
            self._look = "" if reset else arguments.removeprefix("0;") if arguments[:2] == "0;" else (
                f"{self._look};{arguments}" if self._look else arguments
            )  # fmt: skip
        elif final in "Hf":
            second = max(values[1], 1) if len(values) > 1 else 1
            self.row, self.column = min(first, self.rows) - 1, min(second, self.columns) - 1
        elif final in "ABCDGd":
            self._move(final, first)
        elif final in "JKX":
            self._erase(final, values[0] if values else 0, first)

    def _move(self, final, by):
        row = {"A": self.row - by, "B": self.row + by, "d": by - 1}.get(final, self.row)
        column = {"C": self.column + by, "D": self.column - by, "G": by - 1}.get(final, self.column)
        self.row, self.column = min(max(row, 0), self.rows - 1), min(max(column, 0), self.columns - 1)

    def _erase(self, final, how, count):
        blank, line = (" ", self._look), self.cells[self.row]
        if final == "X":
            line[self.column : self.column + count] = [blank] * min(count, self.columns - self.column)
            return
        if how in (0, 2):
            line[self.column :] = [blank] * (self.columns - self.column)
        if how in (1, 2):
            line[: self.column + 1] = [blank] * (self.column + 1)
        if final == "J":
            gone = range(self.row + 1, self.rows) if how == 0 else range(self.row) if how == 1 else range(self.rows)
            for row in gone:
                self.cells[row] = [blank] * self.columns

    def lines(self):
        """The text of each row."""
        return ["".join(char for char, _ in row).rstrip() for row in self.cells]

    @property
    def text(self):
        return "\n".join(self.lines())
