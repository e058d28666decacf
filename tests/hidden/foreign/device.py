"""A sensor of a file: its numbers as the file has them, and where its beams begin and look."""

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

F = NDArray[np.float64]
N = NDArray[np.int64]

LIGHT_M_NS = 0.299792458
SHIPPED = Path(__file__).resolve().parents[3] / "src/lidarcheck/sensors"
BEAMS = 2800
"""About so many beams has a frame of a case."""


@dataclass(frozen=True)
class Beams:
    """The fired beams of a frame, (n,) each: channel, column, angles [deg] of beam and head, firing time [s]."""

    layer: N
    point: N
    elevation_deg: F
    azimuth_deg: F
    head_deg: F
    time_s: F
    first_deg: float  # where Point 0 of this frame looks

    def __len__(self) -> int:
        return len(self.layer)


@dataclass(frozen=True)
class Device:
    """A sensor file, `name` as a model names it and `text` where it is no shipped one."""

    name: str
    document: dict[str, Any]
    text: str = ""

    @property
    def detector(self) -> str:
        return str(self.document["detector"])

    @property
    def numbers(self) -> dict[str, Any]:
        """The detector's table."""
        return dict(self.document[self.detector])

    @property
    def gate_m(self) -> tuple[float, float]:
        gate = self.document["range"]
        return float(gate.get("min_m", 0.0)), float(gate.get("max_m", 300.0))

    @property
    def step_m(self) -> float:
        return float(self.document["range"].get("step_m", 0.01))

    @property
    def fwhm_ns(self) -> float:
        default = {"linear": 5.0, "photon_histogram": 1.0, "spad_array": 5.0}[self.detector]
        return float(self.numbers.get("pulse_fwhm_ns", default))

    def reports(self, law: str) -> bool:
        """Whether a feature of the file follows that law."""
        return any(feature["law"] == law for feature in self.document["features"].values())

    @property
    def rotating(self) -> bool:
        return str(self.document["beams"]["kind"]) == "channels"

    @property
    def layers(self) -> int:
        beams = self.document["beams"]
        return len(beams["elevation_deg"]) if self.rotating else int(beams["layers"])

    def of_channels(self, key: str) -> F:
        """A list of the channels, or one number for all of them."""
        return np.broadcast_to(np.asarray(self.document["beams"].get(key, 0.0), np.float64), (self.layers,))

    @property
    def columns(self) -> float:
        """Columns of a frame; no whole number where they do not repeat."""
        if not self.rotating:
            return float(self.document["beams"]["points"])
        beams = self.document["beams"]
        if "columns" in beams:
            return float(beams["columns"])
        return abs(self._ends_deg[1] - self._ends_deg[0]) / float(beams["azimuth_step_deg"])

    @property
    def _ends_deg(self) -> tuple[float, float]:
        sense = -1.0 if self.document["sweep"].get("direction", "left") == "right" else 1.0
        azimuth = self.document["beams"].get("azimuth_deg", {"first": 0.0})
        return float(azimuth["first"]), float(azimuth.get("last", azimuth["first"] + sense * 360.0))

    @property
    def column_deg(self) -> float:
        return (self._ends_deg[1] - self._ends_deg[0]) / self.columns

    @property
    def column_s(self) -> float:
        return float(self.document["sweep"].get("duration_s", 1.0 / self.document["frame_rate_hz"])) / self.columns

    def sector(self, seed: int, frame: int) -> Beams:
        """All channels of the same columns in every frame; where columns do not repeat a frame begins elsewhere."""
        if not self.rotating:
            return self._grid()
        wide = min(max(BEAMS // self.layers, 8), 100)
        rng = np.random.default_rng([seed, 41])
        first = int(rng.integers(0, int(self.columns) - wide - 1))
        phase = 0.0
        if not self.document["beams"].get("columns_repeat", True):
            begun = (frame + int(rng.integers(100))) * self.columns
            phase = (math.ceil(begun) - begun) * self.column_deg
        layer, point = (a.ravel() for a in np.meshgrid(np.arange(self.layers), first + np.arange(wide), indexing="ij"))
        fire_us = self.of_channels("fire_time_us")[layer]
        start = self._ends_deg[0] + phase
        head = start + point * self.column_deg
        if self.document["sweep"].get("fire_time_in_azimuth", True):
            head = head + self.column_deg / self.column_s * fire_us * 1e-6
        azimuth = head + self.of_channels("azimuth_offset_deg")[layer]
        return Beams(
            layer, point, self.of_channels("elevation_deg")[layer], azimuth, head,
            point * self.column_s + fire_us * 1e-6, (start + 180.0) % 360.0 - 180.0,
        )  # fmt: skip

    def _grid(self) -> Beams:
        beams = self.document["beams"]
        layer, point = (a.ravel() for a in np.meshgrid(*map(np.arange, (self.layers, beams["points"])), indexing="ij"))
        up, aside = (
            beams[key]["first"] + at * beams[key]["step"]
            for key, at in (("elevation_deg", layer), ("azimuth_deg", point))
        )
        return Beams(layer, point, up, aside, aside, np.zeros(len(layer)), float(beams["azimuth_deg"]["first"]))

    def parts_deg(self) -> list[tuple[float, float]]:
        """Azimuth and elevation of the sub-rays of a box, at the centres of equal cells; else one ray."""
        beams = self.document["beams"]
        if "footprint_deg" not in beams:
            return [(0.0, 0.0)]
        (wide, across), (high, along) = (
            (float(beams["footprint_deg"][k]), int(beams["sub_rays"][k])) for k in ("horizontal", "vertical")
        )
        return [
            (((i + 0.5) / across - 0.5) * wide, ((j + 0.5) / along - 0.5) * high)
            for i in range(across)
            for j in range(along)
        ]

    def origins_m(self, beams: Beams) -> F:
        """Where beams begin (n, 3): forward and aside turn with the head."""
        forward, side, up = (self.of_channels(key)[beams.layer] for key in ("origin_m", "side_m", "height_m"))
        c, s = np.cos(np.deg2rad(beams.head_deg)), np.sin(np.deg2rad(beams.head_deg))
        return np.stack([forward * c - side * s, forward * s + side * c, up], axis=-1)

    def range_offset_m(self, beams: Beams) -> F:
        return self.of_channels("range_offset_m")[beams.layer]


def _staggered() -> str:
    """A `spad_array` with the numbers of the built-in SLIM behind a turning head: channels denser near the horizon."""
    k = np.arange(48)
    elevation = np.round(11.0 * np.sign(k - 23.5) * (np.abs(k - 23.5) / 23.5) ** 1.4 - 1.0, 3)
    aside = np.round(np.array([-1.1, 0.4, 1.2, -0.3])[k % 4], 3)
    fire = np.round(0.6 * (k % 12), 2)
    return f"""name = "SLIM behind a turning head"
detector = "spad_array"
frame_rate_hz = 20
returns = 3
sweep = {{direction = "right"}}
range = {{min_m = 0, max_m = 300, step_m = 0.01}}
spad_array = {{spads = 63, rows = 3, columns = 21, shots = 5, threshold = 9, peak_saturation = 236, on_bins = 9,
  dead_bins = 12, pulse_fwhm_ns = 5.0, background_per_ns = 0.0003, signal_at_1m = 6000.0, bin_ns = 1.0,
  time_offset_ns = 4.0}}
[beams]
kind = "channels"
elevation_deg = {elevation.tolist()}
azimuth_offset_deg = {aside.tolist()}
fire_time_us = {fire.tolist()}
origin_m = 0.02
height_m = 0.03
range_offset_m = 0.02
columns = 1600
azimuth_deg = {{first = 30, last = -330}}
[features]
PEAK = {{law = "peak_counts", unit = "detectors", step = 1}}
WIDTH = {{law = "width_bins", unit = "ns", step = 1}}
AREA = {{law = "area_counts", unit = "detectors ns", step = 1, log = true}}
"""


def device(name: str) -> Device:
    """A shipped sensor by its name, or SLIM's detectors on channels."""
    if name == "SLIM-channels":
        text = _staggered().replace(",\n  ", ", ")
        return Device("sensor.toml", tomllib.loads(text), text)
    return Device(name, tomllib.loads((SHIPPED / f"{name}.toml").read_text(encoding="utf-8")))
