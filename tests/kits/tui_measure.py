"""Measures the terminal interface on a pseudo-terminal: python tests/kits/tui_measure.py PROJECT.

First paint [s], key to response while a scenario runs [ms], bytes for the edit of a cell, bytes while idle, memory.
"""

import fcntl
import os
import pty
import select
import statistics
import struct
import sys
import termios
import time
from pathlib import Path


class Terminal:
    """The interface in a child on a pseudo-terminal of 80x24."""

    def __init__(self, project, *arguments):
        self.child, self.end = pty.fork()
        if self.child == 0:
            os.environ |= {"TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"}
            os.execv(sys.executable, [sys.executable, "-m", "lidarcheck", "tui", str(project), *arguments])
        fcntl.ioctl(self.end, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))

    def read(self, seconds, until=None):
        """What comes within so many seconds, or until a text has come; and after how long the first of it came."""
        found, start, first = b"", time.monotonic(), None
        while (left := start + seconds - time.monotonic()) > 0:
            if select.select([self.end], [], [], left)[0]:
                try:
                    part = os.read(self.end, 65536)
                except OSError:
                    break
                first = first if first is not None else time.monotonic() - start
                found += part
                if until is not None and until in found:
                    break
        return found, first if first is not None else float("nan")

    def press(self, keys, seconds, until=None):
        os.write(self.end, keys)
        return self.read(seconds, until)

    def memory_mb(self):
        pages = Path(f"/proc/{self.child}/statm").read_text().split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6

    def stop(self):
        self.press(b"qq", 3.0)
        os.close(self.end)
        os.waitpid(self.child, 0)


def edits(project):
    """How many edits the journals hold: keys that were pressed are done when they are there."""
    return sum(path.read_bytes().count(b'{"edit"') for path in (project / ".lidarcheck/tui").glob("*.journal"))


def memory(terminal, project, most=10_000, burst=100):
    """Memory after so many edits; the next keys are pressed when all before them are done."""
    done, found = edits(project), {0: round(terminal.memory_mb(), 1)}
    for number in range(burst, most + 1, burst):
        terminal.press(b"+-" * (burst // 2), 0.05)
        while edits(project) < done + number:
            terminal.read(0.05)
        if number in (most // 10, most // 5, most // 2, most):
            terminal.read(1)
            found[number] = round(terminal.memory_mb(), 1)
    return found


def main(project):
    start = time.monotonic()
    terminal = Terminal(project, "--screen", "overview")
    terminal.read(30, b"Scenarios")
    print(f"first paint: {time.monotonic() - start:.2f} s")
    terminal.read(4)
    print(f"idle: {len(terminal.read(6)[0])} bytes in 6 s")
    terminal.press(b"a", 0.5)
    waits = [1e3 * terminal.press(b"\t", 0.15)[1] for _ in range(40)]
    waits = sorted(wait for wait in waits if wait == wait)
    print(
        f"key while a run goes on: median {statistics.median(waits):.0f}, 95 % {waits[int(0.95 * len(waits))]:.0f} ms"
    )
    terminal.press(b"x", 4)
    terminal.press(b"\x1b[15~", 12)
    print(f"idle on blooming: {len(terminal.read(6)[0])} bytes in 6 s")
    for name, keys in (("a nudge", b"+"), ("a typed value and Enter", b"455\r")):
        terminal.press(b"\x1b[B", 1.5)
        print(f"{name}: {len(terminal.press(keys, 2.5)[0])} bytes")
    print(f"memory [MB] after edits: {memory(terminal, project)}")
    terminal.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
