"""What the tests of the worker have it compute."""

import os
import signal
import sys
import time
from pathlib import Path

from lidarcheck.errors import InputError
from lidarcheck.formats.lut import load_lut
from lidarcheck.formats.source import read_source
from lidarcheck.reading import shown_content, state_of_file

HELD = {}


def add(one, other, progress):
    progress(1, 1, "sums")
    return one + other


def counted(name, progress):
    """How often it was called in this process with that name."""
    HELD[name] = HELD.get(name, 0) + 1
    return HELD[name], os.getpid(), os.nice(0)


def content(path, progress):
    return read_source(path)


def seeds(number, each_s, told, progress):
    """Tells a file of each seed it begins."""
    for seed in range(number):
        progress(seed, number, "seeds")
        with Path(told).open("a") as stream:
            stream.write(f"{seed}\n")
        time.sleep(each_s)
    return number


def gated(gate, told, progress):
    """Says that it runs, and goes on when there is such a file."""
    with Path(told).open("a") as stream:
        stream.write("runs\n")
    while not Path(gate).exists():
        progress(0, 8, "seeds")
        time.sleep(0.005)
    return "through"


def faulty(kind, progress):
    if kind == "input":
        raise InputError("is not a table", file="a.ini", fix="name another")
    if kind == "pack":
        return lambda: None
    if kind == "write":
        print("to the terminal", flush=True)
        print("to the terminal", file=sys.stderr, flush=True)
        os.write(1, b"to the terminal")
        return "quiet"
    raise RuntimeError("something else")


def dies(until, progress):
    """Ends the process until a file has so many lines, one for each time."""
    with Path(until).open("a") as stream:
        stream.write("died\n")
    with Path(until).open() as stream:
        times = len(stream.readlines())
    if times > 1 and until.endswith("once"):
        return times
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def compiles(told, each_s, progress):
    """As numba says it, without a kernel; silent for so long."""
    from numba.core import event

    with Path(told).open("a") as stream:
        stream.write("begun\n")
    with event.trigger_event("numba:compile"):
        time.sleep(each_s)
    return "compiled"


def hangs(until, progress):
    """Never comes back the first time."""
    if Path(until).exists():
        return "came back"
    Path(until).touch()
    while True:
        time.sleep(1.0)


def of_table(model, table, others, progress):
    """What a model, its table and other files say; files that are not there are nothing."""
    found = [read_source(model), tuple(load_lut(table).tables["vertical"].y)]
    progress(1, 2, "files")
    return [*found, *(read_source(path) if state_of_file(path) or shown_content(path) else None for path in others)]
