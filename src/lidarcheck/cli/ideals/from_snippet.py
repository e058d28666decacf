"""`lidarcheck ideal from-snippet`: what the beams meet of a target that is cut out of measured scans."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    Flag,
    JsonFile,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    SensorName,
    Whole,
    placement_of,
    sensor_named,
)
from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import emit, hush, note, stage
from lidarcheck.cli.ideals.options import check_ideal_file, numbers_of
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.ideals.snippet import Region, Snippet
    from lidarcheck.ideals.surfaces import Surface
    from lidarcheck.model.spec import Model
    from lidarcheck.sensor import Sensor

__all__ = ["from_snippet"]


def from_snippet(
    scans: Annotated[list[Path], Parameter(negative=(), help=f"Scans of a sensor at rest{MANY}.")],
    /,
    *,
    out: Annotated[Path, Parameter(help="Where the ideal scan goes: .txt, .csv, .pcd, .ply or .parquet.")],
    region: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True, help="The target lies in x0,x1,y0,y1,z0,z1 [m, sensor frame], and nothing else."
        ),
    ] = None,
    beams: Annotated[
        str | None, Parameter(help="The target's beams: first and last layer, first and last point, as 20,60,300,420.")
    ] = None,
    form: Annotated[
        Literal["plane", "cylinder"], Parameter(help="What the target is, where no --mesh says it.")
    ] = "plane",
    mesh: Annotated[Path | None, Parameter(help="The target as a mesh: .stl, .obj, .ply or .glb, in metres.")] = None,
    target_pose: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True,
            help="x,y,z,roll,pitch,yaw [m, deg]: takes the target's own frame into the sensor's. A plane is the own "
            "x = 0, a cylinder stands on the own z = 0. Without it plane and cylinder are found in the echoes.",
        ),
    ] = None,
    fit: Annotated[bool, Flag, Parameter(help="--target-pose is only near: fit it to the echoes.")] = False,
    size: Annotated[
        str | None, Parameter(help="Width and height of a plane whose pose is given [m], as 1.5,1.5.")
    ] = None,
    diameter: Annotated[float | None, Parameter(help="Of a cylinder [m]; fitted without it.")] = None,
    height: Annotated[float | None, Parameter(help="Of a cylinder whose pose is given [m].")] = None,
    material: Annotated[int, Whole, Parameter(help="The target's MaterialID.")] = 1,
    sensor: SensorName = None,
    model: Annotated[
        Path | None,
        Parameter(
            help="A model in the place of --sensor: what it adds to its own ranges is taken off a fitted target."
        ),
    ] = None,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Make an ideal scan of a target that is cut out of measured scans."""
    hush(quiet)
    limit_rows(max_rows)
    where = _region(region, beams)
    _check(mesh, target_pose, fit, size, diameter, height, form, material)
    check_ideal_file(out)
    from lidarcheck.cases.source import each_frame, scan_of
    from lidarcheck.formats import save_ideal
    from lidarcheck.ideals.snippet import ideal_of_snippet

    of_model = _model(model)
    known = _sensor(sensor, of_model)
    read = [*scans, *(path for path in (mesh, model) if path is not None)]
    for file, option in ((out, "--out"), (json, "--json")):
        if file is not None:
            check_writable(file, option=option, besides=[*read, *([out] if file is not out else [])])
    placement = placement_of(placed)
    frames = [frame for group in each_frame(scans) for frame in group]
    target = _target(mesh, target_pose, size, diameter, height, form)
    with stage(f"reading {len(frames)} scans"):
        shown = [scan_of(frame, placement, known) for frame in frames]
    try:
        with stage("fitting" if target is None or fit else "casting"):
            found = ideal_of_snippet(
                shown, known, where, target, form=form, radius_m=None if diameter is None else diameter / 2.0, fit=fit,
                material=material, model=of_model,
            )  # fmt: skip
    except UsageError as error:
        raise InputError(error.what, file=str(frames[0]), fix=error.fix) from None
    with stage(f"writing {out.name}"):
        save_ideal(found.ideal, out)
    facts = _facts(found, frames, out)
    if json is not None:
        write_result(json, json_text(with_origin(facts)))
    if json != "-":
        emit(_text(facts))
    if found.fitted:
        note(
            'the target was fitted to these scans: write ideals_from = "snippet" and pose_from = "fit" into their case'
        )
    return 0


def _region(region: str | None, beams: str | None) -> Region:
    from lidarcheck.ideals.snippet import Region

    if region is None and beams is None:
        raise UsageError("neither --region nor --beams is given", fix="say where the target is, it alone")
    box = None
    if region is not None:
        box = numbers_of(region, 6, "--region", "x0,x1,y0,y1,z0,z1 in m")
        if any(low >= high for low, high in zip(box[::2], box[1::2], strict=True)):
            raise UsageError(f"--region {region} is empty", fix="give x0 < x1, y0 < y1, z0 < z1")
    layers = points = None
    if beams is not None:
        span = numbers_of(beams, 4, "--beams", "first and last layer, first and last point")
        if any(one != int(one) or one < 0 for one in span) or span[0] > span[1] or span[2] > span[3]:
            raise UsageError(
                f"--beams {beams} names no beams", fix="give whole numbers from 0, the first before the last"
            )
        layers, points = (int(span[0]), int(span[1])), (int(span[2]), int(span[3]))
    return Region(None if box is None else (box[0], box[1], box[2], box[3], box[4], box[5]), layers, points)


def _check(
    mesh: Path | None,
    pose: str | None,
    fit: bool,
    size: str | None,
    diameter: float | None,
    height: float | None,
    form: str,
    material: int,
) -> None:
    """Refuse options that do not fit together, before anything is read."""
    if mesh is not None and pose is None:
        raise UsageError("--mesh needs --target-pose", fix="say where it stands; with --fit about there is enough")
    if fit and pose is None:
        raise UsageError("--fit needs --target-pose", fix="leave it out: without a pose the target is fitted anyway")
    if size is not None and (pose is None or mesh is not None or form != "plane"):
        raise UsageError("--size is of a plane whose --target-pose is given", fix="leave it out, or give the pose")
    if height is not None and (pose is None or mesh is not None or form != "cylinder"):
        raise UsageError("--height is of a cylinder whose --target-pose is given", fix="leave it out, or give the pose")
    if diameter is not None and (mesh is not None or form != "cylinder"):
        raise UsageError("--diameter is of a cylinder", fix="add --form cylinder, or leave it out")
    if form == "cylinder" and mesh is None and pose is not None and not fit and diameter is None:
        raise UsageError("a cylinder at a known pose needs --diameter", fix="give it, or --fit")
    for name, value in (("--diameter", diameter), ("--height", height)):
        if value is not None and not 0.0 < value <= 1000.0:
            raise UsageError(f"{name} {value:g} is out of range", fix="use a number above 0, up to 1000 m")
    if material < 0:
        raise UsageError(f"--material {material} is out of range", fix="use a whole number from 0")


def _model(model: Path | None) -> Model | None:
    if model is None:
        return None
    from lidarcheck.model import load_model

    return load_model(model)


def _sensor(name: str | None, model: Model | None) -> Sensor:
    found = sensor_named(name, model)
    if found is None:
        raise UsageError("lidarcheck ideal from-snippet needs --sensor or --model", fix="say whose beams are cast")
    return found


def _target(
    mesh: Path | None, pose: str | None, size: str | None, diameter: float | None, height: float | None, form: str
) -> Surface | None:
    """The target where it is said to stand; None where the echoes show it."""
    from lidarcheck.formats.geometry import parse_pose
    from lidarcheck.ideals.surfaces import Cylinder, Mesh, Plane, posed

    if pose is None:
        return None
    turn, place = posed(parse_pose(pose))
    if mesh is not None:
        from lidarcheck.scenes.bvh import Bvh
        from lidarcheck.scenes.meshes import load_mesh

        return Mesh(turn, place, Bvh(load_mesh(mesh, 0).triangles_m))
    if form == "cylinder":
        return Cylinder(turn, place, 0.1 if diameter is None else diameter / 2.0, height, diameter is not None)
    if size is None:
        return Plane(turn, place)
    wide, high = numbers_of(size, 2, "--size", "width and height in m")
    if wide <= 0.0 or high <= 0.0:
        raise UsageError(f"--size {size} is no size", fix="give numbers above 0")
    return Plane(turn, place, (wide, high))


def _facts(found: Snippet, frames: list[FrameFile], out: Path) -> dict[str, Any]:
    """What was fitted, and what stands in the ideal scan."""
    import numpy as np

    from lidarcheck.ideals.surfaces import Cylinder

    ideal, on, surface = found.ideal, found.on_target, found.fit.surface
    error = ideal.extra.get("DistanceError")
    facts = {
        "file": str(out),
        "frames": len(frames),
        "echoes": found.echoes,
        "on_target": int(np.count_nonzero(found.fit.used)),
        "beams": int(np.count_nonzero(on)),
        "at_edge": int(np.count_nonzero(ideal.extra["Edge"])) if "Edge" in ideal.extra else 0,
        "distance_m": [float(ideal.distance_m[on].min()), float(ideal.distance_m[on].max())],
        "scatter_m": found.fit.scatter_m,
        "distance_error_m": None if error is None else float(np.median(error[on])),
        "pose_from": "fit" if found.fitted else "given",
    }
    return facts | ({"diameter_m": 2.0 * surface.radius_m} if isinstance(surface, Cylinder) else {})


def _text(facts: dict[str, Any]) -> str:
    low, high = facts["distance_m"]
    lines = [
        f"{facts['on_target']} of {facts['echoes']} echoes in the region lie on the target, and scatter by "
        f"{1000.0 * facts['scatter_m']:.1f} mm (1 sigma) about it",
        f"{facts['beams']} beams meet it between {low:.3f} and {high:.3f} m, {facts['at_edge']} of them at its edge",
    ]
    if facts["distance_error_m"] is not None:
        lines.append(
            f"its fitted distance is known to {1000.0 * facts['distance_error_m']:.2f} mm (median of the beams)"
        )
    if "diameter_m" in facts:
        lines.append(f"its diameter is {facts['diameter_m']:.4f} m")
    return "\n".join(lines)
