"""NVIDIA Isaac's RTX lidar: the `profile` of a JSON configuration, or the same numbers as attributes of USD.

Angles are degrees in the sensor's frame, positive to the left, times nanoseconds after the firing's start. A rotary
lidar fires its emitters at each step of the head, one state after the other; a solid-state one fires a whole state.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.config.schema import LineIndex
from lidarcheck.config.toml_lines import KeyPath
from lidarcheck.config.words import dotted
from lidarcheck.errors import InputError
from lidarcheck.formats.sensors.imported import Given, Imported, Lacking, is_whole, linear_lacks, rounded
from lidarcheck.formats.sensors.values import MOST_CHANNELS, MOST_LISTED, Values, check_degrees

__all__ = ["import_isaac", "is_isaac"]

_ATTRIBUTE = re.compile(r"omni:sensor:Core:(?:emitterState:(s\d{1,6}):)?(\w+)")
_RENAMED = {"minReflectionRangeM": "minReflectanceRange"}
_MOST_STATES = 10_000
_DETECTED = 5.5 + 1.2815515655446004
"""S in sigma that a threshold of 5.5 sigma detects with a probability of 0.9."""
_FRAMES = {"scanRateBaseHz": 1e4, "reportRateBaseHz": 1e9, "patternFiringRateHz": 1e9}
_State = dict[str, list[float]]
_CORRECTIONS = {"vertOffsetM": "height_m", "horOffsetM": "side_m"}


def is_isaac(data: Any) -> bool:
    """Whether JSON is a configuration of an RTX lidar."""
    if not isinstance(data, dict):
        return False
    profile = data.get("profile")
    if isinstance(profile, dict):
        return any(key in profile for key in ("emitterStates", "scanType", "scanRateBaseHz"))
    return any(isinstance(key, str) and key.startswith("omni:sensor:Core:") for key in data)


def _as_profile(values: Values) -> Values:
    """The profile that attributes of USD stand for, names and lists as in JSON, with the attributes' lines."""
    profile: dict[str, Any] = {}
    lines: dict[KeyPath, int] = {}
    found = {name: match for name in values.data if (match := _ATTRIBUTE.fullmatch(name))}
    states = sorted({match[1] for match in found.values() if match[1]})
    if states:
        profile["emitterStates"] = [{} for _ in states]
    for name, match in found.items():
        own = _RENAMED.get(match[2], match[2])
        path: KeyPath = ("profile", own)
        if match[1]:
            at = states.index(match[1])
            path = ("profile", "emitterStates", at, own)
            profile["emitterStates"][at][own] = values.data[name]
        else:
            profile[own] = values.data[name]
        lines[path] = values.lines.line((name,))
    data = {"name": values.find("name"), "profile": profile}
    return Values(data, LineIndex(values.lines.file, lines), as_text=True)


def import_isaac(values: Values, given: Given) -> Imported:
    """The sensor of a profile; `InputError` where a state's lists are missing or of different lengths."""
    if not isinstance(values.find("profile"), dict):
        values = _as_profile(values)
    states = _states(values)
    scan = "".join(c for c in (values.text("profile", "scanType") or "").lower() if c.isalpha())
    if scan not in ("rotary", "solidstate"):
        raise values.fault(("profile", "scanType"), "scanType is neither rotary nor solidState", "write one of them")
    rate_hz = _positive(values, "scanRateBaseHz")
    document: dict[str, Any] = {
        "name": values.text("name") or "Isaac RTX lidar",
        "source": [
            f"{values.lines.file.name}: Isaac RTX lidar profile",
            "azimuth taken positive to the left: unverified",
        ],
        "detector": "linear",
        "frame_rate_hz": rate_hz,
    }
    lacking, remarks = _numbers(values, document)
    table: dict[str, Sequence[float]] = {}
    if scan == "solidstate":
        document["sweep"] = {"order": "table"}
        document["beams"] = {"kind": "table"}
        table = _solid(values, states, remarks)
    else:
        direction = _direction(values, remarks)
        document["sweep"] = {"direction": direction}
        per_turn = _positive(values, "reportRateBaseHz", "patternFiringRateHz") / rate_hz
        document["beams"], table = _rotary(values, states, per_turn, direction, rate_hz, remarks)
        if table:
            document["sweep"] = {"order": "table"}
    for key in ("azimuthErrorStd", "elevationErrorStd"):
        scatter = values.maybe("profile", key, low=0)
        if scatter:
            remarks.append(f"{key} = {scatter:g} deg is of the model, not of the sensor: vibration, or boresight.")
    return Imported(document, lacking, tuple(remarks), table)


def _positive(values: Values, *keys: str) -> float:
    path = values.first(*(("profile", key) for key in keys))
    return values.number(*path, low=1e-3, high=_FRAMES[str(path[-1])])


def _states(values: Values) -> list[_State]:
    """The states' lists; azimuth and elevation are needed, the others 0 where they are absent."""
    rows = values.entries("profile", "emitterStates", most=_MOST_STATES)
    if not rows:
        raise values.fault(("profile", "emitterStates"), "emitterStates is empty: no beam is described")
    count = values.maybe("profile", "numberOfEmitters", low=1, high=MOST_LISTED)
    states = []
    for index, row in enumerate(rows):
        at: tuple[str | int, ...] = ("profile", "emitterStates", index)
        if not isinstance(row, dict):
            raise values.fault(at, f"{dotted(at)} is no table of a state")
        azimuth = values.numbers(*at, "azimuthDeg", count=None if count is None else int(count))
        state = {"azimuthDeg": azimuth, "elevationDeg": values.numbers(*at, "elevationDeg", count=len(azimuth))}
        for key in ("fireTimeNs", "channelId", *_CORRECTIONS, "distanceCorrectionM"):
            if values.find(*at, key) is not None:
                state[key] = values.numbers(*at, key, count=len(azimuth))

        def fault(what: str, fix: str, at: tuple[str | int, ...] = at) -> InputError:
            return values.fault(at, f"{dotted(at)}: {what}", fix)

        if not azimuth:
            raise fault("the state has no emitters", "describe one at least")
        check_degrees(state["elevationDeg"], "elevationDeg", fault)
        if max(map(abs, azimuth)) > 360.0:
            raise fault("azimuthDeg is beyond 360", "use degrees")
        states.append(state)
    return states


def _numbers(values: Values, document: dict[str, Any]) -> tuple[tuple[Lacking, ...], list[str]]:
    """Range, returns and the detector."""
    ends = {"min_m": "nearRangeM", "max_m": "farRangeM", "step_m": "rangeResolutionM"}
    given = {own: values.maybe("profile", key, low=0, high=1e5) for own, key in ends.items()}
    between = values.maybe("profile", "minDistBetweenEchos", low=0, high=1e4)
    document["range"] = {own: value for own, value in given.items() if value is not None}
    if between is not None:
        document["range"]["min_separation_m"] = between
    returns = values.maybe("profile", "maxReturns", low=1, high=16)
    if returns:
        document["returns"] = int(returns)
    linear: dict[str, Any] = {}
    for own, key in (("range_floor_m", "rangeAccuracyM"), ("pulse_fwhm_ns", "pulseTimeNs")):
        value = values.maybe("profile", key, low=0, high=1e4)
        if value:
            linear[own] = value
    share = values.maybe("profile", "minReflectance", low=1e-6, high=100)
    far_m = values.maybe("profile", "minReflectanceRange", low=1e-3, high=1e5)
    lacking = linear_lacks(min_m="min_m" not in document["range"], max_m="max_m" not in document["range"])
    remarks: list[str] = []
    if share and far_m:
        linear["signal_at_1m"] = float(f"{_DETECTED * far_m**2 / share:.6g}")
        remarks.append(f"signal_at_1m: {far_m:g} m at a reflectance of {share:g}, taken for a probability of 0.9.")
        lacking = lacking[:-1]
    document["linear"] = linear
    look_up = "the law of its intensity: intensityProcessing and intensityMappingType"
    example = {"law": "range_corrected", "max": 255, "aliases": ["intensity"]}
    return (*lacking, Lacking("features.INTENSITY", example, look_up)), remarks


def _direction(values: Values, remarks: list[str]) -> str:
    text = (values.text("profile", "rotationDirection") or "").upper()
    if text not in ("CW", "CCW", ""):
        raise values.fault(("profile", "rotationDirection"), "rotationDirection is neither CW nor CCW")
    if not text:
        remarks.append("The file has no rotationDirection; CW, the vendor's default, is taken.")
    return "left" if text == "CCW" else "right"


def _rotary(
    values: Values, states: list[_State], per_turn: float, direction: str, rate_hz: float, remarks: list[str]
) -> tuple[dict[str, Any], dict[str, Sequence[float]]]:  # fmt: skip
    """Channels where there is one state, a table of a turn where there are several."""
    first = values.maybe("profile", "startAzimuthDeg", low=-360, high=360) or 0.0
    sense = 1.0 if direction == "left" else -1.0
    if any(any(state.get("distanceCorrectionM", ())) for state in states):
        remarks.append("distanceCorrectionM is in the ranges already: no range_offset_m.")
    if len(states) > 1:
        return {"kind": "table"}, _turn(values, states, per_turn, first, sense, rate_hz)
    (state,) = states
    if len(state["elevationDeg"]) > MOST_CHANNELS:
        raise values.fault(
            ("profile", "emitterStates", 0), f"more than {MOST_CHANNELS} emitters turn", "is it solidState?"
        )
    order = _order(values, state)
    beams: dict[str, Any] = {
        "kind": "channels",
        "elevation_deg": [state["elevationDeg"][at] for at in order],
        "azimuth_offset_deg": [state["azimuthDeg"][at] for at in order],
    }
    if any(state.get("fireTimeNs", ())):
        beams["fire_time_us"] = [rounded(state["fireTimeNs"][at] * 1e-3, "us") for at in order]
    for key, own in _CORRECTIONS.items():
        if any(state.get(key, ())):
            beams[own] = [state[key][at] for at in order]
    if is_whole(per_turn) and per_turn >= 1:
        beams["columns"] = round(per_turn)
    else:
        beams |= {"azimuth_step_deg": rounded(360.0 / per_turn, "deg"), "columns_repeat": False}
    return beams | {"azimuth_deg": {"first": first, "last": first + sense * 360.0}}, {}


def _order(values: Values, state: _State) -> list[int]:
    """Emitters in the order of their channels; as they stand where the file numbers none."""
    ids = state.get("channelId")
    if ids is None:
        return list(range(len(state["elevationDeg"])))
    if len(set(ids)) < len(ids):
        raise values.fault(
            ("profile", "emitterStates", 0), "channelId names a channel twice", "number each emitter once"
        )
    return sorted(range(len(ids)), key=lambda at: ids[at])


def _turn(
    values: Values, states: list[_State], per_turn: float, first: float, sense: float, rate_hz: float
) -> dict[str, Sequence[float]]:  # fmt: skip
    """Each firing of a turn: state k of n at the firings k, k + n, ...; layer = emitter, point = firing."""
    firings, emitters = round(per_turn), len(states[0]["elevationDeg"])
    if not is_whole(per_turn) or firings < 1 or firings % len(states):
        what = f"{per_turn:g} firings a turn are no whole rounds of {len(states)} states"
        raise values.fault(("profile", "emitterStates"), what, "correct the rates")
    if any(len(state["elevationDeg"]) != emitters for state in states):
        raise values.fault(("profile", "emitterStates"), "states of a rotary lidar have different numbers of emitters")
    _check_count(values, firings * emitters)
    firing, emitter = np.arange(firings), np.arange(emitters)
    turned_deg = first + sense * firing * 360.0 / firings
    return _table(
        states,
        firing % len(states),
        np.broadcast_to(emitter, (firings, emitters)),
        np.broadcast_to(firing[:, None], (firings, emitters)),
        turned_deg,
        firing / firings / rate_hz,
    )


_ORIGIN = ("origin_x_m", "origin_y_m", "origin_z_m")


def _check_count(values: Values, beams: int) -> None:
    if beams > MOST_LISTED:
        raise values.fault(("profile", "emitterStates"), f"{beams} beams, a table has at most {MOST_LISTED}")


def _table(
    states: Sequence[_State], which: npt.ArrayLike, layers: npt.ArrayLike, points: npt.ArrayLike,
    turned_deg: FloatArray, start_s: FloatArray,
) -> dict[str, Sequence[float]]:  # fmt: skip
    """A row an emitter of each firing: its state `which`, and where the head looks and when; (firings, emitters)."""
    count = len(states[0]["elevationDeg"])
    zeros = [0.0] * count
    keys = ("elevationDeg", "azimuthDeg", "fireTimeNs", "horOffsetM", "vertOffsetM")
    elevation, azimuth, time_ns, left, up = (
        np.array([state.get(key, zeros) for state in states])[np.asarray(which, np.int64)] for key in keys
    )
    sin, cos = (function(np.radians(turned_deg))[:, None] for function in (np.sin, np.cos))
    origin = (-left * sin, left * cos, up)
    columns = {
        "elevation_deg": elevation,
        "azimuth_deg": np.round(turned_deg[:, None] + azimuth, 10),
        "time_s": np.round(start_s[:, None] + time_ns * 1e-9, 12),
        **(dict(zip(_ORIGIN, np.round(origin, 12), strict=True)) if left.any() or up.any() else {}),
    }
    whole = {"Layer": np.asarray(layers), "Point": np.asarray(points)}
    return {name: (column + 0).ravel().tolist() for name, column in (whole | columns).items()}


def _solid(values: Values, states: list[_State], remarks: list[str]) -> dict[str, Sequence[float]]:
    """Each state's emitters, in lines where the file counts its rays a line."""
    if len(states) > 1:
        remarks.append(f"A frame fires one of {len(states)} states; the table holds all of them, one after the other.")
    _check_count(values, sum(len(state["elevationDeg"]) for state in states))
    done: dict[int, int] = {}
    parts = []
    for state in states:
        count = len(state["elevationDeg"])
        lines = [count]
        if values.find("profile", "numRaysPerLine") is not None:
            lines = [int(n) for n in values.numbers("profile", "numRaysPerLine")]
        if sum(lines) != count or min(lines) < 1:
            what = f"numRaysPerLine says {sum(lines)} rays, the state has {count}"
            raise values.fault(("profile", "numRaysPerLine"), what)
        layers = np.repeat(np.arange(len(lines)), lines)
        points = np.concatenate([done.get(layer, 0) + np.arange(n) for layer, n in enumerate(lines)])
        done |= {layer: done.get(layer, 0) + n for layer, n in enumerate(lines)}
        parts.append(_table([state], [0], layers, points, np.zeros(1), np.zeros(1)))
    moved = {name for part in parts for name in part if name in _ORIGIN}
    names = [*parts[0]] + [name for name in _ORIGIN if name in moved and name not in parts[0]]
    return {name: [value for part in parts for value in part.get(name, [0.0] * len(part["Layer"]))] for name in names}
