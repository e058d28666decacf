"""A profile read off a figure beside its target: what is simulated are beams that get the light of each of its offsets.

It says nothing of beams without an echo, nor of how many echoes a mean is of, so that only features are compared, each
offset counts as one beam, and its spread is what the sensor's echoes of such light scatter by.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.blooming.cells import Cells
from lidarcheck.calibration.blooming.csv import read_profile
from lidarcheck.calibration.blooming.operator import light_of_table, nodes_of
from lidarcheck.calibration.blooming.response import FEATURES, bin_length_m, response_of, strongest_echoes
from lidarcheck.calibration.blooming.workflow import ModelSide
from lidarcheck.calibration.number.beside import Beside
from lidarcheck.calibration.number.found_target import bench_of
from lidarcheck.calibration.number.light import Lights, keys_of
from lidarcheck.calibration.number.misfit import Misfit
from lidarcheck.calibration.number.request import Request
from lidarcheck.calibration.number.seen import Seen
from lidarcheck.effects.base import Curve
from lidarcheck.effects.finding import with_role
from lidarcheck.errors import InputError
from lidarcheck.formats.lut import LutTable
from lidarcheck.inference.observed.echo_view import EchoView, Slot
from lidarcheck.model.chain import echoes_of
from lidarcheck.model.spec import Model
from lidarcheck.scan import Light, Scan
from lidarcheck.sensor import SpadArray

__all__ = ["OnProfile"]

_BEAMS = 16
"""Beams of each offset, at as many places within a bin; their mean is one echo's worth of what is seen."""


@dataclass(frozen=True)
class OnProfile:
    """A profile, ready to be compared, as `prepared.OnFrames` is."""

    request: Request
    cells: Cells
    beside: Beside
    slots: tuple[Slot, ...]
    reach_m: float
    misfit: Misfit

    @classmethod
    def of(cls, model: Model, request: Request, key: str) -> OnProfile:
        """Read the profile; `InputError` where it is another axis's, or the model does not say what its target is."""
        file, bench = Path(request.measured[0]), bench_of(model, request, str(request.measured[0]))
        assert bench.signal_at_1m is not None
        cells = read_profile(file, bench.counts, signal_at_1m=bench.signal_at_1m, distance_m=request.distance_m)
        if cells.axis != request.axis:
            fix = f"look at its {cells.axis} table"
            raise InputError(f"is a {cells.axis} profile, and the {request.axis} table is edited", file=file, fix=fix)
        cells = cells.take(cells.bloom & np.isfinite(cells.value).any(axis=1))
        slots = tuple(slot for slot in EchoView.of(bench.sensor).slots if slot.name in FEATURES)
        n = len(cells)
        number = np.arange(n)
        beside = Beside(
            np.zeros(n, dtype=np.int64), keys_of(number, np.zeros(n)), number, np.full(n, cells.distance_m), number,
            cells.offset,
        )  # fmt: skip
        value, spread = _columns(cells, slots, bench)
        misfit = Misfit(beside, slots, Seen(np.ones(n, dtype=bool), value), key, spread)
        return cls(request, cells, beside, slots, EchoView.of(model.sensor).reach_m, misfit)

    def lights(self, model: Model, seeds: Sequence[int]) -> Lights:
        """What the beams of each offset get with a model's table."""
        bench = bench_of(model, self.request, self.cells.name)
        light = self._light(model, bench)
        digest = hashlib.sha256(light.pulse_signal.tobytes() + light.pulse_range_m.tobytes())
        digest.update(repr((bench.sensor, bench.shape, [*seeds])).encode())

        def scans(k: int) -> list[Scan]:
            return [echoes_of(light, bench.sensor, seed=seeds[k], threads=1, rounded=False)]

        return Lights(digest.hexdigest(), scans)

    def seen(self, scans: Sequence[Scan]) -> Seen:
        """The mean echo of each offset."""
        [scan] = scans
        echoes = strongest_echoes(scan.take(np.abs(scan.range_m - self.cells.distance_m) <= self.reach_m))
        n = len(self.cells)
        count = np.bincount(echoes.layer, minlength=n)
        columns = [np.bincount(echoes.layer, slot.of([echoes]), n) for slot in self.slots]
        return Seen(count > 0, np.column_stack(columns) / np.maximum(count, 1)[:, None])

    def _light(self, model: Model, bench: ModelSide) -> Light:
        kind = with_role(f"{self.request.axis} blooming")
        effect: Any = next((one for one in model.effects if isinstance(one, kind)), None)
        signal = self.cells.target + self.cells.other
        if effect is not None:
            table: Curve | None = effect.lut
            if table is None:
                fix = "give the effect a table, `lut`"
                raise InputError("is compared with a table, and the model has none", file=self.cells.name, fix=fix)
            nodes = nodes_of(LutTable(np.asarray(table.x), np.asarray(table.y), (), ()), self.request.axis)
            signal = signal + effect.strength * (light_of_table(self.cells, nodes) - signal)
        n, place = len(signal), (np.arange(_BEAMS) + 0.5) / _BEAMS
        bin_m = bin_length_m(SpadArray.narrow(bench.sensor))
        first_m = bin_m * np.floor(self.cells.distance_m / bin_m)
        return Light(
            layer=np.repeat(np.arange(n), _BEAMS), point=np.tile(np.arange(_BEAMS), n),
            background_per_ns=np.full(n * _BEAMS, bench.sensor.background_per_ns),
            first_pulse=np.arange(n * _BEAMS + 1), pulse_range_m=np.tile(first_m + bin_m * place, n),
            pulse_signal=np.repeat(signal, _BEAMS), shape=bench.shape,
        )  # fmt: skip


def _columns(cells: Cells, slots: Sequence[Slot], bench: ModelSide) -> tuple[FloatArray, FloatArray]:
    """The features as the slots show them, (n, features), and the spreads, (n, 1 + features); what is not known has an
    infinite spread, as the share of beams with an echo has."""
    response = response_of(bench.sensor, bench.shape)
    known = np.isfinite(cells.value)
    area = np.where(known[:, 1], cells.value[:, 1], np.nan_to_num(cells.value[:, 0]) * 9.0)
    scatter = np.sqrt(response.scatter(response.light_of_area(area)))
    value, spread = np.zeros((len(cells), len(slots))), np.full((len(cells), 1 + len(slots)), np.inf)
    for j, slot in enumerate(slots):
        at = FEATURES.index(slot.name)
        there, of = known[:, at], np.maximum(np.nan_to_num(cells.value[:, at]), 1.0)
        value[:, j] = np.where(there, np.log(of) if slot.log else of, 0.0)
        sd = np.maximum(scatter[:, at] / of if slot.log else scatter[:, at], slot.floor)
        spread[there, 1 + j] = sd[there]
    return value, spread
