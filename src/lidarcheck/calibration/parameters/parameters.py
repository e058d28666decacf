"""The parameters of a model by name: `signal_at_1m`, `materials.2.reflectance`, `effects.NAME.PARAMETER`, and
`external.NAME` for a number of somebody else's program."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from lidarcheck.calibration.parameters.fitted import FitParameter
from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import find, make
from lidarcheck.errors import UsageError
from lidarcheck.model.spec import Model, ProgramNumber
from lidarcheck.sensor import RETRO_GAIN_MAX, Material, Program, Sensor, SpadArray

__all__ = [
    "added_effects",
    "calibrating",
    "free_names",
    "free_parameters",
    "known_names",
    "sensor_names",
    "value_of",
    "with_fixed",
    "with_values",
]


_OF_SPADS = (
    "signal_at_1m",
    "background_per_ns",
    "threshold",
    "on_bins",
    "dead_bins",
    "pulse_fwhm_ns",
    "peak_saturation",
)
"""The numbers of a SPAD array that measured frames tell something about; the others are counts and clocks."""
_SETTINGS = (
    *("min_range_m", "max_range_m", "max_echoes", "range_resolution_m", "frame_rate_hz", "spads", "shots", "bins"),
    "walk_reference",
)
"""Numbers of other sensors that are set, or that only name a unit."""
_PROGRAM = "external"
_MATERIAL_BOUNDS = {"reflectance": (0.0, 1.0), "retro_gain": (0.0, RETRO_GAIN_MAX)}
_FACTORS = ("signal_at_1m", "reflectance", "retro_gain", "gain", "factor")
"""What multiplies the light is fitted by its logarithm, and so is what cannot be 0; a rate or a share is not."""
_FAINTEST = 1e-6
"""Of the signal that a sensor calibrates its features by, how little there can be."""


def sensor_names(sensor: Sensor) -> tuple[str, ...]:
    """The sensor's numbers that measured frames tell something about, those that it has; a program's are its own."""
    if isinstance(sensor, Program):
        return ()
    if isinstance(sensor, SpadArray):
        return _OF_SPADS
    return tuple(n for n in sensor.numbers() if n not in _SETTINGS and getattr(sensor, n) is not None)


def calibrating(model: Model) -> dict[str, str]:
    """The numbers by which the sensor calibrates a feature, which then does not show them: words on each."""
    own = [f.name for f in model.sensor.features if f.law == "calibrated_reflectivity"]
    words = f"{', '.join(own)} is calibrated by signal_at_1m and does not show it; effects.signal_gain.gain does"
    return {"signal_at_1m": words} if own else {}


def known_names(model: Model) -> list[str]:
    """Every parameter of the model that can be named, its effects' and no others'."""
    names = [*sensor_names(model.sensor), *(f"{_PROGRAM}.{name}" for name in _numbers(model))]
    for number, material in sorted(model.materials.items()):
        names.append(f"materials.{number}.reflectance")
        names += [f"materials.{number}.retro_gain"] if material.kind == "retro" else []
    return names + [f"effects.{e.name}.{p.name}" for e in model.effects for p in e.parameters()]


def free_parameters(
    model: Model,
    names: Iterable[str],
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    starts: Mapping[str, float] | None = None,
) -> tuple[FitParameter, ...]:
    """The named parameters, each with its interval and its start; `model` has the effects that they belong to.

    `bounds`, `starts`: by name. `UsageError` for what is no parameter, with the nearest one that is, and for bounds
    and starts that do not fit.
    """
    bounds = {canonical(model, name): pair for name, pair in (bounds or {}).items()}
    starts = {canonical(model, name): value for name, value in (starts or {}).items()}
    wanted = list(dict.fromkeys(canonical(model, name) for name in names))
    if not wanted:
        raise UsageError("no parameter is free", fix="name some with --free, as --free signal_at_1m")
    for option, given in (("--bounds", bounds), ("--start", starts)):
        for name in given:
            if name not in wanted:
                raise UsageError(f"{option} {name}: it is not free", fix=f"add it to --free, or leave {option} out")
    return tuple(_free(model, name, bounds.get(name), starts.get(name)) for name in wanted)


def _free(model: Model, name: str, bounds: tuple[float, float] | None, start: float | None) -> FitParameter:
    low, high, whole, unit, typical = _facts(model, name)
    value = value_of(model, name) if start is None else start
    if bounds is not None:
        if not low <= bounds[0] < bounds[1] <= high:
            fix = f"use two numbers from {low:g} to {high:g} {unit}, the lower first".rstrip()
            raise UsageError(f"--bounds {name}={bounds[0]:g}..{bounds[1]:g} is out of range", fix=fix)
        low, high = bounds
    if not low <= value <= high or (whole and value != int(value)):
        what = f"{name} starts at {value:g}, which is {'not whole' if low <= value <= high else 'outside its bounds'}"
        kind = "a whole number" if whole else "a number"
        raise UsageError(what, fix=f"give --start {name}={kind} from {low:g} to {high:g} {unit}".rstrip())
    step = 1.0 if whole else max(abs(typical), abs(value)) or (high - low) / 1000.0
    scales = low > 0.0 or name.rpartition(".")[2] in _FACTORS
    return FitParameter(name, unit, low, high, value, whole, not whole and scales and value > 0.0, step)


def value_of(model: Model, name: str) -> float:
    """What the model has for a parameter."""
    kind, *where = _parts(model, name)
    if kind == "sensor":
        return float(getattr(model.sensor, where[0]))
    if kind == _PROGRAM:
        return float(_settings(model)[where[0]])
    if kind == "materials":
        return float(getattr(model.materials[int(where[0])], where[1]))
    return float(getattr(_own(model, where[0]), where[1]))


def with_values(model: Model, values: Mapping[str, float]) -> Model:
    """The model with other numbers; `UsageError` where no sensor has such numbers."""
    sensor, materials, effects = dict[str, float](), dict(model.materials), list(model.effects)
    changed: dict[str, dict[str, Any]] = {}
    settings = dict(_settings(model))
    for name, value in values.items():
        kind, *where = _parts(model, name)
        if kind == "sensor":
            sensor[where[0]] = int(value) if model.sensor.numbers()[where[0]].whole else value
        elif kind == _PROGRAM:
            settings[where[0]] = float(value)
        elif kind == "materials":
            entry = {where[1]: value}
            materials[int(where[0])] = dataclasses.replace(materials[int(where[0])], **entry)  # type: ignore[arg-type]
        else:
            changed.setdefault(where[0], {})[where[1]] = value
    for i, effect in enumerate(effects):
        if effect.name in changed:
            whole = {p.name for p in effect.parameters() if p.whole}
            numbers = {k: int(v) if k in whole else v for k, v in changed[effect.name].items()}
            effects[i] = dataclasses.replace(effect, **numbers)
    moved = dataclasses.replace(model, materials=materials, effects=tuple(effects))
    if isinstance(moved.sensor, Program):
        moved = dataclasses.replace(moved, sensor=dataclasses.replace(moved.sensor, settings=settings))
    return moved.with_sensor(**sensor) if sensor else moved


def added_effects(model: Model, names: Iterable[str]) -> tuple[Model, dict[str, str]]:
    """The model with every effect that a name belongs to, and what was added, in words by the effect's name.

    An added effect has its typical values, and 0 for every number that may be of either sign.
    """
    there = {effect.name for effect in model.effects}
    added: dict[str, str] = {}
    for name in names:
        parts = name.split(".")
        if parts[0] != "effects" or len(parts) != 3 or parts[1] in there:
            continue
        effect = find(parts[1])
        _check_parameter(effect, parts[2])
        zeros = {p.name: 0.0 for p in effect.parameters() if p.low < 0.0 < p.high and not p.whole}
        made = make(effect.name, zeros)
        model = model.with_(made)
        there.add(effect.name)
        settings = ", ".join(f"{key} = {value}" for key, value in made.settings().items())
        added[effect.name] = f"{effect.name} is not in the model and is added with {settings}"
    return model, added


def free_names(model: Model, names: Sequence[str], fixed: Iterable[str]) -> list[str]:
    """The free names, those of all materials spelled out, less what is fixed."""
    wanted: list[str] = []
    for name in names:
        parts = name.split(".")
        if len(parts) == 3 and parts[:2] == ["materials", "*"]:
            numbers = [i for i, m in sorted(model.materials.items()) if parts[2] != "retro_gain" or m.kind == "retro"]
            wanted += [f"materials.{number}.{parts[2]}" for number in numbers]
        else:
            wanted.append(name)
    left_out = {canonical(model, name) for name in fixed}
    return [name for name in dict.fromkeys(canonical(model, name) for name in wanted) if name not in left_out]


def with_fixed(model: Model, values: Mapping[str, float]) -> Model:
    """The model with parameters held at values; `UsageError` for what may not be."""
    for name, value in values.items():
        low, high, whole, unit, _ = _facts(model, canonical(model, name))
        if not low <= value <= high or (whole and value != int(value)):
            kind = "a whole number" if whole else "a number"
            fix = f"use {kind} from {low:g} to {high:g} {unit}".rstrip()
            raise UsageError(
                f"--fix {name}={value:g} is {'not whole' if low <= value <= high else 'out of range'}", fix=fix
            )
    return with_values(model, {canonical(model, name): value for name, value in values.items()})


def canonical(model: Model, name: str) -> str:
    """One spelling for a parameter: `sensor.threshold` is `threshold`, a material goes by its number."""
    kind, *where = _parts(model, name)
    return where[0] if kind == "sensor" else ".".join((kind, *where))


def _parts(model: Model, name: str) -> tuple[str, ...]:
    """("sensor", key), ("external", name), ("materials", number, key) or ("effects", name, key); `UsageError` for
    anything else."""
    parts = name.split(".")
    if parts[0] == _PROGRAM and ".".join(parts[1:]) in _settings(model):
        return _PROGRAM, ".".join(parts[1:])
    if parts[0] == "sensor" and len(parts) == 2:
        parts = parts[1:]
    if len(parts) == 1 and parts[0] in sensor_names(model.sensor):
        return "sensor", parts[0]
    if len(parts) >= 3 and parts[0] == "materials" and parts[-1] in _MATERIAL_BOUNDS:
        number = _material(model, ".".join(parts[1:-1]), name)
        if parts[-1] == "retro_gain" and model.materials[number].kind != "retro":
            what = f"{name}: material {number} is lambertian and has no retro_gain"
            raise UsageError(what, fix=f"free materials.{number}.reflectance")
        return "materials", str(number), parts[-1]
    if len(parts) == 3 and parts[0] == "effects":
        _check_parameter(find(parts[1]), parts[2])
        return "effects", parts[1], parts[2]
    raise _unknown(model, name)


def _unknown(model: Model, name: str) -> UsageError:
    near = difflib.get_close_matches(name, known_names(model), n=1, cutoff=0.6)
    own = ", ".join(sensor_names(model.sensor))
    own = f"a number of the sensor ({own})" if own else f"{_PROGRAM}.NAME of [external.parameters]"
    shapes = f"{own}, materials.ID.reflectance or effects.NAME.PARAMETER"
    return UsageError(f"there is no parameter {name!r}", fix=f"did you mean {near[0]}?" if near else f"name {shapes}")


def _material(model: Model, text: str, name: str) -> int:
    if text.isdecimal() and int(text) in model.materials:
        return int(text)
    numbers = [number for number, entry in model.materials.items() if entry.name == text]
    if len(numbers) == 1:
        return numbers[0]
    if numbers:
        fix = f"name one by its number: {', '.join(map(str, sorted(numbers)))}"
        raise UsageError(f"{name}: {len(numbers)} materials are called {text}", fix=fix)
    known = [*(str(i) for i in sorted(model.materials)), *(m.name for m in model.materials.values())]
    near = difflib.get_close_matches(text, known, n=1, cutoff=0.5)
    fix = f"did you mean {near[0]}?" if near else f"known: {', '.join(known) or 'none'}"
    raise UsageError(f"{name}: the model has no material {text!r}", fix=fix)


def _check_parameter(effect: type[Effect], key: str) -> None:
    known = [p.name for p in effect.parameters()]
    if key in known:
        return
    others = {p.name for p in effect.lists()} | {p.name for p in effect.choices()} | {p.name for p in effect.files()}
    if key in others:
        raise UsageError(f"effects.{effect.name}.{key} is no number", fix=f"what can be fitted: {', '.join(known)}")
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    fix = f"did you mean effects.{effect.name}.{near[0]}?" if near else f"it has {', '.join(known)}"
    raise UsageError(f"the effect {effect.name} has no parameter {key!r}", fix=fix)


def _facts(model: Model, name: str) -> tuple[float, float, bool, str, float]:
    """Lowest, highest, whether whole, unit and a typical size."""
    kind, *where = _parts(model, name)
    if kind == "sensor":
        bounds = model.sensor.numbers()[where[0]]
        typical = 0.0 if value_of(model, name) else abs(bounds.noticeable)
        low = _FAINTEST * value_of(model, name) if name in calibrating(model) else bounds.low
        return float(low), float(bounds.high), bounds.whole, bounds.unit, typical
    if kind == _PROGRAM:
        one = _numbers(model)[where[0]]
        return one.low, one.high, False, one.unit, 0.05 * (one.high - one.low)
    if kind == "materials":
        entry: Material = model.materials[int(where[0])]
        return (*_MATERIAL_BOUNDS[where[1]], False, "", float(getattr(entry, where[1])))
    for parameter in find(where[0]).parameters():
        if parameter.name == where[1]:
            return parameter.low, parameter.high, parameter.whole, parameter.unit, parameter.typical
    raise KeyError(name)


def _numbers(model: Model) -> dict[str, ProgramNumber]:
    """The numbers of somebody else's program that may be turned."""
    return {} if model.external is None else {one.name: one for one in model.external.parameters}


def _settings(model: Model) -> Mapping[str, float]:
    """What these stand at."""
    return model.sensor.settings if isinstance(model.sensor, Program) else {}


def _own(model: Model, effect: str) -> Effect:
    """The model's effect of that name: the first, where a model has several."""
    for own in model.effects:
        if own.name == effect:
            return own
    raise UsageError(f"the model has no effect {effect}", fix="name a parameter of an effect that it has")
