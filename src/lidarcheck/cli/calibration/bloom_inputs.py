"""What the words of `lidarcheck bloom` mean: scans at distances, settings, ranges, names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from lidarcheck.cli.core.options import Placed, placement_of
from lidarcheck.errors import InputError, UsageError

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Cells
    from lidarcheck.calibration.blooming.workflow import BloomingMeasurement, ModelSide
    from lidarcheck.cases.source import FrameFile, Named
    from lidarcheck.formats.lut import Axis
    from lidarcheck.formats.settings import Settings
    from lidarcheck.sensor import Sensor

__all__ = [
    "axis_of",
    "bench_from",
    "check_beside",
    "check_same_distance",
    "check_ways",
    "free_of",
    "measured_of",
    "provenance_of",
    "reach_of",
    "table_of",
]

_SAME_M = 3.0
FREE = ("pulse", "tail", "brightness")


def measured_of(
    scans: Sequence[str], ideals: Sequence[Path] | None, placed: Placed | None = None
) -> list[BloomingMeasurement]:
    """The measurements that the arguments name, a frame each, with its ideal scan and what is declared of its file."""
    placement = placement_of(placed)
    from lidarcheck.calibration.blooming.csv import is_profile
    from lidarcheck.calibration.blooming.workflow import BloomingMeasurement
    from lidarcheck.cases.partners import beside
    from lidarcheck.cases.source import FrameFile, each_frame

    named = [_at_distance(text) for text in scans]
    profiles = {path for path, _ in named if is_profile(path)}
    frames = iter(each_frame(path for path, _ in named if path not in profiles))
    groups = [[FrameFile(path)] if path in profiles else next(frames) for path, _ in named]
    measured = [(frame, distance_m) for group, (_, distance_m) in zip(groups, named, strict=True) for frame in group]
    others: Sequence[FrameFile | None] = [None] * len(measured)
    if ideals:
        found = beside(groups, each_frame(ideals, "ideal"), "ideal")
        others = found * len(measured) if len(found) == 1 else found
        if len(others) != len(measured):
            what = f"{len(measured)} scans and {len(others)} ideal scans"
            raise UsageError(what, fix="give one --ideal for each scan, or one for all")
    return [BloomingMeasurement(*one, other, placement) for one, other in zip(measured, others, strict=True)]


def _at_distance(text: str) -> tuple[Path, float | None]:
    """`scan.txt@69` as a file and a distance; a file that has such a name is one."""
    name, at, distance = text.rpartition("@")
    if not at or Path(text).exists():
        return Path(text), None
    try:
        value = float(distance)
    except ValueError:
        return Path(text), None
    if not 0.0 < value <= 300.0:
        raise UsageError(f"{text}: the distance {value:g} m is out of range", fix="use more than 0 and at most 300 m")
    return Path(name), value


def axis_of(axis: Axis | None, measured: Sequence[BloomingMeasurement]) -> Axis:
    """The axis that was asked for, else that of the first profile, else vertical."""
    from lidarcheck.calibration.blooming.csv import is_profile, profile_axis

    if axis is not None:
        return axis
    profiles = [one.path for one in measured if is_profile(one.path)]
    return (profile_axis(profiles[0]) if profiles else None) or "vertical"


def check_ways(ideals: Sequence[Path] | None, settings: Path | None, signal: float | None) -> None:
    """Refuse a second way to say what the ideal scan says already, which would be passed over without a word."""
    for option, given in (("--signal", signal), ("--settings", settings)):
        if ideals and given is not None:
            what = f"{option} stands beside --ideal, which tells where the target is and, with the model, its light"
            raise UsageError(what, fix="give the one or the other")


def check_beside(given: Mapping[str, object], sensor: Sensor) -> None:
    """Refuse options that mean something for SPAD arrays alone; `given`: by their names."""
    for option, value in given.items():
        if value is not None:
            what = f"{option} is of SPAD arrays, and {sensor.name} has the detector {sensor.detector}"
            raise UsageError(what, fix=f"leave {option} out")


def check_same_distance(real: Cells, simulated: Cells) -> None:
    """Refuse a simulated target that stands elsewhere than the measured one."""
    apart_m = abs(real.distance_m - simulated.distance_m)
    if apart_m > _SAME_M + 0.01 * real.distance_m:
        what = f"its target is at {simulated.distance_m:.1f} m, that of {real.name} at {real.distance_m:.1f} m"
        raise InputError(what, file=simulated.name, fix="give one --simulated for each scan, in their order")


def bench_from(
    model: Path, axis: Axis, settings: Path | None, target: int | None, signal: float | None
) -> ModelSide:  # fmt: skip
    """The bench that the options describe."""
    from lidarcheck.calibration.blooming.workflow import model_side_of
    from lidarcheck.model import load_model

    if signal is not None and not 0.0 < signal < float("inf"):
        raise UsageError(f"--signal {signal:g} is out of range", fix="use a number above 0")
    loaded = load_model(model)
    variant: Literal["SMART", "SLIM"] = "SMART" if loaded.sensor.variant == "SMART" else "SLIM"
    chosen = None if settings is None else _settings(settings, axis, variant)
    return model_side_of(loaded, axis, settings=chosen, material=target, signal_at_1m=signal)


def _settings(path: Path, axis: Axis, variant: Literal["SMART", "SLIM"]) -> Settings:
    """The settings of that axis and variant; those of another are refused by their name."""
    from lidarcheck.formats.settings import find_settings, load_settings, settings_name

    wanted = settings_name(axis, variant)
    if path.is_dir():
        there = sorted(p.name for p in path.glob("Blooming_Calibration_*.json"))
        if there and wanted not in there:
            raise InputError(
                f"has no {wanted}; it has {', '.join(there)}", file=path, fix="name the file, or leave out --settings"
            )
        return find_settings(path, axis, variant)
    for other in ("SMART", "SLIM"):
        if other != variant and f"_{other}".lower() in path.stem.lower():
            raise InputError(f"are settings of {other}, the model is {variant}", file=path, fix=f"use {wanted}")
    return load_settings(path, axis)


def reach_of(text: str | None) -> tuple[float, float] | None:
    """`LOW:HIGH` as two offsets."""
    if text is None:
        return None
    low, colon, high = text.partition(":")
    try:
        ends = float(low), float(high)
    except ValueError:
        colon = ""
    if not colon or not ends[0] < ends[1]:
        raise UsageError(f"--reach {text} is no range", fix="write LOW:HIGH, as -95:205")
    return ends


def free_of(text: str | None) -> list[str]:
    """The names of what is free."""
    names = [name.strip() for name in (text or "").split(",") if name.strip()]
    for name in names:
        if name not in FREE:
            raise UsageError(f"--free {name} cannot be fitted", fix=f"use {', '.join(FREE)}")
    return names


def table_of(lut: Any, axis: Axis, file: Path) -> Any:
    """The table of that axis."""
    if axis not in lut.tables:
        raise InputError(f"the file has no {axis} table", file=file, fix=f"it has {', '.join(lut.tables)}")
    return lut.tables[axis]


def provenance_of(model: Path, files: Sequence[Named]) -> dict[str, str]:
    """What a result is made from."""
    import hashlib

    return {str(path): f"sha256 {hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]}" for path in [model, *files]}
