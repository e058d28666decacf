"""HELIOS++ scanner XML: channels, each with a beam origin, on a head that turns about Z.

The scanner looks along its Y, with X to the right and Z up: a turn about X by `angle_deg` lifts the beam.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from lidarcheck.config.words import nearest
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.sensors.imported import (
    Given,
    Imported,
    Lacking,
    is_whole,
    linear_lacks,
    rate_lacks,
    rounded,
    step_lacks,
)
from lidarcheck.formats.sensors.pattern import read_pattern
from lidarcheck.formats.sensors.values import MOST_CHANNELS, check_degrees
from lidarcheck.formats.sensors.xml_text import Element

__all__ = ["import_helios", "is_helios"]


def _scanners(root: Element) -> list[Element]:
    return [at for at in root.within() if at.tag == "scanner" and "pulseFreqs_Hz" in at.attributes]


def is_helios(root: Element) -> bool:
    """Whether XML describes scanners of HELIOS++."""
    return bool(_scanners(root))


def import_helios(root: Element, given: Given) -> Imported:
    """The scanner that `--model` names, or the only one; `InputError` for scanners whose pattern no file gives."""
    scanner = _chosen(_scanners(root), given.model)
    name = scanner.attributes.get("name") or scanner.attributes.get("id") or "scanner"
    document: dict[str, Any] = {
        "name": name,
        "source": [f"{root.file.name}: HELIOS++ scanner {scanner.attributes.get('id', name)}"],
        "detector": "linear",
    }
    remarks: list[str] = []
    lacking = _numbers(scanner, document)
    channels = [at for holder in scanner.all("channels") for at in holder.all("channel")]
    if given.pattern is not None:
        document["beams"], table = {"kind": "table"}, read_pattern(given.pattern)
        document["source"].append(f"{given.pattern.name}: directions")
        document["sweep"] = {"order": "table"}
        if given.rate_hz:
            document["frame_rate_hz"] = given.rate_hz
        else:
            lacking.insert(0, rate_lacks("how often a second the pattern is run through"))
    elif not channels:
        optics = scanner.attributes.get("optics", "unknown")
        what = f"the beams of {name} ({optics} optics) follow from a survey's settings, which the file does not have"
        raise InputError(what, file=root.file, line=scanner.line, fix="give their directions with --pattern FILE")
    else:
        table = {}
        _turning(scanner, channels, document, lacking, remarks, given)
    _footprint(scanner, document["beams"], remarks)
    return Imported(document, tuple(lacking), tuple(remarks), table)


def _chosen(scanners: Sequence[Element], model: str | None) -> Element:
    ids = [at.attributes.get("id", "") for at in scanners]
    if model is None:
        if len(scanners) == 1:
            return scanners[0]
        what = f"the file describes {len(scanners)} scanners"
        raise UsageError(what, file=scanners[0].file, fix="choose one: --model " + " | ".join(ids[:20]))
    found = [at for at, name in zip(scanners, ids, strict=True) if name == model]
    if len(found) != 1:
        near = nearest(model, ids)
        what = f"no scanner has the id {model}" if not found else f"{len(found)} scanners have the id {model}"
        raise UsageError(
            what, file=scanners[0].file, fix=f"use {near}" if near else "use one of " + ", ".join(ids[:20])
        )
    return found[0]


def _numbers(scanner: Element, document: dict[str, Any]) -> list[Lacking]:
    """Gate, returns and detector."""
    low, high = (scanner.attribute(key, low=0, high=1e6) for key in ("rangeMin_m", "rangeMax_m"))
    gate = {key: value for key, value in (("min_m", low), ("max_m", high)) if value is not None}
    if gate:
        document["range"] = gate
    returns = scanner.attribute("maxNOR", low=0, high=16)
    if returns:
        document["returns"] = int(returns)
    linear: dict[str, Any] = {}
    for own, key in (("pulse_fwhm_ns", "pulseLength_ns"), ("range_floor_m", "accuracy_m")):
        value = scanner.attribute(key, low=0, high=1e4)
        if value is not None and (value or own == "range_floor_m"):
            linear[own] = value
    document["linear"] = linear
    example = {"law": "range_corrected", "aliases": ["intensity"]}
    look_up = "the law of the sensor's intensity; HELIOS++ writes the received power"
    return [*linear_lacks(min_m=low is None, max_m=high is None), Lacking("features.INTENSITY", example, look_up)]


def _turning(
    scanner: Element, channels: Sequence[Element], document: dict[str, Any], lacking: list[Lacking], remarks: list[str],
    given: Given,
) -> None:  # fmt: skip
    if len(channels) > MOST_CHANNELS:
        raise scanner.fault(f"{len(channels)} channels, {MOST_CHANNELS} are read")
    axis = scanner.find("headRotateAxis")
    if axis is not None and (axis.attribute("x") or axis.attribute("y")):
        raise axis.fault("the head turns about another axis than Z", "give directions with --pattern FILE")
    found = [_channel(at) for at in channels]

    def fault(what: str, fix: str) -> InputError:
        return scanner.fault(what, fix)

    check_degrees([elevation for elevation, _ in found], "elevations (rot about x)", fault)
    beams: dict[str, Any] = {"kind": "channels", "elevation_deg": [elevation for elevation, _ in found]}
    for key, at, sign in (("origin_m", 1, 1.0), ("side_m", 0, -1.0), ("height_m", 2, 1.0)):
        lengths = [rounded(sign * place[at], "m") for _, place in found]
        if any(lengths):
            beams[key] = lengths
    turn = scanner.attribute("headRotatePerSecMax_deg", low=0, high=1e6)
    rate_hz = given.rate_hz or (turn / 360.0 if turn else None)
    if rate_hz is None:
        lacking.insert(0, rate_lacks("turns a second of the head"))
    else:
        document["frame_rate_hz"] = rate_hz
        if given.rate_hz is None:
            remarks.append(f"{rate_hz:g} turns a second are the most that the scanner can do.")
    document["sweep"] = {"direction": "left"}
    beams |= _columns(scanner, rate_hz, lacking, given)
    document["beams"] = beams
    remarks.append(
        "Channels stand in the order of firing, without times. The sense of turning is not in the file: left."
    )


def _columns(scanner: Element, rate_hz: float | None, lacking: list[Lacking], given: Given) -> dict[str, Any]:
    """The head's step between two pulses of a channel."""
    text = scanner.attributes.get("pulseFreqs_Hz", "")
    step = given.azimuth_step_deg
    if step is None and rate_hz is not None and "," not in text:
        pulses = scanner.attribute("pulseFreqs_Hz", low=1, high=1e9) or 1.0
        if is_whole(pulses / rate_hz):
            return {"columns": round(pulses / rate_hz), "azimuth_deg": {"first": 0, "last": 360}}
        step = rounded(360.0 * rate_hz / pulses, "deg")
    found: dict[str, Any] = {"azimuth_deg": {"first": 0, "last": 360}, "columns_repeat": False}
    if step is None:
        lacking.append(step_lacks(0.2, f"360 x turns a second / pulses a second of a channel ({text[:60]})"))
        return found
    return {"azimuth_step_deg": step, **found}


def _channel(channel: Element) -> tuple[float, tuple[float, float, float]]:
    """Elevation [deg] and place [m] of a channel's beam."""
    origin = channel.find("beamOrigin")
    if origin is None:
        raise channel.fault("<beamOrigin> is missing in the channel")
    elevation = 0.0
    for turn in origin.all("rot"):
        angle = turn.attribute("angle_deg", low=-360, high=360) or 0.0
        if turn.attributes.get("axis") == "x":
            elevation += angle
        elif angle:
            raise turn.fault(f"a turn about {turn.attributes.get('axis', 'no axis')} in a channel", "only x is read")
    x, y, z = (origin.attribute(key, low=-100, high=100) or 0.0 for key in "xyz")
    return elevation, (x, y, z)


def _footprint(scanner: Element, beams: dict[str, Any], remarks: list[str]) -> None:
    divergence = scanner.attribute("beamDivergence_rad", low=0, high=1)
    if divergence:
        width = rounded(math.degrees(divergence), "deg")
        beams["footprint_deg"] = {"horizontal": width, "vertical": width}
        remarks.append("beamDivergence_rad is taken for the full width at half maximum; of 1/e^2 it is 0.589 of that.")
