"""The keys of a sensor file, with their types and ranges; docs/sensors.md says what they mean."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, create_model, model_validator

from lidarcheck.config.schema import Config
from lidarcheck.sensor.bounds import Bounds
from lidarcheck.sensor.linear import Linear
from lidarcheck.sensor.photon_histogram import PhotonHistogram
from lidarcheck.sensor.sensor import RANGE_KEYS, Keep, Sensor
from lidarcheck.sensor.spad_array import SpadArray

__all__ = ["DETECTORS", "BeamsTable", "FeatureTable", "SensorTable", "overrides_table", "program_overrides"]

DETECTORS: dict[str, type[Sensor]] = {kind.detector: kind for kind in (SpadArray, Linear, PhotonHistogram)}

_Angle = Annotated[float, Field(ge=-720.0, le=720.0, json_schema_extra={"unit": "deg"})]
_Elevation = Annotated[float, Field(ge=-90.0, le=90.0, json_schema_extra={"unit": "deg"})]
_Length = Annotated[float, Field(ge=-10.0, le=10.0, json_schema_extra={"unit": "m"})]
_Time = Annotated[float, Field(ge=-1e6, le=1e6, json_schema_extra={"unit": "us"})]
_Count = Annotated[int, Field(ge=1, le=10_000_000)]
_Width = Annotated[float, Field(ge=0.0, le=360.0, json_schema_extra={"unit": "deg"})]


class _Steps(Config):
    first: _Angle
    step: _Angle

    @model_validator(mode="after")
    def _moves(self) -> _Steps:
        if self.step == 0.0:
            raise ValueError("step is 0; give the angle from one index to the next, which may be negative")
        return self


class _Turn(Config):
    first: _Angle = 0.0
    last: _Angle | None = None


class _Footprint(Config):
    horizontal: _Width = 0.0
    vertical: _Width = 0.0


class _SubRays(Config):
    horizontal: Annotated[int, Field(ge=1, le=1000)] = 3
    vertical: Annotated[int, Field(ge=1, le=1000)] = 3


class BeamsTable(Config):
    """`[beams]`: keys that belong to one kind only are refused with another."""

    kind: Literal["grid", "channels", "table"]
    layers: _Count | None = None
    points: _Count | None = None
    elevation_deg: _Steps | tuple[_Elevation, ...] | None = None
    azimuth_deg: _Steps | _Turn | None = None
    azimuth_offset_deg: _Angle | tuple[_Angle, ...] | None = None
    origin_m: _Length | tuple[_Length, ...] | None = None
    side_m: _Length | tuple[_Length, ...] | None = None
    height_m: _Length | tuple[_Length, ...] | None = None
    range_offset_m: _Length | tuple[_Length, ...] | None = None
    fire_time_us: _Time | tuple[_Time, ...] | None = None
    ring: tuple[int, ...] | None = None
    column_shift: int | tuple[int, ...] | None = None
    columns: _Count | None = None
    azimuth_step_deg: Annotated[float, Field(gt=0.0, le=360.0, json_schema_extra={"unit": "deg"})] | None = None
    columns_repeat: bool | None = None
    file: str | None = None
    direction: Literal["table", "from_scan"] | None = None
    footprint_deg: _Footprint = _Footprint()
    footprint: Literal["gaussian", "box"] = "gaussian"
    sub_rays: _SubRays = _SubRays()


class SweepTable(Config):
    """`[sweep]`."""

    order: Literal["columns", "layers", "table", "flash"] = "columns"
    duration_s: Annotated[float, Field(gt=0.0, le=1000.0, json_schema_extra={"unit": "s"})] | None = None
    direction: Literal["left", "right"] = "left"
    common_receiver: bool | None = None
    fire_time_in_azimuth: bool = True


class FeatureTable(Config):
    """`[features.NAME]`; the law's own numbers are checked against the law."""

    law: str
    unit: str = ""
    step: Annotated[float, Field(ge=0.0, le=1e12)] | None = None
    min: float | None = None
    max: float | None = None
    bits: Annotated[int, Field(ge=1, le=52)] | None = None
    log: bool = False
    aliases: tuple[str, ...] = ()
    gain: float | None = None
    offset: float | None = None
    knee: Annotated[float, Field(gt=0.0, le=1e9)] | None = None
    above: Literal["log", "linear", "clip"] | None = None
    top_percent: Annotated[float, Field(gt=100.0, le=1e9, json_schema_extra={"unit": "%"})] | None = None
    per_m: Annotated[float, Field(ge=0.0, le=1000.0, json_schema_extra={"unit": "1/m"})] | None = None
    snr_full: Annotated[float, Field(gt=0.0, le=1e9)] | None = None
    file: str | None = None


def _field(bounds: Bounds) -> Any:
    kind = int if bounds.whole else float
    number = Field(ge=kind(bounds.low), le=kind(bounds.high), json_schema_extra={"unit": bounds.unit})
    return (Annotated[kind, number] | None, None)


_SHARED = ("signal_at_1m", "pulse_fwhm_ns")
"""Numbers of every sensor that stand in the detector's table."""
_WORDS: dict[str, dict[str, Any]] = {
    SpadArray.detector: {
        "rows": (Annotated[int, Field(ge=1, le=1000)] | None, None),
        "columns": (Annotated[int, Field(ge=1, le=1000)] | None, None),
    },
    Linear.detector: {"range_law": (Literal["physical", "power", "distance"] | None, None)},
    PhotonHistogram.detector: {
        "readout": (Literal["first", "all"] | None, None),
        "pulse_file": (str | None, None),
        "coates": (bool | None, None),
    },
}
_GATE_OF_SPADS = ("max_range_m", "max_echoes", "range_resolution_m")
"""Bounds of a SPAD array that are tighter than all sensors', of numbers that stand elsewhere in the file."""


def _detector_fields(kind: type[Sensor]) -> dict[str, Any]:
    numbers = kind.numbers()
    names = [*_SHARED, *(name for name in kind.bounds if name not in (*_SHARED, *_GATE_OF_SPADS))]
    return {**{name: _field(numbers[name]) for name in names}, **_WORDS[kind.detector]}


_DETECTOR_TABLES = {
    name: create_model(f"_{kind.__name__}Table", __base__=Config, **_detector_fields(kind))
    for name, kind in DETECTORS.items()
}
_RangeTable: Any = create_model(
    "_RangeTable", __base__=Config, **{key: _field(Sensor.numbers()[name]) for key, name in RANGE_KEYS.items()}
)


class _Own(Config):
    format: Literal[1] = 1
    name: str
    source: str | tuple[str, ...] = ()
    detector: Literal["spad_array", "linear", "photon_histogram"]
    frame_rate_hz: Annotated[float, Field(ge=0.001, le=10_000.0, json_schema_extra={"unit": "Hz"})] | None = None
    returns: Annotated[int, Field(ge=1, le=16)] = 1
    keep: Keep = "strongest"
    strength: str = ""
    return_order: Literal["range", "as_kept"] = "range"
    duplicate_return: Literal["drop", "repeat"] = "drop"
    handedness: Literal["right", "left"] = "right"
    time_unit: Literal["auto", "s", "ms", "us", "ns"] = "auto"
    time_zero: Literal["auto", "first", "last", "epoch"] = "auto"
    deskewed: bool = False
    beams: BeamsTable
    sweep: SweepTable = SweepTable()
    range: _RangeTable = _RangeTable()
    features: dict[str, FeatureTable] = Field(default_factory=dict)
    materials: dict[str, Any] = Field(default_factory=dict)


_tables: dict[str, Any] = {name: (table | None, None) for name, table in _DETECTOR_TABLES.items()}
SensorTable: Any = create_model("SensorTable", __base__=_Own, **_tables)
"""A whole sensor file."""


class _FlatOverrides(Config):
    """What a model's `[sensor]` may hold besides the detector's numbers."""

    frame_rate_hz: Annotated[float, Field(ge=0.001, le=10_000.0, json_schema_extra={"unit": "Hz"})] | None = None
    returns: Annotated[int, Field(ge=1, le=16)] | None = None
    keep: Keep | None = None
    strength: str | None = None
    return_order: Literal["range", "as_kept"] | None = None
    duplicate_return: Literal["drop", "repeat"] | None = None
    range: _RangeTable = _RangeTable()
    beams: dict[str, Any] = Field(default_factory=dict)
    sweep: dict[str, Any] = Field(default_factory=dict)
    features: dict[str, Any] = Field(default_factory=dict)


def _overrides_table(kind: type[Sensor]) -> Any:
    numbers = kind.numbers()
    flat = {name: _field(numbers[name]) for name in numbers if name not in ("frame_rate_hz",)}
    return create_model("_SensorOverrides", __base__=_FlatOverrides, **flat, **_WORDS[kind.detector])


_OVERRIDES = {name: _overrides_table(kind) for name, kind in DETECTORS.items()}


def overrides_table(kind: type[Sensor]) -> Any:
    """The keys of a model's `[sensor]`, for one kind of detector: flat numbers, the sensor's words, and its tables."""
    return _OVERRIDES[kind.detector]


_OF_PROGRAM = create_model(
    "_ProgramOverrides",
    __base__=_FlatOverrides,
    **{name: _field(Sensor.numbers()[name]) for name in (*RANGE_KEYS.values(), "max_echoes")},
)


def program_overrides() -> Any:
    """The keys of a model's `[sensor]` beside somebody else's program: none of the detector's."""
    return _OF_PROGRAM
