"""Tables of a sensor: its gate, its detector, its features, and how its files are written."""

from __future__ import annotations

import math

from lidarcheck.figures.data import Table
from lidarcheck.sensor import Linear, Sensor
from lidarcheck.sensor.overrides import place_of_number

__all__ = ["detector_table", "features_table", "files_table", "gate_table", "needed", "reach"]

_HEAD = ("what", "value", "unit")
_GATE = ("min_range_m", "max_range_m", "range_resolution_m", "range_offset_m")


def gate_table(sensor: Sensor) -> Table:
    """The gate, the step of reported ranges, what makes one echo, and what belongs to a surface."""
    names = ("nearest", "farthest", "step of reported ranges", "constant error")
    rows = [(name, f"{getattr(sensor, key):g}", "m") for name, key in zip(names, _GATE, strict=True)]
    rows.append(("surfaces nearer to each other make one echo", f"{sensor.separation_m:.6g}", "m"))
    rows.append(("an echo so near to a surface is that surface's", f"{sensor.window_m:.6g}", "m"))
    return Table("Range", _HEAD, tuple(rows), right=("value",))


def detector_table(sensor: Sensor) -> Table:
    """The detector's numbers by their keys; "missing" in the place of one that the file lacks."""
    bounds = sensor.numbers()
    rows = []
    for name in dict.fromkeys(("signal_at_1m", "pulse_fwhm_ns", *sensor.bounds, "near_m")):
        if name not in bounds or place_of_number(name, "")[0] or (name == "near_m" and name not in sensor.bounds):
            continue
        rows.append((name, _number(sensor, name), bounds[name].unit))
    rows += [(name, _word(getattr(sensor, name)), "") for name in _words(sensor)]
    return Table(sensor.detector, _HEAD, tuple(rows), right=("value",))


def _number(sensor: Sensor, name: str) -> str:
    if name in sensor.missing:
        return "missing"
    value = getattr(sensor, name)
    if value is not None:
        return f"{value:g}"
    return {"false_rate_hz": "by Rice", "walk_reference": f"{10.0 * getattr(sensor, 'threshold', 0.0):g}"}.get(
        name, "none"
    )


def _word(value: object) -> str:
    return ("yes" if value else "no") if isinstance(value, bool) else str(value) or "none"


def _words(sensor: Sensor) -> list[str]:
    words = ("rows", "columns", "range_law", "readout", "pulse_file", "coates")
    return [name for name in words if hasattr(sensor, name)]


def needed(sensor: Sensor) -> str:
    """What `simulate` still needs; empty for nothing."""
    if not sensor.missing:
        return ""
    keys = (name if "." in name else ".".join(place_of_number(name, sensor.detector)) for name in sensor.missing)
    return f"Missing for simulate: {', '.join(keys)}. Write it into the file, or into a model's [sensor]."


def reach(sensor: Sensor) -> tuple[str, ...]:
    """How far a weak surface is seen, of a detector where that is a closed form."""
    if not isinstance(sensor, Linear) or sensor.missing or sensor.threshold <= 0.0:
        return ()
    square = 0.1 * sensor.signal_at_1m / sensor.threshold - sensor.near_m**2
    return (f"A white surface of 10 % is detected in half of the shots at {math.sqrt(max(square, 0.0)):.4g} m.",)


def features_table(sensor: Sensor) -> Table:
    """What is reported of an echo: name, law with its own numbers, unit, step, limits, names in files."""
    rows = []
    for feature in sensor.features:
        own = (
            f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in feature.numbers.items()
        )
        law = ", ".join([feature.law, *own])
        low = "" if feature.low is None else f"{feature.low:g}"
        most = "" if feature.most is None else f"{feature.most:g}"
        step = f"{feature.step:g}" if feature.step else "none"
        rows.append((feature.name, law, feature.unit, step, low, most, ", ".join(feature.aliases)))
    header = ("feature", "law", "unit", "step", "min", "max", "in files also")
    return Table("Features", header, tuple(rows), right=("step", "min", "max"))


def files_table(sensor: Sensor) -> Table:
    """Which echoes are kept, and how files of the sensor are written."""
    names = ("keep", "strength", "return_order", "duplicate_return", "handedness", "time_unit", "time_zero")
    rows = [("returns", str(sensor.max_echoes), "")]
    rows += [(name, str(getattr(sensor, name)) or "the amplitude", "") for name in names]
    rows.append(("deskewed", _word(sensor.deskewed), ""))
    return Table("Files and echoes", _HEAD, tuple(rows))
