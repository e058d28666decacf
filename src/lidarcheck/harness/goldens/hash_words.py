"""What of a model enters its hash, and under which words.

The hash stands in goldens, in users' own projects: the words are part of the file format and never change. They were
the code's names when they were first hashed; a class, a field or a module that gets another name keeps its word. What
is new in a class belongs here too, else no golden would see it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from lidarcheck.effects.base import Curve, Effect
from lidarcheck.model.spec import Model
from lidarcheck.sensor import (
    VARIANTS,
    Beams,
    Feature,
    Linear,
    Material,
    NonIdeal,
    PhotonHistogram,
    Program,
    Sensor,
    SpadArray,
)
from lidarcheck.sensor.beam_table import TableBeams
from lidarcheck.sensor.channels import ChannelBeams, Channels
from lidarcheck.sensor.document import own
from lidarcheck.sensor.grid import Axis, GridBeams
from lidarcheck.sensor.sweep import Sweep

__all__ = ["hashed_parts"]


def hashed_parts(value: object) -> dict[str, Any] | None:
    """By their words what counts of a model, or of a part of it, with its own word under ""; None for what has none."""
    if isinstance(value, Effect):
        return _effect(value)
    of_class = _PARTS.get(type(value))
    return None if of_class is None else of_class(value)


def _model(model: Model) -> dict[str, Any]:
    """Where its file lies is no parameter."""
    return {
        "": "Model",
        "sensor": model.sensor,
        "materials": model.materials,
        "effects": model.effects,
        "external": model.as_written,
    }


_BUILT_IN = (
    "spads", "shots", "threshold", "peak_saturation", "on_bins", "dead_bins", "pulse_fwhm_ns", "background_per_ns",
    "signal_at_1m", "bin_ns", "max_range_m", "max_echoes", "time_offset_ns", "range_resolution_m",
)  # fmt: skip
"""The numbers of the built-in sensors that have always been hashed, whether a model changes them or not."""
_NO_PARAMETER = ("variant", "name", "source", "tables", "missing", "file", "plain")
"""Where a sensor comes from, and what its other fields already say."""


def _sensor(sensor: Sensor) -> dict[str, Any]:
    """Of a built-in sensor its old numbers and what else differs from it; of any other one everything."""
    if sensor.variant not in VARIANTS or sensor.plain is not None:
        every = [field.name for field in dataclasses.fields(sensor) if field.name not in _NO_PARAMETER]
        return {"": "Sensor", "detector": sensor.detector, **{name: getattr(sensor, name) for name in every}}
    built_in = own(sensor)
    others = [f.name for f in dataclasses.fields(sensor) if f.name not in (*_NO_PARAMETER, *_BUILT_IN)]
    changed = [name for name in others if getattr(sensor, name) != getattr(built_in, name)]
    return {
        "": "Sensor",
        "variant": sensor.variant,
        **{name: getattr(sensor, name) for name in (*_BUILT_IN, *changed)},
    }


def _program(sensor: Program) -> dict[str, Any]:
    """The sensor that the model names: what the program's table says stands in that."""
    return _sensor(sensor.described)


def _sweep(sweep: Sweep) -> dict[str, Any]:
    return {"": "Sweep", **{field.name: getattr(sweep, field.name) for field in dataclasses.fields(sweep)}}


def _axis(axis: Axis) -> dict[str, Any]:
    return {"": "Axis", "count": axis.count, "first_deg": axis.first_deg, "step_deg": axis.step_deg}


def _channels(channels: Channels) -> dict[str, Any]:
    return {"": "Channels", **{f.name: getattr(channels, f.name) for f in dataclasses.fields(channels)}}


def _beams(beams: Beams) -> dict[str, Any]:
    return {"": "Beams", "key": beams.key}


def _feature(feature: Feature) -> dict[str, Any]:
    """The names of its columns in files are no parameter."""
    counted = [field.name for field in dataclasses.fields(feature) if field.name != "aliases"]
    return {"": "Feature", **{name: getattr(feature, name) for name in counted}}


def _nonideal(nonideal: NonIdeal) -> dict[str, Any]:
    return {
        "": "NonIdeal",
        "crosstalk_sides": nonideal.crosstalk_sides,
        "crosstalk_corners": nonideal.crosstalk_corners,
        "afterpulse": nonideal.afterpulse,
        "afterpulse_ns": nonideal.afterpulse_ns,
        "afterpulse_slow_share": nonideal.afterpulse_slow_share,
        "afterpulse_slow_ns": nonideal.afterpulse_slow_ns,
        "dead_spread_ns": nonideal.dead_spread_ns,
        "dead_recovery_ns": nonideal.dead_recovery_ns,
        "threshold_dither": nonideal.threshold_dither,
    }


def _material(material: Material) -> dict[str, Any]:
    return {
        "": "Material",
        "name": material.name,
        "reflectance": material.reflectance,
        "kind": material.kind,
        "retro_gain": material.retro_gain,
    }


def _curve(curve: Curve) -> dict[str, Any]:
    """The file that it was read from is no parameter; its content is."""
    return {"": "Curve", "x": curve.x, "y": curve.y}


_PARTS: Mapping[type, Callable[[Any], dict[str, Any]]] = {
    Model: _model,
    SpadArray: _sensor,
    Linear: _sensor,
    PhotonHistogram: _sensor,
    Program: _program,
    GridBeams: _beams,
    ChannelBeams: _beams,
    TableBeams: _beams,
    Sweep: _sweep,
    Axis: _axis,
    Channels: _channels,
    Feature: _feature,
    NonIdeal: _nonideal,
    Material: _material,
    Curve: _curve,
}


def _effect(effect: Effect) -> dict[str, Any]:
    """Its parameters by their names, which are the keys of its table in a model file."""
    word = effect.hash_word or "".join(part.capitalize() for part in effect.name.split("_"))
    counted = [field for field in dataclasses.fields(effect) if not _is_left_out(effect, field)]
    return {"": word, **{field.name: getattr(effect, field.name) for field in counted}}


def _is_left_out(effect: Effect, field: dataclasses.Field[Any]) -> bool:
    """A list that a model does not give, or an option that it does not use: older goldens know neither."""
    value = getattr(effect, field.name)
    return bool(value == () or (field.metadata.get("option") and value == field.default))
