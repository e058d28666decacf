"""A lidar of SDF or URDF: `<lidar>` or `<ray>`, rays on a grid of angles in rad, ends included."""

from __future__ import annotations

import math
from typing import Any

from lidarcheck.errors import UsageError
from lidarcheck.formats.sensors.imported import Given, Imported, Lacking, nothing_lost, rate_lacks
from lidarcheck.formats.sensors.values import MOST_BEAMS
from lidarcheck.formats.sensors.xml_text import Element

__all__ = ["import_sdf", "is_sdf"]


def _lidars(root: Element) -> list[tuple[Element, Element]]:
    """The sensors, each with its `<lidar>`."""
    found = []
    for at in root.within():
        inner = [child for child in at.children if child.tag in ("lidar", "ray") and child.find("scan") is not None]
        found += [(at, child) for child in inner]
    if root.tag in ("lidar", "ray") and root.find("scan") is not None:
        found.append((root, root))
    return found


def is_sdf(root: Element) -> bool:
    """Whether XML holds a lidar of SDF."""
    return bool(_lidars(root))


def import_sdf(root: Element, given: Given) -> Imported:
    """The lidar that `--model` names, or the only one; `InputError` where a number is missing or in degrees."""
    sensor, lidar = _chosen(_lidars(root), given.model)
    columns, azimuth = _axis(lidar, "horizontal", 2 * math.pi)
    layers, elevation = _axis(lidar, "vertical", math.pi / 2)
    if layers * columns > MOST_BEAMS:
        raise lidar.fault(f"{layers} x {columns} rays, {MOST_BEAMS} are read")
    first, step = azimuth
    up = elevation or (0.0, step)
    gate = {own: lidar.maybe("range", key, low=0, high=1e6) for own, key in (("min_m", "min"), ("max_m", "max"))}
    noise = lidar.find("noise")
    offset, floor = (0.0, 0.0)
    if noise is not None:
        offset, floor = noise.maybe("mean", low=-1e3, high=1e3) or 0.0, noise.maybe("stddev", low=0, high=1e3) or 0.0
    lacking: list[Lacking] = []
    document: dict[str, Any] = {
        "name": sensor.attributes.get("name") or "lidar",
        "source": [f"{root.file.name}: rays, range and noise", "a simulator's ray casts: nothing is lost"],
        "detector": "linear",
    }
    rate_hz = given.rate_hz or sensor.maybe("update_rate", low=0, high=1e6)
    if rate_hz:
        document["frame_rate_hz"] = rate_hz
    else:
        lacking.append(rate_lacks("update_rate of the sensor"))
    document["sweep"] = {"order": "flash", "common_receiver": False}
    document["range"] = {key: value for key, value in gate.items() if value is not None}
    document["range"]["step_m"] = lidar.maybe("range", "resolution", low=0, high=1e3) or 0
    if offset:
        document["range"]["offset_m"] = offset
    if "max_m" not in document["range"]:
        lacking.append(Lacking("range.max_m", 30, "the largest range of the simulator's sensor"))
    document["linear"] = nothing_lost(floor)
    example = {"law": "range_corrected", "aliases": ["intensity"]}
    lacking.append(
        Lacking("features.INTENSITY", example, "the simulator's law of intensity (laser_retro), if it is used")
    )
    document["beams"] = {
        "kind": "grid", "layers": layers, "points": columns,
        "elevation_deg": {"first": up[0], "step": up[1]}, "azimuth_deg": {"first": first, "step": step},
    }  # fmt: skip
    remarks = []
    if columns > 1 and abs(abs(step) * (columns - 1) - 360.0) < 1e-6:
        remarks.append("The first and the last column look the same way: both ends of a full turn are rays.")
    return Imported(document, tuple(lacking), tuple(remarks))


def _chosen(found: list[tuple[Element, Element]], model: str | None) -> tuple[Element, Element]:
    names = [sensor.attributes.get("name", "") for sensor, _ in found]
    wanted = [pair for pair, name in zip(found, names, strict=True) if model in (None, name)]
    if len(wanted) != 1:
        what = f"the file has {len(found)} lidars" if model is None else f"no single lidar is named {model}"
        raise UsageError(what, file=found[0][1].file, fix="choose one: --model " + " | ".join(names[:20]))
    return wanted[0]


def _axis(lidar: Element, name: str, most: float) -> tuple[int, tuple[float, float]]:
    """How many rays there are, the first angle and the step [deg]; one ray at 0 where the axis is absent."""
    axis = lidar.find("scan", name)
    if axis is None:
        if name == "horizontal":
            raise lidar.fault("<scan><horizontal> is missing")
        return 1, (0.0, 1.0)
    samples = axis.number("samples", low=1, high=MOST_BEAMS)
    if samples != int(samples):
        raise axis.fault(f"<samples> = {samples:g} is no whole number")
    resolution = axis.maybe("resolution", low=0)
    if resolution not in (None, 1.0):
        what = f"<resolution> = {resolution:g} interpolates between rays"
        raise axis.fault(what, "set it to 1, and samples to the number of rays")
    low, high = axis.maybe("min_angle") or 0.0, axis.maybe("max_angle") or 0.0
    if max(abs(low), abs(high)) > most * (1 + 1e-4):
        what = f"{name} angles of {low:g} to {high:g} look like degrees, and radians are expected"
        raise axis.fault(what, "divide them by 57.29578")
    if high < low or (samples > 1 and high == low):
        raise axis.fault(f"{name} angles go from {low:g} to {high:g} rad", "put the smaller one first")
    step = math.degrees(high - low) / (samples - 1) if samples > 1 else 1.0
    return int(samples), (math.degrees(low), step)
