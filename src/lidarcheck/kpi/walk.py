"""Walk: the range error that depends on the amplitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.errors import UsageError
from lidarcheck.kpi.features import Decades

__all__ = ["WalkOffset", "walk_offset"]

_OF_AREA = Decades()


@dataclass(frozen=True)
class WalkOffset:
    """Walk of measured against simulated echoes per decade of AREA, or of what else tells an echo's strength, (k,).

    `feature`: which. `decade`: the amplitudes from 10^decade up to 10^(decade + 1); `of` names them; `offset_m`: median
    residual measured minus simulated, NaN where one side has no echo; `measured_m`, `simulated_m`: the two medians;
    `n_measured`, `n_simulated`: echoes.
    """

    decade: IndexArray
    offset_m: FloatArray
    measured_m: FloatArray
    simulated_m: FloatArray
    n_measured: IndexArray
    n_simulated: IndexArray
    feature: str = "AREA"
    of: tuple[str, ...] = ()

    @property
    def worst_m(self) -> float:
        """The offset of largest magnitude, with its sign; NaN where no decade has echoes on both sides."""
        some = self.offset_m[np.isfinite(self.offset_m)]
        return float(some[np.argmax(np.abs(some))]) if some.size else float("nan")


def walk_offset(
    measured_residual_m: npt.ArrayLike,
    measured_area: npt.ArrayLike,
    simulated_residual_m: npt.ArrayLike,
    simulated_area: npt.ArrayLike,
    decades: Decades = _OF_AREA,
) -> WalkOffset:
    """Median range residual [m], measured minus simulated, per amplitude decade.

    The amplitude is the AREA (PEAK saturates where the walk is largest), or what else `decades` are of. A residual is
    an echo's range minus the distance of its surface; residuals and areas have shapes (n,) and (m,). Echoes without a
    residual (NaN) or without a decade are left out. The decades run from the lowest to the highest that occurs on
    either side; none where there is no echo.
    """
    m_res, m_dec = _in_decades(measured_residual_m, measured_area, decades)
    s_res, s_dec = _in_decades(simulated_residual_m, simulated_area, decades)
    both = np.concatenate([m_dec, s_dec])
    decade = np.arange(both.min(), both.max() + 1) if both.size else np.zeros(0, dtype=np.int64)
    measured, simulated = _medians(m_res, m_dec, decade), _medians(s_res, s_dec, decade)
    return WalkOffset(
        decade=decade,
        offset_m=measured - simulated,
        measured_m=measured,
        simulated_m=simulated,
        n_measured=np.array([np.count_nonzero(m_dec == d) for d in decade], dtype=np.int64),
        n_simulated=np.array([np.count_nonzero(s_dec == d) for d in decade], dtype=np.int64),
        feature=decades.name,
        of=tuple(decades.words(d) for d in decade.tolist()),
    )


def _in_decades(residual_m: npt.ArrayLike, area: npt.ArrayLike, decades: Decades) -> tuple[FloatArray, IndexArray]:
    residual, amplitude = np.asarray(residual_m, dtype=np.float64), np.asarray(area, dtype=np.float64)
    if residual.shape != amplitude.shape:
        raise UsageError(f"{residual.size} residuals and {amplitude.size} areas", fix="give one of each an echo")
    decade = decades.of(amplitude)
    usable = np.isfinite(residual) & np.isfinite(decade)
    return residual[usable], decade[usable].astype(np.int64)


def _medians(residual_m: FloatArray, decade: IndexArray, wanted: IndexArray) -> FloatArray:
    groups = [residual_m[decade == d] for d in wanted]
    return np.array([np.median(group) if group.size else np.nan for group in groups], dtype=np.float64)
