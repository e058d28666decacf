"""The interface in tmux: keys, what is on the screen, resizing, and the processes that it has."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest


class Tmux:
    """A tmux server of its own without settings; `text` is what its window shows."""

    def __init__(self, name):
        self.name, self.starts = f"lidarcheck-{name[:40]}-{os.getpid()}", 0
        self.words: list[str] = []

    def __call__(self, *words):
        return subprocess.run([*self.words, *words], capture_output=True, text=True, check=True).stdout

    def start(self, project, size, *arguments, environment=()):
        """Run the interface in a new server: one that ends takes a moment, in which it takes nothing new."""
        self.starts += 1
        self.words = ["tmux", "-L", f"{self.name}-{self.starts}", "-f", "/dev/null"]
        src = Path(__file__).resolve().parents[2] / "src"
        more = [f"PYTHONPATH={src}", "TERM=screen-256color", *environment]
        words = ["env", *more, sys.executable, "-m", "lidarcheck", "tui", str(project), *arguments]
        self("new", "-d", "-s", "t", "-x", str(size[0]), "-y", str(size[1]), *words)

    def keys(self, *keys):
        self("send-keys", "-t", "t", *keys)

    @property
    def text(self):
        return self("capture-pane", "-p", "-t", "t")

    def resize(self, columns, rows):
        self("resize-window", "-t", "t", "-x", str(columns), "-y", str(rows))

    def sees(self, text, seconds=60.0):
        """Wait until a text is on the screen."""
        end = time.monotonic() + seconds
        while text not in self.text:
            assert time.monotonic() < end, self.text
            time.sleep(0.05)

    @property
    def process(self):
        return int(self("display", "-p", "-t", "t", "#{pane_pid}"))

    def stop(self):
        if self.words:
            subprocess.run([*self.words, "kill-server"], capture_output=True, check=False)


def children(process):
    """The processes below one that run now."""
    found, waiting = [], [process]
    while waiting:
        one = waiting.pop()
        try:
            own = [int(word) for word in Path(f"/proc/{one}/task/{one}/children").read_text().split()]
        except OSError:
            own = []
        found += own
        waiting += own
    return found


def is_running(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def tmux(request):
    server = Tmux(request.node.name)
    yield server
    server.stop()
