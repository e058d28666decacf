"""What a fit of ghosts sees: the sign's beams of each dataset, their light, and what stands at twice the range."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.calibration.echoes import place_of
from lidarcheck.calibration.ghosts.returns import Returns, grid_steps
from lidarcheck.calibration.ghosts.targets import clusters_of
from lidarcheck.calibration.ghosts.workflow import GHOST, SIGN, GhostScan
from lidarcheck.effects import with_role
from lidarcheck.errors import InputError
from lidarcheck.kpi.pairing import beam_keys
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import aimed, light_after_effects
from lidarcheck.scan import IdealScan, PulseShape
from lidarcheck.sensor import Sensor, SpadArray

__all__ = ["WINDOW_M", "SignBeams", "check_expected", "check_fit", "sign_beams", "with_ghost"]

WINDOW_M = 1.0
"""An echo this close to where the ghost should be is taken for it; so is none that is further away."""
OF_SIGN_M = 3.0
_UNIT = 1e-6
FEWEST_RETRO_BEAMS = 3


@dataclass(frozen=True)
class SignBeams:
    """The beams of one dataset that see its sign, and could show a ghost, shapes (n,).

    `range_m`: true range of the sign; `unit_signal`: S that a ghost of strength 1 and exponent 0 would have.
    `detected`: an echo stands at the ghost's place; `area` of it and `beyond_m`, its range beyond twice the sign's true
    range, NaN without one. `sensor`, `shape`, `background_per_ns`: what sees the ghosts.
    """

    name: str
    range_m: FloatArray
    unit_signal: FloatArray
    detected: npt.NDArray[np.bool_]
    area: FloatArray
    peak: FloatArray
    beyond_m: FloatArray
    sensor: Sensor
    shape: PulseShape | None
    background_per_ns: float
    sign_early_m: float

    def __len__(self) -> int:
        return len(self.range_m)


@dataclass(frozen=True)
class _Lit:
    """The beams of an ideal scan that a ghost can be on: keys, true range, unit signal; shapes (n,)."""

    key: IndexArray
    range_m: FloatArray
    unit_signal: FloatArray
    sensor: Sensor
    shape: PulseShape | None
    background_per_ns: float


def with_ghost(model: Model, **values: float) -> Model:
    """The model with the ghost effect of these values, in its place if it has one; what is not given stays."""
    ghost = with_role("ghost")
    old = next((effect for effect in model.effects if isinstance(effect, ghost)), None)
    if old is None:
        return model.with_(ghost(**values))
    new = dataclasses.replace(old, **values)
    return dataclasses.replace(model, effects=tuple(new if effect is old else effect for effect in model.effects))


def check_expected(found: GhostScan, ideal: IdealScan, model: Model) -> None:
    """Refuse, with an `InputError`, a scan without the sign that the ideal scan has; says what is there instead."""
    retro = [number for number, material in model.materials.items() if material.kind == "retro"]
    rows = np.flatnonzero(np.isin(ideal.material_id, retro) & (ideal.distance_m > 0.0))
    if len(rows) < FEWEST_RETRO_BEAMS:
        what = f"the ideal scan has {len(rows)} beams on a retro-reflector of the model, so no sign"
        raise InputError(what, file=ideal.file or found.name, fix="check the material IDs, or name another ideal scan")
    part = ideal.take(rows)
    place = place_of(ideal.beams, part.layer, part.point)
    observations = Returns(*place, part.distance_m, np.ones(len(rows)), np.arange(len(rows)))
    largest = next(
        iter(
            clusters_of(
                observations, np.arange(len(rows)), grid_steps(*place_of(ideal.beams, ideal.layer, ideal.point))
            )
        ),
        np.arange(len(rows)),
    )
    range_m = float(np.median(part.distance_m[largest]))
    if not any(abs(sign.range_m - range_m) < OF_SIGN_M for sign in found.signs):
        there = ", ".join(f"{sign.range_m:.2f} m" for sign in found.signs)
        raise InputError(
            f"the ideal scan has a sign of {len(largest)} beams at {range_m:.2f} m, and the scan has none within "
            f"{OF_SIGN_M:g} m of that; signs found at {there}",
            file=found.name,
            fix="name the ideal scan of the same frame, in the scans' order",
        )


def check_fit(model: Model) -> None:
    """Refuse a model whose ghosts cannot be fitted: their S is told by the AREA of a SPAD array."""
    if not isinstance(model.sensor.nominal, SpadArray):
        what = (
            f"{model.sensor.name} has the detector {model.sensor.detector}; the S of a ghost is told by the AREA of a "
        )
        raise InputError(f"{what}spad_array alone", file=model.file, fix="find ghosts, and set retro_ghost by hand")


def sign_beams(found: Sequence[GhostScan], ideals: Sequence[IdealScan], model: Model) -> list[SignBeams]:
    """The beams of each dataset on which a ghost can stand, and what does; a ghost's AREA is needed.

    The place of the ghosts is where those that were found stand most; without any, one cannot know what to look for.
    `InputError` where a dataset lacks its sign, or none has a ghost.
    """
    check_fit(model)
    lit = [_lit(ideal, model) for ideal in ideals]
    for one, ideal in zip(found, ideals, strict=True):
        if one.brightness.column != "AREA":
            what = f"the scan has no AREA, only {one.brightness.column}, from which no S can be told"
            raise InputError(what, file=one.name, fix="give scans with AREA")
        check_expected(one, ideal, model)
    beyond = [_beyond(one, light) for one, light in zip(found, lit, strict=True)]
    at_ghosts = np.concatenate([b[one.label == GHOST] for one, b in zip(found, beyond, strict=True)])
    at_ghosts = at_ghosts[np.isfinite(at_ghosts)]
    if not len(at_ghosts):
        limits = "; ".join(f"{one.name}: {one.signs[0].why}" for one in found)
        raise InputError(
            f"no dataset has a ghost that a fit could use ({limits})",
            fix="`ghosts find` says on how many of its beams each sign could still have one",
        )
    centre_m = float(np.median(at_ghosts))
    return [_beams(one, light, b, centre_m) for one, light, b in zip(found, lit, beyond, strict=True)]


def _lit(ideal: IdealScan, model: Model) -> _Lit:
    """Where a ghost of unit strength would be, by the model's own way of light."""
    unit = with_ghost(model, strength=_UNIT, exponent=0.0, extra_m=0.0)
    light, sensor = light_after_effects(ideal, unit)
    met = aimed(ideal, unit)
    row, beam = light.rows(), light.pulse_beam
    distance = np.where(row >= 0, met.distance_m[row], np.nan)
    ghosts = np.flatnonzero(np.abs(light.pulse_range_m - 2.0 * distance) < 1e-9)
    beams, of = np.unique(beam[ghosts], return_inverse=True)
    signal = np.bincount(of, light.pulse_signal[ghosts], len(beams))
    range_m = np.bincount(of, light.pulse_signal[ghosts] * distance[ghosts], len(beams)) / signal
    background = float(np.median(light.background_per_ns[beams])) if len(beams) else sensor.background_per_ns
    keys = beam_keys(light.layer, light.point)[beams]
    return _Lit(keys, range_m, signal / _UNIT, sensor, light.shape, background)


def _beyond(found: GhostScan, lit: _Lit) -> FloatArray:
    """Range of each echo beyond twice the true range of the sign on its beam; NaN off the sign; shape (n,)."""
    place = _place(lit, beam_keys(found.scan.layer, found.scan.point))
    beyond_m = np.full(len(found.scan), np.nan)
    on = place >= 0
    beyond_m[on] = found.scan.range_m[on] - 2.0 * lit.range_m[place[on]]
    return beyond_m


def _place(lit: _Lit, keys: IndexArray) -> IndexArray:
    """Index of beams among the lit ones, -1 for others."""
    if not len(lit.key):
        return np.full(len(keys), -1, dtype=np.int64)
    at = np.minimum(np.searchsorted(lit.key, keys), len(lit.key) - 1)
    return np.where(lit.key[at] == keys, at, -1)


def _beams(found: GhostScan, lit: _Lit, beyond_m: FloatArray, centre_m: float) -> SignBeams:
    """Beams with an echo of their sign; of several echoes at the ghost's place that which is closest to it."""
    scan, place = found.scan, _place(lit, beam_keys(found.scan.layer, found.scan.point))
    on_sign = np.flatnonzero((found.label == SIGN) & (place >= 0))
    on_sign = on_sign[np.abs(scan.range_m[on_sign] - lit.range_m[place[on_sign]]) < OF_SIGN_M]
    seen = np.unique(place[on_sign])
    early = float(np.median(scan.range_m[on_sign] - lit.range_m[place[on_sign]])) if len(on_sign) else float("nan")
    near = np.flatnonzero((found.label != SIGN) & (np.abs(beyond_m - centre_m) <= WINDOW_M) & np.isin(place, seen))
    near = near[np.argsort(np.abs(beyond_m[near] - centre_m), kind="stable")[::-1]]
    echo = np.full(len(lit.key), -1, dtype=np.int64)
    echo[place[near]] = near  # the last written, and so kept, is the closest
    held = np.bincount(place[place >= 0], minlength=len(lit.key))
    # A beam that reports as many echoes as it can says nothing of a fainter one.
    seen = seen[(echo[seen] >= 0) | (held[seen] < lit.sensor.max_echoes)]
    echo = echo[seen]
    columns = [np.where(echo >= 0, column[echo], np.nan) for column in (scan.area, scan.peak, beyond_m)]
    return SignBeams(
        name=found.name,
        range_m=lit.range_m[seen],
        unit_signal=lit.unit_signal[seen],
        detected=echo >= 0,
        area=columns[0],
        peak=columns[1],
        beyond_m=columns[2],
        sensor=lit.sensor,
        shape=lit.shape,
        background_per_ns=lit.background_per_ns,
        sign_early_m=early,
    )
