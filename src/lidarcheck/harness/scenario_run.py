"""One scenario of a run with everything it is compared with: its model, its goldens, the records of its seeds."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from lidarcheck.errors import GoldenError, InputError
from lidarcheck.harness.gate.seeds import REFERENCE_SEEDS, ScenarioJob, SeedRecord
from lidarcheck.harness.goldens.file import load_proposal, refuse_proposal
from lidarcheck.harness.goldens.golden import Golden, KpiGolden, build, paired_identical, thresholds_changed
from lidarcheck.harness.goldens.provenance import Provenance, provenance_of
from lidarcheck.harness.kpis.spec import KpiSpec, SeedMeasurement
from lidarcheck.harness.layout import Layout, layout_of
from lidarcheck.harness.scenario.scenario import Scenario, load_scenario
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Program, Sensor
from lidarcheck.trust.programs import require_trust

__all__ = ["Load", "Measure", "ScenarioRun", "kpis_in_goldens", "open_run", "provenance_now", "suite_size"]

Measure = Callable[[Scenario, Model, int], SeedMeasurement]
Load = Callable[[Path], Scenario]


@dataclass
class ScenarioRun:
    """A scenario being checked. `paired`, `fresh`: the records so far; `skipped`: why it is not run, empty if it is.

    `foreign`: another model than the scenario's own is asked; `damage`: why the golden could not be read, if tolerated.
    """

    scenario: Scenario
    model: Model
    run: Callable[[int], SeedMeasurement]
    layout: Layout
    golden: Golden | None
    release: Golden | None
    skipped: str = ""
    foreign: bool = False
    damage: str = ""
    paired: list[SeedRecord] = field(default_factory=list)
    fresh: list[SeedRecord] = field(default_factory=list)

    def with_model(self, model: Model) -> ScenarioRun:
        """The same scenario and goldens with another model in the place of the scenario's own, nothing run yet."""
        scenario = self.scenario.with_model(model)
        run = partial(_measure, scenario, model)
        return dataclasses.replace(self, scenario=scenario, model=model, run=run, foreign=True, paired=[], fresh=[])

    @property
    def paired_job(self) -> ScenarioJob:
        """What runs the paired seeds."""
        return ScenarioJob(self.scenario.name, self.run, self.paired, self.scenario.forget)

    @property
    def fresh_job(self) -> ScenarioJob:
        """What runs further seeds."""
        return ScenarioJob(self.scenario.name, self.run, self.fresh, self.scenario.forget)

    def comparisons(self) -> list[tuple[Golden, KpiGolden, KpiSpec]]:
        """(reference, its KPI, what is asked of it) of every KPI of the last golden, and of the release's that it has.

        What is asked is as the last golden has it.
        """
        known = self.golden.kpis if self.golden else {}
        references = [golden for golden in (self.golden, self.release) if golden is not None]
        return [
            (golden, kpi, known[name].spec)
            for golden in references
            for name, kpi in golden.kpis.items()
            if name in known
        ]

    def measures(self, spec: KpiSpec) -> bool:
        """Whether the run gives this KPI on any seed."""
        if spec.kind == "distance":
            return any(spec.feature in record.quantiles for record in self.paired)
        return any(spec.name in record.values for record in self.paired)

    def need_chance(self) -> None:
        """`InputError` where the model is a program that gives every seed the same: a golden rests on chance."""
        if self.model.external is None or len(self.paired) < 2 or len({record.digest for record in self.paired}) > 1:
            return
        what = f"the program gives the same echoes for {len(self.paired)} seeds in the scenario {self.scenario.name}: "
        what += "it ignores its seed, so that nothing says what chance is"
        fix = "let it draw its noise from {seed}, or from PostPro.Seed in {ini}"
        raise InputError(what, file=self.model.file, fix=fix)

    def problems(self) -> list[str]:
        """What fails the scenario beyond its KPIs, each with what to do."""
        golden, name = self.golden, self.scenario.name
        if golden is None or self.skipped:
            return []
        if golden.scenario != name:
            return [f"the golden is of the scenario {golden.scenario}: restore it from version control"]
        if golden.provenance.scenario == self.scenario.content_hash:
            return []
        asked = {spec.name: spec for spec in self.scenario.kpis}
        pairs = [(kpi.spec, asked[key]) for key, kpi in golden.kpis.items() if key in asked]
        thresholds = [f"{old.name}: {text}" for old, new in pairs if (text := thresholds_changed(old, new))]
        what = f" ({'; '.join(thresholds)})" if thresholds else ""
        return [
            f"the scenario has changed since its golden was made{what}: run `lidarcheck review {name}` and accept it"
        ]

    def notes(self) -> list[str]:
        """What a reader should know although it fails nothing."""
        notes = [self.skipped] if self.skipped else []
        stale = self.release is None and self.layout.release(self.scenario.name).is_file()
        if stale and not self.skipped:
            notes.append("the last release measured another version of this scenario: not compared with it")
        golden = self.golden
        if golden and self.paired and not self.foreign:
            differ = tuple(record.digest for record in self.paired) != golden.digests
            moved = [] if differ else [name for name, kpi in golden.kpis.items() if self._is_counted_otherwise(kpi)]
            if moved:
                notes.append(
                    f"the echoes are the golden's bit for bit, but {len(moved)} of its {len(golden.kpis)} KPIs are "
                    f"computed otherwise than by the version that made it ({moved[0]}{', ...' if moved[1:] else ''}): "
                    f"run `lidarcheck review {self.scenario.name}` and accept them"
                )
            if differ and golden.provenance.same_model(provenance_now(self.scenario, self.model)):
                made = golden.provenance
                notes.append(
                    "source, scenario and parameters are the golden's, the echoes are not: another machine or library? "
                    f"(golden: python {made.python}, numpy {made.numpy}, numba {made.numba})"
                )
        return notes

    def _is_counted_otherwise(self, kpi: KpiGolden) -> bool:
        """Whether the same echoes no longer give the value that the golden has of them."""
        return (
            self.golden is not None and self.measures(kpi.spec) and not paired_identical(self.golden, kpi, self.paired)
        )

    def proposal(self, verdicts: Mapping[str, str]) -> Golden:
        """What this run knows of a new golden: the paired seeds alone, which a review completes."""
        seeds = f"0-{len(self.paired) - 1}"
        provenance = provenance_now(self.scenario, self.model, seeds=seeds, reference_seeds=seeds)
        proposal = build(self.scenario.name, self.scenario.kpis, self.paired, self.paired, provenance)
        kpis = {name: dataclasses.replace(kpi, verdict=verdicts.get(name, "")) for name, kpi in proposal.kpis.items()}
        return dataclasses.replace(proposal, kpis=kpis, proposed=True)


def open_run(
    file: Path,
    model: Model | Path | str | None = None,
    measure: Measure | None = None,
    load: Load | None = None,
    *,
    tolerate_damage: bool = False,
) -> ScenarioRun:
    """Read a scenario, its goldens, and the model that is asked; `LidarcheckError` for the first that is at fault.

    `tolerate_damage`: a golden that cannot be read counts as none, and the case says why.
    """
    scenario = (load or load_scenario)(file)
    layout = layout_of(file)
    asked, skipped = _model_for(scenario, model)
    if asked.external is not None and not skipped and measure is None:
        require_trust(asked.external, asked.file)  # before other scenarios are run for nothing
    golden, damage = _golden(layout.golden(scenario.name), tolerate_damage)
    release, _ = _golden(layout.release(scenario.name), tolerate_damage, release=True)
    if release and release.provenance.scenario != scenario.content_hash:
        release = None
    return ScenarioRun(
        scenario=scenario,
        model=asked,
        run=partial(measure or _measure, scenario, asked),
        layout=layout,
        golden=golden,
        release=release,
        skipped=skipped,
        foreign=model is not None,
        damage=damage,
    )


def suite_size(cases: Sequence[ScenarioRun]) -> int:
    """The number of KPIs of the whole suite, whichever part of it is run, so that verdicts do not depend on that."""
    total = sum(kpis_in_goldens(layout) for layout in {case.layout for case in cases})
    return total + sum(len(case.scenario.kpis) for case in cases if case.golden is None)


def kpis_in_goldens(layout: Layout) -> int:
    """The number of KPIs in all goldens of a project."""
    return sum(_count(path) for path in layout.goldens.glob("*.toml") if path.is_file())


def provenance_now(scenario: Scenario, model: Model, *, seeds: str = "", reference_seeds: str = "") -> Provenance:
    """The provenance of a run of `scenario` with `model` now."""
    reference = reference_seeds or f"{REFERENCE_SEEDS[0]}-{REFERENCE_SEEDS[-1]}"
    return provenance_of(scenario, model, seeds=seeds or f"0-{REFERENCE_SEEDS[0] - 1}", reference_seeds=reference)


def _measure(scenario: Scenario, model: Model, seed: int) -> SeedMeasurement:
    from lidarcheck.harness.scenario.measure import measure

    return measure(scenario, model, seed, threads=1)  # seeds run side by side instead


def _model_for(scenario: Scenario, model: Model | Path | str | None) -> tuple[Model, str]:
    """The model to ask, and why the scenario is skipped if it is not for that model.

    What a scenario sets itself are its conditions, such as a raised background: they hold for the given model too,
    where that keeps to the reference sensor. Its materials belong to what is measured and stay: the given model may
    know other surfaces by the same numbers.
    """
    if model is None:
        return scenario.model, ""
    if not isinstance(model, Model):
        from lidarcheck.model.files.model_file import load_model

        model = load_model(Path(model))
    own, given = scenario.model, model.sensor
    materials = {**model.materials, **own.materials}
    if isinstance(given, Program):
        around = dataclasses.replace(given, known=materials)
        effects = model.effects or own.effects
        return dataclasses.replace(model, sensor=around, materials=materials, effects=effects), ""
    if own.sensor.variant != given.variant:
        return own, f"not run: the scenario is for {own.sensor.variant}, the model is a {given.variant}"
    usual = Sensor.of(given.variant)
    conditions = {
        name: getattr(own.sensor, name)
        for name in (field.name for field in dataclasses.fields(usual))
        if getattr(own.sensor, name) != getattr(usual, name) and getattr(given, name) == getattr(usual, name)
    }
    asked = model.with_sensor(**conditions)
    return dataclasses.replace(asked, materials=materials, effects=model.effects or own.effects), ""


def _golden(path: Path, tolerate_damage: bool, *, release: bool = False) -> tuple[Golden | None, str]:
    try:
        golden = load_proposal(path, release=release) if path.is_file() else None
    except GoldenError as error:
        if not tolerate_damage:
            raise
        return None, error.what
    if golden is not None:
        refuse_proposal(golden, path)
    return golden, ""


def _count(golden: Path) -> int:
    return sum(line.startswith(b"[kpis.") for line in golden.read_bytes().splitlines())
