"""A scenario: what the beams meet, the model that is asked, and the KPIs it is judged by.

A scenario is a TOML file; `docs/scenarios.md` describes it. Reading it finds all faults at once, each with its line.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import IntArray
from lidarcheck.config.schema import LineIndex, validate
from lidarcheck.config.toml_lines import KeyPath
from lidarcheck.config.words import shown
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.formats.config import parse_toml
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.harness.scenario.asked import AskedKpi, ask, hashed
from lidarcheck.harness.scenario.file import ScenarioTable
from lidarcheck.harness.scenario.shapes import Shape, lay_beams
from lidarcheck.kpi.pairing import SortedRows, beam_keys, pair_with_ideal
from lidarcheck.model.files.model_file import load_model, model_of
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.scenes import Scene
from lidarcheck.scenes.files.file import SamplingTable, SceneFile, scene_of
from lidarcheck.scenes.files.spans import beyond
from lidarcheck.sensor import Beams
from lidarcheck.sensor.document import own
from lidarcheck.trust.places import named_file

__all__ = ["AskedKpi", "Scenario", "load_scenario"]


@dataclass(frozen=True)
class Scenario:
    """A scenario file, read.

    `name`: the file's name without `.toml`. `frames`: simulated per seed. `scene`: what the ideal scan was cast from,
    None where it comes from shapes or a file. `files`: those that it names, besides the model. `content_hash`: SHA-256
    over the beams or the scene, the KPIs with their tolerances and limits, and the measured echoes; neither comments
    nor the model change it.
    """

    name: str
    description: str
    path: Path
    model: Model
    ideal: IdealScan
    asked: tuple[AskedKpi, ...]
    frames: int = 1
    content_hash: str = ""
    scene: Scene | None = None
    files: tuple[Path, ...] = ()
    kpis: tuple[KpiSpec, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "kpis", tuple(asked.spec for asked in self.asked))

    @functools.cached_property
    def surfaces(self) -> Surfaces:
        """What the ideal scan shows, the same for all seeds."""
        return Surfaces(self.ideal)

    @functools.cached_property
    def rows(self) -> SortedRows:
        """The rows of the ideal scan as echoes are paired with them."""
        return SortedRows.of(self.ideal)

    def forget(self) -> None:
        """Let go of what is the same for all seeds; who asks for it again finds it again."""
        for name in ("surfaces", "rows"):
            self.__dict__.pop(name, None)

    def with_model(self, model: Model) -> Scenario:
        """The same beams and KPIs with another model, and with what is known of the surfaces."""
        other = replace(self, model=model)
        other.__dict__.update(surfaces=self.surfaces, rows=self.rows)
        return other


def load_scenario(path: Path | str) -> Scenario:
    """Read a scenario file and the files that it names, by paths relative to it.

    `InputError` when a file cannot be read, `ConfigError` with every fault of the scenario and its line.
    """
    data, lines = parse_toml(path)
    table = validate(data, lines, ScenarioTable)
    model = _model(data, table, lines)
    scene = None if table.scene is None else scene_of(data["scene"], lines).sampled_as(table.sampling, lines)
    if scene is None:
        ideal, faults = _ideal(table, model, lines)
    else:
        # The materials of a scene file belong to what is measured, as its objects do.
        model = replace(model, materials={**model.materials, **(scene.materials or {})})
        ideal, faults = _cast(scene, model, lines)
    for index, kpi in enumerate(table.kpis):
        spans = {"layers": kpi.layers, "points": kpi.points}
        faults += _beyond(("kpis", index), spans, model.sensor.beams, lines)
    measured = _measured(table, ideal, model, lines)
    asked = ask(table.kpis, ideal, model, measured, lines, faults)
    if faults:
        raise ConfigError(sorted(faults, key=lambda fault: fault.line or 0))
    return Scenario(
        name=Path(path).stem,
        description=table.description,
        path=Path(path),
        model=model,
        ideal=ideal,
        asked=asked,
        frames=table.frames,
        content_hash=_content_hash(table, ideal, asked, scene, model),
        scene=None if scene is None else scene.scene,
        files=_named(table, scene, lines),
    )


def _named(table: ScenarioTable, scene: SceneFile | None, lines: LineIndex) -> tuple[Path, ...]:
    """The files that the scenario names: ideal scan, measured scan, scene."""
    names = [lines.file.parent / name for name in (table.ideal, table.measured) if name is not None]
    return tuple(names if scene is None else [*names, *scene.files])


def _model(data: Mapping[str, Any], table: ScenarioTable, lines: LineIndex) -> Model:
    if isinstance(table.model, Path):
        model = load_model(_existing(table.model, "model", lines))
    else:
        inside = {key[1:]: line for key, line in lines.lines.items() if key[0] == "model"}
        model = model_of(data["model"], LineIndex(lines.file, inside))
    if model.external is not None and not model.external.draws_anew and table.frames > 1:
        what = f"frames = {table.frames}, but an external model does not know frames"
        raise ConfigError([lines.fault(("frames",), what, fix="use frames = 1 and more beams")])
    return model


def _existing(name: Path, key: str, lines: LineIndex) -> Path:
    file = named_file(lines.file, name, lines.line((key,)))
    try:
        there = file.is_file()
    except OSError:
        there = False
    if not there:
        fix = "give its path from the scenario's directory"
        raise ConfigError([lines.fault((key,), f"{key} = {shown(str(name))} is not a file", fix=fix)])
    return file


def _ideal(table: ScenarioTable, model: Model, lines: LineIndex) -> tuple[IdealScan, list[InputError]]:
    """What the beams meet, and what is wrong with the shapes."""
    if table.ideal is not None:
        ideal = load_ideal(_existing(table.ideal, "ideal", lines), model.sensor)
        if not len(ideal):
            raise ConfigError([lines.fault(("ideal",), f"{table.ideal} has no beams", fix="give a file with beams")])
        return ideal, []
    beams = model.sensor.beams
    faults = [fault for index, shape in enumerate(table.beams) for fault in _misplaced(index, shape, beams, lines)]
    if faults:
        raise ConfigError(faults)
    ideal, shape_of_row = lay_beams(table.beams, beams)
    return ideal, [
        *_shared_beams(ideal, shape_of_row, lines),
        *_too_far(ideal, shape_of_row, model, lines),
        *_unknown_materials(table.beams, ideal, shape_of_row, model, lines),
    ]


def _misplaced(index: int, shape: Shape, beams: Beams, lines: LineIndex) -> list[InputError]:
    """Faults of a shape with layers or points that the sensor does not have, or that look where it is not."""
    faults = _beyond(("beams", index), shape.spans, beams, lines)
    what, _, fix = ("" if faults else shape.fault(beams)).partition("; ")
    return faults if not what else [lines.fault(("beams", index), f"beams[{index}]: {what}", fix=fix)]


def _beyond(
    path: KeyPath, spans: Mapping[str, tuple[int, int] | None], beams: Beams, lines: LineIndex
) -> list[InputError]:
    """Faults of spans of layers and points that the sensor does not have."""
    found = {key: beyond(key, span, beams) for key, span in spans.items()}
    return [lines.fault((*path, key), wrong[0], fix=wrong[1]) for key, wrong in found.items() if wrong is not None]


def _cast(scene: SceneFile, model: Model, lines: LineIndex) -> tuple[IdealScan, list[InputError]]:
    """What the beams meet in the scene, and a fault for a material of it that the model does not know.

    A model that reaches less far than its sensor must not make the scene shorter: the KPIs are to see what it misses.
    """
    ideal = scene.ideal(model.sensor, max_range_m=_sampling(scene, model).max_range_m)
    unknown = (ideal.distance_m > 0.0) & ~np.isin(ideal.material_id, list(model.materials))
    if model.external is not None or not unknown.any():
        return ideal, []
    material = int(ideal.material_id[unknown][0])
    return ideal, [_lacks(("scene",), f"the scene has material {material}", material, model, lines)]


def _sampling(scene: SceneFile, model: Model) -> SamplingTable:
    """How the scene is cast for the model's sensor, whose numbers a model may override: those of its file count."""
    return scene.sampling.resolved(own(model.sensor))


def _shared_beams(ideal: IdealScan, shape_of_row: IntArray, lines: LineIndex) -> list[InputError]:
    """A fault for every shape with a beam that an earlier one has."""
    _, first, beam = np.unique(beam_keys(ideal.layer, ideal.point), return_index=True, return_inverse=True)
    earlier = shape_of_row[first[beam]]
    faults = []
    for shape in np.unique(shape_of_row[earlier < shape_of_row]):
        row = int(np.flatnonzero((shape_of_row == shape) & (earlier < shape))[0])
        where = f"Layer {ideal.layer[row]}, Point {ideal.point[row]}"
        what = f"beams[{shape}] shares {where} with beams[{earlier[row]}]"
        faults.append(lines.fault(("beams", int(shape)), what, fix="give each other layers or points"))
    return faults


def _too_far(ideal: IdealScan, shape_of_row: IntArray, model: Model, lines: LineIndex) -> list[InputError]:
    limit = model.sensor.max_range_m
    faults = []
    for shape in np.unique(shape_of_row[ideal.distance_m > limit]):
        far = float(ideal.distance_m[shape_of_row == shape].max())
        what = f"beams[{shape}] reaches {far:.1f} m, the sensor only {limit:g} m"
        faults.append(lines.fault(("beams", int(shape)), what, fix="put it nearer, or on beams closer to the front"))
    return faults


def _unknown_materials(
    shapes: Sequence[Shape], ideal: IdealScan, shape_of_row: IntArray, model: Model, lines: LineIndex
) -> list[InputError]:
    if model.external is not None:
        return []
    unknown = (ideal.distance_m > 0.0) & ~np.isin(ideal.material_id, list(model.materials))
    faults = []
    for shape in np.unique(shape_of_row[unknown]):
        material = int(ideal.material_id[unknown & (shape_of_row == shape)][0])
        key = "behind_material" if material != shapes[shape].material else "material"
        what = f"beams[{shape}] has material {material}"
        faults.append(_lacks(("beams", int(shape), key), what, material, model, lines))
    return faults


def _lacks(path: KeyPath, what: str, material: int, model: Model, lines: LineIndex) -> InputError:
    known = ", ".join(str(number) for number in sorted(model.materials)) or "none"
    inline = model.file == lines.file
    fix = f"add [model.materials.{material}]" if inline else f"add [materials.{material}] to {model.file}"
    return lines.fault(path, f"{what}, which the model's table lacks (there: {known})", fix=fix)


def _measured(table: ScenarioTable, ideal: IdealScan, model: Model, lines: LineIndex) -> Scan | None:
    if table.measured is None:
        return None
    scan = load_scan(_existing(table.measured, "measured", lines), sensor=model.sensor)
    try:
        pair_with_ideal(ideal, scan)
    except UsageError as error:
        raise ConfigError([lines.fault(("measured",), error.what, fix=error.fix)]) from None
    return scan


_PLACE = ("X", "Y", "Z")


def _places(ideal: IdealScan) -> list[npt.NDArray[Any] | None]:
    """The surface points that an ideal scan brings itself; else they follow from its distances."""
    return [ideal.extra[name] for name in sorted(ideal.extra, key=str.upper) if name.upper() in _PLACE]


def _others(ideal: IdealScan) -> dict[str, npt.NDArray[Any]]:
    """The further columns of an ideal scan, by their names in small letters: `Reflectance`, `Edge` and their like."""
    return {
        name.lower(): ideal.extra[name] for name in sorted(ideal.extra, key=str.lower) if name.upper() not in _PLACE
    }


def _content_hash(
    table: ScenarioTable, ideal: IdealScan, asked: Sequence[AskedKpi], scene: SceneFile | None, model: Model
) -> str:
    digest = hashlib.sha256()
    kpis = [hashed(kpi) for kpi in table.kpis]
    digest.update(json.dumps({"frames": table.frames, "kpis": kpis}, sort_keys=True).encode())
    columns: list[npt.NDArray[Any] | None] = []
    if scene is None:
        columns += [ideal.layer, ideal.point, ideal.distance_m, ideal.material_id, ideal.incidence_deg]
        columns += [ideal.object_id, ideal.time_s, ideal.share]
        placed = not ideal.beams.repeats or any(KINDS[kpi.kpi].of_place for kpi in table.kpis)
        columns += _places(ideal) if placed else []
        others = _others(ideal)
        digest.update("".join(others).encode())
        columns += others.values()
    else:
        # Which of two surfaces a beam at an edge meets may differ between machines; the scene itself does not.
        # The keys are those of the file, whatever the code has.
        how = _sampling(scene, model).model_dump(mode="json", by_alias=True)
        digest.update(json.dumps({"scene": scene.scene.digest(), "sampling": how}, sort_keys=True).encode())
    for column in [*columns, *(kpi.measured for kpi in asked)]:
        if column is not None:
            # Angles come from library functions whose last digit may differ between machines.
            digest.update(np.round(column.astype(np.float64), 9).tobytes())
    return digest.hexdigest()
