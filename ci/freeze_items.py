"""What ci/freeze records: for each item its pieces, commands of lidarcheck with the files that they are given."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from freeze_inputs import MEASURED, VARIANTS
from freeze_tool import Tool

PASSING = frozenset({"seconds", "elapsed_s", "model_source", "hashes", "path"})
"""Keys of JSON that may change: times, hashes of the sources and of what is an input anyhow, places of the package."""
LINKED = "in"
"""The inputs as the commands see them, so that no output depends on where the record lies."""
AIMED = frozenset({"beam_divergence", "boresight", "mirror_multipath", "motion", "vibration"})
"""Effects that ask the scene, where one is given."""
FORMATS = ("csv", "pcd", "ply", "las", "laz", "parquet")


@dataclass(frozen=True)
class Piece:
    """Commands that are run one after another in a directory of their own, and what of it is kept."""

    name: str
    commands: Sequence[Sequence[object]]
    texts: bool = True


def run_piece(piece: Piece, inputs: Path, tool: Tool) -> tuple[float, dict[str, Any]]:
    """Processor seconds; and exit codes, texts, JSON and the hashes of all files, without what tells of the place or
    the hour."""
    with tempfile.TemporaryDirectory(prefix="freeze-") as name:
        place = Path(name).resolve()
        (place / LINKED).symlink_to(inputs.resolve(), target_is_directory=True)
        (place / "project").symlink_to(inputs.resolve() / "project", target_is_directory=True)
        if piece.name == "check":  # it leaves proposals beside the scenarios where something fell out
            (place / "project").unlink()
            shutil.copytree(inputs / "project", place / "project")

        def plain(text: str) -> str:
            for path, short in ((place / LINKED, LINKED), (inputs.resolve(), LINKED), (place, ".")):
                text = text.replace(str(path), short)
            return text

        done = [tool.ask(words, place) for words in piece.commands]
        result: dict[str, Any] = {"codes": [one.code for one in done]}
        if piece.texts:
            result["out"] = [plain(one.out).splitlines() for one in done]
        result["err"] = [plain(one.err).splitlines() for one in done]
        result["json"], result["files"] = _left_behind(place, plain)
        return sum(one.seconds for one in done), result


def _left_behind(place: Path, plain: Callable[[str], str]) -> tuple[dict[str, Any], dict[str, str]]:
    """What stands in JSON files, and the hashes of others; of pages, which tell the hour, that they are there."""
    found: dict[str, Any] = {}
    hashes: dict[str, str] = {}
    for folder, names, files in os.walk(place):
        names[:] = sorted(name for name in names if name not in (LINKED, "project"))
        for name in sorted(files):
            file = Path(folder) / name
            key = file.relative_to(place).as_posix()
            if file.suffix == ".json":
                found[key] = settled(json.loads(plain(file.read_text(encoding="utf-8"))))
            elif file.suffix == ".html":
                hashes[key] = "there"
            else:
                hashes[key] = hashlib.sha256(file.read_bytes()).hexdigest()
    return found, hashes


def settled(value: Any) -> Any:
    """JSON without what may change."""
    if isinstance(value, Mapping):
        return {key: settled(one) for key, one in value.items() if key not in PASSING}
    return [settled(one) for one in value] if isinstance(value, list) else value


def pieces_of(item: str, inputs: Path, tool: Tool, jobs: int) -> list[Piece]:
    """The pieces of an item, in their order."""
    if item == "cli":
        return list(_cli(inputs, tool))
    if item == "simulate":
        return list(_simulate(inputs))
    if item == "explain":
        return list(_explain(inputs))
    return {
        "formats": _formats, "scene": _scene, "goldens": lambda: _goldens(jobs), "compare": _compare,
        "calibrate": _calibrate, "bloom": _bloom, "ghosts": _ghosts, "panels": _panels, "vehicles": _vehicles,
        "scenes": _scenes,
    }[item]()  # fmt: skip


ITEMS = (
    "cli", "simulate", "formats", "scene", "goldens", "compare", "calibrate", "bloom", "ghosts", "panels", "vehicles",
    "scenes", "explain",
)  # fmt: skip


def _cli(inputs: Path, tool: Tool) -> Iterator[Piece]:
    """The help of every command, lists and tables that programs read, and the words of errors."""
    queue: list[tuple[str, ...]] = [()]
    while queue:
        words = queue.pop(0)
        text = tool.ask([*words, "--help"], inputs).out
        yield Piece(f"help {' '.join(words)}".strip(), [[*words, "--help"]])
        part = text.partition("\nCommands:\n")[2].partition("\n\n")[0]
        queue += [(*words, name) for name in re.findall(r"^  ([a-z]+)(?:, -\w)?: ", part, re.MULTILINE)]
    lists = ("effects --json", "effects", "effects fog", "effects layer_gain", "scene --list", "--version")
    yield from (Piece(text, [text.split()]) for text in (*lists, "lut show in/frames/flat.ini"))
    for file in ("ideals/yard.txt", "frames/plain_SLIM.txt", "models/empirical_SMART.toml"):
        yield Piece(f"info {file}", [["info", f"in/{file}", "--json"], ["info", f"in/{file}"]])
    simulate = ("simulate", "in/ideals/wall.txt", "--out", "x.txt", "--model")
    wrong = [
        ("simulate", "in/faults/nan.txt", "--out", "x.txt", "--model", "in/faults/bare.toml"),
        ("simulate", "in/faults/lacks.txt", "--out", "x.txt", "--model", "in/faults/bare.toml"),
        (*simulate, "in/faults/model.toml"), (*simulate, "in/faults/effect.toml"), (*simulate, "in/faults/bare.toml"),
        ("info", "in/faults/count.txt"), ("check", "in/faults/scenario.toml"),
        ("explain", "in/faults", "--out", "y"), ("simulat",), ("simulate", "--frobnicate"),
        ("scene", "nowhere", "--out", "x.txt"), ("calibrate", "in/case_SLIM", "--free", "nonsense", "--out", "z"),
    ]  # fmt: skip
    for words in wrong:
        yield Piece(f"error of {' '.join(words)}", [words])


def _simulate(inputs: Path) -> Iterator[Piece]:
    """Every model through the exact chain and the fast path; where a scene matters, with it; and the reference."""
    ideals = [f"in/ideals/{name}.txt" for name in ("wall", "edges", "yard", "grid")]
    rest = ("--out", "out", "--format", "txt", "--seed", 7, "--jobs", 1, "-q")
    models = sorted((inputs / "models").glob("*.toml"))
    for file in models:
        model = ("--model", f"in/models/{file.name}")
        yield Piece(f"{file.stem} exact", [["simulate", *ideals, *model, *rest]])
        # Beams with one pulse alone are drawn from the library, and those of many ranges take many blocks to fill.
        fast = ideals if file.stem.startswith("plain") else ideals[:2]
        yield Piece(f"{file.stem} fast", [["simulate", *fast, *model, *rest, "--fidelity", "fast"]])
        effects = tomllib.loads(file.read_text(encoding="utf-8")).get("effects", [])
        if AIMED & {effect["name"] for effect in effects}:
            cast = ("--scene", "in/ideals/yard.toml", "--out", "yard.txt", "--seed", 7, "--jobs", 1, "-q")
            yield Piece(f"{file.stem} in its scene", [["simulate", "in/ideals/yard.txt", *model, *cast]])
    for variant in VARIANTS:
        plain = ("--model", f"in/models/plain_{variant}.toml", "--jobs", 1, "-q")
        slow = ("--fidelity", "reference", "--out", "tiny.txt")
        yield Piece(f"plain_{variant} reference", [["simulate", "in/ideals/tiny.txt", *slow, *plain]])
        many = ("--frames", 3, "--format", "parquet", "--out", "many")
        yield Piece(f"plain_{variant} many frames", [["simulate", "in/ideals/wall.txt", *many, *plain]])


def _formats() -> list[Piece]:
    """To every format and back: the bytes of each."""
    pieces = []
    for kind, file in (("scan", "frames/ghost_SLIM.txt"), ("ideal", "ideals/edges.txt")):
        for suffix in FORMATS if kind == "scan" else [one for one in FORMATS if one not in ("las", "laz")]:
            there = ["convert", f"in/{file}", f"{kind}.{suffix}", "-q"]
            pieces.append(Piece(f"{kind} {suffix}", [there, ["convert", f"{kind}.{suffix}", f"{kind}.txt", "-q"]]))
    return pieces


def _scene() -> list[Piece]:
    scenes = ("yard", "sign45", "hall", "cars")
    return [
        Piece(name, [["scene", f"in/ideals/{name}.toml", "--out", f"{name}.txt"], [
            "scene", f"in/ideals/{name}.toml", "--out", "still.parquet", "--no-second-hits", "--sub-beams", 1, "--json"
        ]])
        for name in scenes
    ]  # fmt: skip


def _goldens(jobs: int) -> list[Piece]:
    """All scenarios in one run: each KPI with its verdict and all its numbers. Its table tells the time it took."""
    words = ["check", "project/scenarios", "--json", "check.json", "--jobs", jobs, "-q"]
    return [Piece("check", [words], texts=False)]


def _compare() -> list[Piece]:
    pieces = []
    for variant in VARIANTS:
        known = ("--ideal", "in/ideals/yard.txt", "--model", f"in/models/plain_{variant}.toml")
        for name in MEASURED:
            words = ["compare", f"in/frames/{name}_{variant}.txt", f"in/frames/plain_{variant}.txt", "--json", "k.json"]
            pieces.append(Piece(f"{name} {variant}", [[*words, *known, "-q"]]))
    bare = ["compare", "in/frames/walk_SMART.txt", "in/frames/plain_SMART.txt", "--json", "k.json", "-q"]
    many = ["compare", "in/frames/real", "in/frames/model", "--ideal", "in/ideals/yard.txt", "--json", "k.json", "-q"]
    return [*pieces, Piece("without an ideal scan", [bare]), Piece("directories", [many])]


def _calibrate() -> list[Piece]:
    sensor = "signal_at_1m,pulse_fwhm_ns,background_per_ns"
    free = {"SLIM": sensor, "SMART": "effects.fog.mor_m,materials.2.reflectance"}
    rest = ("--out", "out", "--jobs", 1, "--seed", 1, "-q")
    return [Piece(v, [["calibrate", f"in/case_{v}", "--free", names, *rest]]) for v, names in free.items()]


def _bloom() -> list[Piece]:
    both = ("in/frames/sign69.txt@69", "in/frames/sign157.txt@157")
    ideals = ("--ideal", "in/ideals/sign69.txt", "in/ideals/sign157.txt")
    model = ("--model", "in/models/plain_SLIM.toml", "--target", 17, "--lut", "in/frames/flat.ini", "-q")
    lut = "lut.ini"
    edits: list[list[object]] = [
        ["lut", "set", "in/frames/flat.ini", "--at", "-20=430", "--out", lut],
        ["lut", "scale", lut, "--by", 20, "--rows", "5..8"],
        ["lut", "smooth", lut, "--rows", "4..10"],
        ["lut", "show", lut],
    ]
    return [
        Piece("fit", [["bloom", "fit", *both, *ideals, *model, "--out", "out"]]),
        Piece("fit without ideal scans", [["bloom", "fit", *both, *model, "--free", "brightness", "--out", "out"]]),
        Piece("show", [["bloom", "show", both[0], *model, "--json", "show.json"]]),
        Piece("settings", [["bloom", "settings", "Blooming_Calibration_V_SLIM.json", "--set", "69:SegHor=440"]]),
        Piece("edit a table", edits),
    ]


def _ghosts() -> list[Piece]:
    signs = ("in/frames/sign25.txt", "in/frames/sign45.txt")
    known = ("--ideal", "in/ideals/sign25.txt", "in/ideals/sign45.txt", "--model", "in/models/plain_SLIM.toml")
    return [
        Piece("find", [["ghosts", "find", *signs, *known, "--steps", "--out", "out", "-q"]]),
        Piece("find in scans alone", [["ghosts", "find", *signs, "in/frames/ghost_SLIM.txt", "--out", "out", "-q"]]),
        Piece("fit", [["ghosts", "fit", *signs, *known, "--out", "out", "-q"]]),
    ]


def _panels() -> list[Piece]:
    halls = [f"in/frames/hall_{k}.txt" for k in range(3)]
    known = ("--ideal", "in/ideals/hall.txt", "--model", "in/models/plain_SLIM.toml")
    return [
        Piece("with the model", [["panels", *halls, *known, "--out", "out", "-q"]]),
        Piece("in points alone", [["panels", *halls, "--out", "out", "-q"]]),
    ]


def _vehicles() -> list[Piece]:
    real, model = "in/frames/cars_real.txt@50", "in/frames/cars_model.txt"
    words = ("--vehicle", "car", "--ideal", "in/ideals/cars.txt")
    return [
        Piece("compare", [["vehicles", "compare", real, "--simulated", model, *words, "--out", "out", "-q"]]),
        Piece("merge", [["vehicles", "merge", real, model, *words, "--out", "both.txt", "-q"]]),
    ]


def _scenes() -> list[Piece]:
    yard = ("--ideal", "in/ideals/yard.txt", "--scene", "in/ideals/yard.toml", "--out", "out", "-q")
    words = ["scenes", "compare", "in/frames/fog_SLIM.txt", *yard, "--model"]
    return [
        Piece("the plain model", [[*words, "in/models/plain_SLIM.toml"]]),
        Piece("the right model", [[*words, "in/models/measured_fog_SLIM.toml", "--by", "material"]]),
    ]


def _explain(inputs: Path) -> Iterator[Piece]:
    for case in sorted((inputs / "explain").glob("case_??")):
        exclude = json.loads((case / "order.json").read_text(encoding="utf-8"))["exclude"]
        named = ["--exclude", ",".join(exclude)] if exclude else []
        words = ["explain", f"in/explain/{case.name}", "--out", "out", "--jobs", 1, "--no-html", *named, "-q"]
        yield Piece(case.name, [words])
