"""The interface in tmux: resized, left and found again, and hung up, with an edit that is not saved."""

import os
import re
import shutil
import signal
import time

import pytest

import number_kit
from lidarcheck.calibration.number.entry import sample
from screen_kit import Screen
from tmux_kit import children, is_running, tmux  # noqa: F401 - a fixture
from tui_kit import make_project
from tui_measure import Terminal

pytestmark = [pytest.mark.long, pytest.mark.skipif(shutil.which("tmux") is None, reason="tmux is not installed")]


def row_of(text):
    """The table's row with the value that was typed; empty for none. What was said names it too, at a line's end."""
    return next((line[:36] for line in text.splitlines() if re.search(r" 455[_ ] ", line)), "")


def wait(true, shown, seconds=120.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, shown()
        time.sleep(0.05)


def test_an_edit_outlives_resizing_detaching_and_a_hang_up(tmux, tmp_path):  # noqa: F811
    project = make_project(tmp_path / "project")
    tmux.start(project, (80, 24), "--screen", "blooming", "--no-mouse")
    tmux.sees("a_lut.ini")
    tmux.keys("Down", "Down", "Down", "4", "5", "5", "Enter")
    wait(lambda: row_of(tmux.text), lambda: tmux.text)
    first = row_of(tmux.text)
    tmux.keys("Tab", "+")
    tmux.sees("Curve x 2")
    # Resized while something is computed: nothing is lost, the cursor is in the same row, and what is zoomed stays so.
    for size in ((120, 36), (60, 20), (30, 8), (80, 24)):
        tmux.resize(*size)
        time.sleep(0.3)
    wait(lambda: row_of(tmux.text) == first and "Curve x 2" in tmux.text, lambda: tmux.text)
    # Attached by two terminals one after the other: the second one sees what the first one saw.
    for _ in range(2):
        terminal = Terminal([*tmux.words, "attach", "-t", "t"], (80, 25))
        terminal.until(lambda screen: row_of(screen.text), 20.0)
        assert row_of(terminal.screen.text) == first
        terminal.press(b"\x02d")
        terminal.quiet(0.5, 5.0)
        os.close(terminal.end)
        os.waitpid(terminal.child, 0)
    # Hung up: the process ends at once and takes its workers with it; the edit is offered at the next start.
    process = tmux.process
    workers = children(process)
    os.kill(process, signal.SIGHUP)
    wait(lambda: not any(map(is_running, (process, *workers))), lambda: list(filter(is_running, (process, *workers))))
    tmux.stop()
    assert b"0.0001531" not in (project / "a_lut.ini").read_bytes()
    tmux.start(project, (80, 24), "--screen", "blooming", "--no-mouse")
    tmux.sees("bring them back")
    tmux.keys("b")
    wait(lambda: row_of(tmux.text), lambda: tmux.text)
    tmux.keys("u")
    wait(lambda: not row_of(tmux.text), lambda: tmux.text)


def test_from_a_fresh_project_to_a_fitted_table_that_is_better_and_saved(tmux, tmp_path):  # noqa: F811
    folder = number_kit.project(tmp_path / "project/signs")
    lut = folder / "table.ini"
    lut.write_text(number_kit.table([min(4.0 * y, 1.0) for y in number_kit.TRUE]))
    before = lut.read_text()
    tmux.start(folder.parent, (80, 24), "--no-mouse")
    wait(lambda: re.search(r"sign 100 m 1/1 \| misfit [\d.]+ sd *$", tmux.text, re.MULTILINE), lambda: tmux.text)
    tmux.keys("F5")
    tmux.sees("table.ini vertical")
    tmux.keys("F")
    tmux.sees("> lidarcheck bloom fit signs/real_100m.parquet")
    tmux.keys("End", "Enter")
    tmux.sees("Take it over", 120.0)
    time.sleep(1.0)  # a question that comes by itself takes no key at first
    assert lut.read_text() == before
    tmux.keys("y")
    wait(lambda: re.search(r"^table.ini \*8 \| .* edit -[\d.]+ better", tmux.text, re.MULTILINE), lambda: tmux.text)
    assert lut.read_text() == before
    tmux.keys("S")
    tmux.sees("Save 8 rows to table.ini?")
    tmux.keys("Enter")
    wait(lambda: lut.read_text() != before and "table.ini *" not in tmux.text, lambda: tmux.text)
    [fitted] = (folder.parent / ".lidarcheck/tui/runs").glob("*/out/table.ini")
    assert lut.read_text() == fitted.read_text()
    started = sample(number_kit.asked(folder))
    lut.write_text(before)
    assert started.value < 0.5 * sample(number_kit.asked(folder)).value


def test_a_screen_is_read_as_it_was_written():
    screen = Screen(10, 3)
    screen.feed(b"\x1b[?2026$p\x1b[2J\x1b[2;3Hab\x1b[31mc\x1b[0m\xe2")
    screen.feed(b"\x94\x80\x1b[1;1Hx\r\ny\x1b[?25l\x1b]0;title\x07z")
    assert screen.lines() == ["x", "yzabc\u2500", ""]
    assert screen.cells[1][4] == ("c", "31")
