"""The three tables that carry everything: what each beam meets, the light that comes back, the echoes.

Each is a frozen bundle of equally long numpy columns. The columns are made read-only, so that a stage that wants other
values must build a new table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lidarcheck.errors import UsageError
from lidarcheck.sensor import LAYERS, POINTS, beam_directions, layer_of, point_of

__all__ = ["IdealScan", "Light", "Scan", "beams_of"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
_Rows = TypeVar("_Rows", "IdealScan", "Scan")


def _freeze(table: Any, dtypes: Mapping[str, Any], length: int) -> None:
    """Cast the named columns, check their length and make them read-only."""
    for name, dtype in dtypes.items():
        value = getattr(table, name)
        if value is None:
            continue
        column = np.ascontiguousarray(value, dtype=dtype)
        if np.issubdtype(dtype, np.integer) and np.asarray(value).dtype.kind == "f" and np.any(column != value):
            raise UsageError(
                f"column {name} holds a number that is not whole", fix="round it yourself, if that is meant"
            )
        if column.shape != (length,):
            raise UsageError(f"column {name} has shape {column.shape}, the table has {length} rows")
        if column is value and column.flags.writeable:
            column = column.view()
        column.flags.writeable = False
        object.__setattr__(table, name, column)


def _freeze_extra(table: Any, length: int) -> None:
    frozen = {}
    for name, value in table.extra.items():
        column = np.asarray(value).view()
        if column.shape != (length,):
            raise UsageError(f"column {name} has shape {column.shape}, the table has {length} rows")
        column.flags.writeable = False
        frozen[name] = column
    object.__setattr__(table, "extra", frozen)


@dataclass(frozen=True)
class IdealScan:
    """What each fired beam meets, a row each; several rows of one (layer, point) are sub-beams of equal weight.

    `distance_m` 0: nothing within range. `incidence_deg`: angle between beam and surface normal. `time_s`: from the
    frame's start. `extra`: unknown columns, kept. `file`: where it was read from, for messages. All
    columns have shape (n,).
    """

    layer: IntArray
    point: IntArray
    distance_m: FloatArray
    material_id: IntArray
    incidence_deg: FloatArray
    object_id: IntArray | None = None
    time_s: FloatArray | None = None
    extra: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    defaulted: tuple[str, ...] = ()
    file: str = ""

    def __post_init__(self) -> None:
        n = len(self.layer)
        ints = dict.fromkeys(("layer", "point", "material_id", "object_id"), np.int32)
        floats = dict.fromkeys(("distance_m", "incidence_deg", "time_s"), np.float64)
        _freeze(self, {**ints, **floats}, n)
        _freeze_extra(self, n)

    def __len__(self) -> int:
        return len(self.layer)

    def take(self, rows: npt.NDArray[Any]) -> IdealScan:
        """The rows picked by a mask or by indices."""
        return _take(self, rows)


@dataclass(frozen=True)
class Light:
    """The light that reaches each beam: any number of pulses, and a background.

    Beam i has the pulses `first_pulse[i]` ... `first_pulse[i + 1] - 1`. `pulse_range_m` is half the light's way;
    `pulse_signal` is S, the primary avalanches per SPAD and shot that one always-armed SPAD would see on average.
    `background_per_ns` is the beam's background rate.
    Shapes: (n_beams,), (n_beams + 1,) for `first_pulse`, (n_pulses,).
    """

    layer: IntArray
    point: IntArray
    background_per_ns: FloatArray
    first_pulse: npt.NDArray[np.int64]
    pulse_range_m: FloatArray
    pulse_signal: FloatArray

    def __post_init__(self) -> None:
        n = len(self.layer)
        _freeze(self, {"layer": np.int32, "point": np.int32, "background_per_ns": np.float64}, n)
        _freeze(self, {"first_pulse": np.int64}, n + 1)
        if self.first_pulse[0] != 0 or np.any(np.diff(self.first_pulse) < 0):
            raise UsageError("first_pulse must begin with 0 and not decrease")
        pulses = int(self.first_pulse[-1])
        _freeze(self, {"pulse_range_m": np.float64, "pulse_signal": np.float64}, pulses)

    def __len__(self) -> int:
        return len(self.layer)


@dataclass(frozen=True)
class Scan:
    """Echoes, a row each. Columns of shape (n,).

    `echo_number` counts the echoes of a beam from 1, in order of range. `width_ns`, `area` and `peak` are the echo's
    features; `extra` holds the columns that lidarcheck does not know, kept as they were read; `defaulted` names the
    standard columns (`WIDTH`, `Layer`, ...) that the source did not have, whose values here are defaults.
    """

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    layer: IntArray
    point: IntArray
    echo_number: IntArray
    width_ns: FloatArray
    area: FloatArray
    peak: FloatArray
    extra: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    defaulted: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.x_m)
        floats = dict.fromkeys(("x_m", "y_m", "z_m", "width_ns", "area", "peak"), np.float64)
        ints = dict.fromkeys(("layer", "point", "echo_number"), np.int32)
        _freeze(self, {**floats, **ints}, n)
        _freeze_extra(self, n)

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def range_m(self) -> FloatArray:
        """Distance of each echo from the sensor, shape (n,)."""
        return np.sqrt(self.x_m**2 + self.y_m**2 + self.z_m**2)

    def take(self, rows: npt.NDArray[Any]) -> Scan:
        """The rows picked by a mask or by indices."""
        return _take(self, rows)

    @classmethod
    def from_beams(
        cls,
        layer: IntArray,
        point: IntArray,
        range_m: FloatArray,
        *,
        echo_number: IntArray | None = None,
        width_ns: FloatArray | None = None,
        area: FloatArray | None = None,
        peak: FloatArray | None = None,
    ) -> Scan:
        """Echoes at `range_m` along their beams' directions."""
        xyz = beam_directions(layer, point) * np.asarray(range_m, dtype=np.float64)[:, None]
        n = len(range_m)
        given = {"EchoNumber": echo_number, "WIDTH": width_ns, "AREA": area, "PEAK": peak}
        zeros = np.zeros(n)
        return cls(
            x_m=xyz[:, 0],
            y_m=xyz[:, 1],
            z_m=xyz[:, 2],
            layer=layer,
            point=point,
            echo_number=np.ones(n, dtype=np.int32) if echo_number is None else echo_number,
            width_ns=zeros if width_ns is None else width_ns,
            area=zeros if area is None else area,
            peak=zeros if peak is None else peak,
            defaulted=tuple(name for name, column in given.items() if column is None),
        )


def _take(table: _Rows, rows: npt.NDArray[Any]) -> _Rows:
    """A table of the same kind with those rows."""
    parts: dict[str, Any] = {}
    for f in fields(table):
        value = getattr(table, f.name)
        if f.name == "extra":
            parts[f.name] = {name: column[rows] for name, column in value.items()}
        elif value is None or isinstance(value, str | tuple):
            parts[f.name] = value
        else:
            parts[f.name] = value[rows]
    return type(table)(**parts)


def beams_of(x_m: FloatArray, y_m: FloatArray, z_m: FloatArray) -> tuple[IntArray, IntArray]:
    """Nearest (layer, point) of positions; -1 where the position lies outside the sensor's field of view."""
    azimuth = np.rad2deg(np.arctan2(y_m, x_m))
    elevation = np.rad2deg(np.arctan2(z_m, np.hypot(x_m, y_m)))
    layer, point = layer_of(elevation), point_of(azimuth)
    outside = (layer < 0) | (layer >= LAYERS) | (point < 0) | (point >= POINTS)
    return np.where(outside, -1, layer).astype(np.int32), np.where(outside, -1, point).astype(np.int32)
