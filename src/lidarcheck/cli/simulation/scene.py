"""`lidarcheck scene`: the ideal scan of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, JsonFlag, Quiet, Rooted, Whole, up_to
from lidarcheck.cli.core.outputs import check_writable, json_text
from lidarcheck.cli.core.terminal import columns, emit, hush, note, stage, table
from lidarcheck.errors import ConfigError, UsageError

if TYPE_CHECKING:
    from lidarcheck.config.schema import LineIndex
    from lidarcheck.scan import IdealScan
    from lidarcheck.scenes.files.file import SceneFile
    from lidarcheck.sensor import Sensor

__all__ = ["find_scene", "scene"]

ALL = columns("scene", "objects", "triangles", "what it shows", right=("objects", "triangles"))


def _sub_beams(_type: Any, tokens: Sequence[Any]) -> int:
    from lidarcheck.scenes.sampling import MAX_SUB_BEAMS

    return up_to(MAX_SUB_BEAMS)(_type, tokens)


def scene(
    scene: Annotated[
        str | None, Parameter(help="A scene's TOML file, a scenario with a scene, or the name of a built-in scene.")
    ] = None,
    /,
    *,
    out: Annotated[
        Path | None, Parameter(help="Where the ideal scan goes: .txt, .csv, .pcd, .ply or .parquet.")
    ] = None,
    sensor: Annotated[
        str | None,
        Parameter(help="Whose beams are cast: a sensor's name or file; by default the scenario's, else SMART's."),
    ] = None,
    model: Annotated[Path | None, Parameter(help="A model, whose sensor's beams are cast.")] = None,
    rays: Annotated[
        Path | None, Parameter(help="A scan along whose rays is cast, of a sensor whose scans bring their directions.")
    ] = None,
    list_: Annotated[bool, Flag, Parameter(name="--list", help="List the built-in scenes.")] = False,
    sub_beams: Annotated[
        int | None,
        Parameter(
            converter=_sub_beams,
            help="Rows a beam is divided into per axis, 1 to 8; by default as the scene says, else the sensor.",
        ),
    ] = None,
    swept: Annotated[
        bool,
        Flag,
        Parameter(help="Cast each beam at its time; objects and sensor move."),
    ] = False,
    frame: Annotated[
        int, Whole, Parameter(help="Of a sensor whose columns do not repeat: which frame of a run, from 0.")
    ] = 0,
    no_second_hits: Annotated[bool, Flag, Parameter(help="Leave out what mirrors and panes show.")] = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
    permitted: Rooted | None = None,
) -> int:
    """Cast the beams into a scene and write what each meets."""
    hush(quiet)
    if list_:
        if scene is not None or out is not None:
            raise UsageError("--list stands beside a scene or --out", fix="remove one of the two")
        _show_all(json)
        return 0
    if scene is None or out is None:
        missing = "scene" if scene is None else "--out"
        fix = "lidarcheck scene highway --out ideal.txt; --list shows the built-in scenes"
        raise UsageError(f"{missing} is missing", fix=fix)
    from lidarcheck.formats import save_ideal
    from lidarcheck.formats.recognise import target_format

    if target_format(out).name == "las":
        raise UsageError(
            "LAS holds points, not what a beam meets", file=out, fix="use .txt, .csv, .pcd, .ply or .parquet"
        )
    check_writable(out, option="--out", besides=(scene,))
    with stage(f"reading {scene}"):
        file = find_scene(scene)
        beams_of = _sensor(scene, sensor, model)
        if rays is not None:
            beams_of = _along(rays, beams_of)
    check_writable(out, option="--out", besides=(*file.files, *_files_of(sensor, model), rays))
    with stage(f"casting {file.name}"):
        ideal = file.ideal(beams_of, frame=frame, **_changes(sub_beams, swept, no_second_hits))
    with stage(f"writing {out.name}"):
        save_ideal(ideal, out)
    if json:
        emit(json_text(_facts(file, ideal, out)))
    beams, met = _beams(ideal)
    note(f"{out}: {len(ideal)} rows of {beams} beams of {scene}, {met} of which meet something")
    return 0


def _sensor(scene: str, sensor: str | None, model: Path | None) -> Sensor | None:
    """The sensor that is named, else a model's, else that of the scenario that the scene stands in; else None."""
    from lidarcheck.model.files.sensor_file import load_sensor

    if sensor is not None and model is not None:
        raise UsageError("--sensor stands beside --model", fix="give one of them: a model names its sensor")
    if sensor is not None:
        return load_sensor(sensor)
    if model is not None:
        from lidarcheck.model import load_model

        return load_model(model).sensor
    return _of_scenario(scene)


def _along(rays: Path, sensor: Sensor | None) -> Sensor:
    """The sensor with the beams that a scan of it brings."""
    from lidarcheck.formats import load_scan

    if sensor is None or sensor.beams.lattice:
        what = "--rays is for a sensor whose scans bring their directions"
        raise UsageError(what, fix="give --sensor or --model of such a one, or leave out --rays")
    return replace(sensor, beams=load_scan(rays, sensor=sensor).beams)


def _of_scenario(scene: str) -> Sensor | None:
    from lidarcheck.formats.config import parse_toml
    from lidarcheck.scenes.files.file import builtin_names

    if scene in builtin_names():
        return None
    data, lines = parse_toml(scene)
    if isinstance(data.get("model"), dict):
        from lidarcheck.model.files.model_file import model_of

        inside = {key[1:]: line for key, line in lines.lines.items() if key[0] == "model"}
        return model_of(data["model"], replace(lines, lines=inside)).sensor
    if isinstance(data.get("model"), str):
        from lidarcheck.model import load_model
        from lidarcheck.trust.places import named_file

        return load_model(named_file(lines.file, data["model"], lines.line(("model",)))).sensor
    return None


def _files_of(sensor: str | None, model: Path | None) -> list[Path]:
    return [path for path in (model, None if sensor is None else Path(sensor)) if path is not None and path.is_file()]


def _changes(sub_beams: int | None, swept: bool, no_second_hits: bool) -> dict[str, Any]:
    """What the options ask for otherwise than the scene."""
    changes: dict[str, Any] = {} if sub_beams is None else {"sub_beams": sub_beams}
    return changes | ({"swept": True} if swept else {}) | ({"second_hits": False} if no_second_hits else {})


def find_scene(name: str) -> SceneFile:
    """A built-in by its name, else the scene of a file, of a scenario as this samples it.

    A scenario is told by its KPIs or its model.
    """
    from lidarcheck.formats.config import parse_toml
    from lidarcheck.scenes.files.file import builtin_names, builtin_path, load_scene, scene_of

    if name in builtin_names():
        return load_scene(builtin_path(name))
    if not name.endswith(".toml") and not Path(name).exists():
        return load_scene(builtin_path(name))  # says which name is nearest
    data, lines = parse_toml(name)
    if not {"kpis", "model", "frames"} & data.keys():
        return load_scene(name)
    if "scene" not in data:
        raise ConfigError([lines.fault((), "the scenario has no scene", fix='add scene = "NAME" or a [scene] table')])
    return _as_sampled(scene_of(data["scene"], lines), data, lines)


def _as_sampled(file: SceneFile, scenario: dict[str, Any], lines: LineIndex) -> SceneFile:
    """The scene with what the scenario says of its sampling, as `check` casts it."""
    from lidarcheck.config.schema import Config, validate
    from lidarcheck.scenes.files.file import SamplingTable

    class Asked(Config):
        sampling: SamplingTable = SamplingTable()

    asked = validate({key: scenario[key] for key in ("sampling",) if key in scenario}, lines, Asked).sampling
    return replace(file.sampled_as(asked, lines), files=(lines.file, *file.files))


def _show_all(json: bool) -> None:
    from lidarcheck.scenes.files.file import builtin_names, builtin_path, load_scene

    files = [load_scene(builtin_path(name)) for name in builtin_names()]
    if json:
        facts = [{"name": file.name, "description": file.description, "path": str(file.path)} for file in files]
        emit(json_text(facts))
        return
    rows = [
        (file.name, str(len(file.scene.objects)), str(file.scene.triangles), file.description) for file in files
    ]  # fmt: skip
    emit(table(ALL, rows))


def _facts(file: SceneFile, ideal: IdealScan, out: Path) -> dict[str, Any]:
    """What was written, and of each object that is seen how many rows and how near."""
    import numpy as np

    met = ideal.distance_m > 0.0
    beams, hit = _beams(ideal)
    numbers = ideal.object_id[met] if ideal.object_id is not None else np.empty(0, dtype=np.int32)
    distances = ideal.distance_m[met]
    objects = [
        {
            "object": int(number),
            "name": file.scene.names[int(number)],
            "rows": int(np.sum(numbers == number)),
            "nearest_m": float(distances[numbers == number].min()),
        }
        for number in np.unique(numbers)
    ]
    facts = {"file": str(out), "scene": file.name, "rows": len(ideal), "beams": beams, "beams_that_meet": hit}
    return {**facts, "materials": np.unique(ideal.material_id[met]).tolist(), "objects": objects}


def _beams(ideal: IdealScan) -> tuple[int, int]:
    """How many beams there are, and how many meet something."""
    import numpy as np

    beam = ideal.layer.astype(np.int64) << 32 | ideal.point
    return len(np.unique(beam)), len(np.unique(beam[ideal.distance_m > 0.0]))
