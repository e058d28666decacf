"""The interface in tmux: resized, left and found again, and hung up, with an edit that is not saved."""

import os
import shutil
import signal
import time

import pytest

from screen_kit import Screen
from tmux_kit import children, is_running, tmux  # noqa: F401 - a fixture
from tui_kit import make_project
from tui_measure import Terminal

pytestmark = [pytest.mark.long, pytest.mark.skipif(shutil.which("tmux") is None, reason="tmux is not installed")]


def lines(text):
    return [line.rstrip() for line in text.splitlines()]


def test_an_edit_outlives_resizing_detaching_and_a_hang_up(tmux, tmp_path):  # noqa: F811
    project = make_project(tmp_path / "project")
    tmux.start(project, (80, 24), "--screen", "blooming", "--no-mouse")
    tmux.sees("a_lut.ini")
    tmux.keys("Down", "Down", "Down", "4", "5", "5", "Enter")
    tmux.sees(" 455 ")
    first = next(line for line in lines(tmux.text) if " 455 " in line)
    # Resized while something is computed: nothing is lost, and the cursor's row is the same.
    tmux.keys("+", "-")
    for size in ((120, 36), (60, 20), (30, 8), (80, 24)):
        tmux.resize(*size)
        time.sleep(0.3)
    tmux.sees(" 455 ")
    assert first[:30] in tmux.text, tmux.text
    # Attached by two terminals one after the other: the second one sees what the first one saw.
    seen = []
    for _ in range(2):
        terminal = Terminal([*tmux.words, "attach", "-t", "t"], (80, 25))
        terminal.until(lambda screen: " 455 " in screen.text, 20.0)
        seen.append([line for line in lines(terminal.screen.text) if " 455 " in line])
        terminal.press(b"\x02d")
        terminal.quiet(0.5, 5.0)
        os.close(terminal.end)
        os.waitpid(terminal.child, 0)
    assert seen[0] == seen[1] != []
    # Hung up: the process ends at once and takes its workers with it; the edit is offered at the next start.
    process = tmux.process
    workers = children(process)
    os.kill(process, signal.SIGHUP)
    end = time.monotonic() + 10.0
    while any(is_running(one) for one in (process, *workers)):
        assert time.monotonic() < end, [one for one in (process, *workers) if is_running(one)]
        time.sleep(0.05)
    tmux.stop()
    assert b"455" not in (project / "a_lut.ini").read_bytes()
    tmux.start(project, (80, 24), "--screen", "blooming", "--no-mouse")
    tmux.sees("bring them back")
    tmux.keys("b")
    tmux.sees(" 455 ")
    tmux.keys("u", "u", "u")
    end = time.monotonic() + 20.0
    while " 455 " in tmux.text:
        assert time.monotonic() < end, tmux.text
        time.sleep(0.05)


def test_a_screen_is_read_as_it_was_written():
    screen = Screen(10, 3)
    screen.feed(b"\x1b[2J\x1b[2;3Hab\x1b[31mc\x1b[0m\xe2")
    screen.feed(b"\x94\x80\x1b[1;1Hx\r\ny\x1b[?25l\x1b]0;title\x07z")
    assert screen.lines() == ["x", "yzabc\u2500", ""]
    assert screen.cells[1][4] == ("c", "31")
