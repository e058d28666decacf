"""`lidarcheck ideal from-map`: what the beams meet of a registered map, from each pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    Files,
    Flag,
    JsonFile,
    MaxRows,
    Placed,
    Quiet,
    Rooted,
    SensorName,
    Whole,
    placement_of,
    sensor_named,
)
from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import columns, emit, hush, note, progress, stage, table
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.files.sets import write_set
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.formats.poses import Poses
    from lidarcheck.ideals.map import MapSurfaces
    from lidarcheck.scan import IdealScan, Scan
    from lidarcheck.sensor import Sensor

__all__ = ["from_map"]

COLUMNS = columns(
    "frame", "time s", "beams that meet", "unknown", "file", right=("time s", "beams that meet", "unknown")
)
_MOST_FRAMES = 100_000


def from_map(
    surfaces: Annotated[
        Path, Parameter(help="The map: a mesh (.stl, .obj, .ply or .glb, in metres), or a dense cloud as a scan.")
    ],
    /,
    *,
    poses: Annotated[
        Path, Parameter(help="Where the sensor stood in the map: CSV, or rows of a trajectory; see the documentation.")
    ],
    out: Annotated[Path, Parameter(help="Directory for the ideal scans, a file a frame.")],
    sensor: SensorName = None,
    model: Annotated[Path | None, Parameter(help="A model in the place of --sensor.")] = None,
    rays: Annotated[
        Files | None,
        Parameter(
            help=f"The measured scans, one a frame{MANY}: their beams are cast, where a sensor's do not look the same "
            "way in every frame."
        ),
    ] = None,
    swept: Annotated[
        bool,
        Flag,
        Parameter(help="Cast each beam when it is fired, the sensor on its way between the poses."),
    ] = False,
    material: Annotated[int, Whole, Parameter(help="The MaterialID of what has none of its own.")] = 1,
    cell: Annotated[
        float | None, Parameter(help="Of a cloud: width of its flat pieces [m]; by its points' spacing.")
    ] = None,
    map_error: Annotated[float, Parameter(name="--map-error", help="Standard error of the map's surfaces [m].")] = 0.0,
    format: Annotated[
        Literal["parquet", "pcd", "txt", "csv", "ply"], Parameter(help="What each frame is written as.")
    ] = "parquet",
    placed: Placed | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Rooted | None = None,
) -> int:
    """Make ideal scans of a registered map, from each pose."""
    hush(quiet)
    limit_rows(max_rows)
    _check(out, material, cell, map_error)
    from lidarcheck.formats.poses import read_poses
    from lidarcheck.ideals.map import frame_starts

    known = _sensor(sensor, model)
    way = read_poses(poses)
    if swept and not way.timed:
        raise InputError("has no times, which --swept needs", file=poses, fix="add a column time, or leave out --swept")
    try:
        starts: list[float | None] = [*map(float, frame_starts(way, known))] if swept else [None] * len(way)
    except UsageError as error:
        raise InputError(error.what, file=poses, fix=error.fix) from None
    scans = _scans(rays, len(starts), known, placement_of(placed))
    places = [out / f"{name}.{format}" for name in _names(way, starts, surfaces.stem)]
    _check_places(places, json, [surfaces, poses, *([model] if model is not None else []), *(rays or ())])
    with stage(f"reading {surfaces.name}"):
        found = _map(surfaces, material, cell, map_error)
    facts = _write(found, known, way, starts, scans, places)
    document = {"map": str(surfaces), "closed": found.closed, "triangles": len(found.triangles_m), "frames": facts}
    if json is not None:
        write_result(json, json_text(with_origin(document)))
    if json != "-":
        rows = [
            (Path(one["file"]).stem, f"{one['time_s']:.6g}", str(one["met"]), str(one["unknown"]), one["file"])
            for one in facts
        ]
        emit(table(COLUMNS, rows))
    note('write ideals_from = "map" into the case, and pose_from = "fit" where these scans were registered in the map')
    return 0


def _check(out: Path, material: int, cell: float | None, map_error: float) -> None:
    if out.exists() and not out.is_dir():
        raise InputError("is not a directory", file=out, fix="name a directory for the frames")
    if material < 0:
        raise UsageError(f"--material {material} is out of range", fix="use a whole number from 0")
    if cell is not None and not 0.001 <= cell <= 100.0:
        raise UsageError(f"--cell {cell:g} is out of range", fix="use 0.001 to 100 m")
    if not 0.0 <= map_error <= 100.0:
        raise UsageError(f"--map-error {map_error:g} is out of range", fix="use 0 to 100 m")


def _sensor(name: str | None, model: Path | None) -> Sensor:
    from lidarcheck.model import load_model

    found = sensor_named(name, None if model is None else load_model(model))
    if found is None:
        raise UsageError("lidarcheck ideal from-map needs --sensor or --model", fix="say whose beams are cast")
    return found


def _scans(rays: Sequence[Path] | None, count: int, sensor: Sensor, placement: Placement) -> Sequence[Scan | None]:
    """The measured scan of each frame; None of each where the sensor's beams alone say where they look."""
    if rays is None:
        if not sensor.beams.lattice:
            what = f"{sensor.name} has no beams of its own: each scan brings them"
            raise UsageError(what, fix="give the measured scans with --rays")
        if not sensor.beams.repeats:
            note("the columns look elsewhere in every frame: give the measured scans with --rays, where there are such")
        return [None] * count
    from lidarcheck.cases.source import each_frame, scan_of

    frames = [frame for group in each_frame(rays) for frame in group]
    if len(frames) != count:
        raise UsageError(f"{len(frames)} scans for --rays and {count} frames", fix="give one for each, in their order")
    return [scan_of(frame, placement, sensor) for frame in frames]


def _names(way: Poses, starts: list[float | None], stem: str) -> list[str]:
    """The name of each frame: that of its pose, else the map's with a number."""
    named = [name for name in way.names if name]
    if starts and starts[0] is not None and named:
        return named
    if starts and starts[0] is not None:
        return [f"{stem}_{i:06d}" for i in range(len(starts))]
    return [name or f"{stem}_{i:06d}" for i, name in enumerate(way.names)]


def _check_places(places: list[Path], json: str | None, read: list[Path]) -> None:
    if len(places) > _MOST_FRAMES:
        raise UsageError(f"{len(places)} frames", fix=f"give poses of {_MOST_FRAMES} at most")
    for place in places:
        if place.exists():
            raise InputError("is there already", file=place, fix="move it away, or name another directory for --out")
    if json is not None:
        check_writable(json, option="--json", besides=[*read, *places])


def _map(file: Path, material: int, cell: float | None, error_m: float) -> MapSurfaces:
    """The map of a mesh, by its suffix and content, else of a cloud."""
    import numpy as np

    from lidarcheck.ideals.map import map_of_mesh
    from lidarcheck.ideals.surfels import map_of_cloud
    from lidarcheck.scenes.meshes import SUFFIXES, load_mesh

    try:
        if file.suffix.lower() in SUFFIXES and not _is_cloud(file):
            if cell is not None:
                raise UsageError("--cell is of a cloud", fix="leave it out: a mesh has surfaces of its own")
            facets = load_mesh(file, material)
            return map_of_mesh(facets, np.median(facets.triangles_m.reshape(-1, 3), axis=0), error_m)
        places, materials = _cloud(file, material)
        return map_of_cloud(places, materials, cell_m=cell, error_m=error_m)
    except UsageError as error:
        raise InputError(error.what, file=file, fix=error.fix) from None


def _is_cloud(file: Path) -> bool:
    """A PLY file without faces."""
    from lidarcheck.formats.source import first_bytes

    header = first_bytes(file).partition(b"end_header")[0]
    return file.suffix.lower() == ".ply" and b"element face" not in header


def _cloud(file: Path, material: int) -> tuple[Any, Any]:
    """Places (n, 3) and materials (n,) of a cloud's points."""
    import numpy as np

    from lidarcheck.formats.columns import INT32_MAX, LENGTH_MAX_M, missing, real_column, whole_column
    from lidarcheck.formats.recognise import read_table

    points = read_table(file)
    if lacking := missing(points, ("X", "Y", "Z")):
        what = f"no column {', '.join(lacking)}: a map is a mesh or a cloud of points"
        raise points.fault(what, fix="give X, Y, Z of each point in metres")
    xyz = np.stack(
        [real_column(points, name, -LENGTH_MAX_M, LENGTH_MAX_M, "m", missing_ok=True) for name in "XYZ"], axis=1
    )
    there = np.isfinite(xyz).all(axis=1)
    own = points.get("MaterialID")
    number = np.full(len(points), material) if own is None else whole_column(points, "MaterialID", 0, INT32_MAX)
    return xyz[there], np.asarray(number)[there].astype(np.int32)


def _write(
    found: MapSurfaces,
    sensor: Sensor,
    way: Poses,
    starts: Sequence[float | None],
    scans: Sequence[Scan | None],
    places: list[Path],
) -> list[dict[str, Any]]:
    """Cast and write all frames or none, and say what is in each."""
    import numpy as np

    from lidarcheck.formats import save_ideal
    from lidarcheck.ideals.map import ideal_at

    facts: list[dict[str, Any]] = [{} for _ in places]

    def one(number: int, show: Callable[[int, int, str], None], place: Path) -> None:
        ideal: IdealScan = ideal_at(found, sensor, way, number, starts[number], scans[number])
        save_ideal(ideal, place)
        at = way.time_s[number] if starts[number] is None else starts[number]
        facts[number] = {
            "file": str(places[number]),
            "time_s": float(at or 0.0),
            "met": int(np.count_nonzero(ideal.distance_m > 0.0)),
            "unknown": int(np.count_nonzero(np.isnan(ideal.distance_m))),
        }
        show(number + 1, len(places), place.name)

    with progress("casting") as show:
        write_set(places[0].parent, {place.name: partial(one, i, show) for i, place in enumerate(places)})
    return facts
