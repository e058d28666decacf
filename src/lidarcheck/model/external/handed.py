"""What somebody else's program is handed: the light that reaches each beam, as rows of an ideal scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.shared.reflectance import REFLECTANCE, reflectance_of
from lidarcheck.errors import UsageError
from lidarcheck.model.light import surface_signal
from lidarcheck.model.stages import Run
from lidarcheck.scan import Haze, IdealScan, Light
from lidarcheck.sensor import Material, Program

__all__ = ["BACKGROUND", "handed"]

BACKGROUND = "Background"
"""The further column with the factor on the program's own background."""
_AIR_STEP = 0.5
"""Rows of the air lie this part of a pulse's length apart: together they look as even as the air."""
_FAINT = 0.03
"""Rows of the air that return less than this part of what an echo needs are left out."""


@dataclass(frozen=True)
class _Added:
    """Light that is no row of the ideal scan: its beam of the light, range, S and material; shape (m,) each."""

    beam: IndexArray
    range_m: FloatArray
    signal: FloatArray
    material: IndexArray

    def take(self, rows: IndexArray) -> _Added:
        """Some of these."""
        return _Added(self.beam[rows], self.range_m[rows], self.signal[rows], self.material[rows])


def handed(light: Light, run: Run) -> tuple[IdealScan, tuple[str, ...]]:
    """The ideal scan that makes the program see this light, and its columns beyond those that every program gets.

    Each row of the run's ideal scan stays a row, at the range of its light, with the share that it has of what the
    program itself would make of it: Share = S / S_nominal (R' / R)^2. All other light is further rows of its beam, at
    an incidence of 0, with Share = S R^2 / (K rho g). The background is a factor. What the program does not read is
    left out; `Share` also where every beam has one row and all of its own light.
    """
    program = run.sensor
    assert isinstance(program, Program)
    surface, pulse = _surfaces(light, run.ideal)
    ideal = run.ideal.take(surface)
    beam = light.pulse_beam[pulse]
    met = ideal.distance_m > 0.0
    range_m = np.where(met, light.pulse_range_m[pulse], 0.0)
    nominal = _nominal(run.ideal, run, program)[surface]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = light.pulse_signal[pulse] / nominal * (range_m / ideal.distance_m) ** 2
    seen = met & (nominal > 0.0)
    share = np.where(seen, share, run.ideal.shares()[surface])
    added = _added(light, run, program, pulse, seen)
    if not program.understands("Share"):
        added = added.take(np.empty(0, dtype=np.int64))
    table = _table(ideal, beam, range_m, share, added, light, run)
    return _as_read(table, ideal, program)


def _surfaces(light: Light, ideal: IdealScan) -> tuple[IndexArray, IndexArray]:
    """The rows of the ideal scan that the light's beams have, ascending, and the pulse of each: a beam's first of that
    row; what an effect has added of it stands behind."""
    row, beam = light.rows(), light.pulse_beam
    own = np.flatnonzero(row >= 0)
    own = own[(ideal.layer[row[own]] == light.layer[beam[own]]) & (ideal.point[row[own]] == light.point[beam[own]])]
    rows, first = np.unique(row[own], return_index=True)
    return rows.astype(np.int64), own[first]


def _nominal(ideal: IdealScan, run: Run, program: Program) -> FloatArray:
    """S of each row as the program makes it of a whole row of the ideal scan, (n,): with the materials that it knows,
    and a row's own reflectance where it reads that."""
    if reflectance_of(ideal) is not None and not program.understands(REFLECTANCE):
        ideal = replace(ideal, extra={name: c for name, c in ideal.extra.items() if name != REFLECTANCE})
    sensor = replace(program, signal_at_1m=program.described.signal_at_1m)
    return surface_signal(ideal, replace(run.model, sensor=sensor, materials=_known(run, program)))


def _known(run: Run, program: Program) -> Mapping[int, Material]:
    return {**run.materials, **program.known}


def _added(light: Light, run: Run, program: Program, surface: IndexArray, seen: BoolArray) -> _Added:
    """The pulses that are no surface's own, or of one that the program does not see, and what the air sends back."""
    others = np.ones(len(light.pulse_signal), dtype=bool)
    others[surface[seen]] = False
    others &= (light.pulse_signal > 0.0) & (light.pulse_range_m > 0.0)
    others &= light.pulse_range_m <= program.max_range_m
    beam = light.pulse_beam[others]
    air = program.scatter_material
    plain = _plain(run, program) if others.any() else 0
    material = np.where((light.rows()[others] < 0) & (air is not None), air or 0, plain)
    found = _Added(beam, light.pulse_range_m[others], light.pulse_signal[others], material.astype(np.int64))
    return found if light.haze is None or air is None else _with_air(found, light.haze, program, air)


def _plain(run: Run, program: Program) -> int:
    """The material that light of no surface is handed as: the whitest Lambertian one of the scan, else any."""
    known = _known(run, program)
    there = set(np.unique(run.ideal.material_id[run.ideal.distance_m > 0.0]).tolist())

    def rank(number: int) -> tuple[bool, bool, float, int]:
        return known[number].kind == "lambertian", number in there, known[number].reflectance, -number

    able = [number for number, material in known.items() if material.reflectance > 0.0]
    if not able:
        what = "no material returns light: what effects add to a beam cannot be handed to the program"
        raise UsageError(what, fix="give one of [materials] a reflectance above 0")
    return max(able, key=rank)


def _with_air(found: _Added, haze: Haze, program: Program, material: int) -> _Added:
    """The same and rows of the air: its light of half a pulse's length each, at that light's mean range."""
    cells = max(1, round(_AIR_STEP * program.described.window_m / haze.step_m))
    groups = -(-len(haze.density_per_m) // cells)
    density = np.zeros(groups * cells)
    density[: len(haze.density_per_m)] = haze.density_per_m
    per_cell = density.reshape(groups, cells) * haze.step_m
    middle_m = ((np.arange(groups * cells) + 0.5) * haze.step_m).reshape(groups, cells)
    light = per_cell.sum(axis=1)
    at_m = (per_cell * middle_m).sum(axis=1) / np.where(light > 0.0, light, 1.0)
    faint = _FAINT * program.signal_of(program.threshold_counts)
    beams = len(haze.first_row) - 1
    owner = np.repeat(np.arange(beams), np.diff(haze.first_row))
    columns: list[tuple[IndexArray, FloatArray, FloatArray]] = []
    for group in np.flatnonzero(light >= faint):
        reached = np.clip((haze.row_end_m - middle_m[group, 0] + 0.5 * haze.step_m) / (cells * haze.step_m), 0.0, 1.0)
        signal = light[group] * np.bincount(owner, haze.row_share * reached, minlength=beams)
        lit = np.flatnonzero(signal >= faint)
        columns.append((lit, np.full(len(lit), at_m[group]), signal[lit]))
    if not columns:
        return found
    beam, range_m, signal = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    return _Added(
        np.concatenate([found.beam, beam]),
        np.concatenate([found.range_m, range_m]),
        np.concatenate([found.signal, signal]),
        np.concatenate([found.material, np.full(len(beam), material, dtype=np.int64)]),
    )


def _table(
    ideal: IdealScan, beam: IndexArray, range_m: FloatArray, share: FloatArray, added: _Added, light: Light, run: Run
) -> IdealScan:
    """Surfaces and further rows in one table, each beam's together, in the order in which beams come in the scan."""
    program = run.sensor
    assert isinstance(program, Program)
    n, m = len(ideal), len(added.beam)
    first = np.full(len(light), np.iinfo(np.int64).max)
    np.minimum.at(first, beam, np.arange(n))
    both = np.concatenate([beam, added.beam])
    order = np.lexsort((np.concatenate([np.arange(n), n + added.range_m]), both, first[both]))
    zeros = np.zeros(m)
    own = reflectance_of(ideal)
    known = _known(run, program)
    white = np.array([known[int(i)].reflectance for i in added.material])
    extra = {BACKGROUND: (light.background_per_ns / program.background_per_ns)[both]}
    if own is not None:
        filled = np.where(np.isfinite(own), own, _table_reflectance(ideal, known))
        extra[REFLECTANCE] = np.concatenate([filled, white])
    columns: dict[str, Any] = {
        "layer": light.layer[both],
        "point": light.point[both],
        "distance_m": np.concatenate([range_m, added.range_m]),
        "material_id": np.concatenate([ideal.material_id, added.material]),
        "incidence_deg": np.concatenate([ideal.incidence_deg, zeros]),
        "share": np.concatenate([share, _shares(added, known, program)]),
    }
    if ideal.time_s is not None:
        columns["time_s"] = np.concatenate([ideal.time_s, ideal.time_s[_last_row(beam, added.beam)]])
    table = IdealScan(**columns, extra=extra, file=ideal.file, beams=ideal.beams)
    return table if np.array_equal(order, np.arange(n + m)) else table.take(order)


def _last_row(beam: IndexArray, asked: IndexArray) -> IndexArray:
    """A row of each asked beam."""
    order = np.argsort(beam, kind="stable")
    return np.asarray(order[np.searchsorted(beam[order], asked, side="right") - 1])


def _table_reflectance(ideal: IdealScan, known: Mapping[int, Material]) -> FloatArray:
    ids, place = np.unique(ideal.material_id, return_inverse=True)
    return np.array([known[int(i)].reflectance if int(i) in known else 0.0 for i in ids])[place]


def _shares(added: _Added, known: Mapping[int, Material], program: Program) -> FloatArray:
    """S_p R^2 / (K rho g) of each further row."""
    gains = {i: known[i].reflectance * (known[i].retro_gain if known[i].kind == "retro" else 1.0) for i in known}
    bright = np.array([gains[int(i)] for i in added.material])
    return np.asarray(
        added.signal * added.range_m**2 / (program.described.signal_at_1m * np.where(bright, bright, 1.0))
    )


def _as_read(table: IdealScan, ideal: IdealScan, program: Program) -> tuple[IdealScan, tuple[str, ...]]:
    """The columns that the program reads and that say something, and their names."""
    several = _several(table)
    share = table.share
    assert share is not None
    said = bool(several.any() or np.any(share != 1.0))
    names = []
    if program.understands("Share"):
        names += ["Share"] if said else []
    elif program.understands("Parts") and several.any():
        share, names = _parts(table), ["Share"]
    extra = {}
    for name in (REFLECTANCE, BACKGROUND):
        column = table.extra.get(name)
        if column is not None and program.understands(name) and not (name == BACKGROUND and np.all(column == 1.0)):
            extra[name] = column
            names.append(name)
    timed = table.time_s is not None and program.understands("Time")
    names += ["Time"] if timed else []
    kept = replace(
        table, share=share if "Share" in names else None, time_s=table.time_s if timed else None, extra=extra
    )
    return kept, tuple(names)


def _several(table: IdealScan) -> BoolArray:
    """Whether each row shares its beam, shape (n,)."""
    key = table.layer.astype(np.int64) << 32 | table.point
    _, place, count = np.unique(key, return_inverse=True, return_counts=True)
    return np.asarray(count[place] > 1)


def _parts(table: IdealScan) -> FloatArray:
    """How each beam's light divides among its rows, 1 in all."""
    assert table.share is not None
    key = table.layer.astype(np.int64) << 32 | table.point
    _, place = np.unique(key, return_inverse=True)
    whole = np.bincount(place, table.share)[place]
    return np.where(whole > 0.0, table.share / np.where(whole > 0.0, whole, 1.0), table.shares())
