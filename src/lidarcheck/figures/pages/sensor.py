"""A sensor as people see it: its beams, when they are fired, its gate, detector and features; and as JSON."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.figures.data import Course, Curve, Figure, Page, Section, Table
from lidarcheck.figures.pages.sensor_tables import (
    detector_table,
    features_table,
    files_table,
    gate_table,
    needed,
    reach,
)
from lidarcheck.figures.pages.thinning import thinned
from lidarcheck.sensor import Beams, Sensor
from lidarcheck.sensor.channels import ChannelBeams

__all__ = ["document", "page", "rate"]

_BLOCK = 16
"""Columns of the block whose beams are shown."""
_MOST = 20_000
"""Beams that a picture of a whole frame shows; more would not be told apart."""
_UP, _ASIDE = "elevation [deg]", "azimuth [deg], left positive"


def page(sensor: Sensor) -> Page:
    """All that a sensor file says, and what is missing in it for `simulate`."""
    sections = [
        Section("Beams", _beam_words(sensor), (_table("Beams", _beam_rows(sensor)),), _patterns(sensor)),
        Section("Timing", (), (_table("Timing", _timing_rows(sensor)),), _timing(sensor)),
        Section("Range", (), (gate_table(sensor),)),
        Section("Detector", reach(sensor), (detector_table(sensor),)),
        Section("Features", (), (features_table(sensor),)),
        Section("Files and echoes", (), (files_table(sensor),)),
        Section("Sources", tuple(f"- {fact}" for fact in sensor.source) or ("none given",)),
    ]
    return Page(f"sensor {sensor.name}", _summary(sensor), tuple(sections))


def document(sensor: Sensor) -> dict[str, Any]:
    """The same numbers for JSON, with those of each channel or layer; angles [deg], lengths [m], times [s]."""
    numbers = {name: getattr(sensor, name) for name in sensor.numbers()}
    tables = (detector_table(sensor), files_table(sensor))
    words = {row[0]: row[1] for table in tables for row in table.rows if row[0] not in numbers}
    features = [{key: value for key, value in vars(feature).items() if key != "table"} for feature in sensor.features]
    return {
        "name": sensor.name,
        "variant": sensor.variant,
        "detector": sensor.detector,
        "beams": {**_beam_numbers(sensor), "of_layer": _of_layer(sensor.beams)},
        "timing": vars_of_sweep(sensor),
        "numbers": {**numbers, "separation_m": sensor.separation_m, "window_m": sensor.window_m},
        "words": words,
        "features": features,
        "missing": list(sensor.missing),
        "source": list(sensor.source),
    }


def rate(sensor: Sensor) -> tuple[float, float]:
    """Beams of a frame (on average, where columns do not repeat) and beams a second; NaN where the file lacks them."""
    beams = sensor.beams
    if "beams.columns" in sensor.missing:
        return math.nan, math.nan
    columns = beams.columns if isinstance(beams, ChannelBeams) else None
    frame = float(len(beams.every()[0])) if columns is None else beams.layers * columns
    return frame, math.nan if "frame_rate_hz" in sensor.missing else frame * sensor.frame_rate_hz


def vars_of_sweep(sensor: Sensor) -> dict[str, Any]:
    """When beams are fired, as the file says it."""
    sweep = sensor.sweep
    names = ("order", "duration_s", "direction", "common_receiver", "fire_time_in_azimuth")
    return {"frame_rate_hz": sensor.frame_rate_hz, **{name: getattr(sweep, name) for name in names}}


def _summary(sensor: Sensor) -> str:
    frame, second = rate(sensor)
    beams = sensor.beams
    what = f"{beams.layers} layers x {beams.points} points, {frame:,.0f} beams a frame, {second:,.0f} a second"
    if not frame:
        what = "no beams of its own: each scan brings their directions"
    elif math.isnan(second):
        what = f"{beams.layers} layers"
    said = f"{sensor.name}: {sensor.detector}, {what}, from {sensor.min_range_m:g} to {sensor.max_range_m:g} m."
    return f"{said} {needed(sensor)}".rstrip()


def _beam_words(sensor: Sensor) -> tuple[str, ...]:
    beams = sensor.beams
    if not len(beams.every()[0]):
        return ("Directions come with each scan: there is no pattern to show.",)
    if not beams.repeats:
        return ("Columns do not repeat: every frame begins elsewhere. Point counts firings from the frame's start.",)
    return ()


def _beam_numbers(sensor: Sensor) -> dict[str, Any]:
    beams = sensor.beams
    layer, point = beams.every()
    frame, second = rate(sensor)
    found: dict[str, Any] = {
        "kind": "grid" if beams.grid else "channels" if isinstance(beams, ChannelBeams) else "table",
        "layers": beams.layers,
        "points": beams.points,
        "beams_a_frame": frame,
        "beams_a_second": second,
        "columns_repeat": beams.repeats,
        "origins": "0, 0, 0" if beams.central else "of each beam",
        "footprint_deg": list(sensor.footprint_deg),
        "sub_rays": list(sensor.sub_rays),
    }
    if len(layer):
        elevation, azimuth = beams.angles_deg(layer, point)
        up, aside = beams.spacing_deg(layer, point)
        found |= {"elevation_deg": [float(elevation.min()), float(elevation.max())]}
        found |= {"azimuth_deg": [float(azimuth.min()), float(azimuth.max())]}
        found |= {"elevation_spacing_deg": _spread(up), "azimuth_spacing_deg": _spread(aside)}
    return found


def _spread(values: FloatArray) -> list[float]:
    return [float(np.nanmin(values)), float(np.nanmedian(values)), float(np.nanmax(values))]


def _of_layer(beams: Beams) -> dict[str, Any]:
    """What is of each layer: its elevation, and of a turning head all lists of its channels."""
    if isinstance(beams, ChannelBeams):
        return {name: list(getattr(beams.channels, name)) for name in beams.channels.__dataclass_fields__}
    if beams.grid:
        return {"elevation_deg": beams.angles_deg(np.arange(beams.layers), np.zeros(beams.layers, dtype=int))[0]}
    return {}


def _table(title: str, rows: list[tuple[str, str, str]]) -> Table:
    return Table(title, ("what", "value", "unit"), tuple(rows), right=("value",))


def _known(value: float, known: bool = True) -> str:
    return f"{value:,.10g}" if known and not math.isnan(value) else "missing"


def _beam_rows(sensor: Sensor) -> list[tuple[str, str, str]]:
    numbers = _beam_numbers(sensor)
    columns = "beams.columns" not in sensor.missing
    rows = [
        ("kind", numbers["kind"], ""),
        ("layers x points", f"{numbers['layers']} x {_known(numbers['points'], columns)}", ""),
        ("beams a frame", _known(numbers["beams_a_frame"]), ""),
        ("beams a second", _known(numbers["beams_a_second"]), "1/s"),
    ]
    for name in ("elevation", "azimuth"):
        if f"{name}_deg" in numbers:
            low, high = numbers[f"{name}_deg"]
            rows.append((name, f"{low:.4g} to {high:.4g}", "deg"))
    for name in ("elevation", "azimuth"):
        if f"{name}_spacing_deg" in numbers and (columns or name == "elevation"):
            least, middle, most = (f"{value:.4g}" for value in numbers[f"{name}_spacing_deg"])
            shown = middle if least == most else f"{middle} ({least} to {most})"
            rows.append((f"to the next beam in {name}", shown, "deg"))
    rows.append(("beams begin at", numbers["origins"], "m"))
    wide, high = sensor.footprint_deg
    if wide or high:
        rays = " x ".join(str(n) for n in sensor.sub_rays)
        rows.append((f"footprint, {sensor.footprint}, {rays} rays", f"{wide:g} x {high:g}", "deg"))
    return rows


def _timing_rows(sensor: Sensor) -> list[tuple[str, str, str]]:
    sweep, beams = sensor.sweep, sensor.beams
    rated = "frame_rate_hz" not in sensor.missing
    timed = rated and "beams.columns" not in sensor.missing
    rows = [
        ("frames", _known(sensor.frame_rate_hz, rated), "1/s"),
        ("order of firing", sweep.order, ""),
        ("sweep", _known(1e3 * sweep.duration_s, rated), "ms"),
        ("sense of turning", f"to the {sweep.direction}", ""),
        ("one receiver for all that fire together", "yes" if sweep.common_receiver else "no", ""),
    ]
    if isinstance(beams, ChannelBeams):
        rows.insert(3, ("from column to column", _known(1e6 * beams.column_s, timed), "us"))
        rows.append(("fire time turns the azimuth", "yes" if sweep.fire_time_in_azimuth else "no", ""))
    return rows


def _patterns(sensor: Sensor) -> tuple[Figure, ...]:
    beams = sensor.beams
    layer, point = beams.every()
    if not len(layer) or "beams.columns" in sensor.missing:
        return ()
    columns = min(_BLOCK, beams.points)
    begin = (beams.points - columns) // 2
    block = (point >= begin) & (point < begin + columns)
    return (
        _pattern(f"{columns} columns in the middle", beams, layer[block], point[block]),
        _pattern("A whole frame", beams, layer, point),
        *_spacing(beams),
    )


def _pattern(title: str, beams: Beams, layer: IntArray, point: IntArray) -> Course:
    # Every so many-th beam of rows would leave out whole columns or layers.
    rows = thinned(np.random.Generator(np.random.PCG64(0)).permutation(len(layer)), _MOST)
    elevation, azimuth = beams.angles_deg(layer[rows], point[rows])
    return Course(title, _ASIDE, _UP, (Curve("beams", azimuth, elevation, dots=True),))


def _spacing(beams: Beams) -> tuple[Course, ...]:
    if beams.layers < 2:
        return ()
    layer = np.arange(beams.layers)
    point = np.zeros(beams.layers, dtype=np.int64)
    elevation = beams.angles_deg(layer, point)[0]
    up = beams.spacing_deg(layer, point)[0]
    order = np.argsort(elevation, kind="stable")
    curve = Curve("layers", elevation[order], up[order], dots=True)
    return (Course("To the next layer", _UP, "distance [deg]", (curve,)),)


def _timing(sensor: Sensor) -> tuple[Figure, ...]:
    """Fire times: of the channels within their column, else over azimuth and elevation."""
    beams = sensor.beams
    layer, point = beams.every()
    if not len(layer) or sensor.sweep.order == "flash":
        return ()
    if isinstance(beams, ChannelBeams):
        channels = np.arange(beams.layers)
        first = np.zeros(beams.layers, dtype=np.int64)
        elevation = beams.angles_deg(channels, first)[0]
        time_us = 1e6 * beams.fire_time_s(channels, first)
        curve = Curve("channels", time_us, elevation, dots=True)
        return (Course("Firing within a column", "after the column's start [us]", _UP, (curve,)),)
    rows = thinned(np.lexsort((layer, point)), _MOST)
    time_ms = 1e3 * beams.fire_time_s(layer[rows], point[rows])
    azimuth = beams.angles_deg(layer[rows], point[rows])[1]
    curve = Curve("beams", azimuth, time_ms, dots=True)
    return (Course("Firing within a frame", _ASIDE, "after the frame's start [ms]", (curve,)),)
