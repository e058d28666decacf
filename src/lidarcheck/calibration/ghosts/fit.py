"""Fit the parameters of the ghost effect to signs and ghosts measured at one range or several.

A beam of a sign shows a ghost with a probability, and an AREA, that follow from the ghost's S by way of the sensor
(`ghost_library`, the exact chain). S = strength S_sign (25 m / R)^exponent, S_sign by the model. Beams that show none
count as much as those that do: otherwise far ghosts, of which only the brightest are seen, would seem too bright.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.ghosts.data import SignBeams, sign_beams, with_ghost
from lidarcheck.calibration.ghosts.library import FaintPulseLibrary, library_of
from lidarcheck.calibration.ghosts.likelihood import (
    FARTHEST_OFF,
    REFERENCE_M,
    TOLD,
    IntervalWidening,
    Region,
    best_setting,
    doubt_of,
    extra_scatter,
    log_signal_of,
    off_of,
    region_of,
)
from lidarcheck.calibration.ghosts.workflow import GhostScan
from lidarcheck.effects import with_role
from lidarcheck.errors import InputError
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan

__all__ = ["DatasetFit", "GhostFit", "GhostParameter", "fit_ghosts"]

FEWEST_GHOSTS = 10
"""Ghost echoes that a fit needs in all."""
SPREAD_OF_RANGES = 1.15
"""The farthest sign's range over the nearest's from which on the exponent can be told."""
DIGITS = 6
BACKGROUND_DIGITS = 7


@dataclass(frozen=True)
class GhostParameter:
    """A parameter's value and its 95 % interval; `fitted` False: these data do not tell it, and it was not moved."""

    value: float
    low: float
    high: float
    unit: str
    fitted: bool = True


@dataclass(frozen=True)
class DatasetFit:
    """A dataset beside what the fitted model gives for it.

    `beams` of the sign, `ghosts` on them and how many are expected; geometric mean AREA of the ghosts and the expected
    one; `beyond_m`: mean range of the ghosts beyond twice the sign's true range, and the expected one; `pull`: how
    many standard deviations the mean of log AREA is off. NaN where there is no ghost.
    """

    name: str
    range_m: float
    beams: int
    ghosts: int
    ghosts_expected: float
    area: float
    area_expected: float
    beyond_m: float
    beyond_expected_m: float
    pull: float
    sign_early_m: float


@dataclass(frozen=True)
class GhostFit:
    """Fitted parameters by their names, the datasets beside the fit, the model with the effect, and warnings.

    `scatter`: spread of the ghosts' log AREA over what the sensor alone gives.
    """

    parameters: dict[str, GhostParameter]
    datasets: tuple[DatasetFit, ...]
    beams: tuple[SignBeams, ...]
    model: Model
    scatter: float
    warnings: tuple[str, ...]

    @property
    def effect(self) -> Any:
        """The fitted effect, which has the fitted parameters as attributes."""
        return _ghost_of(self.model)


def fit_ghosts(found: Sequence[GhostScan], ideals: Sequence[IdealScan], model: Model, *, seed: int = 0) -> GhostFit:
    """Strength, exponent and extra way of the ghosts in datasets whose ideal scans are known.

    `InputError` where a dataset lacks its sign, or all of them have fewer than 10 ghost echoes. `seed`: of the library.
    """
    beams = sign_beams(found, ideals, model)
    _check_enough(beams)
    libraries = [_library(b, seed) for b in beams]
    extra, scatter = extra_scatter(beams, libraries)
    libraries = [lib.with_scatter(extra) for lib in libraries]
    exponent = _ghost_of(with_ghost(model)).exponent
    free = _tells_exponent(beams)
    best = best_setting(beams, libraries, exponent, free)
    doubt = doubt_of(beams, libraries, best, free, scatter)
    region = region_of(beams, libraries, best, free, doubt.factor)
    parameters = {
        "strength": _estimate(np.exp(region.log_strength), ""),
        "exponent": _estimate(region.exponent, "", fitted=free),
        "extra_m": _extra(beams, libraries, region),
    }
    fitted = with_ghost(model, **{name: float(f"{p.value:.{DIGITS}g}") for name, p in parameters.items()})
    datasets = tuple(_dataset(b, lib, parameters) for b, lib in zip(beams, libraries, strict=True))
    warnings = [*_beyond_library(model), *_warnings(beams, datasets, parameters, region, doubt, free)]
    return GhostFit(parameters, datasets, tuple(beams), fitted, doubt.scatter, tuple(warnings))


def _ghost_of(model: Model) -> Any:
    """The ghost effect of a model that has it."""
    return next(effect for effect in model.effects if isinstance(effect, with_role("ghost")))


def _check_enough(beams: Sequence[SignBeams]) -> None:
    ghosts = sum(int(np.count_nonzero(b.detected)) for b in beams)
    if ghosts < FEWEST_GHOSTS:
        each = ", ".join(f"{b.name} {np.count_nonzero(b.detected)} on {len(b)} beams" for b in beams)
        raise InputError(
            f"a fit needs at least {FEWEST_GHOSTS} ghost echoes, and there are {ghosts} ({each})",
            fix="add datasets, at shorter range or of a larger sign",
        )


def _library(b: SignBeams, seed: int) -> FaintPulseLibrary:
    """The library of a dataset; those that see alike share one."""
    return library_of(b.sensor, b.shape, round(b.background_per_ns, BACKGROUND_DIGITS), seed=seed)


def _tells_exponent(beams: Sequence[SignBeams]) -> bool:
    """Whether signs at ranges that differ enough show ghosts, or at least how rare they are."""
    ranges = [float(np.median(b.range_m)) for b in beams if len(b)]
    return max(ranges) / min(ranges) >= SPREAD_OF_RANGES


def _extra(beams: Sequence[SignBeams], libraries: Sequence[FaintPulseLibrary], region: Region) -> GhostParameter:
    """The extra way from where the ghosts stand, given how early the sensor sees pulses of their strength."""
    best = (float(region.log_strength[0]), float(region.exponent[0]))
    value, error, chi = _extra_at(beams, libraries, *best)
    step = max(1, len(region.exponent) // 60)
    others = [
        _extra_at(beams, libraries, float(s), float(p))[0]
        for s, p in zip(region.log_strength[::step], region.exponent[::step], strict=True)
    ]
    half = float(np.hypot(TOLD * error * np.sqrt(max(chi, 1.0)), max(abs(o - value) for o in others)))
    return GhostParameter(value, value - half, value + half, "m")


def _extra_at(
    beams: Sequence[SignBeams], libraries: Sequence[FaintPulseLibrary], log_strength: float, exponent: float
) -> tuple[float, float, float]:
    """Weighted mean of the extra way, its error, and the scatter around it in units of the expected."""
    values, weights = [], []
    for b, lib in zip(beams, libraries, strict=True):
        log_signal = log_signal_of(b, log_strength, exponent)[b.detected]
        values.append(b.beyond_m[b.detected] - lib.at(lib.shift_m, log_signal))
        weights.append(lib.at(lib.shift_spread_m, log_signal) ** -2)
    value, weight = np.concatenate(values), np.concatenate(weights)
    mean = float(np.median(value))
    for _ in range(3):
        near = weight * (value - mean) ** 2 < FARTHEST_OFF**2
        mean = float(np.average(value[near], weights=weight[near])) if near.any() else mean
    chi = float(np.mean((weight * (value - mean) ** 2)[near])) if near.any() else 1.0
    return mean, float(weight[near].sum() ** -0.5) if near.any() else float("inf"), chi


def _estimate(allowed: FloatArray, unit: str, fitted: bool = True) -> GhostParameter:
    """The first value, and the extremes of all."""
    return GhostParameter(float(allowed[0]), float(allowed.min()), float(allowed.max()), unit, fitted)


def _dataset(b: SignBeams, lib: FaintPulseLibrary, parameters: dict[str, GhostParameter]) -> DatasetFit:
    at = (float(np.log(parameters["strength"].value)), parameters["exponent"].value)
    log_signal = log_signal_of(b, *at)
    probability, seen = lib.at(lib.probability, log_signal), log_signal[b.detected]
    none = not b.detected.any()
    off = np.zeros(0) if none else off_of(b, lib, *at)
    weight = probability / max(float(probability.sum()), 1e-12)
    return DatasetFit(
        name=b.name,
        range_m=float(np.median(b.range_m)) if len(b) else float("nan"),
        beams=len(b),
        ghosts=len(seen),
        ghosts_expected=float(probability.sum()),
        area=float("nan") if none else float(np.exp(np.mean(np.log(b.area[b.detected])))),
        area_expected=float(np.exp(weight @ lib.at(lib.log_area, log_signal))),
        beyond_m=float("nan") if none else float(np.mean(b.beyond_m[b.detected])),
        beyond_expected_m=parameters["extra_m"].value + float(weight @ lib.at(lib.shift_m, log_signal)),
        pull=float("nan") if none else float(off.mean() * np.sqrt(len(off))),
        sign_early_m=b.sign_early_m,
    )


def _beyond_library(model: Model) -> list[str]:
    names = ", ".join(effect.name for effect in model.effects if effect.stage == "readout")
    return [f"the fit takes no account of what changes echoes after the detectors: {names}"] if names else []


def _warnings(
    beams: Sequence[SignBeams],
    datasets: Sequence[DatasetFit],
    parameters: dict[str, GhostParameter],
    region: Region,
    doubt: IntervalWidening,
    free: bool,
) -> list[str]:
    said = []
    nearest, farthest = min(d.range_m for d in datasets), max(d.range_m for d in datasets)
    place = f"{nearest:.1f} to {farthest:.1f}" if farthest - nearest >= 0.05 else f"{nearest:.1f}"
    if not free:
        said.append(
            f"exponent is not told by signs at {place} m: it was left at "
            f"{parameters['exponent'].value:g}, and strength holds for that; measure at ranges that differ by half"
        )
    elif region.reaches_end:
        said.append("strength and exponent are hardly told by these data: their intervals are wider than given")
    if free and not nearest <= REFERENCE_M * 1.5:
        said.append(
            f"strength is the ratio at 25 m, and the nearest sign stands at {nearest:.1f} m: it is extrapolated"
        )
    if doubt.scatter > 1.0:
        said.append(
            f"the ghosts' AREA scatters {doubt.scatter:.2f} times as much as the sensor alone makes it; retro_ghost "
            "has no parameter for that, and the intervals are widened"
        )
    if doubt.disagreement > 1.0:
        worst = max((d for d in datasets if np.isfinite(d.pull)), key=lambda d: abs(d.pull))
        said.append(
            f"the datasets do not lie on one power of the range: {worst.name} is {worst.pull:+.1f} standard deviations "
            "off; the intervals are widened"
        )
    if any(float(np.max(b.unit_signal, initial=0.0)) * parameters["strength"].value > 5.0 for b in beams if len(b)):
        said.append("the nearest ghosts saturate: their AREA tells little of their strength")
    return said
