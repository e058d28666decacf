"""The interface on a terminal, as bytes: dialogs cost little and touch nothing around them; no colour, no letter beyond
ASCII and no report of a moving mouse where the terminal has none; whatever is pasted, and at any size.
"""

import os
import re
import signal
import sys

import pytest

from lidarcheck.tui.widgets.themes import THEMES
from screen_kit import Screen
from tui_kit import make_project
from tui_measure import Terminal

SIZE = (80, 24)
MOST_BYTES = 4000
LEAVE = b"\x07"
COLOUR = re.compile(r"\x1b\[(?:[0-9;]*;)?(?:3[0-8]|4[0-8]|9[0-7]|10[0-7])(?:;[0-9;]*)?m")
BOXES = {"help": b"?", "palette": b"\x10", "open": b"o", "menu": b"m", "a question": b"w"}


class Watched(Terminal):
    """`sent_text`: all that was sent."""

    def read(self, seconds):
        part = super().read(seconds)
        self.sent_text = getattr(self, "sent_text", "") + part.decode("utf-8", "replace")
        return part


@pytest.fixture
def start(tmp_path, monkeypatch):
    project, begun = make_project(tmp_path / "project"), []
    for measured in (project / "measured").iterdir():
        measured.unlink()  # nothing is computed, and nothing comes by itself

    def on(*arguments, size=SIZE, **environ):
        for name in ("NO_COLOR", "COLORTERM", "LC_CTYPE"):
            monkeypatch.delenv(name, raising=False)
        for name, value in environ.items():
            monkeypatch.setenv(name, value)
        command = [sys.executable, "-m", "lidarcheck", "tui", str(project), *arguments]
        begun.append(Watched(command, size))
        return begun[-1]

    yield on
    for terminal in begun:
        terminal.stop()


def words(screen):
    return ["".join(letter or "" for letter, _ in row) for row in screen.cells]


def settled(terminal):
    """The project was read, the screen is there, and all is quiet."""
    waited = terminal.until(lambda screen: words(screen)[-2].startswith("3 scenarios, 2 gol"), 60.0)
    assert waited == waited, "\n".join(words(terminal.screen))
    terminal.quiet(1.5)


def test_a_box_leaves_what_is_around_it_and_costs_little(start):
    terminal = start("--screen", "blooming")
    settled(terminal)
    assert "\x1b[?1002h" in terminal.sent_text
    assert "\x1b[?1003h" not in terminal.sent_text
    assert "38;5;214" in terminal.sent_text, "now, of 256 colours"
    for name, key in BOXES.items():
        before = words(terminal.screen)
        cost = terminal.cost(key, 0.7)
        texts = words(terminal.screen)
        top = next(y for y, text in enumerate(texts) if "+-" in text)
        end = max(y for y, text in enumerate(texts) if "-+" in text)
        left, right = texts[top].index("+-"), texts[top].rindex("-+") + 2
        assert right - left >= 60, name
        assert end - top <= 3 * SIZE[1] // 4
        for y, row in enumerate(texts):
            outside = range(SIZE[0]) if not top <= y <= end else [*range(left), *range(right, SIZE[0])]
            assert [row[x] for x in outside] == [before[y][x] for x in outside], (name, y)
        cost += terminal.cost(LEAVE, 0.7)
        assert words(terminal.screen) == before, name
        assert cost <= MOST_BYTES, (name, cost)
    # The letters to jump by lie over titles and tabs, and nothing moves.
    before = words(terminal.screen)
    terminal.cost(b"g", 0.7)
    after = words(terminal.screen)
    assert after[1:] == before[1:]
    assert re.sub(r" [A-Z](?= )", "F.", f" {after[0][1:]}").strip().count("F.") == 8
    terminal.cost(LEAVE, 0.7)
    assert words(terminal.screen) == before


def test_without_colour_there_is_none_in_any_theme(start):
    terminal = start("--screen", "blooming", NO_COLOR="1")
    settled(terminal)
    for theme in [*THEMES[1:], THEMES[0]]:
        terminal.press(b"T")
        waited = terminal.until(lambda screen, wanted=f"theme: {theme}": wanted in words(screen)[-2], 10.0)
        assert waited == waited, theme
    terminal.cost(b"o", 0.7)
    assert not COLOUR.findall(terminal.sent_text)
    assert "a_lut.ini" in "".join(words(terminal.screen))


def test_ascii_alone_where_the_terminal_has_no_more(start):
    terminal = start("--screen", "blooming", LANG="C", LC_ALL="C")
    settled(terminal)
    assert "[F5 Bloom]" in words(terminal.screen)[0]
    terminal.cost("w\xb0m\xfcll".encode(), 0.7)
    assert terminal.sent_text.isascii(), {letter for letter in terminal.sent_text if not letter.isascii()}


def test_small_sizes_cut_no_word_and_have_every_box(start):
    terminal = start("--screen", "overview", size=(79, 12))
    settled(terminal)
    # Sizes that it never got to see have cut what stood there, though it has its own again.
    before = words(terminal.screen)
    os.kill(terminal.child, signal.SIGSTOP)
    for size in ((30, 8), (79, 12)):
        terminal.resize(*size)
    terminal.screen = Screen(79, 12)
    os.kill(terminal.child, signal.SIGCONT)
    waited = terminal.until(lambda screen: words(screen) == before, 10.0)
    assert waited == waited, words(terminal.screen)
    for columns in (79, 40, 20):
        if columns < 79:
            terminal.screen = Screen(columns, 12)
            terminal.resize(columns, 12)
            terminal.until(lambda screen: "q Quit" in words(screen)[-1], 20.0)
            terminal.quiet(0.4)
        before = words(terminal.screen)
        assert before[-1].rstrip().endswith("? Help  ^P Find  q Quit" if columns > 24 else "? Help  q Quit")
        assert re.fullmatch(r"(F\d( \w+)? ?)+", before[0].strip())
        assert "Measured" in before[2]
        for name, key in BOXES.items():
            terminal.press(key)
            waited = terminal.until(lambda screen: "+-" in "".join(words(screen)), 10.0)
            terminal.press(LEAVE)
            waited += terminal.until(lambda screen, text=before: words(screen) == text, 10.0)
            assert waited == waited, (columns, name, words(terminal.screen))


def test_what_is_pasted_is_typed_and_does_nothing_else(start):
    terminal = start("--screen", "blooming")
    settled(terminal)
    before = words(terminal.screen)
    garbage = b"q\x1b[31mD\n+++\x00\xff\xfe\xe2\x80\xae" + bytes(range(1, 27)) + b"uuu\x7f" * 40
    os.write(terminal.end, b"\x1b[200~" + garbage + b"\x1b[201~")
    terminal.quiet(1.0)
    assert words(terminal.screen)[3:22] == before[3:22]
    terminal.cost(b"w", 0.7)
    os.write(terminal.end, b"\x15\x1b[200~name of it\nsecond line\r\n\x1b[201~")
    terminal.quiet(1.0)
    assert "> name of it" in "\n".join(words(terminal.screen))
    assert "second" not in "\n".join(words(terminal.screen))
    terminal.cost(LEAVE, 0.7)
    assert words(terminal.screen)[3:22] == before[3:22]
