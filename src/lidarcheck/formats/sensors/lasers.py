"""Velodyne's calibration, whichever file it stands in: lasers with angles and offsets, as channels of a sensor.

Position of a return R at the block's azimuth, clockwise from Y (the driver's `rawdata.cc`): with the laser's elevation
p, vertical offset v and horizontal offset h, the distance in the plane is R cos p - v sin p, turned by the azimuth less
`rot_correction`; h is added to the left of it, and v cos p to the height. X of a ROS cloud is that frame's Y, Y its -X.
So the origin is (-v sin p, h), turned with the laser, and v cos p high. `dist_correction` is in R already.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from lidarcheck.errors import UsageError
from lidarcheck.formats.sensors.imported import Given, Imported, Lacking, linear_lacks, rate_lacks, rounded, step_lacks

__all__ = ["MODELS", "Laser", "VelodyneModel", "channels_of", "model_of"]


@dataclass(frozen=True)
class Laser:
    """One laser: angles in rad, `rot` to the left; offsets in m; `intensity`: its smallest and largest value."""

    number: int
    elevation: float
    rot: float
    vertical_m: float
    horizontal_m: float
    distance_m: float
    intensity: tuple[float | None, float | None]


@dataclass(frozen=True)
class VelodyneModel:
    """What a model's manual and driver say that its calibration does not.

    `span_deg`: lowest and highest elevation, by which a file is told. `fire_us`: of a laser's number. `cycle_us`: from
    a column to the next. `turned`: whether the driver turns the azimuth by the fire time. `step_m`: what it decodes.
    """

    name: str
    lasers: int
    span_deg: tuple[float, float]
    fire_us: Callable[[int], float]
    cycle_us: float
    turned: bool
    knee: float
    timing: str
    step_m: float | None = None


MODELS = (
    VelodyneModel("VLP-16", 16, (-15.0, 15.0), lambda n: 2.304 * n, 55.296, True, 100, "2.304 us a laser"),
    VelodyneModel("VLP-16 Hi-Res", 16, (-10.0, 10.0), lambda n: 2.304 * n, 55.296, True, 100, "2.304 us a laser"),
    VelodyneModel(
        "HDL-32E", 32, (-30.67, 10.67), lambda n: 1.152 * n, 46.08, False, 100,
        "46.08 us = 40 x 1.152; one laser a slot assumed, the ROS driver pairs lasers: fit from `time`",
    ),
    VelodyneModel("VLP-32C", 32, (-25.0, 15.0), lambda n: 2.304 * (n // 2), 55.296, False, 100, "2.304 us a pair"),
    VelodyneModel(
        "VLS-128", 128, (-25.0, 15.0), lambda n: 2.665 * (n // 8 + (n // 8 >= 8)), 53.3, True, 110,
        "2.665 us a group of 8, one slot free in the middle", 0.004,
    ),
)  # fmt: skip


def model_of(lasers: Sequence[Laser], named: str | None) -> VelodyneModel | None:
    """The model that is named, else that of these lasers; None where it is none of them.

    `UsageError` where no such model is known, or it has another number of lasers.
    """
    if named is not None:
        model = next((m for m in MODELS if _plain(m.name) == _plain(named)), None)
        if model is None or model.lasers != len(lasers):
            fix = "use one of " + ", ".join(m.name for m in MODELS)
            raise UsageError(f"--model {named} is no known model of {len(lasers)} lasers", fix=fix)
        return model
    low, high = (math.degrees(end(laser.elevation for laser in lasers)) for end in (min, max))
    near = [
        m for m in MODELS if m.lasers == len(lasers) and max(abs(low - m.span_deg[0]), abs(high - m.span_deg[1])) < 1
    ]
    return near[0] if near else None


def _plain(name: str) -> str:
    return "".join(c for c in name.upper() if c.isalnum())


def channels_of(
    lasers: Sequence[Laser], model: VelodyneModel | None, step_m: float | None, given: Given, source: str
) -> Imported:
    """The sensor of these lasers, its layers in the order of ascending elevation, as drivers number rings."""
    order = sorted(lasers, key=lambda laser: (laser.elevation, laser.number))
    lacking: list[Lacking] = []
    remarks = _remarks(order)
    document: dict[str, Any] = {
        "name": f"Velodyne {model.name}" if model else f"Velodyne of {len(order)} lasers",
        "source": [source],
        "detector": "linear",
    }
    rate_hz = given.rate_hz
    if rate_hz is None:
        lacking.append(rate_lacks("turns a second, as the sensor was set up"))
    else:
        document["frame_rate_hz"] = rate_hz
    lacking += [
        Lacking("returns", 2, "2 where the sensor was set to dual returns, then also the next two lines"),
        Lacking("keep", "strongest_last", "of dual returns"),
        Lacking("duplicate_return", "repeat", "of dual returns: the only return stands in both blocks"),
    ]
    document["sweep"] = {"direction": "right", "fire_time_in_azimuth": model.turned if model else True}
    if model is None:
        look_up = "true where the driver interpolates the azimuth over a firing"
        del document["sweep"]["fire_time_in_azimuth"]
        lacking.append(Lacking("sweep.fire_time_in_azimuth", False, look_up))
    step = _range_step(model, step_m, remarks)
    if step is not None:
        document["range"] = {"step_m": step}
    document["linear"] = {}
    document["features"], more = _features(order, model)
    document["beams"], timing = _beams(order, model, given, rate_hz)
    if model:
        document["source"].append(
            f"{model.name} (manual and ROS driver): {model.timing}, {model.cycle_us:g} us a column"
        )
    return Imported(document, (*lacking, *timing, *more, *linear_lacks()), tuple(remarks))


def _remarks(order: Sequence[Laser]) -> list[str]:
    remarks = ["Layer 0 is the lowest laser, as drivers number rings; laser_id is another order."]
    if any(laser.distance_m for laser in order):
        low, high = (end(laser.distance_m for laser in order) for end in (min, max))
        remarks.append(
            f"dist_correction, {low:g} to {high:g} m, is in the ranges of a cloud already: no range_offset_m."
        )
    return remarks


def _range_step(model: VelodyneModel | None, step_m: float | None, remarks: list[str]) -> float | None:
    if model and model.step_m is not None and step_m is not None and step_m != model.step_m:
        remarks.append(
            f"The file says {step_m:g} m a count; packets of a {model.name} are decoded with {model.step_m:g} m."
        )
        return model.step_m
    return step_m


def _features(order: Sequence[Laser], model: VelodyneModel | None) -> tuple[dict[str, Any], list[Lacking]]:
    law: dict[str, Any] = {"law": "calibrated_reflectivity", "bits": 8, "aliases": ["intensity"]}
    ends = [{pair[at] for pair in (laser.intensity for laser in order)} for at in (0, 1)]
    for key, found in zip(("min", "max"), ends, strict=True):
        value = found.pop() if len(found) == 1 else None
        if value is not None:
            law[key] = value
    if model is None:
        return {}, [Lacking("features.INTENSITY", law, "calibrated reflectivity, or raw, as the manual says")]
    return {"INTENSITY": law | {"knee": model.knee}}, []


def _beams(
    order: Sequence[Laser], model: VelodyneModel | None, given: Given, rate_hz: float | None
) -> tuple[dict[str, Any], list[Lacking]]:
    beams: dict[str, Any] = {
        "kind": "channels",
        "elevation_deg": [rounded(math.degrees(laser.elevation), "deg") for laser in order],
        "azimuth_offset_deg": [rounded(math.degrees(laser.rot), "deg") for laser in order],
    }
    lacking: list[Lacking] = []
    beams |= {key: lengths for key, lengths in _origins(order).items() if any(lengths)}
    step = given.azimuth_step_deg
    if model is not None:
        beams["fire_time_us"] = [rounded(model.fire_us(laser.number), "us") for laser in order]
        if step is None and rate_hz is not None:
            step = rounded(360.0 * rate_hz * model.cycle_us * 1e-6, "deg")
    else:
        lacking.append(Lacking("beams.fire_time_us", 0.0, "the time of each laser after the first, from the manual"))
    if step is None:
        example = rounded(3600.0 * model.cycle_us * 1e-6, "deg") if model else 0.2
        look_up = "360 x turns a second x the time from a firing to the next" + (", here of 10 Hz" if model else "")
        lacking.append(step_lacks(example, look_up))
    else:
        beams["azimuth_step_deg"] = step
    return beams | {"azimuth_deg": {"first": 0, "last": -360}, "columns_repeat": False}, lacking


def _origins(order: Sequence[Laser]) -> dict[str, list[float]]:
    """(-v sin p, h) turned by the laser's azimuth offset, and v cos p."""
    found: dict[str, list[float]] = {"origin_m": [], "side_m": [], "height_m": []}
    for laser in order:
        back, left = -laser.vertical_m * math.sin(laser.elevation), laser.horizontal_m
        cos, sin = math.cos(laser.rot), math.sin(laser.rot)
        found["origin_m"].append(rounded(back * cos - left * sin, "m"))
        found["side_m"].append(rounded(back * sin + left * cos, "m"))
        found["height_m"].append(rounded(laser.vertical_m * math.cos(laser.elevation), "m"))
    return found
