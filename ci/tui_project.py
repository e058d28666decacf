"""The projects of simulated measurements that the pictures of the terminal interface are made from."""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from lidarcheck.cli import main as lidarcheck
from lidarcheck.formats.lut import y_of_scaled

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS = ("background_SLIM", "range_sweep_SLIM", "retro_reflector_SLIM", "incidence_SLIM", "weak_targets_SLIM")
X = (-160, -120, -80, -50, -33, -20, -10, -6, -3, 0, 3, 6, 10, 20, 33, 50, 80, 100, 120, 140, 200)

SCENES = ROOT / "src/lidarcheck/scenes"
MODEL = ROOT / "scenarios/models/scenes_SLIM.toml"
SENSOR = {"crosstalk": "sides = 0.3\ncorners = 0.12", "walk_error": "per_decade_m = -0.08"}
"""What the sensor has and its model lacks."""
NOISE = {"timing_jitter": "sigma_ns = 0.5", "walk_error": "per_decade_m = -0.08"}
GHOSTS = {"retro_ghost": "strength = 1.2e-5"}
DIRT = {
    "blockage": "transmission = 0.25\nfirst_layer = 225\nlast_layer = 265\nfirst_point = 440\nlast_point = 500",
}
WALK = {"walk_error": "per_decade_m = -0.06"}
CARS = {"10m": ((50, 230), (430, 529)), "25m": ((165, 250), (455, 504)), "50m": ((205, 258), (460, 499))}
SIGNS = ("25m", "45m", "58m")
FRAMES = 5
CASE = {"near": "vehicles_50m", "middle": "sign_ghost_45m", "far": "sign_vertical_156m"}


def run(*words: object) -> None:
    """A command, as a user runs it."""
    if lidarcheck([*map(str, words), "--quiet"]) != 0:
        sys.exit(f"lidarcheck {' '.join(map(str, words))} failed")


def cast(name: str, layers: tuple[int, int], points: tuple[int, int], ideal: Path) -> None:
    """The ideal scan of a part of a built-in scene."""
    scene = (SCENES / f"builtin/{name}.toml").read_text(encoding="utf-8")
    head = re.sub(r"^materials = .*$", 'materials = "materials.toml"', scene, flags=re.MULTILINE)
    table = "[scene.sampling]\n"
    part = f"{table}layers = {[*layers]}\npoints = {[*points]}\n"
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copy(SCENES / "materials.toml", scratch)
        file = Path(scratch) / f"{name}.toml"
        file.write_text(head.replace(table, part) if table in head else f"{head}\n{part}", encoding="utf-8")
        run("scene", file, "--out", ideal)


def measure(ideal: Path, effects: Mapping[str, str], scan: Path, seed: int = 7) -> None:
    """What a sensor with these effects would report: each one's name and its parameters."""
    more = "".join(f'\n[[effects]]\nname = "{name}"\n{values}\n' for name, values in effects.items())
    with tempfile.TemporaryDirectory() as scratch:
        truth = Path(scratch) / "truth.toml"
        truth.write_text(MODEL.read_text(encoding="utf-8") + more, encoding="utf-8")
        run("simulate", ideal, "--model", truth, "--out", scan, "--seed", seed)


def make_bench(root: Path) -> None:
    """Scenarios whose model has moved, and a sign at three distances, simulated with bloom that the table lacks."""
    for part in ("scenarios", "goldens", "signs"):
        (root / part).mkdir(parents=True)
    for name in SCENARIOS:
        for part in ("scenarios", "goldens"):
            shutil.copy(ROOT / part / f"{name}.toml", root / part)
    shutil.copytree(ROOT / "scenarios" / "models", root / "scenarios" / "models")
    moved = root / "scenarios" / "models" / "SLIM.toml"
    text = moved.read_text(encoding="utf-8")
    moved.write_text(text.replace("[materials", "[sensor]\nsignal_at_1m = 6180.0\n\n[materials", 1), encoding="utf-8")
    scaled = [1000 if x == 0 else 560 - abs(x) // 2 for x in X]
    table = f"PostPro.LUT_blooming_X = {', '.join(map(str, X))}\n"
    table += f"PostPro.LUT_blooming_Y = {', '.join(f'{y_of_scaled(s):.7f}' for s in scaled)}\n"
    (root / "signs" / "vertical_lut.ini").write_text(table, encoding="utf-8")
    look = '\n[[effects]]\nname = "blooming_vertical"\nlut = "vertical_lut.ini"\n'
    (root / "signs" / "SLIM.toml").write_text(MODEL.read_text(encoding="utf-8") + look, encoding="utf-8")
    for distance in ("69m", "156m", "199m"):
        ideal = root / "signs" / f"ideal_sign_{distance}.parquet"
        cast(f"sign_vertical_{distance}", (170, 380), (440, 520), ideal)
        measure(ideal, {"blooming_vertical": ""}, root / "signs" / f"sign_{distance}.csv")


def make_drive(root: Path) -> None:
    """Measurements of a sensor that has what its model lacks, and a case to explain: parts of built-in scenes."""
    for part in ("models", "cars", "lab", "signs", "street", "walk"):
        (root / part).mkdir(parents=True)
    shutil.copy(MODEL, root / "models" / "SLIM.toml")
    for distance, (layers, points) in CARS.items():
        ideal = root / "cars" / f"ideal_car_{distance}.parquet"
        cast(f"vehicles_{distance}", layers, points, ideal)
        measure(ideal, SENSOR, root / "cars" / f"real_car_{distance}.pcd")
    for number, distance in enumerate(SIGNS, 1):
        ideal = root / "signs" / f"{number}_ideal.parquet"
        cast(f"sign_ghost_{distance}", (255, 335), (455, 504), ideal)
        measure(ideal, GHOSTS, root / "signs" / f"{number}_{distance}.pcd")
    cast("lab_c", (225, 294), (350, 609), root / "lab" / "ideal.parquet")
    for frame in range(FRAMES):
        measure(root / "lab" / "ideal.parquet", NOISE, root / "lab" / f"frame_{frame:02}.pcd", 100 + frame)
    cast("city_street", (190, 329), (380, 579), root / "street" / "ideal_street.parquet")
    measure(root / "street" / "ideal_street.parquet", DIRT, root / "street" / "real_street.pcd")
    make_case(root / "walk")


def make_case(case: Path) -> None:
    """The case of docs/explain.md, in a part of each frame."""
    shutil.copy(MODEL, case / "model.toml")
    said = 'model = "model.toml"\n'
    for name, scene in CASE.items():
        ideal = case / f"ideal_{name}.parquet"
        cast(scene, (210, 309), (435, 524), ideal)
        for seed, twin in enumerate("ab", 1):
            scan = case / f"{name}_{twin}.pcd"
            measure(ideal, WALK, scan, seed)
            said += f'\n[[frames]]\nideal = "{ideal.name}"\nmeasured = "{scan.name}"\ntime = 0.0\n'
    (case / "case.toml").write_text(said, encoding="utf-8")
