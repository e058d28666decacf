"""The light that comes back to each beam: pulses, a background, and what the air scatters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray, freeze
from lidarcheck.errors import UsageError
from lidarcheck.sensor import Beams, reference_beams

__all__ = ["Haze", "Light", "PulseShape", "light_of_beams"]

_Column = TypeVar("_Column", FloatArray, IntArray)


@dataclass(frozen=True, slots=True)
class PulseShape:
    """The laser pulse over time: a Gaussian, a share of whose light trails off exponentially behind it.

    Share of the light before t: (1 - tail_share) Phi(t / sigma) + tail_share EMG(t - tail_delay_ns), where EMG is the
    Gaussian convolved with an exponential of time constant `tail_ns`. t = 0 is the Gaussian's centre.
    """

    fwhm_ns: float
    tail_share: float = 0.0
    tail_ns: float = 1.0
    tail_delay_ns: float = 0.0


@dataclass(frozen=True)
class Haze:
    """Light scattered back by the air along the beams: one profile over range, ended by what a beam meets.

    `density_per_m` (m,): S per metre of the air in the cell [i, i + 1) `step_m`. Beam i has the rows `first_row[i]` ...
    `first_row[i + 1] - 1`; a row sees the air up to `row_end_m` with the factor `row_share`. Shapes: (n_beams + 1,),
    (n_rows,).
    """

    step_m: float
    density_per_m: FloatArray
    first_row: npt.NDArray[np.int64]
    row_end_m: FloatArray
    row_share: FloatArray

    def __post_init__(self) -> None:
        freeze(self, {"density_per_m": np.float64}, len(self.density_per_m))
        freeze(self, {"first_row": np.int64}, len(self.first_row))
        rows = int(self.first_row[-1])
        freeze(self, {"row_end_m": np.float64, "row_share": np.float64}, rows)


@dataclass(frozen=True)
class Light:
    """The light that reaches each beam: any number of pulses, a background, and what the air scatters back.

    Beam i has the pulses `first_pulse[i]` ... `first_pulse[i + 1] - 1`. `pulse_range_m` is half the light's way;
    `pulse_signal` is S, the primary avalanches per SPAD and shot that one always-armed SPAD would see on average;
    `pulse_row` is the row of the ideal scan that the light comes from, -1 where that is no surface (None: all -1).
    Light of another beam's surface keeps that surface's row. `background_per_ns` is the beam's background rate.
    `beams`: the sensor's, whose numbers `layer` and `point` are. `shape`: the laser pulse, the sensor's own where
    None. `extinction_per_m`: of the air that the light has passed so far, for light that the same air sends back later.
    Shapes: (n_beams,), (n_beams + 1,) for `first_pulse`, (n_pulses,).
    """

    layer: IntArray
    point: IntArray
    background_per_ns: FloatArray
    first_pulse: npt.NDArray[np.int64]
    pulse_range_m: FloatArray
    pulse_signal: FloatArray
    pulse_row: IntArray | None = None
    shape: PulseShape | None = None
    haze: Haze | None = None
    extinction_per_m: float = 0.0
    beams: Beams = field(default_factory=reference_beams, repr=False)

    def __post_init__(self) -> None:
        n = len(self.layer)
        freeze(self, {"layer": np.int32, "point": np.int32, "background_per_ns": np.float64}, n)
        freeze(self, {"first_pulse": np.int64}, n + 1)
        if self.first_pulse[0] != 0 or np.any(self.first_pulse[1:] < self.first_pulse[:-1]):
            raise UsageError("first_pulse must begin with 0 and not decrease")
        pulses = int(self.first_pulse[-1])
        freeze(self, {"pulse_range_m": np.float64, "pulse_signal": np.float64, "pulse_row": np.int32}, pulses)

    def __len__(self) -> int:
        return len(self.layer)

    @property
    def pulse_beam(self) -> npt.NDArray[np.int64]:
        """The beam of each pulse, shape (n_pulses,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.first_pulse))

    def rows(self) -> IntArray:
        """`pulse_row`, -1 throughout where there is none."""
        return np.full(len(self.pulse_signal), -1, dtype=np.int32) if self.pulse_row is None else self.pulse_row

    def dimmed(self, factor: npt.ArrayLike, *, background: float | FloatArray = 1.0) -> Light:
        """Pulses and haze times `factor`, the background times `background`; each a number or of shape (n_beams,)."""
        beams = np.broadcast_to(np.asarray(factor, dtype=np.float64), len(self))
        haze = self.haze
        if haze is not None:
            haze = replace(haze, row_share=haze.row_share * np.repeat(beams, np.diff(haze.first_row)))
        return replace(
            self,
            background_per_ns=self.background_per_ns * background,
            pulse_signal=self.pulse_signal * np.repeat(beams, np.diff(self.first_pulse)),
            haze=haze,
        )

    def attenuated(self, extinction_per_m: float) -> Light:
        """Pulses and haze behind air of that extinction, there and back: times exp(-2 alpha R)."""
        haze = self.haze
        if haze is not None:
            middle_m = (np.arange(len(haze.density_per_m)) + 0.5) * haze.step_m
            haze = replace(haze, density_per_m=haze.density_per_m * elementary.exp(-2.0 * extinction_per_m * middle_m))
        signal = self.pulse_signal * elementary.exp(-2.0 * extinction_per_m * self.pulse_range_m)
        together = self.extinction_per_m + extinction_per_m
        return replace(self, pulse_signal=signal, haze=haze, extinction_per_m=together)

    def with_pulses(
        self, beam: npt.ArrayLike, range_m: npt.ArrayLike, signal: npt.ArrayLike, row: npt.ArrayLike = -1
    ) -> Light:
        """The same light and further pulses, behind those that their beams have; shape (m,) each, in any order."""
        beam = np.asarray(beam, dtype=np.int64)
        m = len(beam)
        if m == 0:
            return self
        order = np.argsort(beam, kind="stable") if np.any(beam[1:] < beam[:-1]) else slice(None)
        # Behind the pulses that the beam and those before it have, and behind the new ones before it.
        place = self.first_pulse[beam[order] + 1] + np.arange(m)
        free = np.ones(len(self.pulse_signal) + m, dtype=bool)
        free[place] = False
        old = np.flatnonzero(free)

        def merged(before: _Column, further: npt.ArrayLike) -> _Column:
            column: Any = np.empty(len(free), dtype=before.dtype)
            column[old], column[place] = before, np.broadcast_to(further, m)[order]
            return column  # type: ignore[no-any-return]

        first = self.first_pulse.copy()
        first[1:] += np.cumsum(np.bincount(beam, minlength=len(self)))
        return replace(
            self,
            first_pulse=first,
            pulse_range_m=merged(self.pulse_range_m, range_m),
            pulse_signal=merged(self.pulse_signal, signal),
            pulse_row=merged(self.rows(), np.asarray(row, dtype=np.int32)),
        )


def light_of_beams(light: Light, mask: npt.NDArray[np.bool_]) -> Light:
    """The light of the beams of a mask, shape (n_beams,), with what the air scatters into them."""
    pulses = mask[light.pulse_beam]
    counts = np.diff(light.first_pulse)[mask]
    return replace(
        light,
        layer=light.layer[mask],
        point=light.point[mask],
        background_per_ns=light.background_per_ns[mask],
        first_pulse=np.concatenate([[0], np.cumsum(counts)]),
        pulse_range_m=light.pulse_range_m[pulses],
        pulse_signal=light.pulse_signal[pulses],
        pulse_row=None if light.pulse_row is None else light.pulse_row[pulses],
        haze=None if light.haze is None else _haze_of_beams(light.haze, mask),
    )


def _haze_of_beams(haze: Haze, mask: npt.NDArray[np.bool_]) -> Haze:
    counts = np.diff(haze.first_row)
    rows = np.repeat(mask, counts)
    first = np.concatenate([[0], np.cumsum(counts[mask])])
    return replace(haze, first_row=first, row_end_m=haze.row_end_m[rows], row_share=haze.row_share[rows])
