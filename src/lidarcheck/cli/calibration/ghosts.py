"""`lidarcheck ghosts`: find signs and their ghosts, and fit the ghost effect to them."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    Flag,
    JsonFile,
    Many,
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
from lidarcheck.cli.core.outputs import check_twice, files_given
from lidarcheck.cli.core.terminal import hush, note, progress, stage
from lidarcheck.cli.core.workflow_output import Plot, check_places, finish
from lidarcheck.errors import UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.calibration.ghosts.workflow import GhostScan
    from lidarcheck.cases.source import FrameFile, Named
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.model.spec import Model
    from lidarcheck.scan import IdealScan
    from lidarcheck.sensor import Sensor

__all__ = ["find", "fit"]

MODEL = "model.toml"
Scans = Annotated[tuple[Path, ...], Parameter(help=f"Measured scans, a file a dataset{MANY}.")]


def find(
    scans: Scans,
    /,
    *,
    out: Annotated[
        Path | None, Parameter(help="Directory for the stripped scans (PCD), the page and pictures.")
    ] = None,
    ideal: Annotated[
        tuple[Path, ...], Many, Parameter(help="Ideal scans, one for each scan: what must be found.")
    ] = (),
    model: Annotated[Path | None, Parameter(help="The sensor model; with --ideal the same is simulated.")] = None,
    simulated: Annotated[
        tuple[Path, ...], Many, Parameter(help="Simulated scans, one for each, to compare with.")
    ] = (),
    range_m: Annotated[
        tuple[float, ...], Many, Parameter(help="Where a sign must be [m]: one for all scans, or one for each.")
    ] = (),
    bright: Annotated[
        float | None, Parameter(help="The least AREA (else INTENSITY, ...) of a sign; by the sensor if not given.")
    ] = None,
    sensor: SensorName = None,
    steps: Annotated[bool, Flag, Parameter(help="Also show what each step of the extraction holds.")] = False,
    seed: Seed = 0,
    placed: Placed | None = None,
    plot: Plot | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Find signs and their ghosts, and leave nothing else."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    _check_options(bright, ideal, model, simulated)
    from lidarcheck.calibration.ghosts.files import dataset_names, stripped_files, stripped_name
    from lidarcheck.figures.pages.ghosts import find_document, find_page

    with stage("reading"):
        frames, ideals, shown = _frames(scans, range_m, ideal=ideal, simulated=simulated)
    names = [stripped_name(name) for name in dataset_names(frames)]
    check_places(out, json, files_given(*scans, *ideal, *simulated, model, sensor_file(sensor)), names)
    sensor_model = _model_of(model)
    known = sensor_named(sensor, sensor_model)
    scenes = _ideals_of(ideals, known)
    found = _found(frames, scenes, sensor_model, range_m, bright, placement, known)
    others = _simulated(found, shown, scenes, sensor_model, bright, seed)
    page = find_page(found, others, _provenance(frames, ideals, shown, model, seed), steps=steps)
    document = {"datasets": find_document(found), "simulated": find_document(others)}
    files = stripped_files({one.name: one.stripped() for one in found}, known)
    finish(page, document, out=out, json=json, plot=plot, files=files)
    for one in found if out is not None else ():
        note(f"{out}/{stripped_name(one.name)}: {len(one.stripped())} of {len(one.scan)} echoes, Label 1 sign, 2 ghost")
    return 0


def fit(
    scans: Scans,
    /,
    *,
    ideal: Annotated[tuple[Path, ...], Many, Parameter(help="Ideal scans, one for each scan, in the same order.")],
    model: Annotated[Path, Parameter(help="The sensor model, with the sign's material; its effects stay.")],
    out: Annotated[Path, Parameter(help="Directory for model.toml, the model with the fitted effect, and the page.")],
    bright: Annotated[
        float | None, Parameter(help="The least AREA of a sign's echo; by the sensor if not given.")
    ] = None,
    seed: Seed = 0,
    placed: Placed | None = None,
    plot: Plot | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Fit the ghost effect to signs and ghosts measured at several ranges."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    _check_options(bright, ideal, model, ())
    check_places(out, json, files_given(*scans, *ideal, model), [MODEL])
    from lidarcheck.calibration.ghosts.data import check_fit
    from lidarcheck.calibration.ghosts.fit import fit_ghosts
    from lidarcheck.figures.pages.ghost_fit import fit_document, fit_page
    from lidarcheck.model.files.write import write_model

    with stage("reading"):
        frames, ideals, _ = _frames(scans, (), ideal=ideal)
    check_twice(frames)
    sensor_model = _model_of(model)
    assert sensor_model is not None
    check_fit(sensor_model)
    scenes = _ideals_of(ideals, sensor_model.sensor)
    found = _found(frames, scenes, sensor_model, (), bright, placement)
    with stage("fitting"):
        fitted = fit_ghosts(found, scenes, sensor_model, seed=seed)
    others = _simulated(found, (), scenes, fitted.model, bright, seed)
    page = fit_page(fitted, others, _provenance(frames, ideals, (), model, seed))
    files = {MODEL: lambda place: write_model(model, fitted.model, place)}
    finish(page, fit_document(fitted), out=out, json=json, plot=plot, files=files)
    note(f"{out / MODEL}: the model with retro_ghost")
    return 0


def _frames(
    scans: Sequence[Path], range_m: Sequence[float], *, ideal: Sequence[Path] = (), simulated: Sequence[Path] = ()
) -> tuple[list[FrameFile], list[FrameFile], list[FrameFile]]:
    """The frames of the scans, and as many ideal and simulated ones, none where none is given."""
    from lidarcheck.cases.partners import beside
    from lidarcheck.cases.source import each_frame

    if not scans:
        raise UsageError("no scan was given", fix="name one scan or more, before the options")
    groups = each_frame(scans)
    frames = [frame for group in groups for frame in group]
    ideals = beside(groups, each_frame(ideal, "ideal"), "ideal") if ideal else []
    shown = beside(groups, each_frame(simulated), "simulated") if simulated else []
    for option, found in (("ideal", ideals), ("simulated", shown)):
        if found and len(found) != len(frames):
            what = f"there are {len(frames)} scans and {len(found)} files for --{option}"
            raise UsageError(what, fix=f"give --{option} one for each scan, in the same order, behind the scans")
    if range_m and len(range_m) not in (1, len(frames)):
        what = f"there are {len(frames)} scans and {len(range_m)} ranges for --range-m"
        raise UsageError(what, fix="give one for all, or one for each scan")
    for value in range_m:
        if not 0.5 <= value <= 300.0:
            raise UsageError(f"--range-m {value:g} is out of range", fix="use 0.5 to 300 m")
    return frames, ideals, shown


def _check_options(bright: float | None, ideal: Sequence[Path], model: Path | None, simulated: Sequence[Path]) -> None:
    if bright is not None and not 0.0 < bright <= 1e9:
        raise UsageError(f"--bright {bright:g} is out of range", fix="use a number above 0, up to 1e9")
    if ideal and model is None:
        raise UsageError(
            "--ideal needs --model, which says what materials are retro-reflectors", fix="add --model MODEL.toml"
        )
    if ideal and simulated:
        raise UsageError("--simulated and --ideal are two ways to the same comparison", fix="give one of them")


def _model_of(path: Path | None) -> Model | None:
    from lidarcheck.calibration.ghosts.files import load_ghost_model

    return None if path is None else load_ghost_model(path)


def _ideals_of(frames: Sequence[FrameFile], sensor: Sensor | None) -> list[IdealScan]:
    from lidarcheck.cases.source import ideal_of

    with stage("reading ideal scans"):
        read = {frame: ideal_of(frame, sensor) for frame in dict.fromkeys(frames)}  # one of all is read once
        return [read[frame] for frame in frames]


def _found(
    scans: Sequence[FrameFile],
    ideals: Sequence[IdealScan],
    model: Model | None,
    range_m: Sequence[float],
    bright: float | None,
    placement: Placement,
    sensor: Sensor | None = None,
) -> list[GhostScan]:
    """What each scan shows, and refused where it is not what the ideal scans and the model say."""
    from lidarcheck.calibration.ghosts.files import dataset_names, find_in

    found = []
    with progress("looking at") as show:
        for i, (path, name) in enumerate(zip(scans, dataset_names(scans), strict=True)):
            show(i, len(scans), path.name)
            expected = range_m if len(range_m) == 1 else range_m[i : i + 1]
            ideal = ideals[i] if ideals else None
            one = find_in(
                path,
                name,
                ideal=ideal,
                model=model,
                expected_m=expected,
                bright=bright,
                placement=placement,
                sensor=sensor,
            )
            found.append(one)
    return found


def _simulated(
    found: Sequence[GhostScan],
    paths: Sequence[FrameFile],
    ideals: Sequence[IdealScan],
    model: Model | None,
    bright: float | None,
    seed: int,
) -> list[GhostScan]:
    """The same search in simulated scans: those of `paths`, or of the ideal scans; none without either."""
    from lidarcheck.calibration.ghosts.files import find_simulated
    from lidarcheck.calibration.ghosts.workflow import find_ghosts
    from lidarcheck.cases.source import scan_of
    from lidarcheck.kpi.variant import check_variant

    others = []
    for i, one in enumerate(found):
        if paths:
            scan = scan_of(paths[i], sensor=one.sensor)
            if one.sensor is not None:
                check_variant(scan, one.sensor, str(paths[i]))
            others.append(find_ghosts(scan, name=str(paths[i]), sensor=one.sensor, above=bright))
        elif ideals and model is not None:
            with stage(f"simulating {one.name}"):
                others.append(find_simulated(one, ideals[i], model, bright=bright, seed=seed))
    return others


def _provenance(
    scans: Sequence[Named], ideal: Sequence[Named], simulated: Sequence[Named], model: Path | None, seed: int
) -> dict[str, str]:
    given: dict[str, Sequence[Named]] = {
        "scans": scans,
        "ideal scans": ideal,
        "simulated scans": simulated,
        "model": [model] if model else [],
    }
    files = {name: ", ".join(str(path) for path in paths) for name, paths in given.items() if paths}
    return files | {"seed": str(seed), "command": shlex.join(["lidarcheck", *sys.argv[1:]])}
