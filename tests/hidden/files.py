"""The files of a case, as text."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .rays import Beams, Hits, directions
from .sensor import Echoes

Table = dict[int, tuple[str, float, float]]


def ideal_text(beams: Beams, hits: Hits, object_ids: bool, time_s: NDArray[np.float64] | None) -> str:
    """What every beam meets, a row each."""
    names = ["Layer", "Point", "Distance", "MaterialID", "IncidenceAngle"]
    columns = [beams.layer, beams.point, hits.range_m, hits.material, hits.incidence_deg]
    form = "%d %d %.4f %d %.3f"
    if object_ids:
        names.append("ObjectID")
        columns.append(np.maximum(hits.object_id, 0))
        form += " %d"
    if time_s is not None:
        names.append("Time")
        columns.append(time_s)
        form += " %.9f"
    rows = "\n".join(form % row for row in zip(*(c.tolist() for c in columns), strict=True))
    return f"//{' '.join(names)}\n{len(beams)}\n{rows}\n"


def echoes_text(beams: Beams, echoes: Echoes) -> str:
    """Echoes at their beams' nominal directions, numbered from 1 by range."""
    heading = directions(beams.azimuth_deg, beams.elevation_deg)
    at = echoes.range_m[:, None] * heading[echoes.beam]
    start = np.concatenate([[True], np.diff(echoes.beam) != 0])[: len(echoes.beam)]
    row = np.arange(len(echoes.beam))
    number = row - np.maximum.accumulate(np.where(start, row, 0)) + 1
    columns = (
        at[:, 0],
        at[:, 1],
        at[:, 2],
        echoes.peak,
        echoes.area,
        echoes.width_ns,
        number,
        beams.layer[echoes.beam],
        beams.point[echoes.beam],
    )
    form = "%.6f %.6f %.6f %d %d %d %d %d %d"
    rows = "\n".join(form % values for values in zip(*(c.tolist() for c in columns), strict=True))
    return f"//X Y Z PEAK AREA WIDTH EchoNumber Layer Point\n{len(echoes.beam)}\n{rows}\n"


def model_text(variant: str, table: Table, effects: dict[str, dict[str, float]]) -> str:
    """The model file: variant, materials and the effects that it already has."""
    lines = [f'variant = "{variant}"', ""]
    for number, (name, reflectance, gain) in sorted(table.items()):
        kind = "retro" if gain else "lambertian"
        lines += [f"[materials.{number}]", f'name = "{name}"', f"reflectance = {reflectance}", f'kind = "{kind}"']
        lines += [f"retro_gain = {gain}"] if gain else []
        lines.append("")
    for name, parameters in effects.items():
        lines += ["[[effects]]", f'name = "{name}"', *(f"{key} = {value!r}" for key, value in parameters.items()), ""]
    return "\n".join(lines)


def case_text(frames: list[tuple[str, str, float]]) -> str:
    """The case file: model and frames (ideal, measured, time in s)."""
    lines = ['model = "model.toml"', ""]
    for ideal, measured, time_s in frames:
        lines += ["[[frames]]", f'ideal = "{ideal}"', f'measured = "{measured}"', f"time = {time_s!r}", ""]
    return "\n".join(lines)


def write(directory: Path, name: str, text: str) -> Path:
    """Writes a text file with plain line ends."""
    path = directory / name
    path.write_text(text, encoding="utf-8", newline="\n")
    return path
