"""The inputs of ci/freeze: ideal scans, models, frames and cases, made once and kept beside the record.

Nothing here imports lidarcheck: what needs it (casting a scene, simulating a frame) is asked of the command line.
"""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from freeze_tool import Tool

VARIANTS = ("SMART", "SLIM")
MATERIALS = range(1, 26)
"""Those of the built-in scenes: every ideal scan here keeps to them, and every model gets those that it lacks."""

GHOST = {"name": "retro_ghost", "strength": 3e-4, "exponent": 0.25, "extra_m": 0.5}
MEASURED: Mapping[str, list[dict[str, Any]]] = {
    "fog": [{"name": "fog", "mor_m": 150.0}],
    "walk": [{"name": "walk_error", "per_decade_m": 0.06}, {"name": "timing_jitter", "sigma_ns": 0.5}],
    "ghost": [GHOST],
    "bloom": [{"name": "blooming_vertical"}, {"name": "blooming_horizontal"}],
    "other": [],
}
"""What the frames that are compared with the plain model's were measured with."""
LUT_X = (-160, -120, -80, -50, -33, -20, -10, -6, -3, 0, 3, 6, 10, 20, 33, 50, 80, 100, 120, 140, 200)
KNOTS = {"covariate": "range_m", "knots": [5.0, 40.0, 120.0]}
EMPIRICAL = [
    {"name": "empirical_flicker", **KNOTS, "values": [0.1, 0.2, 0.3]},
    {"name": "empirical_signal", **KNOTS, "values": [0.1, -0.2, 0.0], "covariate_2": "material_id",
     "knots_2": [3, 7], "values_2": [0.2, -0.1]},
    {"name": "empirical_amplitude", **KNOTS, "values": [0.05, -0.1, 0.0]},
    {"name": "empirical_extra", **KNOTS, "values": [0.05, 0.1, 0.2], "range_from": "surface",
     "range_knots": [1.0, 3.0, 9.0], "range_density": [0.7, 0.3], "peak_quantiles": [8, 20, 60],
     "area_quantiles": [30, 90, 600], "width_quantiles": [2.0, 4.0, 9.0]},
    {"name": "empirical_loss", "covariate": "area_log10", "knots": [1.5, 3.0], "values": [0.2, 0.0]},
    {"name": "empirical_range", **KNOTS, "values": [0.05, 0.0, -0.05]},
    {"name": "empirical_spread", **KNOTS, "values": [0.01, 0.02, 0.05]},
]  # fmt: skip

YARD = """\
description = "A road with a car that comes, a sign, a glass front and a wall"
{materials}
[[scene.objects]]
name = "road"
shape = "plane"
position_m = [100.0, 0.0, -1.8]
size_m = [250.0, 12.0]
material = 5

[[scene.objects]]
name = "car"
shape = "car"
position_m = [22.0, 1.6, -1.8]
yaw_deg = 170.0
material = 11
velocity_m_s = [-8.0, 0.5, 0.0]

[[scene.objects]]
name = "sign"
shape = "sign"
position_m = [32.0, -1.5, 0.5]
width_m = 0.9
height_m = 0.9
material = 17
post_m = 2.3

[[scene.objects]]
name = "glass"
shape = "panel"
position_m = [15.0, -0.6, -0.5]
width_m = 0.9
height_m = 1.6
material = 15
yaw_deg = 20.0

[[scene.objects]]
name = "wall"
shape = "box"
position_m = [60.0, 0.0, -1.8]
size_m = [1.0, 9.0, 5.0]
material = 21

[scene.optics.15]
mirror = 0.08
transmission = 0.8

[scene.sampling]
layers = [205, 284]
points = [455, 504]
sub_beams = 2
"""
SIGN = """\
description = "A sign ahead"
{materials}
[[scene.objects]]
name = "sign"
shape = "panel"
position_m = [{x}, 0.1, 0.0]
width_m = {size}
height_m = {size}
material = 17

[[scene.objects]]
name = "hedge"
shape = "panel"
position_m = [{far}, 0.0, 0.0]
width_m = 40.0
height_m = 12.0
material = 9

[scene.sampling]
layers = [{layers}]
points = [{points}]
second_hits = false
"""


def make_inputs(repo: Path, place: Path, tool: Tool) -> None:
    """Everything but the cases of explain, in `place`; all or nothing, so that what is there can be trusted."""
    draft = place.with_name(f"{place.name}.draft")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    for name in ("scenarios", "goldens"):
        shutil.copytree(repo / name, draft / "project" / name)
    shutil.copytree(repo / "examples", draft / "examples")
    table = tomllib.loads((repo / "scenarios/models/scenes_SLIM.toml").read_text(encoding="utf-8"))["materials"]
    _write_models(draft, table)
    _write_ideals(draft, table, tool)
    _write_frames(draft, tool)
    _write_case(draft, "SLIM", {"signal_at_1m": 4500.0, "background_per_ns": 5e-4}, [], tool)
    _write_case(draft, "SMART", {}, MEASURED["fog"], tool)
    _write_faults(draft)
    draft.replace(place)


def write_explain_case(tests: Path, number: int, of: int, seed: int, frames: int, directory: Path) -> dict[str, Any]:
    """One case of the independent generator, and what of its order the explainer is told, or a reader wants to know."""
    if str(tests) not in sys.path:
        sys.path.insert(0, str(tests))
    import hidden  # type: ignore[import-not-found]  # found by the line above

    order = hidden.plan(of, seed)[number]
    draft = directory.with_name(f"{directory.name}.draft")
    shutil.rmtree(draft, ignore_errors=True)
    hidden.write_case(order, draft, frames=frames)
    told = {"kind": order.kind, "hidden": list(order.effects), "strength": order.strength, "exclude": [*order.exclude]}
    (draft / "order.json").write_text(json.dumps(told), encoding="utf-8")
    draft.replace(directory)
    return told


def toml_text(model: Mapping[str, Any]) -> str:
    """A model as TOML, as far as models go: numbers, texts and lists in tables."""

    def lines(table: Mapping[str, Any]) -> list[str]:
        return [f"{key} = {json.dumps(value)}" for key, value in table.items()]

    text = [f'variant = "{model["variant"]}"']
    if "sensor" in model:
        text += ["", "[sensor]", *lines(model["sensor"])]
    for number, material in sorted(model.get("materials", {}).items(), key=lambda item: int(item[0])):
        text += ["", f"[materials.{number}]", *lines(material)]
    for effect in model.get("effects", ()):
        text += ["", "[[effects]]", *lines(effect)]
    return "\n".join(text) + "\n"


def _write_models(place: Path, table: Mapping[str, Any]) -> None:
    """Each model of each scenario, on its own variant and on the other one, once; and some that no scenario has."""
    models = place / "models"
    models.mkdir()
    known: set[str] = set()

    def write(name: str, model: Mapping[str, Any]) -> None:
        text = toml_text(dict(model) | {"materials": dict(table) | dict(model.get("materials", {}))})
        if text not in known:
            known.add(text)
            (models / f"{name}.toml").write_text(text, encoding="utf-8")

    (models / "bloom.ini").write_text(lut_text("LUT_blooming") + lut_text("LUT_bloomingH"), encoding="utf-8")
    for variant in VARIANTS:
        write(f"plain_{variant}", {"variant": variant})
        write(f"empirical_{variant}", {"variant": variant, "effects": EMPIRICAL})
        blooms = [{"name": f"blooming_{axis}", "lut": "bloom.ini"} for axis in ("vertical", "horizontal")]
        write(f"lut_{variant}", {"variant": variant, "effects": blooms[:1]})
        write(f"luts_{variant}", {"variant": variant, "effects": blooms})
        for name, effects in MEASURED.items():
            write(f"measured_{name}_{variant}", {"variant": variant, "effects": effects})
    scenarios = place / "project/scenarios"
    for file in sorted(scenarios.glob("*.toml")):
        model = tomllib.loads(file.read_text(encoding="utf-8"))["model"]
        if isinstance(model, str):
            model = tomllib.loads((scenarios / model).read_text(encoding="utf-8"))
        write(file.stem, model)
        other = next(variant for variant in VARIANTS if variant != model["variant"])
        write(f"{file.stem}_as_{other}", model | {"variant": other})


def lut_text(key: str, *, flat: bool = False) -> str:
    """A blooming table: neither symmetric nor monotone, or a flat one for a fit to begin with."""
    y = [4e-3 * math.exp(-abs(x) / 6) + 3e-4 * math.exp(-((x - 55) ** 2) / 1600) for x in LUT_X]
    rows = [1.0 if x == 0 else 1e-4 if flat else value for x, value in zip(LUT_X, y, strict=True)]
    numbers = ", ".join(f"{value:.7f}" for value in rows)
    return f"PostPro.{key}_X = {', '.join(map(str, LUT_X))}\nPostPro.{key}_Y = {numbers}\n"


def _write_ideals(place: Path, table: Mapping[str, Any], tool: Tool) -> None:
    ideals = place / "ideals"
    ideals.mkdir()
    shutil.copy(place / "examples/wall_ideal.txt", ideals / "wall.txt")
    names = "Layer Point Distance MaterialID IncidenceAngle"
    _write_rows(ideals / "grid.txt", names, _grid())
    _write_rows(ideals / "edges.txt", f"{names} ObjectID Time Share", _edges())
    _write_rows(ideals / "tiny.txt", names, [row for row in _grid() if row[1] % 20 == 0 and row[0] % 5 == 0])
    named = {number: {key: row[key] for key in row} for number, row in table.items()}
    materials = toml_text({"variant": "SLIM", "materials": named}).partition("\n")[2]
    scenes = {"yard": YARD.format(materials=materials)}
    for x, far, size, layers, points in (
        (25.0, 110.0, 0.8, "235, 284", "470, 489"), (45.0, 150.0, 0.8, "235, 284", "470, 489"),
        (69.0, 260.0, 0.9, "180, 349", "474, 487"), (157.0, 260.0, 0.9, "180, 349", "474, 487"),
    ):  # fmt: skip
        scenes[f"sign{x:.0f}"] = SIGN.format(materials=materials, x=x, far=far, size=size, layers=layers, points=points)
    for name, text in scenes.items():
        (ideals / f"{name}.toml").write_text(text, encoding="utf-8")
    _write_part(place, "scene_lab_c_SLIM", ideals / "hall.toml", "240, 279", "200, 759")
    _write_part(place, "scene_vehicles_50m_SLIM", ideals / "cars.toml", "205, 258", "460, 499")
    for file in sorted(ideals.glob("*.toml")):
        swept = ("--swept",) if file.stem == "yard" else ()
        tool.run("scene", file, "--out", file.with_suffix(".txt"), "-q", *swept, place=ideals)


def _write_part(place: Path, scenario: str, file: Path, layers: str, points: str) -> None:
    """A scenario's scene with other beams: fewer, so that it stays cheap."""
    text = (place / f"project/scenarios/{scenario}.toml").read_text(encoding="utf-8")
    text = re.sub(r"^layers = .*$", f"layers = [{layers}]", text, count=1, flags=re.MULTILINE)
    file.write_text(re.sub(r"^points = .*$", f"points = [{points}]", text, count=1, flags=re.MULTILINE), "utf-8")


def _write_rows(file: Path, names: str, rows: Sequence[Sequence[float]]) -> None:
    text = "".join(" ".join(map(repr, row)) + "\n" for row in rows)
    file.write_text(f"//{names}\n{len(rows)}\n{text}", encoding="utf-8")


def _grid() -> list[tuple[float, ...]]:
    """Every material, a layer each, at all ranges and incidences; above them beams that meet nothing."""
    rows: list[tuple[float, ...]] = []
    for material in MATERIALS:
        for k in range(80):
            distance = round(1.5 * (290.0 / 1.5) ** (k / 79), 3)
            rows.append((235 + material, 440 + k, distance, material, float(7 * (k + material) % 86)))
    return rows + [(layer, 440 + k, 0.0, 1, 0.0) for layer in (261, 262) for k in range(80)]


def _edges() -> list[tuple[float, ...]]:
    """Beams that meet two surfaces of different objects, with shares and times of their own."""
    rows: list[tuple[float, ...]] = []
    for layer in range(250, 262):
        for k in range(40):
            share, time = round(0.1 + 0.8 * k / 39, 3), round(k * 1e-4, 6)
            rows.append((layer, 460 + k, 10.0 + layer - 250, 1 + k % 4, 10.0, 1, time, share))
            rows.append((layer, 460 + k, 25.0 + 3.0 * (layer - 250), 5 + k % 13, 40.0, 2, time, round(1 - share, 3)))
    return rows


def _write_frames(place: Path, tool: Tool) -> None:
    """Scans for the commands that compare and fit: two of each where many frames are asked for."""
    frames, ideals, models = place / "frames", place / "ideals", place / "models"
    frames.mkdir()

    def frame(name: str, ideal: str, model: str, seed: int) -> None:
        words = ("--model", models / f"{model}.toml", "--out", frames / f"{name}.txt", "--seed", seed, "-q")
        tool.run("simulate", ideals / f"{ideal}.txt", *words, "--jobs", 1, place=frames)

    for variant in VARIANTS:
        frame(f"plain_{variant}", "yard", f"plain_{variant}", 1)
        for k, name in enumerate(MEASURED):
            model = f"plain_{variant}" if name == "other" else f"measured_{name}_{variant}"
            frame(f"{name}_{variant}", "yard", model, 11 + k)
    for sign in ("sign25", "sign45"):
        frame(sign, sign, "measured_ghost_SLIM", 21)
    for sign in ("sign69", "sign157"):
        frame(sign, sign, "lut_SLIM", 22)
    for k in range(3):
        frame(f"hall_{k}", "hall", "measured_walk_SLIM", 31 + k)
    frame("cars_real", "cars", "measured_walk_SLIM", 41)
    frame("cars_model", "cars", "plain_SLIM", 42)
    for side, model in (("real", "measured_walk_SLIM"), ("model", "plain_SLIM")):
        (frames / side).mkdir()
        for k in range(2):
            frame(f"{side}/{k}", "yard", model, 51 + k + 10 * (side == "real"))
    (frames / "flat.ini").write_text(lut_text("LUT_blooming", flat=True), encoding="utf-8")


def _write_case(
    place: Path, variant: str, sensor: Mapping[str, float], effects: Sequence[Mapping[str, Any]], tool: Tool
) -> None:
    """A case for calibrate: two frames of a sensor with other numbers, and the model that does not know them."""
    case = place / f"case_{variant}"
    case.mkdir()
    plain = tomllib.loads((place / f"models/plain_{variant}.toml").read_text(encoding="utf-8"))
    (case / "model.toml").write_text(toml_text(plain), encoding="utf-8")
    truth = place / f"models/truth_{variant}.txt"
    truth.write_text(toml_text(plain | ({"sensor": sensor} if sensor else {}) | {"effects": effects}), "utf-8")
    text = ['model = "model.toml"']
    for k, ideal in enumerate(("wall", "yard")):
        shutil.copy(place / f"ideals/{ideal}.txt", case / f"{k}_ideal.txt")
        words = ("--model", truth, "--out", case / f"{k}.txt", "--seed", 61 + k, "--jobs", 1, "-q")
        tool.run("simulate", case / f"{k}_ideal.txt", *words, place=case)
        text += ["", "[[frames]]", f'ideal = "{k}_ideal.txt"', f'measured = "{k}.txt"', f"time = {0.1 * k}"]
    (case / "case.toml").write_text("\n".join(text) + "\n", encoding="utf-8")


def _write_faults(place: Path) -> None:
    """Files that must be refused, in the very words that they are refused with today."""
    faults = place / "faults"
    faults.mkdir()
    (faults / "model.toml").write_text('variant = "SLIM"\n\n[sensor]\ntreshold = 3\nspads = "5"\n', encoding="utf-8")
    (faults / "effect.toml").write_text('variant = "SLIM"\n\n[[effects]]\nname = "fogg"\n', encoding="utf-8")
    (faults / "bare.toml").write_text('variant = "SLIM"\n', encoding="utf-8")
    (faults / "nan.txt").write_text("//Layer Point Distance MaterialID\n1\n240 420 nan 2\n", encoding="utf-8")
    (faults / "lacks.txt").write_text("//Layer Point Distance\n1\n240 420 30.0\n", encoding="utf-8")
    (faults / "count.txt").write_text("//X Y Z PEAK AREA WIDTH\n2\n1.0 2.0 3.0 4 5 6\n", encoding="utf-8")
    (faults / "scenario.toml").write_text('model = "bare.toml"\nkpi = 3\n', encoding="utf-8")
    (faults / "case.toml").write_text('model = "bare.toml"\n[[frames]]\nideal = "lacks.txt"\n', encoding="utf-8")
