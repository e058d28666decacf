"""The light that comes back: from what each beam meets to the pulses that reach it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IndexArray
from lidarcheck.effects.shared.reflectance import reflectance_of
from lidarcheck.errors import InputError, UsageError
from lidarcheck.model.sharing import Share, serially
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Light
from lidarcheck.sensor import Material

__all__ = ["light_of", "material_tables", "surface_signal"]

_CHUNK = 32768
"""Rows that are worked on at a time: few enough for what lies between to stay in the cache."""
_MOST_MATERIALS = 65536


def surface_signal(ideal: IdealScan, model: Model, share: Share = serially) -> FloatArray:
    """S of each row of the ideal scan, as `_by_materials`; with the row's own reflectance where it has one."""
    signal, reflectance = _by_materials(ideal, model, share), reflectance_of(ideal)
    if reflectance is None or not np.isfinite(reflectance).any():
        return signal
    white = {number: replace(material, reflectance=1.0) for number, material in model.materials.items()}
    own = _by_materials(ideal, replace(model, materials=white), share) * reflectance
    return np.where(np.isfinite(reflectance), own, signal)


def _by_materials(ideal: IdealScan, model: Model, share: Share) -> FloatArray:
    """S of each row of the ideal scan: primary avalanches per SPAD and shot, 0 where the row meets nothing.

    S = K rho cos(iota) / R^2 for a Lambertian surface, K rho gain / R^2 for a retro-reflector (lidar range equation of
    an extended target in a clear atmosphere, constants folded into K); R^2 + near^2 where the sensor's optics lose
    light close by. `InputError` names a material without an entry.
    """
    from lidarcheck.model.exact.range_equation import NOT_FINITE, UNKNOWN, range_equation

    strength, falloff, material = _responses(ideal, model)
    near2 = model.sensor.near_m * model.sensor.near_m
    signal, wrong = np.empty(len(ideal)), np.zeros(len(ideal) // _CHUNK + 1, dtype=np.int64)

    def fill(start: int) -> None:
        rows = slice(start, start + _CHUNK)
        with np.errstate(invalid="ignore"):
            cosine = elementary.cos(np.deg2rad(ideal.incidence_deg[rows]))
        columns = (ideal.distance_m[rows], cosine, material[rows])
        wrong[start // _CHUNK] = range_equation(*columns, strength, falloff, near2, signal[rows])

    share(fill, range(0, len(ideal), _CHUNK))
    found = int(np.bitwise_or.reduce(wrong))
    if found & NOT_FINITE:
        raise UsageError("the ideal scan holds a distance below 0, or one that is not finite", fix="0 means no surface")
    if found & UNKNOWN:
        known = np.isin(ideal.material_id, list(model.materials))
        raise _missing(ideal, int(np.flatnonzero((ideal.distance_m > 0.0) & ~known)[0]), model)
    return signal


def _responses(ideal: IdealScan, model: Model) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int32]]:
    """The tables of `material_tables`, and each row's place in them."""
    tables = material_tables(model)
    if tables is not None:
        return *tables, ideal.material_id
    ids, place = np.unique(ideal.material_id, return_inverse=True)
    strength, falloff = np.full(len(ids) + 1, np.nan), np.zeros(len(ids) + 1)
    for i, number in enumerate(ids):
        if int(number) in model.materials:
            gain, falloff[i] = _response(model.materials[int(number)])
            strength[i] = model.sensor.signal_at_1m * gain
    return strength, falloff, place.astype(np.int32)


def _response(material: Material) -> tuple[float, float]:
    """Reflectance times gain, and the power of the cosine."""
    if material.kind == "retro":
        return material.reflectance * material.retro_gain, 0.0
    return material.reflectance, 1.0


def material_tables(model: Model) -> tuple[FloatArray, FloatArray] | None:
    """K times reflectance and gain, and the power of the cosine, by a material's number; NaN where there is none.

    One number more than there are materials; None where there are negative numbers or large ones.
    """
    most = max(model.materials, default=0)
    if min(model.materials, default=0) < 0 or most >= _MOST_MATERIALS:
        return None
    strength, falloff = np.full(most + 2, np.nan), np.zeros(most + 2)
    for number, material in model.materials.items():
        gain, falloff[number] = _response(material)
        strength[number] = model.sensor.signal_at_1m * gain
    return strength, falloff


def _missing(ideal: IdealScan, row: int, model: Model) -> InputError:
    material_id = int(ideal.material_id[row])
    scene = ideal.file or "the ideal scan"
    known = ", ".join(str(i) for i in sorted(model.materials)) or "none"
    return InputError(
        f"material {material_id} is not in the table of materials (there: {known}); "
        f"in {scene} the beam Layer {ideal.layer[row]}, Point {ideal.point[row]} meets it first",
        file=model.file,
        fix=f"add [materials.{material_id}] with name, reflectance and kind",
    )


def light_of(ideal: IdealScan, model: Model, share: Share = serially) -> Light:
    """The light of each beam of an ideal scan, beams in order of (layer, point).

    Sub-beams (several rows of one beam) carry their shares of the beam's light, equal ones unless the scan says
    otherwise; each becomes a pulse of its own.
    """
    signal = surface_signal(ideal, model, share)
    if ideal.in_order:
        return _one_row_a_beam(ideal, signal, model)
    # Rows of one beam may stand in any order; nearer pulses first, so that the order of rows cannot matter.
    order, first_row = _nearer_first(ideal, signal)
    rows_per_beam = np.diff(np.append(first_row, len(order)))
    part = np.repeat(1.0 / np.maximum(rows_per_beam, 1), rows_per_beam) if ideal.share is None else ideal.share[order]
    return Light(
        layer=ideal.layer[order][first_row],
        point=ideal.point[order][first_row],
        background_per_ns=np.full(len(first_row), model.sensor.background_per_ns),
        first_pulse=np.append(first_row, len(order)),
        pulse_range_m=ideal.distance_m[order],
        pulse_signal=signal[order] * part,
        pulse_row=order.astype(np.int32),
        beams=ideal.beams,
    )


def _nearer_first(ideal: IdealScan, signal: FloatArray) -> tuple[IndexArray, IndexArray]:
    """The rows in order of (layer, point, distance, signal), shape (n,), and where in it each beam begins."""
    from lidarcheck.model.row_order import sort_in_beams

    key = ideal.layer.astype(np.int64) << 32 | ideal.point
    order = np.arange(len(key))
    beams_in_order = bool(np.all(key[1:] >= key[:-1]))
    if not beams_in_order:
        order = np.argsort(key, kind="stable")
        key = key[order]
    first = np.flatnonzero(np.concatenate(([True], key[1:] > key[:-1]))) if len(key) else np.empty(0, np.int64)
    sort_in_beams(np.append(first, len(key)), ideal.distance_m, signal, order)
    return order, first


def _one_row_a_beam(ideal: IdealScan, signal: FloatArray, model: Model) -> Light:
    """The light of an ideal scan whose rows are its beams, in order."""
    n = len(signal)
    return Light(
        layer=ideal.layer,
        point=ideal.point,
        background_per_ns=np.full(n, model.sensor.background_per_ns),
        first_pulse=np.arange(n + 1),
        pulse_range_m=ideal.distance_m,
        pulse_signal=signal if ideal.share is None else signal * ideal.share,
        pulse_row=np.arange(n, dtype=np.int32),
        beams=ideal.beams,
    )
