"""CARLA's ray-cast lidar: the attributes of its blueprint as JSON.

Left-handed: X forward, Y right. Rows are grouped by channel, channel 0 on top; all rays of a tick show one instant.
"""

from __future__ import annotations

from typing import Any

from lidarcheck.formats.sensors.imported import Given, Imported, Lacking, nothing_lost
from lidarcheck.formats.sensors.values import MOST_BEAMS, MOST_CHANNELS, Values

__all__ = ["import_carla", "is_carla"]

_LONGEST_M = 1000.0
_DROPOFF = ("dropoff_general_rate", "dropoff_intensity_limit", "dropoff_zero_intensity")


def is_carla(data: Any) -> bool:
    """Whether JSON has the attributes of such a lidar, by themselves or below `attributes`."""
    if not isinstance(data, dict):
        return False
    inner = data.get("attributes")
    attributes = inner if isinstance(inner, dict) else data
    return "points_per_second" in attributes and "rotation_frequency" in attributes


def import_carla(values: Values, _given: Given) -> Imported:
    """The sensor of a blueprint; `InputError` where an attribute is missing, out of range or in centimetres."""
    at: tuple[str, ...] = ("attributes",) if isinstance(values.find("attributes"), dict) else ()
    channels = values.whole(*at, "channels", low=1, high=MOST_CHANNELS)
    rate_hz = values.number(*at, "rotation_frequency", low=1e-3, high=1e4)
    top, bottom = (values.number(*at, key, low=-90, high=90) for key in ("upper_fov", "lower_fov"))
    if top < bottom or (channels > 1 and top == bottom):
        raise values.fault((*at, "upper_fov"), f"upper_fov {top:g} is not above lower_fov {bottom:g}", "exchange them")
    points = values.number(*at, "points_per_second", low=1, high=1e10) / (channels * rate_hz)
    columns = round(points)
    if not 1 <= columns <= MOST_BEAMS // channels:
        raise values.fault(
            (*at, "points_per_second"), f"{points:g} points a turn and channel", "correct the attributes"
        )
    span = values.maybe(*at, "horizontal_fov", low=0.1, high=360) or 360.0
    document = _document(values, at)
    document["frame_rate_hz"] = rate_hz
    up = -(top - bottom) / (channels - 1) if channels > 1 else -1.0
    document["beams"] = {
        "kind": "grid", "layers": channels, "points": columns,
        "elevation_deg": {"first": top, "step": up},
        "azimuth_deg": {"first": 0.0 if span == 360.0 else span / 2, "step": -span / columns},
    }  # fmt: skip
    remarks = ["Columns repeat only where the simulator's frame rate equals rotation_frequency.",
               "The first column's azimuth depends on the ticks before: hold it against a scan."]  # fmt: skip
    if columns != points:
        remarks.append(f"points_per_second gives {points:.6g} columns a turn; the simulator fires {columns}.")
    remarks += [f"{key} = {values.number(*at, key):g} is of the model: effect dropout." for key in _DROPOFF
                if values.find(*at, key) is not None]  # fmt: skip
    lacking = (
        [] if "max_m" in document["range"] else [Lacking("range.max_m", 10, "`range` of the blueprint, in metres")]
    )
    if "features" not in document:
        example = {"law": "attenuation", "per_m": 0.004, "max": 1, "aliases": ["intensity", "I"]}
        lacking.append(Lacking("features.INTENSITY", example, "atmosphere_attenuation_rate of the blueprint"))
    return Imported(document, tuple(lacking), tuple(remarks))


def _document(values: Values, at: tuple[str, ...]) -> dict[str, Any]:
    """All but the beams."""
    far_m = values.maybe(*at, "range", low=0)
    if far_m is not None and far_m > _LONGEST_M:
        what = f"range = {far_m:g} m looks like centimetres, as CARLA had them before 0.9.7"
        raise values.fault((*at, "range"), what, "divide it by 100")
    document: dict[str, Any] = {
        "name": values.text("id") or "carla ray_cast",
        "source": [f"{values.lines.file.name}: attributes of the blueprint"],
        "detector": "linear",
        "frame_rate_hz": 0,
        "handedness": "left",
        "sweep": {"order": "flash", "common_receiver": False},
        "range": {"step_m": 0},
        "linear": nothing_lost(values.maybe(*at, "noise_stddev", low=0, high=1e3) or 0),
    }
    if far_m is not None:
        document["range"] = {"max_m": far_m, "step_m": 0}
    per_m = values.maybe(*at, "atmosphere_attenuation_rate", low=0, high=1e3)
    if per_m is not None:
        law = {"law": "attenuation", "per_m": per_m, "max": 1, "aliases": ["intensity", "I"]}
        document["features"] = {"INTENSITY": law}
    return document
