"""The blooming calibration: from measured scans or profiles at several distances to a table that the model can use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.calibration.blooming.cells import Cells, Profile, cells_of_scan, profile_of
from lidarcheck.calibration.blooming.csv import is_profile, profile_axis, read_profile
from lidarcheck.calibration.blooming.fit import FreeLight, TableFit, fit_table
from lidarcheck.calibration.blooming.operator import Nodes, light_of_table, nodes_of, spread
from lidarcheck.calibration.blooming.response import FEATURES, Response, response_of
from lidarcheck.calibration.blooming.target import bright_beams, own_light, target_in_scan
from lidarcheck.cases.source import Named, ideal_of, scan_of
from lidarcheck.effects.base import Curve, Effect
from lidarcheck.effects.finding import make, with_role
from lidarcheck.errors import InputError, NotThereError, UsageError
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.lut import Axis, LutFile, LutTable
from lidarcheck.formats.settings import Settings, default_settings
from lidarcheck.kpi.variant import check_variant
from lidarcheck.model import Model
from lidarcheck.scan import IdealScan, Light, PulseShape
from lidarcheck.sensor import Sensor, SpadArray
from lidarcheck.workers import one_blas_thread

__all__ = [
    "BloomingCalibration",
    "BloomingMeasurement",
    "ModelSide",
    "TableRow",
    "bare_of",
    "calibrate",
    "check_counts",
    "fitted_model",
    "gather",
    "model_side_of",
    "rms_of",
]

ProgressCallback = Callable[[str], object]

LEAST_CELLS = 8
"""Offsets beside the target that must have echoes: a fit of fewer is a drawing."""
CLEAR_PEAK = 20.0
"""PEAK from which on a profile is judged: twice the threshold."""
_FITTED, _SMOOTH, _TOLD = 0.3, 1.0, 0.5
"""Half-widths of a 95 % interval [decades] up to which a row counts as fitted, and as told by its neighbours; and the
standard deviation up to which data that several rows share tell of each."""


@dataclass(frozen=True)
class BloomingMeasurement:
    """A measured scan or profile, where its target stands, its ideal scan (None where not known), what is declared."""

    path: Named
    distance_m: float | None = None
    ideal: Named | None = None
    placement: Placement = AS_IT_IS


@dataclass(frozen=True)
class ModelSide:
    """What measurements are held against: the sensor behind its effects, its pulse, and the target's light.

    `model` is without blooming. `signal_at_1m`: S of the target on a beam, times R^2, where no ideal scan tells;
    `material`: that target's, None where the number was given.
    """

    model: Model
    sensor: Sensor
    shape: PulseShape | None
    axis: Axis
    bright_signal: float
    signal_at_1m: float | None
    material: int | None
    settings: Settings

    @property
    def counts(self) -> SpadArray:
        """The SPADs that count PEAK, AREA and WIDTH; of a program those of the sensor that its model names."""
        return SpadArray.narrow(self.sensor.nominal)


@dataclass(frozen=True)
class TableRow:
    """A row of the fitted table: Y as given, as written, its 95 % interval and how it was found.

    `status`: `fitted` by the data, its light above the threshold; `smooth`, told by its neighbours or by faint
    light; `limit`, nothing is seen there and Y is no more
    than what would be seen; `held`, nothing is known and Y is as given.
    """

    x: float
    before: float
    y: float
    low: float
    high: float
    status: str


@dataclass(frozen=True)
class BloomingCalibration:
    """A fitted table, what it rests on and how it holds; `expected`: profiles as the written table gives them."""

    axis: Axis
    fit: TableFit
    lut: LutFile
    rows: tuple[TableRow, ...]
    cells: tuple[Cells, ...]
    measured: tuple[Profile, ...]
    expected: tuple[Profile, ...]


def model_side_of(
    model: Model, axis: Axis, *, settings: Settings | None = None, material: int | None = None,
    signal_at_1m: float | None = None,
) -> ModelSide:  # fmt: skip
    """The bench of a model. Of several retro-reflectors `material` says which is the target."""
    check_counts(model)
    bare, bright = bare_of(model, axis)
    nothing = np.zeros(1, dtype=np.int32)
    beams = model.sensor.beams
    light, sensor = _light_of(IdealScan(nothing, nothing, np.zeros(1), nothing, np.zeros(1), beams=beams), bare)
    if signal_at_1m is None:
        material, signal_at_1m = _target_signal(model, material)
    else:
        material = None
    settings = settings or default_settings(axis)
    return ModelSide(bare, sensor, light.shape, axis, bright, signal_at_1m, material, settings)


def check_counts(model: Model) -> None:
    """Refuse a sensor that counts no PEAK, AREA and WIDTH, which tables are fitted to."""
    if not isinstance(model.sensor.nominal, SpadArray):
        what = f"{model.sensor.name} has the detector {model.sensor.detector}; blooming is fitted to the PEAK, AREA"
        raise NotThereError(
            f"{what} and WIDTH of a spad_array", file=model.file, fix="set blooming by hand in the model"
        )


def bare_of(model: Model, axis: Axis) -> tuple[Model, float]:
    """(the model without blooming, the least signal of a target that blooms along an axis)."""
    blooming = _blooming(axis)
    given = [effect for effect in model.effects if isinstance(effect, blooming)]
    effect: Any = given[0] if given else blooming()
    bare = model.without(_blooming("vertical").name).without(_blooming("horizontal").name)
    return bare, float(effect.bright_signal)


def _blooming(axis: Axis) -> type[Effect]:
    """The effect whose table is fitted."""
    return with_role(f"{axis} blooming")


def _light_of(ideal: IdealScan, model: Model) -> tuple[Light, Sensor]:
    from lidarcheck.model.stages import light_after_effects

    return light_after_effects(ideal, model)


def _target_signal(model: Model, wanted: int | None) -> tuple[int | None, float | None]:
    """The target's material and its S times R^2; None where the model does not say which it is."""
    retros = {number: m for number, m in model.materials.items() if m.kind == "retro"}
    known = ", ".join(map(str, sorted(retros))) or "none"
    if wanted is not None and wanted not in retros:
        raise UsageError(f"material {wanted} is no retro-reflector of the model", fix=f"there are: {known}")
    if wanted is None and len(retros) != 1:
        return None, None
    number = next(iter(retros)) if wanted is None else wanted
    return number, model.sensor.signal_at_1m * retros[number].reflectance * retros[number].retro_gain


def gather(
    measured: Sequence[BloomingMeasurement], bench: ModelSide, reach: tuple[float, float] | None = None
) -> list[Cells]:
    """The cells of all measurements, within `reach` of offsets where it is given. Errors name the file."""
    found = [_cells(one, bench) for one in measured]
    if reach is not None:
        found = [c.take((c.offset >= reach[0]) & (c.offset <= reach[1]) | (c.target > 0.0)) for c in found]
    return found


def _cells(measured: BloomingMeasurement, bench: ModelSide) -> Cells:
    name, axis = str(measured.path), bench.axis
    if is_profile(measured.path):
        if profile_axis(measured.path) != axis:
            raise InputError(f"is a {profile_axis(measured.path)} profile", file=name, fix=f"{axis} ones are asked for")
        signal = _needed_signal(bench, name)
        return read_profile(measured.path, bench.counts, signal_at_1m=signal, distance_m=measured.distance_m)
    scan = scan_of(measured.path, measured.placement, bench.sensor)
    check_variant(scan, bench.sensor, name)
    missing = [column for column in ("PEAK", "AREA", "WIDTH") if column in scan.defaulted]
    if missing:
        raise InputError(
            f"has no {', '.join(missing)}", file=name, fix="blooming needs PEAK, AREA and WIDTH of each echo"
        )
    if measured.ideal is None:
        target = target_in_scan(
            scan, bench.counts, axis, signal_at_1m=_needed_signal(bench, name), settings=bench.settings,
            distance_m=measured.distance_m, name=name,
        )  # fmt: skip
        if target.signal.max() < bench.bright_signal:
            what = f"the target's S is {target.signal.max():.3g} at {target.distance_m:.1f} m, which does not bloom"
            raise NotThereError(what, file=name, fix=f"it must be at least bright_signal, {bench.bright_signal:g}")
        return cells_of_scan(scan, target, axis, name=name)
    light, _ = _light_of(ideal_of(measured.ideal, bench.sensor), bench.model)
    target = bright_beams(light, bench.counts, axis, bench.bright_signal, measured.distance_m, name)
    own = own_light(light, target, axis, bench.bright_signal)
    return cells_of_scan(scan, target, axis, own=own, name=name)


def _needed_signal(bench: ModelSide, name: str) -> float:
    if bench.signal_at_1m is None:
        retros = [str(number) for number, m in bench.model.materials.items() if m.kind == "retro"]
        found = f"retro-reflectors {', '.join(retros)}" if retros else "no retro-reflector"
        what = f"how bright the target is: the model has {found}"
        raise InputError(f"does not say {what}", file=name, fix="say which with --target, or give --ideal or --signal")
    return bench.signal_at_1m


@one_blas_thread()  # on two it takes several times the processor time
def calibrate(
    measured: Sequence[Cells],
    bench: ModelSide,
    lut: LutFile,
    *,
    free: FreeLight = FreeLight(),  # noqa: B008 - frozen
    smoothness: float | None = None,
    progress: ProgressCallback = lambda _what: None,
) -> BloomingCalibration:
    """Fit the table of `lut` to all measurements and give the file with it; its X stay as they are."""
    shaped = with_role("pulse").why_not(bench.sensor) if free.pulse or free.tail else ""
    if shaped:
        raise UsageError(f"the pulse cannot be free: {shaped}", fix="leave the pulse and its tail as they are")
    table = lut.tables.get(bench.axis)
    if table is None:
        raise InputError(f"the file has no {bench.axis} table", file=lut.file, fix=f"it has {', '.join(lut.tables)}")
    nodes = nodes_of(table, bench.axis)
    for cells in measured:
        _check_cover(cells, nodes, lut)
    _check_number(measured, nodes)
    fit = fit_table(
        measured, nodes, bench.sensor, shape=bench.shape, free=free, smoothness=smoothness, progress=progress
    )
    rows = _rows(fit, table)
    new = lut
    for number, row in enumerate(rows):
        if row.status != "held":
            new = new.with_y(bench.axis, number, row.y)
    final = nodes_of(new.tables[bench.axis], bench.axis)
    expected = tuple(
        expected_profile(cells, final, response_of(bench.sensor, fit.shape, within=cells.within), fit.brightness)
        for cells in measured
    )
    profiles = tuple(profile_of(cells) for cells in measured)
    return BloomingCalibration(bench.axis, fit, new, rows, tuple(measured), profiles, expected)


def _check_cover(cells: Cells, nodes: Nodes, lut: LutFile) -> None:
    """Refuse a table beyond which the target blooms visibly."""
    outside = cells.bloom & (cells.other == 0.0) & (spread(cells, nodes).max(axis=1) == 0.0)
    lost, seen = int(cells.echoes[outside].sum()), int(cells.echoes[cells.bloom].sum())
    if lost >= max(3, 0.05 * seen):
        low, high = nodes.reach
        there = cells.offset[outside]
        what = (
            f"the {cells.axis} table covers offsets {low:g} to {high:g}, but {lost} of {seen} echoes beside the "
            f"target in {cells.name} lie outside, from {there.min():g} to {there.max():g}"
        )
        raise InputError(what, file=lut.file, fix="add X, or leave them out with --reach LOW:HIGH")


def _check_number(measured: Sequence[Cells], nodes: Nodes) -> None:
    """Refuse fewer offsets with echoes than a fit needs."""
    total = 0
    for cells in measured:
        here = cells.bloom & (spread(cells, nodes).max(axis=1) > 0.0)
        count = len(np.unique(cells.offset[here]))
        if count == 0:
            what = f"no echo beside the target at {cells.distance_m:.1f} m: nothing of its bloom is seen"
            raise InputError(what, file=cells.name, fix="leave it out, or use a brighter target")
        total += count
    if total < LEAST_CELLS:
        what = f"{total} offsets beside the target have an echo; a fit needs at least {LEAST_CELLS}"
        raise InputError(what, file=measured[0].name, fix="add scans at other distances")


def _rows(fit: TableFit, table: LutTable) -> tuple[TableRow, ...]:
    half = np.minimum(1.96 * fit.sigma, 9.0)
    rows = []
    for x, before, k in zip(table.x.tolist(), table.y.tolist(), fit.nodes.row.tolist(), strict=True):
        y, low, high = (float(np.clip(10.0 ** (fit.log_y[k] + s * half[k]), 0.0, 1.0)) for s in (0.0, -1.0, 1.0))
        limit = float(10.0 ** fit.limit[k])
        if not fit.active[k]:
            rows.append(TableRow(x, before, before, np.nan, np.nan, "held"))
        elif fit.clear[k] and half[k] <= _FITTED and 1.96 * fit.data_sigma[k] <= _FITTED:
            rows.append(TableRow(x, before, y, low, high, "fitted"))
        elif fit.dark[k] and limit < 1.0:
            rows.append(TableRow(x, before, min(before, limit), 0.0, limit, "limit"))
        elif half[k] <= _SMOOTH or fit.data_sigma[k] <= _TOLD:
            rows.append(TableRow(x, before, y, low, high, "smooth"))
        else:
            rows.append(TableRow(x, before, before, low, high, "held"))
    return tuple(rows)


def expected_profile(cells: Cells, nodes: Nodes, response: Response, brightness: float = 1.0) -> Profile:
    """What the sensor is expected to show of the cells with a table, where they have echoes."""
    light = brightness * (light_of_table(cells, nodes) - cells.other) + cells.other
    mean, _ = response.features(np.log10(np.maximum(light, 1e-9)))
    return profile_of(replace(cells, value=np.where(np.isfinite(cells.value), mean, np.nan)))


def rms_of(measured: Profile, expected: Profile) -> dict[str, float]:
    """RMS of expected over measured - 1 for PEAK and AREA, of the difference [ns] for WIDTH; beside the target, where
    the measured PEAK, or AREA over the ON time of 9 bins, exceeds 20.
    """
    height = np.where(np.isfinite(measured.value[:, 0]), measured.value[:, 0], measured.value[:, 1] / 9.0)
    clear = ~measured.on_target & (height > CLEAR_PEAK)
    found = {}
    for j, name in enumerate(FEATURES):
        real, made = measured.value[clear, j], expected.value[clear, j]
        off = made - real if name == "WIDTH" else made / real - 1.0
        off = off[np.isfinite(off)]
        found[name] = float(np.sqrt(np.mean(off**2))) if len(off) else float("nan")
    return found


def fitted_model(model: Model, bench: ModelSide, result: BloomingCalibration, file: Path, free: FreeLight) -> Model:
    """The model with the table, which `file` holds, and with the pulse and the target's brightness that were free."""
    table = result.lut.tables[bench.axis]
    curve = Curve(tuple(table.x.tolist()), tuple(table.y.tolist()), str(file))
    new = _put(model, make(_blooming(bench.axis).name, {"lut": curve, "bright_signal": bench.bright_signal}))
    if free.pulse or free.tail:
        shape = result.fit.shape
        stretch = shape.fwhm_ns / bench.sensor.pulse_fwhm_ns
        tail = (
            {"tail_share": shape.tail_share, "tail_ns": shape.tail_ns, "tail_delay_ns": shape.tail_delay_ns}
            if shape.tail_share > 0.0
            else {"tail_share": 0.0}
        )
        new = _put(new, make(with_role("pulse").name, {"stretch": stretch, **tail}))
    if free.brightness and bench.material is not None:
        before = new.materials[bench.material]
        brighter = replace(before, retro_gain=before.retro_gain * result.fit.brightness)
        new = replace(new, materials={**new.materials, bench.material: brighter})
    return new


def _put(model: Model, effect: Effect) -> Model:
    """The model with an effect in the place of the one of its name, else behind those of its stage."""
    if not any(old.name == effect.name for old in model.effects):
        return model.with_(effect)
    return replace(model, effects=tuple(effect if old.name == effect.name else old for old in model.effects))
