"""The mixes of effects of `mixes.toml`, as models."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any

from lidarcheck.effects import Effect
from lidarcheck.effects.base import beams_in
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Sensor

__all__ = ["mixes", "with_effects"]

Mix = Mapping[str, Mapping[str, Any]]


def mixes(table: str) -> Mapping[str, Mix]:
    """The mixes of one of the file's tables by name: the parameters of each effect that differ from the typical."""
    text = resources.files(__package__).joinpath("mixes.toml").read_text(encoding="utf-8")
    found: Mapping[str, Mix] = tomllib.loads(text)[table]
    return found


def with_effects(model: Model, mix: Mix) -> tuple[Model, dict[str, str]]:
    """The model with a mix's effects, and why it goes without those that mean nothing for its sensor."""
    from lidarcheck.effects import find, make

    why = {name: find(name).why_not(model.sensor) for name in mix}
    for name, settings in mix.items():
        if not why[name]:
            model = model.with_(make(name, {**_in_reach(find(name), model.sensor), **settings}))
    return model, {name: reason for name, reason in why.items() if reason}


def _in_reach(effect: type[Effect], sensor: Sensor) -> dict[str, float]:
    """The typical values of what counts beams, at the same part of this sensor's as of the built-in grid's."""
    here, there = beams_in(sensor), beams_in(Sensor.of("SMART"))
    counted = (one for one in effect.parameters() if one.counts)
    return {one.name: one.typical * here[one.counts] // there[one.counts] for one in counted}
