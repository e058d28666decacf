"""Echoes that belong to no surface, from another sensor's light."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import LightEffect, Surroundings, parameter
from lidarcheck.effects.shared.draws import check_interval, normals, strikes
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, PhotonHistogram

__all__ = ["Interference"]

_SHORTEST_NS = 1e-3


@dataclass(frozen=True)
class Interference(LightEffect):
    """Echoes that belong to no surface, from another sensor's light.

    A beam takes in a Poisson number of foreign pulses of mean `share`. The other sensor fires on its own clock: they
    lie uniformly between `nearest_m` and `farthest_m`, whatever stands there, with S of median `signal` and a
    log-normal spread of `spread_decades`. Its pulses come in runs while the two sensors look at each other: a share
    `columns` of the point columns is hit, each then with share / columns pulses per beam, the mean over the frame
    staying the same. Where both fire at nearly the same rate, the pulses of a column lie together: within
    `column_span_m`, from a range on that is uniform again and the column's own. Kim, Eom and Park, "Occurrence and
    characteristics of mutual interference between LIDAR scanners", Proc. SPIE 9504, 2015.

    A histogram chip sums many shots: pulses on another clock raise the background of the zones that are hit, those that
    lie together in all shots make a peak. Valid for foreign pulses as short as the sensor's own, which they share the
    shape of. Identity at share 0.
    """

    name = "interference"

    share: float = parameter(
        "", low=0.0, high=2.0, typical=0.02, noticeable=0.005, meaning="foreign pulses per beam, on average"
    )
    signal: float = parameter(
        "S",
        low=0.0,
        high=1e4,
        typical=0.5,
        noticeable=0.125,
        meaning="median of a pulse's avalanches per SPAD and shot",
    )
    spread_decades: float = parameter(
        "decades", low=0.0, high=2.0, typical=0.3, noticeable=0.1, meaning="standard deviation of log10 of the signal"
    )
    nearest_m: float = parameter("m", low=0.0, high=1000.0, typical=0.0, noticeable=10.0, meaning="from this range on")
    farthest_m: float = parameter(
        "m", low=0.0, high=1000.0, typical=300.0, noticeable=-30.0, meaning="up to this range"
    )
    columns: float = parameter(
        "", low=0.01, high=1.0, typical=1.0, noticeable=-0.2, meaning="share of the point columns that are hit"
    )
    column_span_m: float = parameter(
        "m",
        low=0.1,
        high=1000.0,
        typical=1000.0,
        noticeable=-200.0,
        meaning="range over which the pulses of a column lie",
        option=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_interval(self.name, ("nearest_m", self.nearest_m), ("farthest_m", self.farthest_m))

    def light(self, light: Light, around: Surroundings) -> Light:
        """Add the foreign pulses."""
        if self.share == 0.0:
            return light
        if around.sensor.detector == PhotonHistogram.detector and not self._in_step:
            return self._floor(light, around)
        lit = np.flatnonzero(self._hit(light, around))
        of, uniform = strikes(around, light.layer[lit], light.point[lit], self.share / self.columns)
        if len(of) == 0:
            return light
        beam = lit[of]
        range_m = self._ranges(uniform[:, 0], light.point[beam], around)
        signal = self.signal * elementary.power(10.0, self.spread_decades * normals(uniform[:, 1]))
        return light.with_pulses(beam, range_m, signal)

    @property
    def _in_step(self) -> bool:
        """Whether the pulses of a column lie together."""
        return self.column_span_m < self.farthest_m - self.nearest_m

    def _floor(self, light: Light, around: Surroundings) -> Light:
        """Foreign pulses among many shots: each of these sees others, and all together raise the background."""
        spread = elementary.log(10.0) * self.spread_decades
        mean = self.signal * elementary.exp(0.5 * spread**2)
        window_ns = max(2.0 * (self.farthest_m - self.nearest_m) / LIGHT_SPEED_M_PER_NS, _SHORTEST_NS)
        more = np.where(self._hit(light, around), self.share / self.columns * mean / window_ns, 0.0)
        return replace(light, background_per_ns=light.background_per_ns + more)

    def _hit(self, light: Light, around: Surroundings) -> npt.NDArray[np.bool_]:
        """Whether each beam's point column is hit, shape (n_beams,)."""
        if self.columns == 1.0:
            return np.ones(len(light), dtype=bool)
        column = self._of_columns(light.point, around)[:, 0]
        return np.asarray((column < self.columns)[light.point])

    def _ranges(self, uniform: FloatArray, point: npt.NDArray[np.integer], around: Surroundings) -> FloatArray:
        """Where each pulse of a beam in column `point` seems to come from, shape (n_pulses,)."""
        whole = self.farthest_m - self.nearest_m
        if not self._in_step:
            return self.nearest_m + whole * uniform
        start = (whole - self.column_span_m) * self._of_columns(point, around)[:, 1][point]
        return np.asarray(self.nearest_m + start + self.column_span_m * uniform)

    def _of_columns(self, point: npt.NDArray[np.integer], around: Surroundings) -> FloatArray:
        """What all beams of a column share: whether it is hit, and from where, shape (n_columns, 2)."""
        # A layer beyond the sensor's own, drawn apart from what each beam draws.
        beams = around.ideal.beams
        columns = np.arange(max(beams.points, int(point.max(initial=0)) + 1))
        return around.uniforms(np.full(len(columns), beams.layers), columns, 2)
