"""Fog in patches: what its backscatter differs by between frames and directions, beyond what even fog shows.

Summaries are means over frames, and patches lie elsewhere in each: they do not show there, and a fit of summaries
knows only how dense the fog is on average. So the patches are measured after the fit, by the spread of the light that
the air sends back, and kept where the model with them comes nearer beam by beam.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import make
from lidarcheck.effects.search.evidence import BeamTable, Observations, Replays
from lidarcheck.effects.search.parts import Refined
from lidarcheck.sensor import Beams

__all__ = ["Patchiness", "patchiness_of", "refined", "words"]


_SECTOR_DEG = 1.0
"""About so wide are the sectors in which light is summed: whole points."""
_SEEDS = 4
_DENSITIES = np.geomspace(0.3, 3.3, 10)
"""Of these, relative to the even fog's, is what each sector shows read."""
_BRIGHTEST = 10.0
"""The largest backscatter that fog can have."""
_KNOWN, _FEWEST = 0.25, 2
"""A sector tells the density where chance shifts its logarithm by less; there must be some in a frame, and frames."""
_SURE = 3.0
"""Fog is patchy where its density differs by so many times what even fog's seems to by chance, as a variance."""


@dataclass(frozen=True)
class Patchiness:
    """The fog's `patchiness` with its 90 % interval (value, low, high), the patches' size in azimuth, and how many of
    them, about, were looked at."""

    patchiness: tuple[float, float, float]
    patch_deg: float
    patches: float


def refined(seen: Replays, even: Effect) -> Refined | None:
    """Fog in patches where its density differs by more than chance; None otherwise.

    Patches as few as were seen tell less of the mean visibility than the fit knows.
    """
    found = patchiness_of(seen, even)
    if found is None:
        return None
    more = {"patchiness": round(found.patchiness[0], 4), "patch_deg": round(found.patch_deg, 2)}
    wider = float(np.exp(1.645 * found.patchiness[0] / np.sqrt(found.patches)))
    return Refined(make("fog", {**even.settings(), **more}), {"patchiness": found.patchiness}, {"mor_m": wider})


def words(effect: Effect) -> str:
    """The patches of fog, in words; empty without any."""
    settings = effect.settings()
    if settings["patchiness"] <= 0.0:
        return ""
    spread, size = 100.0 * settings["patchiness"], settings["patch_deg"]
    return f"fog: its density differs by {spread:.0f} % between patches of {size:.1f} deg, and between frames"


def patchiness_of(seen: Replays, even: Effect) -> Patchiness | None:
    """How patchy the fog is on these frames, None where it is no more so than even fog by chance."""
    backscatter = float(even.settings()["backscatter"])
    ladder = [{**even.settings(), "backscatter": min(backscatter * one, _BRIGHTEST)} for one in _DENSITIES]
    light = functools.partial(_light, seen.sensor.beams)
    shown = seen.looks([make("fog", one) for one in ladder], 1, light)
    tables = np.maximum.accumulate(np.array([one[0] for one in shown]), axis=0)
    chance = np.array([_log_density(one, tables) for one in seen.looks([even], _SEEDS, light)[0]])
    # Where fog hardly shows, what is seen is chance and says nothing of its density.
    used = _Cells.of(seen.sensor.beams, seen.beams).seen & (np.sqrt((chance**2).mean(axis=0)) < _KNOWN)
    frames = np.count_nonzero(used, axis=1) >= _FEWEST
    if np.count_nonzero(frames) < _FEWEST:
        return None
    used = used[frames]
    total, step = _variances(_log_density(light(seen.beams, seen.measured), tables)[frames], used)
    usual = np.array([_variances(one[frames], used) for one in chance])
    if total < _SURE * usual[:, 0].max():
        return None
    noise, noise_step = usual.mean(axis=0)
    view_deg = _sector_deg(seen.sensor.beams) * used.shape[1]
    return _patchiness(total - noise, max(step - noise_step, 0.0), view_deg, used.shape)


def _light(sensor: Beams, beams: BeamTable, shown: Observations) -> FloatArray:
    """The light of the echoes of no surface in each cell, (n_frames, n_sectors)."""
    return _Cells.of(sensor, beams).light(shown)


def _points_of_sector(sensor: Beams) -> int:
    """How many points of an even grid make a sector."""
    return max(round(_SECTOR_DEG / float(sensor.spacing_deg(0, 0)[1])), 1)


def _sector_deg(sensor: Beams) -> float:
    """How wide a sector is."""
    return _points_of_sector(sensor) * float(sensor.spacing_deg(0, 0)[1]) if sensor.grid else _SECTOR_DEG


def _sectors(sensor: Beams, beams: BeamTable) -> IndexArray:
    """The sector of the view that each beam lies in, from 0."""
    if sensor.grid:
        sector = beams.point // _points_of_sector(sensor)
    else:
        sector = np.floor(sensor.angles_deg(beams.layer, beams.point)[1] / _SECTOR_DEG).astype(np.int64)
    return np.asarray(sector - sector.min())


def _log_density(light: FloatArray, tables: FloatArray) -> FloatArray:
    """The logarithm of the density, relative to the even fog's, with which fog shows the light of each cell.

    `tables` (n_densities, n_frames, n_sectors): what it shows with each of `_DENSITIES`.
    """
    log = np.log(_DENSITIES)
    found = np.empty(light.shape)
    for cell in np.ndindex(light.shape):
        found[cell] = np.interp(light[cell], tables[(slice(None), *cell)], log)
    return found


def _variances(value: FloatArray, used: BoolArray) -> tuple[float, float]:
    """The variance of all, within frames and between these, and half the mean square of what neighbouring sectors
    differ by; of those of (n_frames, n_sectors) that are used."""
    count = used.sum(axis=1)
    mean = np.where(used, value, 0.0).sum(axis=1) / count
    within = np.where(used, value - mean[:, None], 0.0)
    beside = np.diff(value, axis=1)[used[:, 1:] & used[:, :-1]]
    step = float((beside**2).mean()) / 2.0 if len(beside) else 0.0
    return float(((within**2).sum(axis=1) / count).mean() + mean.var(ddof=1)), step


def _patchiness(total: float, step: float, view_deg: float, shape: tuple[int, int]) -> Patchiness:
    """From the variance of the density's logarithm, and half the mean square of its steps between sectors."""
    from scipy.stats import chi2

    # A field whose correlation is exp(-(x / d)^2 / 2) has steps of the variance 2 s^2 (1 - exp(-(x / d)^2 / 2)).
    apart = float(np.clip(step / total, 1e-4, 0.86))
    # Between half a sector and so many that there is no telling.
    size_deg = view_deg / shape[1] / float(np.sqrt(-2.0 * np.log1p(-apart)))
    patches = shape[0] * (1.0 + view_deg / (2.5 * size_deg))
    low, high = (float(np.sqrt(patches / chi2.ppf(p, patches))) for p in (0.95, 0.05))
    value = min(float(np.sqrt(total)), 2.0)
    return Patchiness((value, value * low, min(value * high, 2.0)), size_deg, patches)


@dataclass(frozen=True)
class _Cells:
    """Sectors of the view in each frame: `cell` (n_beams,), `shape` (n_frames, n_sectors)."""

    cell: IndexArray
    shape: tuple[int, int]

    @classmethod
    def of(cls, sensor: Beams, beams: BeamTable) -> _Cells:
        """Those of some frames, from the first column looked at to the last one."""
        sector = _sectors(sensor, beams)
        sectors = int(sector.max()) + 1
        return cls(beams.frame * sectors + sector, (int(beams.frame.max()) + 1, sectors))

    def light(self, observations: Observations) -> FloatArray:
        """The light of the echoes of no surface in each cell, as AREA; shape `shape`."""
        lone = observations.extra_side < 0
        cell, area = self.cell[observations.extra_beam[lone]], np.exp(observations.extra_area[lone])
        return np.bincount(cell, area, self.shape[0] * self.shape[1]).reshape(self.shape).astype(np.float64)

    @property
    def seen(self) -> BoolArray:
        """Where there are beams; shape `shape`."""
        return np.bincount(self.cell, minlength=self.shape[0] * self.shape[1]).reshape(self.shape) > 0
