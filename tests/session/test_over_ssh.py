"""The terminal interface in a real terminal: tmux, keys, and the file on the disk."""

import contextlib
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lidarcheck.formats.lut import load_lut
from tui_kit import LUT, ROOT, make_project

pytestmark = pytest.mark.skipif(shutil.which("tmux") is None, reason="tmux is not installed")


class Tmux:
    """A server of its own with one window."""

    def __init__(self, socket, project, size=(80, 24)):
        self.command = ["tmux", "-S", str(socket), "-f", os.devnull]
        program = f"{sys.executable} -m lidarcheck tui {project}; echo ended $?; sleep 60"
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "SHELL": "/bin/sh", "LC_ALL": "C.UTF-8"}
        start = [*self.command, "new-session", "-d", "-x", str(size[0]), "-y", str(size[1]), program]
        subprocess.run(start, check=True, env=environment)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        subprocess.run([*self.command, "kill-server"], check=False, capture_output=True)

    def keys(self, *keys):
        subprocess.run([*self.command, "send-keys", *keys], check=True)

    def resize(self, width, height):
        subprocess.run([*self.command, "resize-window", "-x", str(width), "-y", str(height)], check=True)

    def processes(self):
        """The commands of all that runs in the window, by process."""
        shown = subprocess.run([*self.command, "display", "-p", "#{pane_pid}"], check=True, capture_output=True)
        parents = {}
        for place in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):  # it has just ended
                parents[int(place.name)] = int((place / "stat").read_text().rpartition(")")[2].split()[1])
        found = {int(shown.stdout)}
        while more := {process for process, parent in parents.items() if parent in found} - found:
            found |= more
        return {process: Path(f"/proc/{process}/cmdline").read_text() for process in found}

    def shows(self, text, seconds=20.0):
        end = time.monotonic() + seconds
        while True:
            seen = subprocess.run(
                [*self.command, "capture-pane", "-p"], check=True, capture_output=True, text=True
            ).stdout
            if text in seen:
                return seen
            assert time.monotonic() < end, seen
            time.sleep(0.1)


def test_a_user_edits_saves_and_leaves(tmp_path):
    project = make_project(tmp_path / "bench")
    with Tmux(tmp_path / "s", project) as terminal:
        terminal.shows("3 scenarios")
        terminal.keys("F5")
        terminal.shows("a_lut.ini vertical")
        terminal.keys("Down", "5", "1", "2", "Enter")
        terminal.shows("512")
        terminal.keys("+", "+", "u")
        terminal.shows("taken back: nudge +1")
        terminal.keys("C-s")
        terminal.shows("Save 1 row to a_lut.ini?")
        terminal.keys("Enter")
        terminal.shows("saved, 1 row")
        assert load_lut(project / "a_lut.ini").tables["vertical"].rows()[1].scaled == 513
        terminal.resize(20, 5)
        terminal.resize(100, 30)
        terminal.keys("F2")
        terminal.shows("3 files with a fault")
        terminal.keys("q")
        terminal.shows("ended 0")


def test_a_lost_connection_loses_no_edit(tmp_path):
    project = make_project(tmp_path / "bench")
    with Tmux(tmp_path / "s", project) as terminal:
        terminal.shows("3 scenarios")
        terminal.keys("F5")
        terminal.shows("a_lut.ini vertical")
        terminal.keys("6", "0", "0", "Enter")
        terminal.shows("600")
        below = terminal.processes()
        assert any("spawn_main" in command for command in below.values()), below  # what computes beside it
    end = time.monotonic() + 20.0
    while any(Path(f"/proc/{process}").exists() for process in below):
        assert time.monotonic() < end, below
        time.sleep(0.05)
    assert (project / "a_lut.ini").read_bytes() == LUT.encode()
    with Tmux(tmp_path / "t", project) as terminal:
        terminal.shows("an earlier session ended with 1 row not saved")
        terminal.keys("b")
        terminal.shows("1 row brought back")
        terminal.keys("C-s")
        terminal.shows("Save 1 row")
        terminal.keys("Enter")
        terminal.shows("saved, 1 row")
    assert load_lut(project / "a_lut.ini").tables["vertical"].rows()[0].scaled == 600
