"""A small case on disk and an explanation of it, without the workflow: for tests of what stands around it."""

import dataclasses
from pathlib import Path

import numpy as np

from lidarcheck.effects import make
from lidarcheck.explain.report.explanation import Candidate, Explanation, Finding, SearchStep, Standout
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.inference.intervals import Gap, Interval
from lidarcheck.model import load_model, simulate
from lidarcheck.scan import IdealScan

MODEL = """# the sensor on the bench
variant = "{variant}"

[materials.1]
name = "panel"
reflectance = 0.5

[materials.2]
name = "wall"
reflectance = 0.2
"""


def ideal_scan(k, *, layers=range(250, 270), points=range(470, 500)):
    """A panel at a place of its own for each frame, before a wall; some beams meet nothing."""
    layer, point = (a.ravel() for a in np.meshgrid(list(layers), list(points), indexing="ij"))
    panel = (point >= points[2 + 3 * k % 20]) & (point < points[2 + 3 * k % 20] + 8)
    distance = np.where(panel, 8.0 + 0.9 * k, 20.0 + 0.01 * layer)
    distance[layer == layers[0]] = 0.0
    return IdealScan(layer, point, distance, np.where(panel, 1, 2), np.full(len(layer), 10.0))


def write_case(directory, frames=4, variant="SMART", measured_by=None):
    """A case directory whose frames the model itself, or a sensor of another variant, measured."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "model.toml").write_text(MODEL.format(variant=variant))
    (directory / "by.toml").write_text(MODEL.format(variant=measured_by or variant))
    model = load_model(directory / "by.toml")
    (directory / "by.toml").unlink()
    lines = ['model = "model.toml"']
    for k in range(frames):
        ideal = ideal_scan(k)
        save_ideal(ideal, directory / f"i{k}.txt")
        save_scan(simulate(ideal, model, seed=5, frame=k), directory / f"m{k}.txt")
        lines += ["", "[[frames]]", f'ideal = "i{k}.txt"', f'measured = "m{k}.txt"', f"time = {0.1 * k}"]
    (directory / "case.toml").write_text("\n".join(lines) + "\n")
    return Path(directory)


def explanation(case, verdict="explained", names=("fog",)):
    """What a workflow might have found in a case."""
    effects = {name: make(name, {}) for name in names if name != "unknown"}
    findings = tuple(
        Finding(
            name,
            {"extinction_per_m": Interval(0.0123, 0.0119, 0.0131, "1/m")} if name == "fog" else {},
            0.97 - 0.1 * i,
            ("rain",) if name == "fog" else (),
            "AREA falls with range, on all materials alike, and echoes without a surface come from near the sensor",
            "a frame in clear air beside one in fog" if name == "fog" else "",
            (effects[name],) if name in effects else (),
        )
        for i, name in enumerate(names)
    )
    model = case.model
    for effect in effects.values():
        model = model.with_(effect)
    before, after, floor = Interval(12.5, 12.0, 13.1), Interval(1.4, 1.1, 1.7), Interval(1.1, 0.9, 1.3)
    gap = Gap(before, after, floor, {"range": (0.01, 0.001, 0.001)}, tuple((n, after) for n in names))
    if verdict == "no_gap":
        findings, gap, model = (), Gap(floor, floor, floor), case.model
    return Explanation(
        verdict=verdict,
        findings=findings,
        not_testable={"retro_ghost": "no retro-reflector is in any frame"},
        gap=gap,
        model=dataclasses.replace(model),
        steps=(SearchStep("split", "2 frames to fit, 1 to select, 1 to verify"),),
        where=(Standout("area", "range", "60 ... 80 m", -12.3, "AREA is 20 % lower than modelled at 60 to 80 m"),),
        candidates=(
            Candidate("fog", 1, 812.0, 23.0, 31.0, 0.98, "accepted", ("rain",)),
            Candidate("blockage", 1, 12.0, 23.0, 2.0, float("nan"), "gains less than chance does", ()),
        ),
        split={"fit": (0, 2), "select": (1,), "verify": (3,)},
        seeds={"fit": 0, "verify": 99},
        hashes=dict(case.hashes),
        left_out=dict(case.left_out),
    )
