"""The figure of the gap workflow: six frames in which a loss of signal is hidden, explained by a process of its own."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lidarcheck.cli.bench import scene as bench_scene
from lidarcheck.cli.bench.kit import Figure, duration, times

__all__ = ["explain_figures", "write_case"]

FRAMES, SIDE = 6, 96
"""Six frames of 96 x 96 beams."""


def explain_figures(run: Callable[..., None]) -> list[Figure]:
    """Seconds of `explain`, all cores; `run` calls lidarcheck with arguments. Once: a warm cache would say no more."""
    with tempfile.TemporaryDirectory(prefix="lidarcheck-bench-") as name:
        place = Path(name)
        write_case(place)
        run("explain", str(place), "--out", str(place / "warm"), "--no-html")  # compiles what is not yet
        seconds = times(lambda: run("explain", str(place), "--out", str(place / "found"), "--no-html"), 1, warm=False)
    return [duration("explain_s", seconds)]


def write_case(place: Path) -> None:
    """A case of the lab, seen at six places, by a sensor that has lost three tenths of its signal."""
    from lidarcheck.effects import make, with_role
    from lidarcheck.formats import save_ideal, save_scan
    from lidarcheck.model import save_model, simulate

    model, frame = bench_scene.lab_model("SMART"), bench_scene.lab_frame()
    save_model(model, place / "model.toml")
    sensor = model.with_(make(with_role("gain").name, {"gain": 0.7}))
    lines = ['model = "model.toml"']
    for number in range(FRAMES):
        column = number * 140
        near = (np.abs(frame.layer - 260) <= SIDE) & (frame.layer % 2 == 0)
        part = frame.take(near & (frame.point >= column) & (frame.point < column + SIDE))
        save_ideal(part, place / f"ideal_{number}.parquet")
        save_scan(simulate(part, sensor, seed=9, frame=number), place / f"measured_{number}.pcd")
        files = f'ideal = "ideal_{number}.parquet"\nmeasured = "measured_{number}.pcd"\ntime = {0.04 * number:.2f}'
        lines.append(f"\n[[frames]]\n{files}")
    (place / "case.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
