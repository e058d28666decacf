"""Trying KPIs on an ideal scan: which of them notice when a model loses an effect, and how clearly."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck import elementary
from lidarcheck.formats import load_ideal
from lidarcheck.harness.gate import evidence, sensitivity
from lidarcheck.harness.gate.seeds import Runner, ScenarioJob, SeedRecord
from lidarcheck.harness.gate.sensitivity import resolution
from lidarcheck.harness.kpis.spec import KpiSpec, SeedMeasurement
from lidarcheck.harness.propose.candidates import Watch, watches
from lidarcheck.harness.scenario.measure import measure
from lidarcheck.harness.scenario.scenario import Scenario
from lidarcheck.model.spec import Model

__all__ = ["LOST_SEEDS", "SHARE", "Catch", "KpiTrial"]

SHARE = evidence.error_share(500)
"""The error that one KPI may make in a suite of 500, in which a proposal must still hold."""
LOST_SEEDS = tuple(range(9_000, 9_003))
"""The seeds without an effect, none of them a golden's own."""


@dataclass(frozen=True, slots=True)
class Catch:
    """A KPI that notices when an effect is lost: its mean with the effect and without, in its `unit`.

    `smallest`: the smallest change that the gate catches with 95 % power.
    """

    kpi: str
    unit: str
    present: float
    lost: float
    smallest: float

    @property
    def margin(self) -> float:
        """How many such changes the loss is; above 1 it is caught."""
        return abs(self.lost - self.present) / self.smallest


@dataclass
class KpiTrial:
    """An ideal scan with the KPIs that are tried on it, and what was measured so far.

    `lost`: by effect, the model that lacks it; `tables`: what a scenario's file says of each KPI; `asked_for`: the KPIs
    tried for each effect; `with_all`: by seed, with all effects; `without`: by effect, without it.
    """

    file: Path
    scenario: Scenario
    lost: Mapping[str, Model]
    tables: Mapping[str, dict[str, Any]]
    asked_for: Mapping[str, Sequence[str]]
    with_all: dict[int, SeedMeasurement] = field(default_factory=dict)
    without: dict[str, list[SeedRecord]] = field(default_factory=dict)

    @classmethod
    def of(cls, ideal_file: Path, scenario_file: Path, model: Model, lost: Mapping[str, Model]) -> KpiTrial:
        """An ideal scan with every KPI that might see one of the effects."""
        ideal = load_ideal(ideal_file, model.sensor)
        found: dict[str, Watch] = {}
        asked_for: dict[str, list[str]] = {}
        for name in lost:
            effect = next(effect for effect in model.effects if effect.name == name)
            own = {asked.spec.name: (table, asked) for table, asked in watches(ideal, model, effect)}
            found |= own
            asked_for[name] = list(own)
        asked = tuple(kpi for _, kpi in found.values())
        scenario = Scenario(scenario_file.stem, "", scenario_file, model, ideal, asked)
        return cls(ideal_file, scenario, lost, {name: table for name, (table, _) in found.items()}, asked_for)

    def only(self, names: Sequence[str]) -> KpiTrial:
        """The same trial of these KPIs alone."""
        asked = tuple(kpi for kpi in self.scenario.asked if kpi.spec.name in names)
        return dataclasses.replace(self, scenario=dataclasses.replace(self.scenario, asked=asked))

    def run(self, runner: Runner, seeds: Sequence[int]) -> None:
        """Measure those of the seeds that are lacking with all effects, and, the first time, a few without each."""
        label, model = self.scenario.name, self.scenario.model

        def kept(seed: int) -> SeedMeasurement:
            self.with_all[seed] = measure(self.scenario, model, seed, threads=1)
            return self.with_all[seed]

        runner.seeds([ScenarioJob(label, kept, [])], [seed for seed in seeds if seed not in self.with_all])
        for name, lost in self.lost.items():
            if name not in self.without:
                records: list[SeedRecord] = []
                job = ScenarioJob(f"{label} without {name}", partial(measure, self.scenario, lost, threads=1), records)
                runner.seeds([job], LOST_SEEDS)
                self.without[name] = records

    def tolerance(self, kpi: str) -> float:
        """The least that chance allows, and a fiftieth of the smallest loss that is seen; two digits, rounded up."""
        mean = self._reference(kpi).mean
        lost = [self._lost_values(name, kpi) for name in self.lost if kpi in self.asked_for[name]]
        # A KPI may happen to be the same on all seeds with the effect, as one that is cut at 0: both sides say how
        # much it scatters.
        sd = max(self._reference(kpi).sd, *(float(values.std(ddof=1)) for values in lost))
        moved = [abs(float(values.mean()) - mean) for values in lost]
        seen = [delta for delta in moved if delta > 3.0 * sd]
        least = max(1.1 * resolution(SHARE, sd), 1.3 * sd, 0.02 * min(seen, default=0.0), 1e-6 * abs(mean), 1e-9)
        if not math.isfinite(least):
            return 1.0
        step = 10.0 ** (math.floor(elementary.log10(least)) - 1)
        return float(f"{math.ceil(least / step - 1e-9) * step:.2g}")

    def catch(self, effect: str, kpi: str) -> Catch | None:
        """How clearly a KPI sees the effect's loss; None where it has no value on some seed, or always the same."""
        reference, lost = self._reference(kpi), self._lost_values(effect, kpi)
        if reference.seeds < 2 or not np.isfinite(lost).all():
            return None
        spec = dataclasses.replace(self._spec(kpi), tolerance=self.tolerance(kpi))
        if spec.kind != "proportion" and reference.sd == 0.0:
            return None  # cut at 0, or on the grid of what the sensor reports: a step of any size would look clear
        smallest = sensitivity.smallest_change(spec, reference, SHARE)
        return Catch(kpi, spec.unit, reference.mean, float(lost.mean()), smallest)

    def _spec(self, kpi: str) -> KpiSpec:
        return next(asked.spec for asked in self.scenario.asked if asked.spec.name == kpi)

    def _reference(self, kpi: str) -> evidence.Reference:
        """The KPI with all effects, over the seeds that were measured; no seeds where it has no value on one."""
        found = [self.with_all[seed] for seed in sorted(self.with_all)]
        values = np.array([one.values.get(kpi, math.nan) for one in found])
        if not np.isfinite(values).all():
            return evidence.Reference(math.nan, 0.0, 0, len(found), ())
        trials = float(np.mean([one.trials.get(kpi, 0) for one in found]))
        return evidence.Reference(float(values.mean()), float(values.std(ddof=1)), len(found), len(found), (), trials)

    def _lost_values(self, effect: str, kpi: str) -> npt.NDArray[np.float64]:
        """The KPI without the effect, a value a seed."""
        return np.array([record.values.get(kpi, math.nan) for record in self.without[effect]])
