"""Velodyne's YAML, as its ROS driver reads it: angles in rad, offsets in metres."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from lidarcheck.config.words import dotted
from lidarcheck.errors import InputError
from lidarcheck.formats.sensors.imported import Given, Imported
from lidarcheck.formats.sensors.lasers import Laser, channels_of, model_of
from lidarcheck.formats.sensors.values import MOST_CHANNELS, Values, check_radians

__all__ = ["checked_lasers", "import_velodyne"]

_ANGLES = {"vert_correction": "elevation", "rot_correction": "rot"}
_OFFSETS = {
    "vert_offset_correction": "vertical_m",
    "horiz_offset_correction": "horizontal_m",
    "dist_correction": "distance_m",
}
_LONGEST_M = 1.0
"""Offsets of a laser; 20 cm in an HDL-64."""


def import_velodyne(values: Values, given: Given) -> Imported:
    """The sensor of a driver's YAML; `InputError` where lasers are missing, stand twice, or have other units."""
    rows = values.entries("lasers", most=MOST_CHANNELS)
    count = values.whole("num_lasers", low=1, high=MOST_CHANNELS)
    lasers = [_laser(values, index) for index in range(len(rows))]
    used = [laser for laser in lasers if laser.number < count]
    rest = [laser for laser in lasers if laser.number >= count]
    if any(laser.elevation or laser.rot for laser in rest):
        what = f"{len(lasers)} lasers have angles, num_lasers says {count}"
        raise values.fault(("num_lasers",), what, "correct num_lasers")

    def fault(what: str, fix: str) -> InputError:
        return values.fault(("lasers",), what, fix)

    checked_lasers(used, count, fault)
    check_radians([laser.elevation for laser in used], "vert_correction", fault)
    check_radians([laser.rot for laser in used], "rot_correction", fault, most=3.2)
    step_m = values.maybe("distance_resolution", low=1e-5, high=0.1)
    name = values.lines.file.name
    source = f"{name}: angles and offsets, {step_m:g} m a count" if step_m else f"{name}: angles and offsets"
    return channels_of(used, model_of(used, given.model), step_m, given, source)


def _laser(values: Values, index: int) -> Laser:
    at: tuple[str | int, ...] = ("lasers", index)
    if not isinstance(values.find(*at), dict):
        raise values.fault(
            at, f"{dotted(at)} is no table of a laser", "write laser_id, vert_correction, rot_correction"
        )
    numbers: dict[str, Any] = {own: values.number(*at, key) for key, own in _ANGLES.items()}
    for key, own in _OFFSETS.items():
        length = values.maybe(*at, key) or 0.0
        if own != "distance_m" and abs(length) > _LONGEST_M:
            what = f"{dotted((*at, key))} = {length:g} m looks like cm"
            raise values.fault((*at, key), what, "divide offsets by 100")
        numbers[own] = length
    number = values.whole(*at, "laser_id", low=0, high=MOST_CHANNELS)
    intensity = tuple(values.maybe(*at, key, low=0, high=65535) for key in ("min_intensity", "max_intensity"))
    return Laser(number, **numbers, intensity=(intensity[0], intensity[1]))


def checked_lasers(lasers: list[Laser], count: int, fault: Any) -> None:
    """Refuse a laser that is missing or stands twice, and lasers that all look one way; `fault` makes the error."""
    numbers = sorted(laser.number for laser in lasers)
    twice = next((a for a, b in pairwise(numbers) if a == b), None)
    if twice is not None:
        raise fault(f"laser {twice} stands twice", "remove one")
    if numbers != list(range(count)):
        gone = next(number for number in range(count) if number not in numbers)
        raise fault(f"laser {gone} of {count} is missing", "add it")
    if count > 1 and len({laser.elevation for laser in lasers}) == 1:
        raise fault(f"all lasers have the elevation {lasers[0].elevation:g}", "is the file filled in?")
