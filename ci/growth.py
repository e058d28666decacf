"""How time and memory grow with beams, frames and worker processes: Markdown tables, a process for each figure.

A line is straight where the last column, the exponent between a row and the one before, is near 1: of seconds, of
processes of what they do in a second. Memory has a part that is always there. Worker processes stand in for cores of
their own: a task sleeps for as long as a frame takes and hands back as many bytes as its echoes have, so that what is
measured is what the caller does for each.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from lidarcheck.scan import IdealScan

MEGA = 1e6
AT_ONCE = 499_200
"""Beams of the largest frame; what is beyond comes frame by frame."""
FRAME_BEAMS = 10_000
TASK_S = 0.05


def main() -> None:
    """Print the tables, or measure one figure as JSON where `--point` asks for it."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--most-beams", type=int, default=10**8)
    options.add_argument("--most-frames", type=int, default=1000)
    options.add_argument("--most-processes", type=int, default=64)
    options.add_argument("--point", nargs=2, metavar=("WHAT", "N"))
    given = options.parse_args()
    if given.point:
        what, count = given.point
        print(json.dumps(POINTS[what](int(count))))
        return
    for fidelity in ("fast", "exact"):
        show(f"beams, {fidelity}, one thread", f"beams_{fidelity}", tens(10**4, given.most_beams))
    show(f"frames of {FRAME_BEAMS} beams, exact, each written as PCD", "frames", tens(1, given.most_frames))
    show(
        f"processes, {TASK_S} s a task", "processes", [n for n in (1, 2, 4, 8, 16, 32, 64) if n <= given.most_processes]
    )


def tens(first: int, last: int) -> list[int]:
    """The powers of ten."""
    return [first * 10**k for k in range(int(math.log10(last / first) + 0.5) + 1)]


def show(title: str, what: str, counts: Sequence[int]) -> None:
    """A table, row by row as it is measured."""
    unit = "tasks" if what == "processes" else "M beams"
    print(
        f"\n| {title} | seconds | {unit} a second | memory at its most [MB] | exponent |\n|---|---|---|---|---|",
        flush=True,
    )
    before: tuple[int, float] | None = None
    note = ""
    for count in counts:
        found = point(what, count)
        measured = found["amount"] / found["seconds"]
        grows = measured if what == "processes" else found["seconds"]
        power = "" if before is None else f"{math.log(grows / before[1]) / math.log(count / before[0]):.2f}"
        print(
            f"| {count:,} | {found['seconds']:.3g} | {measured:.3g} | {found['memory_mb']:.0f} | {power} |", flush=True
        )
        before = count, grows
        if "caller_ms" in found:
            note = f"the caller takes {found['caller_ms']:.1f} ms a task"
    print(f"\n{note}" if note else "", flush=True)


def point(what: str, count: int) -> dict[str, float]:
    """A figure from a process of its own."""
    command = [sys.executable, __file__, "--point", what, str(count)]
    found: dict[str, float] = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
    return found


def frame_of(beams: int) -> IdealScan:
    """So many beams of the laboratory."""
    from lidarcheck.cli.bench.scene import lab_frame

    whole = lab_frame()
    return whole.take(np.linspace(0, len(whole) - 1, beams).astype(np.int64))


def figures(seconds: float, amount: float) -> dict[str, float]:
    """Of this process: seconds, what was done in them, and the most memory."""
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return {"seconds": seconds, "amount": amount, "memory_mb": memory}


def over_beams(count: int, fidelity: Any) -> dict[str, float]:
    """One frame, or as many full ones as have so many beams, whose echoes are counted and dropped."""
    from lidarcheck.cli.bench.scene import lab_model
    from lidarcheck.model import simulate

    model, ideal = lab_model("SMART"), frame_of(min(count, AT_ONCE))
    simulate(ideal, model, seed=1, threads=1, fidelity=fidelity)  # loads kernels, fills or reads the library
    frames = max(round(count / len(ideal)), 1)
    begun = time.process_time()
    for number in range(frames):
        simulate(ideal, model, seed=1, frame=number, threads=1, fidelity=fidelity)
    return figures(time.process_time() - begun, frames * len(ideal) / MEGA)


def over_frames(count: int) -> dict[str, float]:
    """So many frames, one after the other, each written to a file."""
    from lidarcheck.cli.bench.scene import lab_model
    from lidarcheck.formats import save_scan
    from lidarcheck.model import simulate

    model, ideal = lab_model("SMART"), frame_of(FRAME_BEAMS)
    with tempfile.TemporaryDirectory(prefix="lidarcheck-growth-") as folder:
        place = Path(folder) / "frame.pcd"
        save_scan(simulate(ideal, model, seed=1, threads=1), place)
        begun = time.process_time()
        for number in range(count):
            save_scan(simulate(ideal, model, seed=1, frame=number, threads=1), place)
        return figures(time.process_time() - begun, count * len(ideal) / MEGA)


def task(number: int) -> bytes:
    """What a core would do for a frame, without needing one: wait, and hand back as many bytes as its echoes have."""
    time.sleep(TASK_S)
    return bytes(FRAME_BEAMS * 60)


def over_processes(count: int) -> dict[str, float]:
    """Tasks that so many processes do, ten each; memory of all of them together, and the caller's own time."""
    from lidarcheck.workers import Processes

    tasks = 10 * count
    with Processes(count, least=1) as pool:
        for _ in pool.map(task, ((number,) for number in range(count))):
            pass  # all have started
        begun, own = time.perf_counter(), time.process_time()
        done = sum(1 for _ in pool.map(task, ((number,) for number in range(tasks))))
        seconds, own = time.perf_counter() - begun, time.process_time() - own
        memory = sum(proportional_mb(process) for process in family(os.getpid()))
    return {"seconds": seconds, "amount": float(done), "memory_mb": memory, "caller_ms": 1000.0 * own / done}


def family(process: int) -> Iterator[int]:
    """A process and all that descend from it."""
    yield process
    for child in Path(f"/proc/{process}/task/{process}/children").read_text(encoding="ascii").split():
        yield from family(int(child))


def proportional_mb(process: int) -> float:
    """Memory of a process, what it shares with others in parts."""
    lines = Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024.0


POINTS: dict[str, Callable[[int], dict[str, float]]] = {
    "beams_fast": lambda count: over_beams(count, "fast"),
    "beams_exact": lambda count: over_beams(count, "exact"),
    "frames": over_frames,
    "processes": over_processes,
}

if __name__ == "__main__":
    main()
