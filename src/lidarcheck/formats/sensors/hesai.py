"""Hesai's angle-correction CSV: a channel a row with elevation and azimuth in degrees.

The vendor's cloud has x = d cos p sin a, y = d cos p cos a: its azimuth a is 0 along Y and turns clockwise. The azimuth
from X, positive to the left, is 90 deg - a, and a channel's own is subtracted as well.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from lidarcheck.config.words import shown
from lidarcheck.errors import InputError
from lidarcheck.formats.sensors.csv_text import Row, rows_of
from lidarcheck.formats.sensors.hesai_firetimes import fire_times
from lidarcheck.formats.sensors.imported import Given, Imported, Lacking, linear_lacks, rate_lacks, step_lacks
from lidarcheck.formats.sensors.values import MOST_CHANNELS, check_degrees

__all__ = ["import_hesai", "is_angle_table", "refuse_other_models"]

_CHANNEL = re.compile(r"channel|laser ?_?id", re.IGNORECASE)
_OTHER_MODELS = re.compile(r"AT\d{3,4}|ATX|ET\d{2}|ET[XY]|FT\d{3}|FTX")
"""Lidars without a head that turns: mirrors, flash, solid state."""
_MODEL = re.compile(r"(?:Pandar)?(XT|QT|OT|JT|Pandar)-?\d{1,3}[A-Z0-9]*|Pandar\d+[A-Z0-9]*", re.IGNORECASE)
_AT128_STEP_DEG = 0.2
_GUESS = "export a point cloud and use `lidarcheck sensor guess`"


def is_angle_table(row: Sequence[str]) -> bool:
    """Whether these cells are the header of an angle table."""
    names = [cell.lower() for cell in row]
    return bool(names) and _CHANNEL.fullmatch(names[0]) is not None and names[1:3] == ["elevation", "azimuth"]


def refuse_other_models(content: bytes, file: Path, model: str | None) -> None:
    """`InputError` for files of models whose beams no table of channels describes, told by head or by name."""
    headed = content.startswith(b"\xee\xff") or content.lstrip(b"\xef\xbb\xbf")[:4].upper() == b"EEFF"
    named = _OTHER_MODELS.search(model or file.name)
    if not headed and named is None:
        return
    name = named[0] if named else "AT128, ATX, ET25 or FT120"
    what = f"the calibration of a Hesai {name}, whose beams do not turn with a head"
    raise InputError(what, file=file, fix=_GUESS)


def import_hesai(text: str, file: Path, given: Given) -> Imported:
    """The sensor of an angle table; `InputError` for tables with holes, a channel twice, or angles in radians."""
    channels = _channels(rows_of(text, file), file)
    elevation, azimuth = ([pair[at] for pair in channels.values()] for at in (0, 1))

    def fault(what: str, fix: str) -> InputError:
        return InputError(what, file=file, fix=fix)

    check_degrees(elevation, "elevations", fault)
    if given.model is None and _is_at128(elevation):
        raise fault("the angles of an AT128, whose beams do not turn with a head", _GUESS)
    found = _MODEL.search(file.name)
    model = given.model or (found[0] if found else None)
    kept, times, remarks = list(range(len(channels))), None, list[str]()
    if given.firetimes is not None:
        kept, times, remarks = fire_times(given.firetimes, list(channels), given.state)
    return _sensor(
        file, model, [elevation[at] for at in kept], [azimuth[at] for at in kept], kept, times, remarks, given
    )


def _channels(rows: Sequence[Row], file: Path) -> dict[int, tuple[float, float]]:
    """Elevation and azimuth of each channel, in the order of their numbers; the last row may be a hash."""
    found: dict[int, tuple[float, float]] = {}
    body = list(rows[1:])
    if body and len(body[-1].cells) < 3:
        body.pop()  # a checksum
    if not 0 < len(body) <= MOST_CHANNELS:
        fix = f"1 to {MOST_CHANNELS} are read"
        raise InputError(f"the table has {len(body)} channels", file=file, fix=fix)
    for row in body:
        channel = row.whole(0)
        if channel is None:
            raise row.fault(f"the channel is {shown(row.cells[0])}, no whole number")
        if channel in found:
            raise row.fault(f"channel {channel} stands twice", "remove one")
        found[channel] = row.number(1, "the elevation"), row.number(2, "the azimuth")
        if abs(found[channel][1]) > 360.0:
            raise row.fault(f"the azimuth is {found[channel][1]:g} deg", "use -360 to 360")
    first = min(found)
    gone = [number for number in range(first, first + len(found)) if number not in found]
    if first > 1 or gone:
        raise InputError(f"channel {gone[0] if gone else 1} is missing", file=file, fix="add its row")
    return dict(sorted(found.items()))


def _is_at128(elevation: Sequence[float]) -> bool:
    steps = [abs(a - b) for a, b in pairwise(elevation)]
    return len(elevation) == 128 and all(abs(step - _AT128_STEP_DEG) < 1e-6 for step in steps)


def _sensor(
    file: Path, model: str | None, elevation: list[float], azimuth: list[float], kept: list[int],
    times: list[float] | None, remarks: list[str], given: Given,
) -> Imported:  # fmt: skip
    lacking: list[Lacking] = []
    document: dict[str, Any] = {
        "name": f"Hesai {model}" if model else f"Hesai of {len(elevation)} channels",
        "source": [f"{file.name}: angle correction"],
        "detector": "linear",
    }
    if given.firetimes is not None:
        state = f", state {given.state}" if given.state else ""
        document["source"].append(f"{given.firetimes.name}: fire times{state}")
    if given.rate_hz is None:
        lacking.append(rate_lacks("turns a second, as the sensor was set up"))
    else:
        document["frame_rate_hz"] = given.rate_hz
    lacking += [
        Lacking("returns", 2, "2 where the sensor was set to dual returns"),
        Lacking("keep", "strongest_last", "of dual returns, as the sensor was set up"),
        Lacking("range.step_m", 0.004, "the unit of distance in the packets: 4 mm of most models"),
    ]
    document["sweep"] = {"direction": "right", "fire_time_in_azimuth": False}
    remarks.append("Fire times turn the azimuth only where the driver's fire-time option was on: then write "
                   "fire_time_in_azimuth = true.")  # fmt: skip
    document["linear"] = {}
    if model and re.search("XT", model, re.IGNORECASE):
        document["source"].append("XT manual, Reflectivity Mapping: linear, a count a percent")
        law = {"law": "calibrated_reflectivity", "bits": 8, "knee": 100, "above": "linear", "aliases": ["intensity"]}
        document["features"] = {"INTENSITY": law}
    else:
        law = {"law": "calibrated_reflectivity", "bits": 8, "aliases": ["intensity"]}
        lacking.append(Lacking("features.INTENSITY", law, "Reflectivity Mapping in the model's manual: knee, above"))
    document["beams"], more = _beams(elevation, azimuth, kept, times, given)
    return Imported(document, (*lacking, *more, *linear_lacks()), tuple(remarks))


def _beams(
    elevation: list[float], azimuth: list[float], kept: list[int], times: list[float] | None, given: Given
) -> tuple[dict[str, Any], list[Lacking]]:
    lacking: list[Lacking] = []
    beams: dict[str, Any] = {
        "kind": "channels",
        "elevation_deg": elevation,
        "azimuth_offset_deg": [-angle + 0.0 for angle in azimuth],
    }
    if kept != list(range(len(kept))):
        beams["ring"] = kept
    if times is None:
        look_up = "the fire-time correction file of the model: --firetimes FILE"
        lacking.append(Lacking("beams.fire_time_us", 0.0, look_up))
    else:
        beams["fire_time_us"] = times
    if given.azimuth_step_deg is None:
        lacking.append(step_lacks(0.18, "the horizontal resolution of the manual at this rate"))
    else:
        beams["azimuth_step_deg"] = given.azimuth_step_deg
    return beams | {"azimuth_deg": {"first": 90, "last": -270}}, lacking
