"""What a fit may free besides the table, and the sensor's responses to the pulses that it then looks at."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.blooming.response import Response, response_of
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import Sensor

__all__ = ["FreeLight", "FreeNumber", "FreePulse"]

_BRIGHTNESS = "brightness"


@dataclass(frozen=True)
class FreeLight:
    """What is fitted besides the table: the pulse's length, its tail, a factor on the target's light."""

    pulse: bool = False
    tail: bool = False
    brightness: bool = False

    @property
    def needs_target(self) -> bool:
        """Whether it takes the target's own echoes, which tell nothing of the table."""
        return self.tail or self.brightness


@dataclass(frozen=True)
class FreeNumber:
    """A number fitted on the log scale: start, bounds and the grid on which responses are made, all log10."""

    name: str
    unit: str
    start: float
    low: float
    high: float
    step: float


_TAIL = (FreeNumber("tail_share", "", -2.0, -5.0, -0.3, 0.1), FreeNumber("tail_ns", "ns", 0.8, 0.0, 1.7, 0.1))


class FreePulse:
    """The free numbers, and the response to the pulse that values of them make.

    Between the corners of a grid the response is linear, so that a fit has slopes without noise; made corners are kept,
    since a fit looks at few.
    """

    def __init__(self, sensor: Sensor, shape: PulseShape, free: FreeLight, within: tuple[float, ...] = ()) -> None:
        self.sensor, self.shape, self.within = sensor, shape, within
        length = float(np.log10(shape.fwhm_ns))
        extras: tuple[FreeNumber, ...] = (
            (FreeNumber("fwhm_ns", "ns", length, length - 1.0, length + 0.7, 0.04),) if free.pulse else ()
        )
        extras += _TAIL if free.tail else ()
        self.extras = extras + ((FreeNumber(_BRIGHTNESS, "", 0.0, -1.5, 1.5, 0.02),) if free.brightness else ())
        self.shaping = [i for i, extra in enumerate(self.extras) if extra.name != _BRIGHTNESS]
        self._made: dict[tuple[int, ...], Response] = {}

    def __len__(self) -> int:
        return len(self.extras)

    @property
    def start(self) -> FloatArray:
        """Where each number begins, log10."""
        return np.array([extra.start for extra in self.extras], dtype=np.float64)

    def pulse(self, values: FloatArray) -> PulseShape:
        """The shape with those log10 values in it."""
        return replace(self.shape, **{self.extras[i].name: float(10.0 ** values[i]) for i in self.shaping})

    def brightness(self, values: FloatArray) -> float:
        """The factor on the target's light."""
        return float(10.0 ** values[-1]) if len(self.shaping) < len(self.extras) else 1.0

    def cell(self, values: FloatArray) -> FloatArray:
        """The cell of the grid, by its lowest corner."""
        return np.floor(self._on_grid(values))

    def response(self, values: FloatArray, cell: FloatArray | None = None) -> Response:
        """The response, linear within its own cell of the grid, or as the given cell has it."""
        at = self._on_grid(values)
        cell = np.floor(at) if cell is None else cell
        off = np.flatnonzero(at != cell)
        corner = self._corner(cell)
        if not len(off):
            return corner
        eye = np.eye(len(at))
        return corner.moved([(float(at[i] - cell[i]), self._corner(cell + eye[i])) for i in off])

    def _on_grid(self, values: FloatArray) -> FloatArray:
        pairs = zip(self.extras, values, strict=True)
        return np.array([0.0 if e.name == _BRIGHTNESS else (v - e.start) / e.step for e, v in pairs], dtype=np.float64)

    def _corner(self, place: FloatArray) -> Response:
        key = tuple(int(p) for p in place)
        if key not in self._made:
            values = np.array([e.start + p * e.step for e, p in zip(self.extras, place, strict=True)])
            self._made[key] = response_of(self.sensor, self.pulse(values), within=self.within)
        return self._made[key]
