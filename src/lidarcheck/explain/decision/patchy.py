"""Fog in patches: what its backscatter differs by between frames and directions, beyond what even fog shows.

Summaries are means over frames, and patches lie elsewhere in each: they do not show there, and a fit of summaries
knows only how dense the fog is on average. So the patches are measured after the fit, by the spread of the light that
the air sends back, and kept where the model with them comes nearer beam by beam.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.base import Effect, make
from lidarcheck.explain.report.explanation import Finding
from lidarcheck.inference.intervals import Interval
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.pairing import Observations
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool

__all__ = ["Patchiness", "patches_in", "patchiness_of", "with_patches"]

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int64]

_SECTOR_POINTS, _SECTOR_DEG = 8, 1.0
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
    """The fog's `patchiness` with its 90 % interval, the patches' size in azimuth, and how many of them, about, were
    looked at."""

    patchiness: Interval
    patch_deg: float
    patches: float


def with_patches(
    seen: Scale, model: Model, findings: Sequence[Finding], off: Nuisance, pool: WorkerPool
) -> tuple[Finding, ...]:
    """The findings, fog in patches if it is among them, its density differs by more than chance, and the model comes
    nearer so than with even fog."""
    at = next((i for i, one in enumerate(findings) if one.name == "fog" and len(one.effects) == 1), None)
    if at is None:
        return tuple(findings)
    even = model
    for finding in findings:
        for effect in finding.effects:
            even = even.with_(effect)
    fog = findings[at].effects[0]
    found = patchiness_of(seen, even, fog, off, pool)
    if found is None:
        return tuple(findings)
    patchy = _patchy(fog, found)
    (left, _), (there, _) = pool.map(Scale.excess, ((seen.held, one, off) for one in (even, even.with_(patchy))))
    if there >= left:
        return tuple(findings)
    return (*findings[:at], _found(findings[at], patchy, found), *findings[at + 1 :])


def patches_in(findings: Sequence[Finding]) -> str:
    """The patches of the fog among the findings, in words; empty without any."""
    for effect in (effect for one in findings if one.name == "fog" for effect in one.effects):
        settings = effect.settings()
        if settings["patchiness"] > 0.0:
            spread, size = 100.0 * settings["patchiness"], settings["patch_deg"]
            return f"fog: its density differs by {spread:.0f} % between patches of {size:.1f} deg, and between frames"
    return ""


def patchiness_of(seen: Scale, even: Model, fog: Effect, off: Nuisance, pool: WorkerPool) -> Patchiness | None:
    """How patchy the fog is on these frames, None where it is no more so than even fog by chance.

    `even`: the model with even fog, `fog` that effect, `off` the small errors that were fitted besides.
    """
    cells, backscatter = _Cells.of(seen), float(fog.settings()["backscatter"])
    ladder = [{**fog.settings(), "backscatter": min(backscatter * one, _BRIGHTEST)} for one in _DENSITIES]
    shown = pool.map(_light, ((seen.held, even.with_(make("fog", one)), off, 1) for one in ladder))
    tables = np.maximum.accumulate(np.array([one[0] for one in shown]), axis=0)
    chance = np.array([_log_density(one, tables) for one in _light(seen, even, off, _SEEDS)])
    # Where fog hardly shows, what is seen is chance and says nothing of its density.
    used = cells.seen & (np.sqrt((chance**2).mean(axis=0)) < _KNOWN)
    frames = np.count_nonzero(used, axis=1) >= _FEWEST
    if np.count_nonzero(frames) < _FEWEST:
        return None
    used = used[frames]
    total, step = _variances(_log_density(cells.light(seen.measured), tables)[frames], used)
    usual = np.array([_variances(one[frames], used) for one in chance])
    if total < _SURE * usual[:, 0].max():
        return None
    noise, noise_step = usual.mean(axis=0)
    view_deg = _SECTOR_DEG * used.shape[1]
    return _patchiness(total - noise, max(step - noise_step, 0.0), view_deg, len(used))


def _light(seen: Scale, model: Model, off: Nuisance, seeds: int) -> list[FloatArray]:
    """The light of each cell in some simulations."""
    cells = _Cells.of(seen)
    return [cells.light(one) for one in seen.simulated(model, 9700, seeds, off)]


def _log_density(light: FloatArray, tables: FloatArray) -> FloatArray:
    """The logarithm of the density, relative to the even fog's, with which fog shows the light of each cell.

    `tables` (n_densities, n_frames, n_sectors): what it shows with each of `_DENSITIES`.
    """
    log = np.log(_DENSITIES)
    found = np.empty(light.shape)
    for cell in np.ndindex(light.shape):
        found[cell] = np.interp(light[cell], tables[(slice(None), *cell)], log)
    return found


def _variances(value: FloatArray, used: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """The variance of all, within frames and between these, and half the mean square of what neighbouring sectors
    differ by; of those of (n_frames, n_sectors) that are used."""
    count = used.sum(axis=1)
    mean = np.where(used, value, 0.0).sum(axis=1) / count
    within = np.where(used, value - mean[:, None], 0.0)
    beside = np.diff(value, axis=1)[used[:, 1:] & used[:, :-1]]
    step = float((beside**2).mean()) / 2.0 if len(beside) else 0.0
    return float(((within**2).sum(axis=1) / count).mean() + mean.var(ddof=1)), step


def _patchiness(total: float, step: float, view_deg: float, frames: int) -> Patchiness:
    """From the variance of the density's logarithm, and half the mean square of its steps between sectors."""
    from scipy.stats import chi2

    # A field whose correlation is exp(-(x / d)^2 / 2) has steps of the variance 2 s^2 (1 - exp(-(x / d)^2 / 2)).
    apart = float(np.clip(step / total, 1e-4, 0.86))
    # Between half a sector and so many that there is no telling.
    size_deg = _SECTOR_DEG / float(np.sqrt(-2.0 * np.log1p(-apart)))
    patches = frames * (1.0 + view_deg / (2.5 * size_deg))
    low, high = (float(np.sqrt(patches / chi2.ppf(p, patches))) for p in (0.95, 0.05))
    value = min(float(np.sqrt(total)), 2.0)
    return Patchiness(Interval(value, value * low, min(value * high, 2.0)), size_deg, patches)


def _patchy(fog: Effect, found: Patchiness) -> Effect:
    more = {"patchiness": round(found.patchiness.value, 4), "patch_deg": round(found.patch_deg, 2)}
    return make("fog", {**fog.settings(), **more})


def _found(even: Finding, patchy: Effect, found: Patchiness) -> Finding:
    """The finding with the patches; as few as were seen tell less of the mean visibility than the fit knows."""
    parameters = dict(even.parameters)
    wider = float(np.exp(1.645 * found.patchiness.value / np.sqrt(found.patches)))
    mor = parameters.get("mor_m")
    if mor is not None:
        parameters["mor_m"] = replace(mor, low=mor.low / wider, high=mor.high * wider)
    parameters["patchiness"] = found.patchiness
    return replace(even, parameters=parameters, effects=(patchy,))


@dataclass(frozen=True)
class _Cells:
    """Sectors of the view in each frame: `cell` (n_beams,), `shape` (n_frames, n_sectors)."""

    cell: IndexArray
    shape: tuple[int, int]

    @classmethod
    def of(cls, seen: Scale) -> _Cells:
        """Those of some frames, from the first column looked at to the last one."""
        sector = seen.beams.point // _SECTOR_POINTS
        sector -= sector.min()
        sectors = int(sector.max()) + 1
        return cls(seen.beams.frame * sectors + sector, (len(seen.frames), sectors))

    def light(self, observations: Observations) -> FloatArray:
        """The light of the echoes of no surface in each cell, as AREA; shape `shape`."""
        lone = observations.extra_side < 0
        cell, area = self.cell[observations.extra_beam[lone]], np.exp(observations.extra_area[lone])
        return np.bincount(cell, area, self.shape[0] * self.shape[1]).reshape(self.shape).astype(np.float64)

    @property
    def seen(self) -> npt.NDArray[np.bool_]:
        """Where there are beams; shape `shape`."""
        return np.bincount(self.cell, minlength=self.shape[0] * self.shape[1]).reshape(self.shape) > 0
