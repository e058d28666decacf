"""The figures of the fast path, each beside the exact chain in the same minutes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from lidarcheck.cli.bench import scene as bench_scene
from lidarcheck.cli.bench.kit import MEGA, Alternative, Figure, duration, rate, times_in_turn
from lidarcheck.workers.cores import usable_cores

__all__ = ["fast_figures", "pcd_figures", "plain_keys"]

PLAIN = ("frame_to_pcd_s", "read_text_mb_s", "raycast_mrays_s", "check_s", "explain_s")
FASTER = 4
"""Repeats of the fast path for one of the exact chain: what is over in 20 ms needs more of them for its best."""


def fast_figures(variant: str, repeats: int, quick: bool) -> list[Figure]:
    """Points per second of a frame whose library is filled, on one core and on all."""
    from lidarcheck.model import simulate

    model, frame = bench_scene.lab_model(variant), bench_scene.lab_frame()
    if quick:
        frame = frame.take(np.arange(0, len(frame), 10))
    figures = []
    for threads in sorted({1, usable_cores()}):

        def fast(threads: int = threads) -> object:
            return simulate(frame, model, seed=1, threads=threads, fidelity="fast")

        def exact(threads: int = threads) -> object:
            return simulate(frame, model, seed=1, threads=threads)

        seconds, others = times_in_turn((fast,) * FASTER, exact, repeats)
        amount, name = len(frame) / MEGA, f"simulate_fast_{variant.lower()}_{threads}_mpts_s"
        against = Alternative("the exact chain", amount / min(others), min(others) / min(seconds))
        figures.append(rate(name, "Mpoints/s", amount, seconds, (against,)))
    return figures


def pcd_figures(repeats: int, quick: bool) -> list[Figure]:
    """Seconds from an ideal scan in memory to a PCD file of its echoes, binary_compressed as `simulate` writes it."""
    from lidarcheck.formats import save_scan
    from lidarcheck.model import simulate

    model, frame = bench_scene.lab_model("SMART"), bench_scene.lab_frame()
    if quick:
        frame = frame.take(np.arange(0, len(frame), 10))
    with tempfile.TemporaryDirectory(prefix="lidarcheck-bench-") as name:
        path = Path(name) / "scan.pcd"
        ways: list[Callable[[], object]] = [
            lambda: save_scan(simulate(frame, model, seed=1, fidelity="fast"), path),
            lambda: save_scan(simulate(frame, model, seed=1), path),
        ]
        seconds, others = times_in_turn(ways[:1], ways[1], repeats)
    against = Alternative("with the exact chain", min(others), min(others) / min(seconds))
    return [duration("frame_to_pcd_s", seconds, (against,))]


def plain_keys(figures: Sequence[Figure]) -> Mapping[str, float]:
    """The figures that others look up by name; of `simulate`, the best of any number of threads for the SMART."""
    keys = {}
    for fidelity in ("fast", "exact"):
        speeds = [figure.best for figure in figures if figure.name.startswith(f"simulate_{fidelity}_smart_")]
        if speeds:
            keys[f"simulate_{fidelity}_mpts_s"] = max(speeds)
    return keys | {figure.name: figure.best for figure in figures if figure.name in PLAIN}
