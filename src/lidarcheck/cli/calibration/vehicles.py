"""`lidarcheck vehicles`: vehicles at their distances, real against simulated, and beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.calibration.vehicles_files import NamedFrame, boxes, check_compare, check_merge, frames_of, named
from lidarcheck.cli.core.options import (
    MANY,
    Files,
    JsonFile,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    Rooted,
    Seed,
    SensorName,
    Several,
    Whole,
    placement_of,
    sensor_file,
    sensor_named,
)
from lidarcheck.cli.core.outputs import check_writable
from lidarcheck.cli.core.terminal import hush, note, progress, stage
from lidarcheck.cli.core.workflow_output import Plot, check_places, finish
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.compare import Pair
    from lidarcheck.calibration.vehicles.cut import CutBox, CutSource
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.scan import IdealScan

__all__ = ["compare", "merge"]

Object = Annotated[int, Whole, Parameter(name="--object", help="The vehicle's ObjectID in the ideal scan.")]
Boxes = Annotated[
    list[str],
    Parameter(
        negative=(),
        allow_leading_hyphen=True,
        help="Cut out what lies in x0,x1,y0,y1,z0,z1 [m, sensor frame]: one for all frames, or one for each.",
    ),
]


def compare(
    *real: Annotated[str, Parameter(help=f"The real sensor's frames, FILE or FILE@DISTANCE{MANY}.")],
    vehicle: Annotated[str, Parameter(help="car, van or truck.")],
    simulated: Annotated[
        list[str] | None,
        Several,
        Parameter(help="The model's frames, one for each real one, in their order or named as these."),
    ] = None,
    model: Annotated[Path | None, Parameter(help="Simulate with this model in the place of --simulated.")] = None,
    ideal: Annotated[
        Files | None,
        Parameter(help="What the beams meet, one for each: with it by ObjectID."),
    ] = None,
    variant: Annotated[str | None, Parameter(help="SMART or SLIM: refuse frames of the other variant.")] = None,
    sensor: SensorName = None,
    object_: Object | None = None,
    box: Boxes | None = None,
    out: Annotated[Path | None, Parameter(help="Directory for the page, the numbers and the pictures.")] = None,
    seed: Seed = 0,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    plot: Plot | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Compare a vehicle at several distances, real against simulated."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    cuts = boxes(box or [])
    reals, shown, ideals = _frames(real, simulated or (), ideal or ())
    check_compare(reals, shown, model, ideals, variant, object_, cuts)
    inputs = [
        *(Path(r.path) for r in reals),
        *(Path(s.path) for s in shown),
        *map(Path, ideals),
        model,
        sensor_file(sensor),
    ]
    from lidarcheck.figures.files.vehicle_sheet import SHEET, save_distances

    check_places(out, json, inputs, [SHEET])
    from lidarcheck.calibration.vehicles.compare import compare_vehicles
    from lidarcheck.calibration.vehicles.kinds import vehicle_named
    from lidarcheck.calibration.vehicles.read import provenance_of
    from lidarcheck.figures.pages.vehicles import page

    kind = vehicle_named(vehicle)
    pairs = _read_pairs(reals, shown, model, ideals, variant, object_, cuts, seed, placement, sensor)
    with stage("comparing"):
        result = compare_vehicles(kind, pairs)
    files = provenance_of([r.path for r in reals], [s.path for s in shown], ideals, model, seed=seed)
    sheet = {SHEET: lambda place: save_distances(result, place, plot or "histogram")}
    finish(page(result, files), result.to_dict(), out=out, json=json, plot=plot, files=sheet)
    if out is not None:
        note(f"{out / SHEET}: all distances")
    return 0


def _frames(
    real: Sequence[str], simulated: Sequence[str], ideal: Sequence[Path]
) -> tuple[list[NamedFrame], list[NamedFrame], list[FrameFile]]:
    """The real frames, and the simulated ones and ideal scans beside them; none where none is named."""
    from lidarcheck.cases.partners import beside
    from lidarcheck.cases.source import each_frame

    sides = [frames_of([named(text) for text in side]) for side in (real, simulated)]
    groups, shown = ([[frame for frame, _ in group] for group in side] for side in sides)
    named_of = {frame: own for side in sides for group in side for frame, own in group}
    made = [named_of[frame] for frame in beside(groups, shown, "simulated")] if simulated else []
    ideals = beside(groups, each_frame(ideal, "ideal"), "ideal") if ideal else []
    return [named_of[frame] for group in groups for frame in group], made, ideals


def _read_pairs(
    real: Sequence[NamedFrame],
    simulated: Sequence[NamedFrame],
    model: Path | None,
    ideal: Sequence[FrameFile],
    variant: str | None,
    object_: int | None,
    box: Sequence[CutBox],
    seed: int,
    placement: Placement,
    sensor: str | None,
) -> list[Pair]:
    from lidarcheck.calibration.vehicles.read import check_model, read_pair
    from lidarcheck.model import load_model
    from lidarcheck.sensor import Sensor

    sensor_model = None if model is None else load_model(model)
    if variant is not None:
        Sensor.of(variant)
    check_model(sensor_model, variant)
    known = sensor_named(sensor, sensor_model)
    pairs = []
    with progress("frame") as show:
        for i, frame in enumerate(real):
            show(i, len(real), frame.path.name)
            pair = read_pair(
                frame.path,
                simulated[i].path if simulated else None,
                ideal[i] if ideal else None,
                sensor_model,
                distance_m=frame.distance_m or (simulated[i].distance_m if simulated else None),
                variant=variant,
                object_id=object_,
                box=box[i if len(box) > 1 else 0] if box else None,
                seed=seed,
                number=i,
                placement=placement,
                sensor=known,
            )
            pairs.append(pair)
    return pairs


def merge(
    real: Annotated[str, Parameter(help="The real sensor's frame, FILE or FILE@DISTANCE.")],
    simulated: Annotated[str, Parameter(help="The model's frame.")],
    /,
    *,
    out: Annotated[Path, Parameter(help="Where the merged points go: .pcd, .ply, .txt, .csv, .las, .laz or .parquet.")],
    vehicle: Annotated[
        str | None, Parameter(help="car, van or truck: cut it out of whole frames, and suggest the offset.")
    ] = None,
    x: Annotated[
        float | None, Parameter(help="Move the simulated points forward by so much [m]; 0 by default.")
    ] = None,
    y: Annotated[
        float | None, Parameter(help="Move them to the left [m], negative to the right; as suggested by default.")
    ] = None,
    ideal: Annotated[
        Path | None, Parameter(help="What the beams meet: the vehicle is cut out by its ObjectID.")
    ] = None,
    object_: Object | None = None,
    box: Boxes | None = None,
    sensor: SensorName = None,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    plot: Plot | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Rooted | None = None,
) -> int:
    """Put a real and a simulated vehicle beside each other in one file."""
    hush(quiet)
    limit_rows(max_rows)
    placement = placement_of(placed)
    files, places = [named(real), named(simulated)], boxes(box or [])
    check_merge(files, out, vehicle, ideal, object_, places, x, y)
    inputs = [*(Path(file.path) for file in files), ideal, sensor_file(sensor)]
    check_writable(out, option="--out", besides=inputs)
    if json is not None:
        check_writable(json, option="--json", besides=[*inputs, out])
    from lidarcheck.calibration.vehicles.cut import cut_vehicle
    from lidarcheck.calibration.vehicles.kinds import vehicle_named
    from lidarcheck.calibration.vehicles.merge import merge_vehicles
    from lidarcheck.figures.pages.vehicles import merge_page
    from lidarcheck.formats import load_ideal, load_scan
    from lidarcheck.formats.recognise import write_table

    kind = None if vehicle is None else vehicle_named(vehicle)
    with stage("reading"):
        known = sensor_named(sensor)
        meets = None if ideal is None else load_ideal(ideal, known)
        scans = [load_scan(files[0].path, placement, known), load_scan(files[1].path, sensor=known)]
    sources = _merge_sources(files, meets, kind, object_, places)
    with stage("cutting out"):
        cuts = [cut_vehicle(scan, kind, source) for scan, source in zip(scans, sources, strict=True)]
    names = (str(files[0].path), str(files[1].path))
    merged = merge_vehicles(cuts[0], cuts[1], kind, x_m=x, y_m=y, files=names)
    with stage(f"writing {out.name}"):
        write_table(merged.columns, out)
    page = merge_page(
        merged, f"{vehicle or 'vehicle'}: real left, simulated right", dict(zip(_SIDES, names, strict=True))
    )
    finish(page, merged.to_dict(), out=None, json=json, plot=plot)
    note(f"{out}: {merged.n_real + merged.n_simulated} points, Simulated is 0 for the real ones and 1 for the others")
    return 0


_SIDES = ("real", "simulated")


def _merge_sources(
    files: Sequence[NamedFrame], meets: IdealScan | None, kind: Any, object_: int | None, box: Sequence[CutBox]
) -> list[CutSource]:
    from lidarcheck.calibration.vehicles.cut import CutSource, find_object

    distance = files[0].distance_m or files[1].distance_m
    if meets is not None and object_ is None and meets.object_id is not None and not box:
        object_ = find_object(meets, kind, distance, meets.file)
    boxes = [box[0], box[-1]] if box else [None, None]
    return [CutSource(meets, object_, b, distance, str(file.path)) for file, b in zip(files, boxes, strict=True)]
