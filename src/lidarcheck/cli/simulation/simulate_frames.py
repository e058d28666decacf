"""`lidarcheck simulate` with many frames: several ideal scans, or several frames of each, into a directory."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.cli.core.terminal import note, progress
from lidarcheck.cli.core.workers import workers
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.cases.source import Named
    from lidarcheck.model.fidelity import Device, Fidelity
    from lidarcheck.scenes.files.file import SceneFile

__all__ = ["MOST_FRAMES", "simulate_frames"]

MOST_FRAMES = 1_000_000


def simulate_frames(
    ideals: Sequence[Named],
    model: Path,
    out: Path,
    *,
    scene: SceneFile | None,
    seed: int,
    count: int | None,
    suffix: str,
    jobs: int | None,
    scheduler: str | None,
    fidelity: Fidelity = "exact",
    device: Device = "cpu",
) -> int:
    """Simulate what is not in the directory yet, and say what was done."""
    from lidarcheck.formats.table import counted
    from lidarcheck.harness.frames import FrameBatch
    from lidarcheck.model import load_model
    from lidarcheck.workers import Processes
    from lidarcheck.workers.cores import usable_cores

    frames = FrameBatch(ideals, load_model(model), out, count, f".{suffix.lstrip('.')}", seed, scene, fidelity, device)
    frames.check(here=scheduler is None)
    external = frames.model.external is not None
    if external and scheduler is not None:
        what = f"the model {model} is an external program, which is on this machine alone"
        raise UsageError(what, fix="leave out --scheduler")
    own = 1 if external or device != "cpu" else min(jobs or usable_cores(), len(ideals) * (count or 1))
    with workers(scheduler, jobs) as cluster:
        local = Processes(own, _wake)
        with local if cluster is None else contextlib.nullcontext(cluster) as pool, progress("simulating") as show:
            done = frames.run(pool, show)
    kept = f"; {done.kept} were there already" if done.kept else ""
    note(f"{out}: {counted(done.simulated, 'frame')} with {done.echoes} echoes, seed {seed}{kept}")
    return 0


def _wake() -> None:
    """Load what every frame needs."""
    import scipy.linalg  # noqa: F401

    import lidarcheck.harness.frames
    import lidarcheck.model.exact.kernel  # noqa: F401
