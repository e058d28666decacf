"""The files and boxes that `lidarcheck vehicles` takes, and whether they fit together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lidarcheck.cli.core.outputs import check_twice
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.cut import CutBox
    from lidarcheck.cases.source import FrameFile, Named

__all__ = ["NamedFrame", "boxes", "check_compare", "check_merge", "frames_of", "named"]


class NamedFrame(NamedTuple):
    """A file or a frame in it, and the distance that its name says."""

    path: Named
    distance_m: float | None


def named(text: str) -> NamedFrame:
    """FILE or FILE@25; a number before an m in the name, as in car_25m.pcd, is a distance too."""
    name, at, distance = text.rpartition("@")
    if at and not Path(text).exists():
        value = _number(distance)
        if not name or not 0.0 < value <= 300.0:
            what = f"{text} names no distance" if math.isnan(value) else f"{distance} m is out of range"
            raise UsageError(what, fix="write FILE@25, a distance above 0, up to 300 m")
        return NamedFrame(Path(name), value)
    from lidarcheck.calibration.vehicles.kinds import distance_in_name

    return NamedFrame(Path(text), distance_in_name(Path(text)))


def frames_of(files: Sequence[NamedFrame]) -> list[list[tuple[FrameFile, NamedFrame]]]:
    """The frames of each file, folder or pattern, at the distance that it says, or else the frame's own name."""
    from lidarcheck.calibration.vehicles.kinds import distance_in_name
    from lidarcheck.cases.source import each_frame

    return [
        [(frame, NamedFrame(frame, file.distance_m or distance_in_name(frame.path))) for frame in group]
        for file, group in zip(files, each_frame(file.path for file in files), strict=True)
    ]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def boxes(texts: Sequence[str]) -> list[CutBox]:
    """Boxes of `x0,x1,y0,y1,z0,z1`."""
    from lidarcheck.calibration.vehicles.cut import CutBox

    found = []
    for text in texts:
        values = [_number(part) for part in text.split(",")]
        if len(values) != 6 or not all(map(math.isfinite, values)) or any(a >= b for a, b in _pairs(values)):
            fix = "use --box x0,x1,y0,y1,z0,z1 in metres, the smaller of each pair first"
            raise UsageError(f"--box {text} is no box", fix=fix)
        (x0, x1), (y0, y1), (z0, z1) = _pairs(values)
        found.append(CutBox((x0, y0, z0), (x1, y1, z1)))
    return found


def _pairs(values: Sequence[float]) -> list[tuple[float, float]]:
    return list(zip(values[::2], values[1::2], strict=True))


def check_compare(
    real: Sequence[NamedFrame],
    simulated: Sequence[NamedFrame],
    model: Path | None,
    ideal: Sequence[Named],
    variant: str | None,
    object_: int | None,
    box: Sequence[CutBox],
) -> None:
    """Refuse what does not fit together, before anything is read."""
    if not real:
        fix = "lidarcheck vehicles compare real.pcd --vehicle car --simulated sim.pcd"
        raise UsageError("no real frame is named", fix=fix)
    if bool(simulated) == (model is not None):
        what = "--model stands beside --simulated" if simulated else "neither --simulated nor --model is given"
        raise UsageError(what, fix="give the one or the other")
    if simulated and len(simulated) != len(real):
        raise UsageError(f"{len(real)} real frames and {len(simulated)} simulated", fix="give one each, in one order")
    if model is not None and not ideal:
        raise UsageError("--model needs --ideal", fix="give the ideal scan of each frame, which is what is simulated")
    if ideal and len(ideal) != len(real):
        raise UsageError(f"{len(real)} real frames and {len(ideal)} ideal scans", fix="give one each, in one order")
    if variant is not None:
        _check_variant_name(variant)
    if object_ is not None and not ideal:
        raise UsageError("--object needs --ideal", fix="give the ideal scans, whose ObjectID it is")
    if object_ is not None and box:
        raise UsageError("--object stands beside --box", fix="give the one or the other")
    if len(box) not in (0, 1, len(real)):
        raise UsageError(f"{len(box)} boxes for {len(real)} frames", fix="give one box, or one for each frame")
    for i, (r, s) in enumerate(zip(real, simulated, strict=False)):
        if None not in (r.distance_m, s.distance_m) and r.distance_m != s.distance_m:
            what = f"pair {i + 1} is {r.path} at {r.distance_m:g} m and {s.path} at {s.distance_m:g} m"
            raise UsageError(what, fix="give real and simulated frames in one order of distances")
    check_twice([*(r.path for r in real), *(s.path for s in simulated)])


def _check_variant_name(variant: str) -> None:
    from lidarcheck.sensor import Sensor

    Sensor.of(variant)


def check_merge(
    files: Sequence[NamedFrame],
    out: Path,
    vehicle: str | None,
    ideal: Path | None,
    object_: int | None,
    box: Sequence[CutBox],
    x: float | None,
    y: float | None,
) -> None:
    """Refuse what does not fit together, before anything is read."""
    from lidarcheck.formats.recognise import target_format

    target_format(out)
    check_twice(file.path for file in files)
    if object_ is not None and ideal is None:
        raise UsageError("--object needs --ideal", fix="give the ideal scan, whose ObjectID it is")
    if object_ is not None and box:
        raise UsageError("--object stands beside --box", fix="give the one or the other")
    if ideal is not None and object_ is None and vehicle is None:
        raise UsageError("--ideal needs --object or --vehicle", fix="say which of its objects to cut out")
    if len(box) > 2:
        raise UsageError(f"{len(box)} boxes for two frames", fix="give one box, or one for each frame")
    for name, value in (("--x", x), ("--y", y)):
        if value is not None and not (math.isfinite(value) and abs(value) <= 1000.0):
            raise UsageError(f"{name} {value:g} is out of range", fix="use -1000 to 1000 m")
