"""A retro-reflector appears again on the same beams at twice its range, fainter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.scan import Light
from lidarcheck.sensor import Linear, Sensor

__all__ = ["RetroGhost"]

_REFERENCE_M = 25.0
_NEAREST_M = 1e-3


@dataclass(frozen=True)
class RetroGhost(LightEffect):
    """A retro-reflector appears again on the same beams at twice its range, fainter.

    The light goes sensor - sign - own car - sign - sensor: to every pulse of a retro-reflector at range R, a further
    one at 2 R + extra_m on the same beam, and so twice the size, with

        S_ghost = strength S(R) (25 m / R)^exponent,

    and never above S(R) itself. S falls as R^-2, so a ghost falls as R^-(2 + exponent); a sign measured at two
    distances gave about -2.25. `extra_m` is half the way by which the second loop is longer than the first. Measured
    ghosts stood 0.15 ... 0.33 m behind twice the *measured* range; a saturated sign's echo is early or, with a tail
    of the pulse, late, so this is not `extra_m` itself. Only light that comes from the beam's own surface makes a
    ghost, in pulses of at least `min_signal`; with `retro_only` 1 the surface must be a retro-reflector in the table
    of materials, with 0 it may be any. Identity at strength 0.
    """

    name = "retro_ghost"
    role = "ghost"
    tree = (108,)

    strength: float = parameter(
        "", low=0.0, high=1.0, typical=5.2e-5, noticeable=1.3e-5, meaning="ghost's S over the target's, at 25 m"
    )
    exponent: float = parameter(
        "", low=-10.0, high=10.0, typical=0.25, noticeable=0.25, meaning="power by which that ratio falls with range"
    )
    extra_m: float = parameter(
        "m", low=-10.0, high=50.0, typical=0.5, noticeable=0.1, meaning="the ghost's range beyond twice the target's"
    )
    min_signal: float = parameter(
        "avalanches per SPAD and shot",
        low=0.0,
        high=1e9,
        typical=1.0,
        noticeable=0.1,
        meaning="S from which on a pulse makes a ghost",
    )
    retro_only: int = parameter(
        "", low=0, high=1, typical=1, whole=True, noticeable=-1, meaning="1: retro-reflectors alone, 0: any surface"
    )

    @classmethod
    def needs(cls, sensor: Sensor) -> str:
        """Room for an echo behind the target's."""
        one = isinstance(sensor, Linear) and sensor.max_echoes < 2 and sensor.keep != "last"
        return "the target takes the beam's one echo (returns = 1)" if one else ""

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add the ghosts' pulses."""
        if self.strength == 0.0:
            return light
        row, beam = light.rows(), light.pulse_beam
        of = np.flatnonzero(self._makes_ghost(light, around, row, beam))
        range_m = light.pulse_range_m[of]
        with np.errstate(over="ignore", invalid="ignore"):
            fall = elementary.power(_REFERENCE_M / np.maximum(range_m, _NEAREST_M), self.exponent)
            signal = self.strength * light.pulse_signal[of] * fall
        ghost_m = 2.0 * range_m + self.extra_m
        # The air that dimmed the target dims the ghost's longer way as well.
        signal = signal * elementary.exp(-2.0 * light.extinction_per_m * np.maximum(ghost_m - range_m, 0.0))
        # A ghost cannot be brighter than what it is a ghost of: at short range the power law has no meaning.
        signal = np.minimum(np.nan_to_num(signal, nan=0.0), light.pulse_signal[of])
        seen = (signal > 0.0) & (ghost_m > 0.0)
        return light.with_pulses(beam[of][seen], ghost_m[seen], signal[seen], row[of][seen])

    def _makes_ghost(
        self, light: Light, around: Surroundings, row: npt.NDArray[np.int32], beam: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.bool_]:
        """Whether each pulse makes a ghost, shape (n_pulses,)."""
        ideal = around.ideal
        makes = (row >= 0) & (light.pulse_signal > 0.0) & (light.pulse_signal >= self.min_signal)
        some = np.flatnonzero(makes)
        of, its = row[some], beam[some]
        own = (ideal.layer[of] == light.layer[its]) & (ideal.point[of] == light.point[its])
        if self.retro_only:
            retro = [number for number, material in around.materials.items() if material.kind == "retro"]
            own &= np.isin(ideal.material_id[of], retro)
        makes[some] = own
        return makes
