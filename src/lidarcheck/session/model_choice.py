"""Which of a project's models a screen simulates with: what was chosen, else the one that can be meant, else none."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.project import Entry, Project

if TYPE_CHECKING:
    from lidarcheck.sensor import Sensor

__all__ = [
    "NONE",
    "RANGE",
    "chosen_model",
    "features_of",
    "features_of_models",
    "free_models",
    "likely_model",
    "model_after",
    "models_of_sensor",
    "other_sensors",
    "sensor_of_models",
    "suits",
    "which_model",
]

NONE = "-"
"""Kept in the state for the choice of no model."""
RANGE = "range"
"""What every sensor reports of an echo, besides its features."""
_BUILT_IN = ("SMART", "SLIM")
"""Variants whose scans tell by themselves which measured."""


def chosen_model(project: Project, wanted: str, beside: Path, variant: str = "") -> Entry | None:
    """The model called `wanted`, if it can be meant for the variant; else the likely one; `beside`: the measurement's
    directory.
    """
    if wanted == NONE:
        return None
    models = project.of("model")
    named = next((entry for entry in models if entry.name == wanted and suits(entry, variant)), None)
    return named or likely_model(free_models(project, beside), beside, variant)


def free_models(project: Project, beside: Path) -> list[Entry]:
    """The models that a measurement in the directory `beside` may be meant with: not those of cases elsewhere."""
    models = project.of("model")
    cases = {case.path.parent for case in project.of("case", sound=False)} - {beside}
    return [entry for entry in models if entry.path.parent not in cases] or models


def suits(model: Entry, variant: str) -> bool:
    """Whether a model can be meant for scans of a variant: that of another built-in one cannot."""
    if variant not in _BUILT_IN:
        return True
    own = _variant_in(model.path)
    return own not in _BUILT_IN or own == variant


def likely_model(models: Sequence[Entry], beside: Path, variant: str) -> Entry | None:
    """Of those with the variant in their name, else of all: the only one in the directory `beside`, or the only one.

    Of several with the variant the first. None where several are left: a wrong one would say wrong things.
    """
    alike = [entry for entry in models if variant and variant.lower() in entry.name.lower()]
    could = alike or list(models)
    near = [entry for entry in could if entry.path.parent == beside]
    return next((some[0] for some in (near, could, alike[:1]) if len(some) == 1), None)


def which_model(models: Sequence[Entry]) -> str:
    """Why there is none, to be said where one is needed."""
    return (
        "there is no model in this project"
        if not models
        else f"any of {len(models)} models could be meant: o chooses one"
    )


def model_after(project: Project, now: Entry | None) -> str:
    """The name of the model after this one; `NONE` after the last."""
    names = [*(entry.name for entry in project.of("model")), NONE]
    at = names.index(now.name) if now is not None and now.name in names else len(names) - 1
    return names[(at + 1) % len(names)]


def models_of_sensor(project: Project, wanted: str, beside: Path, variant: str = "") -> tuple[Path, ...]:
    """The models that say what measured a scan: the one that is meant, else all of the project."""
    meant = chosen_model(project, wanted, beside, variant)
    return (meant.path,) if meant is not None else tuple(entry.path for entry in project.of("model"))


def sensor_of_models(models: Sequence[Path]) -> Sensor | None:
    """The one sensor that all these models are of; None where they differ, and for the built-in SPAD arrays, whose
    scans tell by themselves which measured."""
    from lidarcheck.sensor import reference_beams

    # Models of built-in sensors say nothing here, so that what is computed does not depend on them.
    named = [_variant_in(model) for model in models]
    if any(variant in _BUILT_IN for variant in named):
        return None
    sensors = [sensor for model in models if (sensor := _sensor_of(model)) is not None]
    alike = bool(sensors) and all(sensor.beams == sensors[0].beams for sensor in sensors)
    return sensors[0] if alike and sensors[0].beams != reference_beams() else None


def other_sensors(project: Project) -> list[str]:
    """The names of the sensors that the project's models are of, besides the built-in SPAD arrays."""
    from lidarcheck.sensor import reference_beams

    named = [entry.path for entry in project.of("model") if _variant_in(entry.path) not in ("", *_BUILT_IN)]
    sensors = [sensor for path in named if (sensor := _sensor_of(path)) is not None]
    return list(dict.fromkeys(sensor.name for sensor in sensors if sensor.beams != reference_beams()))


def features_of(sensor: Sensor) -> tuple[str, ...]:
    """The quantities of a sensor's echoes that can be looked at, what says most of their strength first."""
    from lidarcheck.calibration.echoes import echo_features
    from lidarcheck.inference.observed.echo_view import EchoView

    own = echo_features(sensor)
    first = [slot.name for slot in EchoView.of(sensor).slots if slot.name in own]
    return (*dict.fromkeys([*first, *own]), RANGE)


def features_of_models(models: Sequence[Entry]) -> tuple[str, ...]:
    """Those of all sensors that the models are of, each once."""
    sensors = [sensor for model in models if (sensor := _sensor_of(model.path)) is not None]
    found = [name for sensor in sensors for name in features_of(sensor) if name != RANGE]
    return (*dict.fromkeys(found), *([RANGE] if sensors else []))


def _variant_in(model: Path) -> str:
    """What a model's file says of its sensor, without a look at the rest; empty where it says nothing."""
    try:
        return str(tomllib.loads(model.read_text(encoding="utf-8")).get("variant", ""))
    except (OSError, ValueError):
        return ""


def _sensor_of(model: Path) -> Sensor | None:
    """A model's sensor; None where the model has a fault, or its program's sensor is not known."""
    from lidarcheck.model import load_model

    try:
        return load_model(model).sensor
    except LidarcheckError:
        return None
