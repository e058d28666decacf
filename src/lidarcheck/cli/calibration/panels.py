"""`lidarcheck panels`: the sensor's noise on the panels of a laboratory, and the model's beside it."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
    Whole,
    placement_of,
    sensor_file,
    sensor_named,
)
from lidarcheck.cli.core.outputs import check_twice, check_writable, files_given
from lidarcheck.cli.core.terminal import hush, note, progress
from lidarcheck.cli.core.workflow_output import Folder, Plot, check_out_dir, finish
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.files.result_folder import drawing_ahead
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.calibration.panels.samples import PanelSamples
    from lidarcheck.calibration.panels.workflow import PanelsResult
    from lidarcheck.cases.source import FrameFile, Named

__all__ = ["panels"]

DIRECTORY = "panels"
_SAVED = re.compile(r"panel_[0-9].*_.*\..*")


def _two(values: tuple[float, float]) -> str:
    return f"{values[0]:g} {values[1]:g}"


def panels(
    *measured: Annotated[Path, Parameter(help=f"Frames of the real sensor, of a scene at rest: a file each{MANY}.")],
    ideal: Annotated[
        Files | None,
        Parameter(help="What the beams meet: one ideal scan for all frames, or one for each frame, named as these."),
    ] = None,
    simulated: Annotated[Files | None, Parameter(help=f"Frames of the model, any number: a file each{MANY}.")] = None,
    model: Annotated[
        Path | None, Parameter(help="Simulate as many frames as were measured with this model; names materials.")
    ] = None,
    sensor: SensorName = None,
    seed: Seed = 0,
    out: Annotated[
        Path, Parameter(help="Directory for the report, the numbers, the pictures and each panel's echoes.")
    ],
    format: Annotated[
        str, Parameter(help="Format of the panels' echoes: pcd, txt, csv, ply, las, laz or parquet.")
    ] = "pcd",
    expect: Annotated[
        int | None, Whole, Parameter(help="How many panels there must be; another number is an error.")
    ] = None,
    range: Annotated[
        tuple[float, float], Parameter(negative=(), show_default=_two, help="Nearest and farthest panel [m].")
    ] = (4.0, 85.0),
    size: Annotated[
        tuple[float, float],
        Parameter(negative=(), show_default=_two, help="Least and largest width and height of a panel [m]."),
    ] = (0.2, 4.0),
    trim_layers: Annotated[int, Whole, Parameter(help="Layers that the upper and the lower border lose.")] = 2,
    trim_points: Annotated[int, Whole, Parameter(help="Points that the left and the right border lose.")] = 1,
    trim_m: Annotated[float, Parameter(help="The least that each border loses [m].")] = 0.0,
    floor_m: Annotated[
        float | None, Parameter(help="Height of the floor in the sensor frame [m]; found by default.")
    ] = None,
    roof_m: Annotated[
        float | None, Parameter(help="Height of the roof in the sensor frame [m]; found by default.")
    ] = None,
    clearance_m: Annotated[float, Parameter(help="What is this close to floor or roof is trimmed with it [m].")] = 0.15,
    max_incidence: Annotated[float, Parameter(help="How far a panel may be turned away from the sensor [deg].")] = 60.0,
    window_m: Annotated[float, Parameter(help="An echo this close to the panel's plane is on the panel [m].")] = 1.0,
    placed: Placed | None = None,
    plot: Plot | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Say how the sensor sees panels: detection, range noise, walk, amplitude; and the model beside it."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    from lidarcheck.calibration.panels.settings import PanelSettings
    from lidarcheck.formats.recognise import target_format

    settings = PanelSettings(
        range, size, trim_layers, trim_points, trim_m, floor_m, roof_m, clearance_m, max_incidence, window_m, expect
    )
    if not measured:
        raise UsageError("no measured frame is given", fix="name one file or more before the options")
    target_format(f"panel.{format}")
    _check_places(out, json, files_given(*measured, *(ideal or ()), *(simulated or ()), model, sensor_file(sensor)))
    from lidarcheck.cases.partners import beside
    from lidarcheck.cases.source import each_frame

    groups = each_frame(measured)
    real = [frame for group in groups for frame in group]
    ideals = list(dict.fromkeys(beside(groups, each_frame(ideal, "ideal"), "ideal"))) if ideal else []
    frames = [frame for group in each_frame(simulated or ()) for frame in group]
    _check_arguments(real, ideals, frames, model)
    from lidarcheck.calibration.panels.files import arrangements_of, provenance
    from lidarcheck.calibration.panels.workflow import characterise
    from lidarcheck.figures.pages.panels import document, page
    from lidarcheck.model import load_model

    with drawing_ahead(out):
        sensor_model = None if model is None else load_model(model)
        known = sensor_named(sensor, sensor_model)
        names = {} if sensor_model is None else {n: material.name for n, material in sensor_model.materials.items()}
        with progress("panels:") as show:
            arrangements = arrangements_of(real, ideals, frames, sensor_model, seed, placement, known)
            result = characterise(arrangements, settings, materials=names, sensor=known, progress=show)
        origin: dict[str, Sequence[Named]] = {
            "measured": real,
            "ideal": ideals,
            "simulated": frames,
            "model": [model] if model else [],
        }
        made = provenance(origin, shlex.join(["lidarcheck", *sys.argv[1:]]), seed if model else None)
        saved = Folder(lambda place: _save(result, place, format), _SAVED)
        finish(page(result, made), document(result), out=out, json=json, plot=plot, folders={DIRECTORY: saved})
    note(f"{out / DIRECTORY}: {len(_samples(result))} files of the panels' echoes")
    return 0


def _check_arguments(
    measured: Sequence[FrameFile], ideals: list[FrameFile], frames: list[FrameFile], model: Path | None
) -> None:
    if len(ideals) > 1 and len(ideals) != len(measured):
        what = f"{len(ideals)} ideal scans for {len(measured)} measured frames"
        raise UsageError(what, fix="give --ideal one file for all frames, or one for each, in their order")
    if len(ideals) > 1 and frames and len(frames) != len(ideals):
        what = f"{len(frames)} simulated frames for {len(ideals)} ideal scans"
        raise UsageError(what, fix="give --simulated one file for each ideal scan, in their order")
    if model is not None and not ideals:
        raise UsageError("--model needs --ideal", fix="a model is simulated from what the beams meet")
    if model is not None and frames:
        raise UsageError(
            "--model and --simulated are both given", fix="give one: what the model is to simulate, or has"
        )
    check_twice(measured)
    check_twice(frames)
    for frame in (*measured, *ideals, *frames):
        if not frame.path.exists():
            raise InputError("there is no such file", file=frame.path, fix="check the name and the directory")


def _check_places(out: Path, json: str | None, read: list[Path]) -> None:
    check_out_dir(out, besides=read)
    if json is not None:
        check_writable(json, option="--json", besides=read)
    place = out / DIRECTORY
    if place.exists() and not place.is_dir():
        raise InputError("is not a directory", file=place, fix="move it away, or choose another --out")
    inside = next((path for path in read if path.resolve().parent == place.resolve()), None)
    if inside is not None:
        raise InputError("lies where the panels are written", file=inside, fix="choose another --out")


def _save(result: PanelsResult, place: Path, suffix: str) -> None:
    """A file of echoes for each panel and side."""
    from lidarcheck.calibration.panels.workflow import panel_scan
    from lidarcheck.formats import save_scan

    for name, sample in _samples(result):
        save_scan(panel_scan(sample), place / f"{name}.{suffix}", result.sensor)


def _samples(result: PanelsResult) -> list[tuple[str, PanelSamples]]:
    """What each panel and side shows, where it shows anything, by the name of its file."""
    return [
        (f"panel_{panel.number:02d}_{side}", sample)
        for side, samples in (("real", result.measured), ("simulated", result.simulated or ()))
        for panel, sample in zip(result.panels, samples, strict=False)
        if len(sample.scan)
    ]
