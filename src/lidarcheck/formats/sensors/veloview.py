"""Velodyne's `db.xml`, as VeloView and the vendor's tools write it: angles in degrees, lengths in centimetres."""

from __future__ import annotations

import math
from typing import Any

from lidarcheck.errors import InputError
from lidarcheck.formats.sensors.imported import Given, Imported
from lidarcheck.formats.sensors.lasers import Laser, channels_of, model_of
from lidarcheck.formats.sensors.values import MOST_CHANNELS, check_degrees
from lidarcheck.formats.sensors.velodyne import checked_lasers
from lidarcheck.formats.sensors.xml_text import Element

__all__ = ["import_veloview"]

_LONGEST_CM = 100.0


def import_veloview(root: Element, given: Given) -> Imported:
    """The sensor of a db.xml; `InputError` where lasers are missing, stand twice, or have other units."""
    base = root.find("DB")
    points = None if base is None else base.find("points_")
    if base is None or points is None:
        raise root.fault("<DB><points_> is missing: no lasers are described")
    items = points.all("item")
    if not 0 < len(items) <= MOST_CHANNELS:
        raise points.fault(f"{len(items)} lasers are described, 1 to {MOST_CHANNELS} are read")
    enabled, least, most = (_list(base, tag, len(items)) for tag in ("enabled_", "minIntensity_", "maxIntensity_"))
    lasers = [_laser(item, len(items), least, most) for item in items]
    used = [laser for laser in lasers if enabled is None or enabled[laser.number]]
    if not used:
        raise base.fault("no laser is enabled")

    def fault(what: str, fix: str) -> InputError:
        return points.fault(what, fix)

    checked_lasers(used, len(used), fault)
    check_degrees([math.degrees(laser.elevation) for laser in used], "vertCorrection_", fault)
    step_cm = base.maybe("distLSB_", low=0.0, high=10.0)
    if step_cm is not None and step_cm < 0.02:
        raise base.fault(f"<distLSB_> = {step_cm:g} looks like metres, and cm are expected", "multiply lengths by 100")
    source = f"{root.file.name}: angles and offsets" + (f", {step_cm:g} cm a count" if step_cm else "")
    step_m = None if step_cm is None else step_cm / 100
    return channels_of(used, model_of(used, given.model), step_m, given, source)


def _list(base: Element, tag: str, count: int) -> list[float] | None:
    """One number a laser; None where the file has no such list."""
    at = base.find(tag)
    if at is None:
        return None
    items = at.all("item")
    if len(items) != count:
        raise at.fault(f"<{tag}> has {len(items)} items, there are {count} lasers")
    return [item.number() for item in items]


def _laser(item: Element, count: int, least: list[float] | None, most: list[float] | None) -> Laser:
    px = item.find("px")
    if px is None:
        raise item.fault("<px> is missing in an item of <points_>")
    number = px.number("id_", low=0, high=count - 1)
    if number != int(number):
        raise px.fault(f"<id_> = {number:g} is no whole number")
    cm: dict[str, Any] = {}
    for tag in ("vertOffsetCorrection_", "horizOffsetCorrection_"):
        cm[tag] = px.maybe(tag, low=-_LONGEST_CM, high=_LONGEST_CM) or 0.0
    rot_deg = px.number("rotCorrection_", low=-360.0, high=360.0)
    at = int(number)
    return Laser(
        at,
        math.radians(px.number("vertCorrection_", low=-90.0, high=90.0)),
        math.radians(rot_deg),
        cm["vertOffsetCorrection_"] / 100.0,
        cm["horizOffsetCorrection_"] / 100.0,
        (px.maybe("distCorrection_") or 0.0) / 100.0,
        (None if least is None else least[at], None if most is None else most[at]),
    )
