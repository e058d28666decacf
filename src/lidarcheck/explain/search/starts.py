"""Where the search for each effect begins, and which of its parameters are free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import Effect, find, make

__all__ = ["FreeParameter", "Probe", "fixed_probes", "free_of"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """A parameter that a fit may move: on a logarithmic scale, or in steps of `step` in its own unit.

    `least`: below it the effect would be no more what its name says.
    """

    name: str
    step: float
    log: bool = False
    whole: bool = False
    least: float = -float("inf")

    def encode(self, value: float) -> float:
        """The value on the fit's own scale, where one step has length 1."""
        return float(np.log(max(value, 1e-12)) / self.step if self.log else value / self.step)

    def decode(self, x: float, low: float, high: float) -> float:
        """The parameter's value, kept within its range."""
        value = float(np.exp(np.clip(x * self.step, -60.0, 60.0)) if self.log else x * self.step)
        value = min(max(value, low, self.least), high)
        return float(round(value)) if self.whole else value


@dataclass(frozen=True, slots=True)
class Probe:
    """One start of the search for an effect: its settings there, and the parameters that are free.

    `variant`: starts of one effect that differ in kind are fitted each, else the best one only. `ways`: settings of
    which one is tried after the other where the effect's plain kind ends, and the fit goes on from the best.
    """

    name: str
    settings: Mapping[str, Any]
    free: tuple[FreeParameter, ...]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    variant: str = ""
    ways: tuple[Mapping[str, Any], ...] = ()

    def plain(self) -> Probe:
        """The same start of the effect's plain kind."""
        ways = {name for way in self.ways for name in way}
        settings = {name: value for name, value in self.settings.items() if name not in ways}
        return Probe(self.name, settings, _FREE[self.name], self.fixed)

    def effect(self, x: FloatArray | None = None) -> Effect:
        """The effect at the start, or at a point of the fit's scale."""
        values = {**self.fixed, **self.settings}
        if x is not None:
            ranges = {p.name: (p.low, p.high) for p in find(self.name).parameters()}
            for one, at in zip(self.free, x, strict=True):
                values[one.name] = one.decode(float(at), *ranges[one.name])
        for low, high in _RISING.get(self.name, ()):
            values[low] = min(values[low], values.get(high, np.inf))
        whole = {p.name for p in find(self.name).parameters() if p.whole}
        return make(self.name, {k: int(v) if k in whole else v for k, v in values.items()})

    def scaled(self, factor: float) -> Probe:
        """The same start with the effect's strength scaled, as far as its parameters have a strength."""
        powers, parts = _POWERS.get(self.name, ()), _PARTS.get(self.name, ())
        settings = dict(self.settings)
        settings |= {name: settings[name] ** factor for name in powers if name in settings}
        settings |= {name: settings[name] * factor for name in parts if name in settings}
        if "gains" in settings:
            settings["gains"] = tuple(round(g**factor, 4) for g in settings["gains"])
        if self.name == "fog":
            settings["mor_m"] = min(settings["mor_m"] / max(factor, 0.02), 1e5)
        if self.name == "dead_time" and settings.get("shift_ns"):
            # It acts in whole bins: less than one is nothing, from which no slope leads away.
            settings["shift_ns"] = float(np.copysign(max(abs(settings["shift_ns"]), 1.0), settings["shift_ns"]))
        if self.name == "incidence_falloff":
            settings["exponent"] = 1.0 + (settings["exponent"] - 1.0) * factor
        return replace(self, settings=settings)

    def weaker(self, x: FloatArray, factor: float) -> Probe:
        """A start at a point of the fit's scale, with the strength there scaled."""
        there = self.effect(x).settings()
        moved = {one.name: there[one.name] for one in self.free}
        return replace(self, settings={**self.settings, **moved}).scaled(factor)

    def start(self) -> FloatArray:
        """The start on the fit's scale, shape (n_free,)."""
        typical = {p.name: p.typical for p in find(self.name).parameters()}
        values = {**typical, **self.fixed, **self.settings}
        return np.array([one.encode(float(values[one.name])) for one in self.free])


_POWERS: dict[str, tuple[str, ...]] = {
    "signal_gain": ("gain",), "material_reflectance": ("factor",), "layer_gain": ("gain",),
    "blockage": ("transmission",), "pulse_shape": ("stretch",),
}  # fmt: skip
"""Parameters that are 1 without the effect."""
_PARTS: dict[str, tuple[str, ...]] = {
    "ambient_light": ("rate_per_ns",), "dark_counts": ("rate_per_ns",), "crosstalk": ("sides", "corners"),
    "afterpulsing": ("probability",), "dead_time": ("shift_ns",), "timing_jitter": ("sigma_ns",),
    "range_offset": ("offset_m",), "range_scale": ("fraction",), "walk_error": ("per_decade_m", "bend_m"),
    "boresight": ("yaw_deg", "pitch_deg"), "beam_divergence": ("vertical_deg", "horizontal_deg"),
    "blooming_vertical": ("core_up", "core_down", "skirt_up", "skirt_down"),
    "blooming_horizontal": ("core_left", "core_right", "skirt_left", "skirt_right"),
    "retro_ghost": ("strength",), "mirror_multipath": ("reflectivity",), "rain": ("rate_mm_h",),
    "motion": ("forward_m_s", "left_m_s", "up_m_s", "yaw_deg_s", "objects"),
    "vibration": ("pitch_deg", "yaw_deg", "random_deg"), "interference": ("share",), "dropout": ("share",),
    "threshold": ("shift",),
}  # fmt: skip
"""Parameters that are 0 without the effect."""
_LOG = 0.2
_RISING: dict[str, tuple[tuple[str, str], ...]] = {"fog": (("overlap_start_m", "overlap_full_m"),)}
"""Parameters of which the first must not pass the second."""

_FREE: dict[str, tuple[FreeParameter, ...]] = {
    "signal_gain": (FreeParameter("gain", 0.05, log=True),),
    "ambient_light": (FreeParameter("rate_per_ns", _LOG, log=True), FreeParameter("sky", 0.4, log=True)),
    "dark_counts": (FreeParameter("rate_per_ns", _LOG, log=True),),
    "crosstalk": (FreeParameter("sides", 0.4, log=True), FreeParameter("corners", 0.7, log=True)),
    "afterpulsing": (FreeParameter("probability", 0.4, log=True), FreeParameter("delay_ns", 0.5, log=True)),
    "dead_time": (FreeParameter("shift_ns", 1.0), FreeParameter("spread_ns", 0.5)),
    "pulse_shape": (
        FreeParameter("stretch", 0.05, log=True),
        FreeParameter("tail_share", 0.3, log=True),
        FreeParameter("tail_ns", 0.25, log=True),
    ),
    "timing_jitter": (FreeParameter("sigma_ns", _LOG, log=True), FreeParameter("amplitude_power", 0.1)),
    "range_offset": (FreeParameter("offset_m", 0.005),),
    "range_scale": (FreeParameter("fraction", 0.0001),),
    "walk_error": (FreeParameter("per_decade_m", 0.01), FreeParameter("bend_m", 0.01)),
    "threshold": (FreeParameter("shift", 1.0),),
    "boresight": (FreeParameter("yaw_deg", 0.03), FreeParameter("pitch_deg", 0.015)),
    "beam_divergence": (FreeParameter("vertical_deg", _LOG, log=True), FreeParameter("horizontal_deg", _LOG, log=True)),
    "incidence_falloff": (FreeParameter("exponent", 0.1),),
    "material_reflectance": (FreeParameter("factor", 0.05, log=True),),
    "layer_gain": (FreeParameter("gain", 0.05, log=True),),
    "blooming_vertical": (
        FreeParameter("core_up", 0.4, log=True),
        FreeParameter("core_down", 0.4, log=True),
        FreeParameter("core_rows", _LOG, log=True),
        FreeParameter("skirt_up", 0.4, log=True),
        FreeParameter("skirt_down", 0.4, log=True),
        FreeParameter("skirt_up_rows", _LOG, log=True),
        FreeParameter("skirt_down_rows", _LOG, log=True),
    ),
    "blooming_horizontal": (
        FreeParameter("core_left", 0.4, log=True),
        FreeParameter("core_right", 0.4, log=True),
        FreeParameter("core_columns", _LOG, log=True),
        FreeParameter("skirt_left", 0.4, log=True),
        FreeParameter("skirt_right", 0.4, log=True),
        FreeParameter("skirt_left_columns", _LOG, log=True),
        FreeParameter("skirt_right_columns", _LOG, log=True),
    ),
    "retro_ghost": (
        FreeParameter("strength", _LOG, log=True),
        FreeParameter("extra_m", 0.1),
        FreeParameter("exponent", 0.3),
    ),
    "mirror_multipath": (FreeParameter("reflectivity", _LOG, log=True), FreeParameter("grazing", 0.1)),
    "fog": (
        FreeParameter("mor_m", _LOG, log=True),
        FreeParameter("backscatter", 0.3, log=True),
        FreeParameter("overlap_start_m", 0.3),
        FreeParameter("overlap_full_m", 0.3, log=True),
    ),
    "rain": (
        FreeParameter("rate_mm_h", _LOG, log=True),
        FreeParameter("drop_echo", 0.4, log=True),
        FreeParameter("drop_density", 0.4, log=True, least=0.002),
    ),
    "motion": (
        FreeParameter("forward_m_s", 1.0),
        FreeParameter("left_m_s", 1.0),
        FreeParameter("up_m_s", 0.5),
        FreeParameter("yaw_deg_s", 2.0),
    ),
    "vibration": (FreeParameter("pitch_deg", 0.3, log=True), FreeParameter("yaw_deg", 0.3, log=True)),
    "blockage": (
        FreeParameter("transmission", 0.05),
        FreeParameter("soft_edge_deg", 0.3, log=True),
        FreeParameter("roundness", 0.3),
    ),
    "interference": (
        FreeParameter("share", _LOG, log=True),
        FreeParameter("signal", 0.3, log=True),
        FreeParameter("farthest_m", _LOG, log=True),
    ),
    "dropout": (FreeParameter("share", _LOG, log=True),),
}

_STARTS: dict[str, list[dict[str, float]]] = {
    "signal_gain": [{"gain": 0.8}, {"gain": 1.25}, {"gain": 0.5}],
    "ambient_light": [{"rate_per_ns": 0.0005}, {"rate_per_ns": 0.002}],
    "dark_counts": [{"rate_per_ns": 0.0002}, {"rate_per_ns": 0.0008}],
    "crosstalk": [
        {"sides": 0.03, "corners": 0.015},
        {"sides": 0.1, "corners": 0.05},
        {"sides": 0.3, "corners": 0.12},
    ],
    "afterpulsing": [{"probability": 0.05}, {"probability": 0.15}],
    "dead_time": [
        {"shift_ns": -3.0, "spread_ns": 0.0},
        {"shift_ns": 4.0, "spread_ns": 0.0},
        {"shift_ns": 0.0, "spread_ns": 3.0},
    ],
    "pulse_shape": [
        {"stretch": 0.75, "tail_share": 0.001},
        {"stretch": 1.3, "tail_share": 0.001},
        {"stretch": 1.0, "tail_share": 0.1, "tail_ns": 8.0},
    ],
    "timing_jitter": [{"sigma_ns": 0.3}, {"sigma_ns": 1.0}],
    "range_offset": [{"offset_m": 0.04}, {"offset_m": -0.04}, {"offset_m": 0.3}, {"offset_m": -0.3}],
    "range_scale": [{"fraction": 0.001}, {"fraction": -0.001}, {"fraction": 0.006}, {"fraction": -0.006}],
    "walk_error": [
        {"per_decade_m": 0.06, "bend_m": 0.0},
        {"per_decade_m": -0.06, "bend_m": 0.0},
        {"per_decade_m": 0.0, "bend_m": 0.06},
        {"per_decade_m": 0.0, "bend_m": -0.06},
    ],
    "threshold": [{"shift": 2.0}, {"shift": -2.0}, {"shift": 6.0}],
    "boresight": [
        {"yaw_deg": y, "pitch_deg": p}
        for y, p in (
            *((y, 0.0) for y in (0.12, -0.12, 0.4, -0.4)),
            *((0.0, p) for p in (0.06, -0.06, 0.2, -0.2, 0.4, -0.4)),
            *((y * size, p * size) for size in (0.1, 0.3) for y in (1.0, -1.0) for p in (1.0, -1.0)),
        )
    ],
    "beam_divergence": [
        {"vertical_deg": 0.06, "horizontal_deg": 0.12},
        {"vertical_deg": 0.15, "horizontal_deg": 0.3},
    ],
    "incidence_falloff": [{"exponent": 0.6}, {"exponent": 1.5}, {"exponent": 2.5}],
    "blooming_vertical": [
        {"core_up": 0.0003, "core_down": 0.0003, "skirt_up": 5e-5, "skirt_down": 5e-5},
        {"core_up": 0.0003, "core_down": 0.002, "skirt_up": 5e-4, "skirt_down": 1e-4},
    ],
    "blooming_horizontal": [
        {"core_left": 1e-4, "core_right": 1e-4},
        {"core_left": 1e-3, "core_right": 1e-3, "skirt_left": 2e-5, "skirt_right": 2e-5},
    ],
    "retro_ghost": [{"strength": 3e-5}, {"strength": 1.5e-4}],
    "mirror_multipath": [{"reflectivity": 0.15}, {"reflectivity": 0.5}],
    "fog": [
        {"mor_m": 60.0, "overlap_start_m": 1.0, "overlap_full_m": 3.0},
        {"mor_m": 250.0, "overlap_start_m": 1.0, "overlap_full_m": 3.0},
        {"mor_m": 500.0, "backscatter": 0.025, "overlap_start_m": 5.0, "overlap_full_m": 15.0},
    ],
    "rain": [{"rate_mm_h": 10.0}, {"rate_mm_h": 40.0}],
    "motion": [
        {"forward_m_s": 12.0},
        {"forward_m_s": -12.0},
        {"forward_m_s": 0.0, "left_m_s": 10.0},
        {"forward_m_s": 0.0, "left_m_s": -10.0},
        {"forward_m_s": 0.0, "yaw_deg_s": 25.0},
        {"forward_m_s": 0.0, "yaw_deg_s": -25.0},
    ],
    "vibration": [
        {"pitch_deg": 0.05, "yaw_deg": 0.05, "frequency_hz": 150.0, "random_deg": 0.0},
        {"pitch_deg": 0.05, "yaw_deg": 0.05, "frequency_hz": 60.0, "random_deg": 0.0},
    ],
    "interference": [
        {"share": 0.01, "signal": 1.0},
        {"share": 0.06, "signal": 3.0},
    ],
    "dropout": [{"share": 0.01}, {"share": 0.06}],
}

_STRIPES = (
    FreeParameter("share", _LOG, log=True),
    FreeParameter("signal", 0.3, log=True),
    FreeParameter("farthest_m", _LOG, log=True),
    FreeParameter("columns", 0.4, log=True),
)
_LINES = (
    FreeParameter("share", _LOG, log=True),
    FreeParameter("signal", 0.3, log=True),
    FreeParameter("columns", 0.4, log=True),
    FreeParameter("column_span_m", 0.4, log=True),
)
_RECOVERY = (FreeParameter("shift_ns", 1.0), FreeParameter("recovery_ns", 0.3, log=True))
_TREMBLE = (FreeParameter("random_deg", _LOG, log=True),)
_WANDER = (FreeParameter("random_deg", _LOG, log=True), FreeParameter("memory_columns", 0.4, log=True))
_SUN = (
    FreeParameter("rate_per_ns", _LOG, log=True), FreeParameter("sky", 0.4, log=True), FreeParameter("direct", 0.1),
    FreeParameter("sun_azimuth_deg", 15.0), FreeParameter("sun_elevation_deg", 10.0),
)  # fmt: skip
_SECOND = (
    FreeParameter("stretch", 0.05, log=True),
    FreeParameter("tail_share", 0.3, log=True),
    FreeParameter("tail_delay_ns", 1.0),
)
_TWICE = {"stretch": 1.0, "tail_ns": 0.5, "tail_delay_ns": 9.0}
_FALL = (*_SECOND, FreeParameter("tail_ns", 0.25, log=True))
_SLOW = {"stretch": 1.0, "tail_ns": 1.0}
_LARGE = {"beam_diameter_m": 0.001, "divergence_mrad": 2.0, "drop_shape": 2.0, "drop_echo": 5.0, "drop_density": 0.1}
_FAR = {"overlap_start_m": 5.0, "overlap_full_m": 15.0}
_SMOOTH = {"backscatter": 0.046, "overlap_power": 2.0}
_THIN = {"thinning_per_m": 0.2}
_STRATA = (*_FREE["fog"], FreeParameter("thinning_per_m", 0.1))
_LEVEL = (*_FREE["incidence_falloff"], FreeParameter("level_from_deg", 4.0))
_DROPS = (*_FREE["rain"], FreeParameter("drop_shape", 0.5))
_VARIANTS: tuple[tuple[str, str, dict[str, float], tuple[FreeParameter, ...]], ...] = (
    ("vibration", "random", {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.03}, _TREMBLE),
    ("vibration", "random", {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.12}, _TREMBLE),
    ("vibration", "wander", {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.05, "memory_columns": 5.0}, _WANDER),
    ("vibration", "wander", {"pitch_deg": 0.0, "yaw_deg": 0.0, "random_deg": 0.08, "memory_columns": 25.0}, _WANDER),
    ("dead_time", "varying", {"shift_ns": 2.0, "spread_ns": 3.0}, _FREE["dead_time"]),
    ("dead_time", "varying", {"shift_ns": 1.0, "spread_ns": 1.0}, _FREE["dead_time"]),
    ("dead_time", "recovering", {"shift_ns": -2.0, "spread_ns": 0.0, "recovery_ns": 4.0}, _RECOVERY),
    ("fog", "far overlap", {"mor_m": 150.0, "backscatter": 0.046} | _FAR, _FREE["fog"]),
    ("fog", "smooth overlap", {"mor_m": 150.0, "overlap_start_m": 1.0, "overlap_full_m": 7.0} | _SMOOTH, _FREE["fog"]),
    ("fog", "smooth overlap", {"mor_m": 600.0, "overlap_start_m": 1.0, "overlap_full_m": 7.0} | _SMOOTH, _FREE["fog"]),
    ("fog", "smooth far overlap", {"mor_m": 150.0} | _FAR | _SMOOTH, _FREE["fog"]),
    ("fog", "smooth far overlap", {"mor_m": 600.0} | _FAR | _SMOOTH, _FREE["fog"]),
    ("fog", "layers", {"mor_m": 150.0, "overlap_start_m": 1.0, "overlap_full_m": 7.0} | _SMOOTH | _THIN, _STRATA),
    ("fog", "layers", {"mor_m": 150.0} | _FAR | _SMOOTH | _THIN, _STRATA),
    ("incidence_falloff", "levelling", {"exponent": 1.8, "level_from_deg": 65.0}, _LEVEL),
    ("rain", "large drops", {"rate_mm_h": 10.0} | _LARGE, _DROPS),
    ("rain", "large drops", {"rate_mm_h": 40.0} | _LARGE, _DROPS),
    ("pulse_shape", "second pulse", _TWICE | {"tail_share": 0.05}, _SECOND),
    ("pulse_shape", "second pulse", _TWICE | {"tail_share": 0.2}, _SECOND),
    ("pulse_shape", "slow fall", _SLOW | {"tail_share": 0.1, "tail_delay_ns": 2.5}, _FALL),
    ("pulse_shape", "slow fall", _SLOW | {"tail_share": 0.35, "tail_delay_ns": 3.5}, _FALL),
    ("ambient_light", "from the sun", {"rate_per_ns": 0.002, "direct": 0.6}, _SUN),
    ("interference", "stripes", {"share": 0.02, "signal": 2.0, "columns": 0.08, "spread_decades": 0.1}, _STRIPES),
    (
        "interference",
        "lines",
        {"share": 0.02, "signal": 2.0, "columns": 0.08, "spread_decades": 0.1, "column_span_m": 10.0},
        _LINES,
    ),
)
"""Starts of another kind: an effect's name, the kind's, the settings, what is free."""
_WAYS: dict[tuple[str, str], tuple[dict[str, float], ...]] = {
    ("ambient_light", "from the sun"): tuple(
        {"direct": 0.6, "sun_azimuth_deg": azimuth, "sun_elevation_deg": 40.0}
        for azimuth in (0.0, 60.0, 120.0, 180.0, -120.0, -60.0)
    )
}
"""Where the sun stands cannot be told before it is known how bright it is."""
_FIXED: dict[str, dict[str, float]] = {"beam_divergence": {"rays": 3}}
"""Few rays are fast; `footprint_rays` tries more at the end."""


def free_of(name: str) -> tuple[FreeParameter, ...]:
    """The parameters of an effect that fits move."""
    return _FREE[name]


def fixed_probes(names: Sequence[str]) -> list[Probe]:
    """The starts that need no look at the data."""
    found = [
        Probe(name, settings, _FREE[name], _FIXED.get(name, {})) for name in names for settings in _STARTS.get(name, ())
    ]
    for name, variant, settings, free in _VARIANTS:
        if name in names:
            found.append(Probe(name, settings, free, _FIXED.get(name, {}), variant, _WAYS.get((name, variant), ())))
    return found
