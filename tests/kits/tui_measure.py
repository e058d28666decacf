"""Measures the terminal interface on a pseudo-terminal: python tests/kits/tui_measure.py PROJECT [--over ssh].

First paint, bytes of screens, dialogs and edits, bytes while idle, how soon a key is answered, how soon an edit has its
number, memory; at 80x24 and 120x36, directly, in tmux, over ssh to this machine, or both (`--over "ssh tmux"`). PROJECT
is copied first. `--json FILE` keeps the figures, `--beside FILE ...` prints them in columns.
"""

import argparse
import fcntl
import json
import os
import pty
import re
import select
import shlex
import shutil
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import termios
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

from screen_kit import Screen

KEYS = {"histograms": b"\x1bOR", "noise": b"\x1bOS", "blooming": b"\x1b[15~", "ghosts": b"\x1b[17~",
        "seventh": b"\x1b[18~", "explain": b"\x1b[19~", "goldens": b"\x1b[20~", "overview": b"\x1bOQ"}  # fmt: skip
ESCAPE, LEAVE = b"\x1b", b"\x07"
NUMBER = re.compile(r"\b(?:gap|misfit) (~?)([\d.]+)")


class Terminal:
    """A program in a child on a pseudo-terminal; `screen`: what it has drawn; `sent`: how many bytes came."""

    def __init__(self, command, size):
        self.screen, self.sent = Screen(*size), 0
        self.child, self.end = pty.fork()
        if self.child == 0:
            self.end = 0
            self.resize(*size)
            # Without COLUMNS and LINES, which would count more than a later size.
            environ = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
            os.execvpe(command[0], command, {**environ, "TERM": "xterm-256color"})

    def resize(self, columns, rows):
        fcntl.ioctl(self.end, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def read(self, seconds):
        """What comes next, within so many seconds; empty for nothing."""
        if not select.select([self.end], [], [], max(seconds, 0.0))[0]:
            return b""
        try:
            part = os.read(self.end, 65536)
        except OSError:
            time.sleep(min(seconds, 0.01))
            return b""
        self.sent += len(part)
        self.screen.feed(part)
        return part

    def until(self, true, seconds):
        """How long until something is so on the screen; NaN where it never is."""
        start = time.monotonic()
        while not true(self.screen):
            left = start + seconds - time.monotonic()
            if left <= 0:
                return float("nan")
            self.read(left)
        return time.monotonic() - start

    def quiet(self, still=1.0, most=60.0):
        """How many bytes come until none has for so many seconds."""
        before, end = self.sent, time.monotonic() + most
        while self.read(still) and time.monotonic() < end:
            pass
        return self.sent - before

    def press(self, keys):
        os.write(self.end, keys)

    def cost(self, keys, still=1.0, most=60.0):
        """Bytes that keys bring about; a busy machine may take a while until the first."""
        before = self.sent
        self.press(keys)
        if keys:
            self.read(max(still, 5.0))
        self.quiet(still, most)
        return self.sent - before

    def echo(self, keys, seconds=1.0):
        """How long until the first byte after keys [ms]; NaN for none."""
        self.press(keys)
        start = time.monotonic()
        return 1e3 * (time.monotonic() - start) if self.read(seconds) else float("nan")

    def stop(self):
        for keys in (LEAVE, b"q", b"q"):
            self.press(keys)
            self.quiet(0.5, 3.0)
        os.close(self.end)
        os.waitpid(self.child, 0)


# Where the interface runs


@contextmanager
def sshd():
    """An ssh server for this machine alone with keys of its own; gives the words to run something through it."""
    with tempfile.TemporaryDirectory() as directory:
        where = Path(directory)
        for name in ("host", "user"):
            subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", where / name], check=True)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        if os.geteuid() == 0:
            Path("/run/sshd").mkdir(exist_ok=True)
        said = (
            f"Port {port}\nListenAddress 127.0.0.1\nHostKey {where}/host\nAuthorizedKeysFile {where}/user.pub\n"
            "StrictModes no\nUsePAM no\nPasswordAuthentication no\nPidFile none\nPermitRootLogin yes\n"
        )
        (where / "config").write_text(said)
        server = subprocess.Popen([shutil.which("sshd") or "/usr/sbin/sshd", "-D", "-q", "-f", where / "config"])
        try:
            for _ in range(100):
                with socket.socket() as knock:
                    if knock.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.05)
            sure = ["-o", "StrictHostKeyChecking=no", "-o", f"UserKnownHostsFile={where}/known", "-o", "LogLevel=ERROR"]
            yield ["ssh", "-tt", "-F", "none", *sure, "-i", str(where / "user"), "-p", str(port), "127.0.0.1"]
        finally:
            server.terminate()
            server.wait()


def in_shell(words):
    """Words for a shell elsewhere, with the settings that the interface has here."""
    kept = {name: value for name, value in os.environ.items() if name in ("PATH", "PYTHONPATH", "LIDARCHECK_CACHE")}
    kept |= {"TERM": "xterm-256color", "LANG": os.environ.get("LANG", "C.UTF-8")}
    return shlex.join(["env", "-C", str(Path.cwd()), *(f"{name}={value}" for name, value in kept.items()), *words])


class Place:
    """Starts interfaces: directly, in tmux, over ssh, or in tmux over ssh."""

    def __init__(self, over, stack):
        self.over = over.split()
        self.tmux = ["tmux", "-L", f"measure{os.getpid()}", "-f", "/dev/null"]
        self.ssh = stack.enter_context(sshd()) if "ssh" in self.over else []
        if "tmux" in self.over:
            stack.callback(subprocess.run, [*self.tmux, "kill-server"], stderr=subprocess.DEVNULL, check=False)

    def start(self, project, size, *arguments):
        words = [sys.executable, "-m", "lidarcheck", "tui", str(project), *arguments]
        if "tmux" in self.over:
            words = [*self.tmux, "new", "-A", "-s", "t", "-x", str(size[0]), "-y", str(size[1]), in_shell(words)]
        return Terminal([*self.ssh, in_shell(words)] if self.ssh else words, size)


# The figures


def middle_and_most(values):
    values = sorted(value for value in values if value == value)
    if not values:
        return "-"
    return f"{statistics.median(values):.0f} / {values[min(int(0.95 * len(values)), len(values) - 1)]:.0f}"


def number_of(screen):
    """(the number of line 2, as text; whether it is expected only); empty where there is none."""
    found = NUMBER.search(screen.lines()[1])
    return (found[2], bool(found[1])) if found else ("", False)


def has_number(screen):
    """Whether line 2 has a number that was simulated, of what is set now."""
    number, expected = number_of(screen)
    return bool(number) and not expected and not re.search(r"computing|\bOLD\b", screen.lines()[1])


def settled(screen):
    """Whether nothing on the screen says that it is being computed."""
    return not re.search(r"computing|expected \.\.\.|\bOLD\b", screen.text)


def first_paint(terminal, figures):
    start = time.monotonic()
    terminal.until(lambda screen: "Overview" in screen.text, 60.0)
    figures["first paint [s]"] = f"{time.monotonic() - start:.2f}"
    terminal.quiet(2.5)
    figures["first paint [bytes]"] = terminal.sent
    terminal.until(lambda screen: "reading the project" not in screen.text, 60.0)
    terminal.until(has_number, 60.0)
    terminal.quiet(6.0)  # until those of the other distances are there as well
    figures["idle, 10 s [bytes]"] = terminal.cost(b"", 10.0, 10.0)
    figures["key answered, idle [ms]"] = middle_and_most(terminal.echo(b"\t") for _ in range(40))


def screens(terminal, figures):
    for name, keys in KEYS.items():
        figures[f"go to {name} [bytes]"] = terminal.cost(keys, 1.5)


def dialogs(terminal, figures):
    """Help and palette over Overview; no cell outside the box may be another one."""
    for name, keys in (("help", b"\x1bOP"), ("find", b"\x10"), ("jump", b"g")):
        before = terminal.screen.text
        figures[f"{name}: open [bytes]"] = terminal.cost(keys)
        figures[f"{name}: close [bytes]"] = terminal.cost(ESCAPE, 1.2)
        figures[f"{name}: lines that are others afterwards"] = differing(before, terminal.screen.text)


def differing(before, after):
    return sum(one != other for one, other in zip(before.split("\n"), after.split("\n"), strict=True))


def edits(terminal, figures, times=12):
    """Nudges on Blooming: bytes, first answer, and when expected and simulated numbers of line 2 stand."""
    terminal.press(KEYS["blooming"])
    terminal.quiet(3.0, 120.0)
    terminal.until(settled, 120.0)
    terminal.press(b"\x1b[B" * 13)
    figures["idle on blooming, 10 s [bytes]"] = terminal.cost(b"", 10.0, 10.0)
    waits = {name: [] for name in ("answered", "expected", "simulated", "settled")}
    costs = []
    for _ in range(times):
        terminal.press(b"\x1b[A")
        terminal.quiet(1.0)
        sent, start = terminal.sent, time.monotonic()
        waits["answered"].append(terminal.echo(b"+"))
        if number_of(terminal.screen)[0]:
            terminal.until(lambda screen: number_of(screen)[1], 3.0)
            waits["expected"].append(1e3 * (time.monotonic() - start))
            terminal.until(has_number, 10.0)
            waits["simulated"].append(1e3 * (time.monotonic() - start))
        terminal.until(settled, 20.0)
        waits["settled"].append(1e3 * (time.monotonic() - start))
        terminal.quiet(2.0)
        costs.append(terminal.sent - sent)
    figures["an edit [bytes], median / most"] = f"{statistics.median(costs):.0f} / {max(costs)}"
    for name, values in waits.items():
        figures[f"an edit, {name} [ms]"] = middle_and_most(values)
    figures["a typed value and Enter [bytes]"] = terminal.cost(b"455\r", 2.0)
    busy = []
    for at in range(12):
        terminal.press(b"+" if at % 2 else b"-")
        terminal.quiet(0.15, 0.3)
        busy += [terminal.echo(b"\x1b[A" if at % 2 else b"\x1b[B") for _ in range(3)]
        terminal.quiet(0.3, 1.0)
    figures["key answered while an edit is computed [ms]"] = middle_and_most(busy)
    terminal.quiet(2.0)
    before = terminal.screen.text
    figures["save: open [bytes]"] = terminal.cost(b"S")
    figures["save: close [bytes]"] = terminal.cost(ESCAPE, 1.2)
    figures["save: lines that are others afterwards"] = differing(before, terminal.screen.text)


def busy(terminal, figures):
    """Keys while scenarios run."""
    terminal.press(KEYS["overview"])
    terminal.quiet(1.0)
    terminal.press(b"gc")
    terminal.quiet(0.5)
    terminal.press(b"R")
    terminal.read(1.0)
    figures["key answered while scenarios run [ms]"] = middle_and_most(terminal.echo(b"\t", 0.3) for _ in range(40))
    terminal.press(b"x")
    terminal.quiet(3.0, 30.0)


def edits_kept(project):
    """How many edits the journals hold: keys that were pressed are done when they are there."""
    return sum(path.read_bytes().count(b'{"edit"') for path in (project / ".lidarcheck/tui").glob("*.journal"))


def memory(terminal, project, figures, most=10_000, burst=100):
    """Memory after so many edits; the next keys are pressed when all before them are done."""
    terminal.press(KEYS["blooming"])
    terminal.quiet(1.0)
    done = edits_kept(project)
    for number in range(0, most + 1, burst):
        if number:
            terminal.press(b"+-" * (burst // 2))
        while edits_kept(project) < done + number:
            terminal.read(0.05)
        if number in (0, most // 10, most):
            terminal.quiet(1.0, 5.0)
            pages = int(Path(f"/proc/{terminal.child}/statm").read_text().split()[1])
            figures[f"memory after {number} edits [MB]"] = f"{pages * os.sysconf('SC_PAGE_SIZE') / 1e6:.1f}"


def measured(place, project, size, with_memory):
    figures = {}
    shutil.rmtree(project / ".lidarcheck", ignore_errors=True)
    terminal = place.start(project, size, "--screen", "overview")
    for take in (first_paint, screens, dialogs, edits, busy):
        take(terminal, figures)
    if with_memory:
        memory(terminal, project, figures)
    terminal.stop()
    return figures


def table(columns):
    """Figures beside each other, by the name of the column."""
    names = dict.fromkeys(name for column in columns.values() for name in column)
    head = ["", *columns]
    rows = [[name, *(str(column.get(name, "-")) for column in columns.values())] for name in names]
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *rows])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("project", type=Path, nargs="?")
    parser.add_argument("--over", default="", choices=("", "tmux", "ssh", "ssh tmux"))
    parser.add_argument("--size", nargs="*", default=["80x24", "120x36"])
    parser.add_argument("--memory", action="store_true", help="also the memory after 10 000 edits, directly only")
    parser.add_argument("--name", default="", help="of these figures' columns")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--beside", type=Path, nargs="*", default=[])
    asked = parser.parse_args()
    columns = {name: column for file in asked.beside for name, column in json.loads(file.read_text()).items()}
    if asked.project is not None:
        with ExitStack() as stack:
            place = Place(asked.over, stack)
            for size in asked.size:
                project = Path(stack.enter_context(tempfile.TemporaryDirectory())) / asked.project.resolve().name
                shutil.copytree(asked.project, project, ignore=shutil.ignore_patterns(".lidarcheck"))
                columns_rows = tuple(map(int, size.split("x")))
                figures = measured(place, project, columns_rows, asked.memory and not asked.over)
                columns[" ".join(filter(None, (asked.name, asked.over, size)))] = figures
    if asked.json:
        asked.json.write_text(json.dumps(columns, indent=1) + "\n")
    print(table(columns))


if __name__ == "__main__":
    main()
