"""What repeats gave as files: the model with its laws, what it names beside it, and the summary."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import tomli_w

from lidarcheck.ideals.repeats.laws import Laws, predicted_sd
from lidarcheck.ideals.repeats.response import response_of
from lidarcheck.ideals.repeats.workflow import Repeats
from lidarcheck.model.files.model_file import dump_model
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Material, Sensor

__all__ = ["facts_of", "material_of", "model_text", "named_tables"]

SURFACE = Material("surface from repeats", 0.5)
"""What rows are of whose model names no material; its reflectance counts for none of them."""


def material_of(model: Model | None) -> tuple[int, Mapping[int, Material]]:
    """The material that rows get, and the model's table with it: one that scatters evenly, the first that there is."""
    materials = {} if model is None else dict(model.materials)
    for number, material in sorted(materials.items()):
        if material.kind == "lambertian":
            return number, materials
    number = next(n for n in range(len(materials) + 1) if n not in materials)
    return number, {**materials, number: SURFACE}


def model_text(model: Model | None, laws: Laws, materials: Mapping[int, Material], out: Path) -> str:
    """The text of the model's file at `out`: the sensor's, with the numbers that were fitted in `[sensor]`."""
    sensor = laws.sensor
    if sensor.file:
        sensor = replace(sensor, file=str(out.absolute().parent / Path(sensor.file).name))
    written = Model(sensor, dict(materials), () if model is None else model.effects)
    document = tomllib.loads(dump_model(written, out))
    numbers = {name: _rounded(found.value) for name, found in laws.fitted.items()}
    if numbers or laws.words:
        document["sensor"] = {**document.get("sensor", {}), **numbers, **laws.words}
    order = ("variant", "sensor", "materials", "effects")
    return tomli_w.dumps({key: document[key] for key in order if key in document})


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")


def named_tables(sensor: Sensor) -> Sequence[str]:
    """The files that a sensor's file names, by their paths from there."""
    document = tomllib.loads(Path(sensor.file).read_text(encoding="utf-8-sig"))
    features = document.get("features", {})
    named = [document.get("beams", {}).get("file"), document.get(sensor.detector, {}).get("pulse_file")]
    named += [entry.get("file") for entry in features.values() if isinstance(entry, Mapping)]
    return [name for name in named if name]


def facts_of(found: Repeats, measured: Sequence[str], ideals: Sequence[str]) -> dict[str, Any]:
    """The summary, ready for JSON. `ideals`: the file of each frame's ideal scan, none where there is none."""
    sensor = found.laws.sensor
    of_frame = {one.frame: one for one in found.ideals}
    frames = []
    for number, (name, part) in enumerate(zip(measured, found.parts.names, strict=True)):
        row: dict[str, Any] = {"measured": name, "part": part}
        if number in of_frame:
            row |= {"ideal": ideals[number], **asdict(of_frame[number].counts)}
        frames.append(row)
    facts: dict[str, Any] = {
        "schema": 1,
        "ideals_from": "repeats",
        "sensor": sensor.name,
        "amplitude": found.feature or None,
        "moved_share": found.moved,
        "echoes_outside": found.outside,
        "frames": frames,
        "laws": _laws(found.laws, found),
    }
    if found.whole is not None:
        facts["ideal"] = {"file": ideals[0], **asdict(found.whole.counts)}
    return facts


def _laws(laws: Laws, found: Repeats) -> dict[str, Any]:
    feature = next((f for f in laws.sensor.features if f.name == found.feature), None)
    range_sd, amplitude_sd = predicted_sd(response_of(laws.sensor, feature), laws.bins)
    bins = [
        {**asdict(one), "law_range_sd_m": float(a), "law_amplitude_sd": float(b)}
        for one, a, b in zip(laws.bins, range_sd, amplitude_sd, strict=True)
    ]
    return {
        "fitted": {name: asdict(one) for name, one in laws.fitted.items()},
        "words": dict(laws.words),
        "coarse": laws.coarse,
        "no_amplitude_below_m": laws.untold_m,
        "bins": [{key: _finite(value) for key, value in one.items()} for one in bins],
        "notes": list(laws.notes),
    }


def _finite(value: Any) -> Any:
    return value if not isinstance(value, float) or abs(value) < float("inf") else None
