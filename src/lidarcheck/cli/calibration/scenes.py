"""`lidarcheck scenes compare`: a whole measured frame beside the model's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    Files,
    JsonFile,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    Seed,
    SensorName,
    placement_of,
    sensor_file,
    sensor_named,
)
from lidarcheck.cli.core.outputs import check_twice, check_writable, files_given
from lidarcheck.cli.core.terminal import hush, note, progress, stage
from lidarcheck.cli.core.workflow_output import Plot, check_out_dir, finish
from lidarcheck.errors import UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.calibration.scenes.frame import SceneFrame
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.model import Model
    from lidarcheck.scenes.files.file import SceneFile
    from lidarcheck.sensor import Sensor

__all__ = ["compare"]


def _names(_type: Any, tokens: Sequence[Any]) -> list[str]:
    return [name.strip() for token in tokens for name in token.value.split(",") if name.strip()]


def _sectors(text: str) -> tuple[int, int]:
    from lidarcheck.calibration.scenes.workflow import MOST_SECTORS

    parts = text.lower().split("x")
    if len(parts) != 2 or not all(p.isdecimal() and len(p) <= 3 and 1 <= int(p) <= MOST_SECTORS for p in parts):
        fix = f"use columns x rows as 12x6, 1 to {MOST_SECTORS} each"
        raise UsageError(f"--sectors {text} is no grid", fix=fix)
    return int(parts[0]), int(parts[1])


def _radius(_type: Any, tokens: Sequence[Any]) -> float:
    text = tokens[0].value
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 < value <= 10.0:
        raise UsageError(f"--radius {text} is out of range", fix="use a number above 0, up to 10 m")
    return value


Names = Annotated[list[str], Parameter(converter=_names, negative=())]


def compare(
    *measured: Annotated[Path, Parameter(help=f"The frames of the real sensor, a file each{MANY}.")],
    ideal: Annotated[
        Files,
        Parameter(help="What the beams meet, one for each frame: files in their order, or a folder, named as these."),
    ],
    model: Annotated[Path | None, Parameter(help="The sensor model, TOML, to simulate the frames with.")] = None,
    simulated: Annotated[Files | None, Parameter(help="Simulated frames, in the place of --model.")] = None,
    effects: Annotated[
        Names | None,
        Parameter(help="Only these effects, with commas; one that the model lacks comes with typical parameters."),
    ] = None,
    without: Annotated[Names | None, Parameter(help="The model without these effects, with commas.")] = None,
    scene: Annotated[
        str | None,
        Parameter(help="What the ideal scan was cast from, as `scene` takes it: names objects, and effects cast anew."),
    ] = None,
    by: Annotated[
        str | None, Parameter(help="What a part is: object, material or surface; what the ideal scan has by default.")
    ] = None,
    sectors: Annotated[str, Parameter(help="Columns of azimuth x rows of elevation, 1 to 100 each.")] = "12x6",
    radius: Annotated[float, Parameter(converter=_radius, help="Of the overlap [m], up to 10.")] = 0.1,
    out: Annotated[Path | None, Parameter(help="Directory for report.html, result.json and pictures.")] = None,
    sensor: SensorName = None,
    seed: Seed = 0,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    plot: Plot | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Compare measured frames of a scene with the model's."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    grid = _sectors(sectors)
    _check_arguments(measured, model, simulated, effects, without)
    inputs = files_given(*measured, *ideal, *(simulated or ()), model, sensor_file(sensor))
    if out is not None:
        check_out_dir(out, besides=inputs)
    if json is not None:
        check_writable(json, option="--json", besides=inputs)
    from lidarcheck.calibration.scenes.checks import check_grouping
    from lidarcheck.calibration.scenes.read import provenance_of
    from lidarcheck.calibration.scenes.workflow import compare_scene
    from lidarcheck.figures.pages.scenes import page

    check_grouping(by)
    with stage("reading"):
        real, ideals, shown = _sides(measured, ideal, simulated or ())
        sensor_model = None if model is None else _model(model, effects, without)
        known = sensor_named(sensor, sensor_model)
        scene_file = _scene(scene)
        names = {} if scene_file is None else dict(scene_file.scene.names)
        materials = {} if sensor_model is None else {n: m.name for n, m in sensor_model.materials.items()}
    frames = _frames(real, ideals, shown, sensor_model, scene_file, scene or "", seed, placement, known)
    with stage("comparing"):
        result = compare_scene(frames, by=by, sectors=grid, radius_m=radius, names=names, materials=materials)
    files = provenance_of(list(zip(real, ideals, strict=True)), sensor_model, shown, seed=seed)
    finish(page(result, files), result.to_dict(), out=out, json=json, plot=plot)
    return 0


def _check_arguments(
    measured: Sequence[Path],
    model: Path | None,
    simulated: Sequence[Path] | None,
    effects: Sequence[str] | None,
    without: Sequence[str] | None,
) -> None:
    """Refuse what does not fit together, before anything is read."""
    if not measured:
        raise UsageError(
            "no measured frame is named", fix="lidarcheck scenes compare real.pcd --ideal ideal.txt --model M"
        )
    if (model is None) == (simulated is None):
        what = "neither --model nor --simulated is given" if model is None else "--model stands beside --simulated"
        raise UsageError(what, fix="give the one or the other")
    if simulated is not None and (effects is not None or without):
        raise UsageError(
            "--effects and --without choose what a model does", fix="give --model in the place of --simulated"
        )
    if effects is not None and without:
        raise UsageError("--effects stands beside --without", fix="give the one or the other")


def _sides(
    measured: Sequence[Path], ideal: Sequence[Path], simulated: Sequence[Path]
) -> tuple[list[FrameFile], list[FrameFile], list[FrameFile]]:
    """The measured frames, as many ideal scans, and as many simulated frames, none where none is named."""
    from lidarcheck.cases.partners import beside
    from lidarcheck.cases.source import each_frame

    groups = each_frame(measured)
    real = [frame for group in groups for frame in group]
    ideals = beside(groups, each_frame(ideal, "ideal"), "ideal")
    shown = beside(groups, each_frame(simulated), "simulated") if simulated else []
    if len(ideals) != len(real):
        raise UsageError(f"{len(real)} measured frames and {len(ideals)} ideal scans", fix="give an ideal scan each")
    if shown and len(shown) != len(real):
        raise UsageError(f"{len(real)} measured frames and {len(shown)} simulated", fix="give one each")
    check_twice((*real, *dict.fromkeys(ideals), *shown))
    return real, ideals, shown


def _model(path: Path, effects: Sequence[str] | None, without: Sequence[str] | None) -> Model:
    from lidarcheck.calibration.scenes.effects import chosen_effects
    from lidarcheck.model import load_model

    chosen, added = chosen_effects(load_model(path), only=effects, without=without or ())
    for name in added:
        settings = ", ".join(f"{k} = {v}" for k, v in chosen.effects[_index(chosen, name)].settings().items())
        note(f"{name} is not in {path}: added with {settings or 'its typical parameters'}")
    return chosen


def _index(model: Model, name: str) -> int:
    return [effect.name for effect in model.effects].index(name)


def _scene(name: str | None) -> SceneFile | None:
    if name is None:
        return None
    from lidarcheck.cli.simulation.scene import find_scene

    return find_scene(name)


def _frames(
    measured: Sequence[FrameFile],
    ideal: Sequence[FrameFile],
    simulated: Sequence[FrameFile],
    model: Model | None,
    scene: SceneFile | None,
    scene_name: str,
    seed: int,
    placement: Placement,
    sensor: Sensor | None,
) -> list[SceneFrame]:
    """The frames, read and simulated."""
    from lidarcheck.calibration.scenes.read import read_frame

    frames = []
    with progress("frame") as show:
        for number, (file, ideal_file) in enumerate(zip(measured, ideal, strict=True)):
            show(number, len(measured), file.name)
            frame = read_frame(
                file,
                ideal_file,
                model=model,
                simulated=simulated[number] if model is None else None,
                scene=None if scene is None else scene.scene,
                scene_name=scene_name,
                seed=seed,
                number=number,
                placement=placement,
                sensor=sensor,
            )
            frames.append(frame)
    return frames
