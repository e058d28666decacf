"""A sign before nothing, measured with a table that is known, in a folder as a user would have it."""

from pathlib import Path

import numpy as np

from lidarcheck.calibration.number.request import Request
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.model import load_model, simulate
from lidarcheck.scan import IdealScan

X = (-600, -400, -90, -30, -3, 0, 3, 30, 90, 150)
TRUE = (5e-5, 5e-5, 2e-4, 4e-4, 1e-3, 1.0, 1e-3, 4e-4, 2e-4, 5e-5)
"""Of rows 0 and 1 no beam sees anything: the frame ends before."""
MODEL = """variant = "{variant}"

[materials.1]
reflectance = 0.3

[materials.2]
reflectance = 0.8
kind = "retro"
retro_gain = 1000.0

[[effects]]
name = "blooming_{axis}"
lut = "table.ini"
"""


def table(y=TRUE, axis="vertical"):
    key = "LUT_blooming" if axis == "vertical" else "LUT_bloomingH"
    return f"PostPro.{key}_X = {', '.join(map(str, X))}\nPostPro.{key}_Y = {', '.join(f'{v:.7f}' for v in y)}\n"


def changed(row, factor):
    """The true table with one row times a factor."""
    return table([y * factor if i == row else y for i, y in enumerate(TRUE)])


def sign(beams, at_m=(100.0,), layers=(195, 326), points=(460, 501), own=((255, 263), (472, 482))):
    """The ideal scan of signs behind each other's columns: the n-th is ten points further on."""
    layer, point = (a.ravel() for a in np.mgrid[slice(*layers), slice(*points)])
    distance, material = np.zeros(len(layer)), np.ones(len(layer), dtype=np.int32)
    for k, range_m in enumerate(at_m):
        (low, high), (left, right) = own[0], (own[1][0] + 12 * k, own[1][1] + 12 * k)
        on = (layer >= low) & (layer < high) & (point >= left) & (point < right)
        distance[on], material[on] = range_m, 2
    wall = (layer < layers[0] + 20) & (distance == 0.0)
    distance[wall] = 40.0
    return IdealScan(
        layer.astype(np.int32), point.astype(np.int32), distance, material, np.zeros(len(layer)), beams=beams
    )


def project(folder: Path, variant="SLIM", axis="vertical", seed=3, **scene) -> Path:
    """A folder with model, table, an ideal scan and what was measured of it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(MODEL.format(variant=variant, axis=axis))
    (folder / "table.ini").write_text(table(axis=axis))
    model = load_model(folder / "model.toml")
    ideal = sign(model.sensor.beams, **scene)
    save_ideal(ideal, folder / "ideal_100m.parquet")
    save_scan(simulate(ideal, model, seed=seed), folder / "real_100m.parquet", model.sensor)
    return folder


def asked(folder: Path, kind="misfit", **more) -> Request:
    return Request(
        kind, folder / "model.toml", (folder / "real_100m.parquet",), (folder / "ideal_100m.parquet",), **more
    )
