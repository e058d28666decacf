"""The figures that `lidarcheck bench` measures, each beside what a user would otherwise take."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lidarcheck.cli.bench.cluster import cluster_figures
from lidarcheck.cli.bench.explain import explain_figures
from lidarcheck.cli.bench.fast import fast_figures, pcd_figures
from lidarcheck.cli.bench.frames import effects_figures, raycast_figures
from lidarcheck.cli.bench.kit import MEGA, Alternative, Figure, duration, rate, times
from lidarcheck.errors import UsageError
from lidarcheck.sensor import SpadArray
from lidarcheck.workers.cores import usable_cores

__all__ = ["cases"]


def cases(quick: bool) -> dict[str, Callable[[], list[Figure]]]:
    """What to measure by its name, each one or several figures; `quick` with less input and fewer repeats."""
    repeats = 2 if quick else 5
    return {
        "simulate, SMART": lambda: _simulate("SMART", repeats, quick),
        "simulate, SLIM": lambda: _simulate("SLIM", repeats, quick),
        **({"simulate on the GPU": lambda: _on_gpu(repeats, quick)} if _has_gpu() else {}),
        "simulate fast, SMART": lambda: fast_figures("SMART", repeats, quick),
        "simulate fast, SLIM": lambda: fast_figures("SLIM", repeats, quick),
        "frame to PCD": lambda: pcd_figures(repeats, quick),
        "effects, SMART": lambda: effects_figures("SMART", min(repeats, 3), quick),
        "effects, SLIM": lambda: effects_figures("SLIM", min(repeats, 3), quick),
        "ray casting": lambda: raycast_figures(repeats, quick),
        "reading text": lambda: _read_text(repeats, quick),
        "KPIs": lambda: _wasserstein(repeats, quick),
        "cluster": lambda: cluster_figures(repeats, quick),
        "check": lambda: _check(1 if quick else 3),
        "explain": lambda: explain_figures(_lidarcheck),
        "help": lambda: _help(3 if quick else 9),
    }


def _simulate(variant: str, repeats: int, quick: bool) -> list[Figure]:
    from lidarcheck.cli.bench.scene import lab_frame, lab_model
    from lidarcheck.model import simulate

    model, frame = lab_model(variant), lab_frame()
    if quick:
        frame = frame.take(np.arange(0, len(frame), 10))
    figures = []
    for threads in sorted({1, usable_cores()}):
        seconds = times(lambda threads=threads: simulate(frame, model, seed=1, threads=threads), repeats)  # type: ignore[misc]
        mpts = len(frame) / MEGA / min(seconds)
        against = _plain_numpy(variant, mpts, quick) if threads == 1 else ()
        name = f"simulate_exact_{variant.lower()}_{threads}_mpts_s"
        figures.append(rate(name, "Mpoints/s", len(frame) / MEGA, seconds, against))
    return figures


def _has_gpu() -> bool:
    from lidarcheck.model.fidelity import check_device

    try:
        check_device("cuda")
    except UsageError:
        return False
    return True


def _on_gpu(repeats: int, quick: bool) -> list[Figure]:
    """The exact chain on a GPU, beside the same on all cores of the processor."""
    from lidarcheck.cli.bench.scene import lab_frame, lab_model
    from lidarcheck.model import simulate

    figures, frame = [], lab_frame()
    if quick:
        frame = frame.take(np.arange(0, len(frame), 10))
    for variant in ("SMART", "SLIM"):
        model = lab_model(variant)
        seconds, own = (
            times(lambda device=device, model=model: simulate(frame, model, seed=1, device=device), repeats)  # type: ignore[misc]
            for device in ("cuda", "cpu")
        )
        speeds = [len(frame) / MEGA / min(one) for one in (seconds, own)]
        others = (Alternative("the processor, all cores", speeds[1], speeds[0] / speeds[1]),)
        figures.append(rate(f"simulate_cuda_{variant.lower()}_mpts_s", "Mpoints/s", len(frame) / MEGA, seconds, others))
    return figures


def _plain_numpy(variant: str, mpts: float, quick: bool) -> tuple[Alternative, ...]:
    """Plain numpy on one core, on fewer beams of the same frame."""
    from lidarcheck.cli.bench.reference import count_chain, every_detector, rates, sim_sipm_seconds
    from lidarcheck.cli.bench.scene import lab_frame, lab_model

    model, frame = lab_model(variant), lab_frame()
    others = []
    for name, chain, beams in (
        ("numpy, a coin per detector", every_detector, 32),
        ("numpy, a binomial per bin", count_chain, 500 if quick else 2000),
    ):
        few = frame.take(np.linspace(0, len(frame) - 1, beams).astype(np.int64))
        draw = np.random.Generator(np.random.Philox(1))
        start = time.perf_counter()
        chain(rates(few, model), SpadArray.narrow(model.sensor), draw)
        speed = beams / MEGA / (time.perf_counter() - start)
        others.append(Alternative(name, speed, mpts / speed))
    waveform = sim_sipm_seconds(SpadArray.narrow(model.sensor), 50 if quick else 500)
    if waveform is not None:
        others.append(Alternative("SimSiPM, a waveform a beam", 1.0 / MEGA / waveform, mpts * MEGA * waveform))
    return tuple(others)


def _read_text(repeats: int, quick: bool) -> list[Figure]:
    from pyarrow import csv

    from lidarcheck.cli.bench.scene import write_rows
    from lidarcheck.formats import load_scan

    rows, few = (200_000, 20_000) if quick else (2_000_000, 200_000)
    with tempfile.TemporaryDirectory(prefix="lidarcheck-bench-") as name:
        path, short = Path(name) / "scan.txt", Path(name) / "short.txt"
        write_rows(path, rows)
        write_rows(short, few)
        size, short_size = path.stat().st_size / MEGA, short.stat().st_size / MEGA
        seconds = times(lambda: load_scan(path), repeats)
        loadtxt = short_size / min(times(lambda: np.loadtxt(short, skiprows=2), 1))
        options = csv.ReadOptions(use_threads=False, skip_rows=2, autogenerate_column_names=True)
        parse = csv.ParseOptions(delimiter=" ")
        arrow = size / min(times(lambda: csv.read_csv(path, options, parse), repeats))
    best = size / min(seconds)
    against = (
        Alternative("numpy.loadtxt", loadtxt, best / loadtxt),
        Alternative("pyarrow.csv, one core", arrow, best / arrow),
    )
    return [rate("read_text_mb_s", "MB/s", size, seconds, against)]


def _wasserstein(repeats: int, quick: bool) -> list[Figure]:
    from scipy.stats import wasserstein_distance

    from lidarcheck.kpi.distances import wasserstein

    draw = np.random.Generator(np.random.Philox(1))
    size = 100_000 if quick else 1_000_000
    measured, simulated = draw.normal(10.0, 1.0, size), draw.normal(10.1, 1.0, size)
    seconds = times(lambda: wasserstein(measured, simulated), repeats)
    scipy_seconds = min(times(lambda: wasserstein_distance(measured, simulated), repeats))
    against = (Alternative("scipy.stats", size / MEGA / scipy_seconds, scipy_seconds / min(seconds)),)
    return [rate("kpi_wasserstein_mpts_s", "Mpoints/s", size / MEGA, seconds, against)]


def _check(repeats: int) -> list[Figure]:
    """All scenarios of the working directory, as a user runs them: a process, kernels compiled before."""
    if not Path("scenarios").is_dir():
        return []
    seconds = times(lambda: _lidarcheck("check", "--quiet"), repeats)
    return [duration("check_s", seconds)]


def _help(repeats: int) -> list[Figure]:
    seconds = times(lambda: _lidarcheck("--help"), repeats)
    return [duration("help_s", seconds)]


def _lidarcheck(*arguments: str) -> None:
    """Run this program in a process of its own; `UsageError` when it could not do its work."""
    command = [sys.executable, "-m", "lidarcheck", *arguments]
    ran = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if ran.returncode not in (0, 1):  # a KPI that fell out takes no less time
        first = (ran.stderr.splitlines() or [""])[0].removeprefix("error: ")
        raise UsageError(f"cannot time lidarcheck {' '.join(arguments)}: {first}", fix="put that right first")
