"""A scenario that would have caught a missing effect: its beams, its model, its KPIs, and a proposal for its golden.

Every KPI in it has shown that it notices when an effect is lost; what notices nothing is left out. The golden itself
is for a person to accept with `lidarcheck review`.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarcheck.effects.search import search_spec
from lidarcheck.errors import UsageError
from lidarcheck.harness.gate import evidence, sensitivity
from lidarcheck.harness.gate.seeds import GOLDEN_SEEDS, Progress, Runner, record_of
from lidarcheck.harness.goldens.file import load_proposal
from lidarcheck.harness.kpis.spec import SeedMeasurement
from lidarcheck.harness.layout import Layout, layout_of
from lidarcheck.harness.propose.files import ideal_file, model_file, write_files
from lidarcheck.harness.propose.trial import LOST_SEEDS, SHARE, Catch, KpiTrial
from lidarcheck.harness.review.review import review
from lidarcheck.harness.scenario.measure import measure
from lidarcheck.harness.scenario.scenario import Scenario, load_scenario
from lidarcheck.model.spec import Model

__all__ = ["Catch", "Proposed", "propose_scenario"]

_CLEAR = 1.5
"""How many smallest changes a loss must move a KPI by in the first look, whose scatter is known from few seeds."""
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]*")


@dataclass(frozen=True, slots=True)
class Proposed:
    """What was written: the scenario, all files of it, and the proposal for its golden.

    `catches`: by effect, the KPIs that catch its loss, the clearest first; `uncaught`: effects whose loss none of
    them catches on these beams.
    """

    scenario: Path
    files: tuple[Path, ...]
    proposal: Path
    catches: Mapping[str, tuple[Catch, ...]]
    uncaught: tuple[str, ...]

    def lines(self) -> list[str]:
        """What a person should know, a line each."""
        said = []
        for effect, found in self.catches.items():
            said += [
                f"{effect}: {catch.kpi} is {catch.present:.4g} {catch.unit}, and {catch.lost:.4g} when it is lost: "
                f"{catch.margin:.1f} times the smallest change that is caught"
                for catch in found
            ]
        said += [f"{effect}: no KPI catches its loss on these beams" for effect in self.uncaught]
        return [*said, f"{self.scenario}: `lidarcheck review {self.scenario} --accept all` makes its golden"]


def propose_scenario(
    ideals: Sequence[Path | str],
    model: Model,
    effects: Sequence[str],
    scenario: Path | str,
    *,
    tree: Path | str | None = None,
    lost: Mapping[str, Model] | None = None,
    description: str = "",
    per_effect: int = 3,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Proposed:
    """Write a scenario that runs one of `ideals` with `model` and catches the loss of `effects`.

    `scenario`: the file to create, or a name, for `scenarios/NAME.toml` in `tree` (the nearest directory upward that
    has `scenarios/`, else the current one). `lost`: by effect, the model that lacks it, where that is not `model`
    without it. The first ideal scan that shows every effect is taken, else the one that shows most. `per_effect`: KPIs
    for each effect, at most. The golden's proposal has all its seeds and waits for `lidarcheck review`. Nothing is
    overwritten. `UsageError` where something is in the way, and where no KPI catches anything; nothing is written then.
    """
    if not ideals:
        raise UsageError("no ideal scan is given", fix="give one that shows the effects")
    file = _target(scenario, tree)
    layout = layout_of(file)
    _refuse(file, layout, model, effects)
    without = {name: (lost or {}).get(name, model.without(name)) for name in effects}
    runner = Runner(jobs, progress)
    looked: list[tuple[int, KpiTrial, dict[str, list[str]]]] = []
    for ideal in ideals:
        _refuse_there(ideal_file(file, Path(ideal)))
        trial = KpiTrial.of(Path(ideal), file, model, without)
        trial.run(runner, GOLDEN_SEEDS[: evidence.PAIRED_SEEDS])
        chosen = {name: _best(trial, name, per_effect) for name in without}
        looked.append((sum(map(bool, chosen.values())), trial, chosen))
        if looked[-1][0] == len(without):
            break
    seen, trial, chosen = max(looked, key=lambda look: look[0])
    if seen == 0:
        raise _nothing_caught(effects)
    names = list(dict.fromkeys(kpi for kpis in chosen.values() for kpi in kpis))
    trial = trial.only(names)
    trial.run(runner, GOLDEN_SEEDS)
    return _written(trial, _catches(trial, chosen), layout, description, jobs)


def _target(scenario: Path | str, tree: Path | str | None) -> Path:
    path = Path(scenario)
    if path.suffix == ".toml":
        return path.absolute()
    if path.parent != Path():
        return path.with_name(f"{path.name}.toml").absolute()
    here = Path.cwd()
    root = Path(tree) if tree else next((d for d in (here, *here.parents) if (d / "scenarios").is_dir()), here)
    return root.absolute() / "scenarios" / f"{path.name}.toml"


def _refuse(file: Path, layout: Layout, model: Model, effects: Sequence[str]) -> None:
    if not _NAME.fullmatch(file.stem):
        raise UsageError(f"{file.stem!r} is no name for a scenario", fix="use letters, digits, _, . and -")
    known = {effect.name for effect in model.effects}
    for name in effects:
        if name not in known:
            raise UsageError(f"the model has no effect {name!r}", fix=f"it has {', '.join(sorted(known)) or 'none'}")
    if not effects:
        raise UsageError("no effect is named whose loss the scenario should catch", fix="name one of the model's")
    for there in (file, layout.golden(file.stem), layout.release(file.stem), model_file(file)):
        _refuse_there(there)


def _refuse_there(path: Path) -> None:
    if path.exists():
        raise UsageError(f"{path} is there already", fix="give the scenario another name")


def _nothing_caught(effects: Sequence[str]) -> UsageError:
    fix = "give another frame of the case, or ask for KPIs yourself in a scenario file"
    return UsageError(f"no KPI catches the loss of {', '.join(effects)} on these beams", fix=fix)


def _best(trial: KpiTrial, effect: str, count: int) -> list[str]:
    """The KPIs that seem to catch the loss, one a kind: of the kinds that the effect is known by, else of others."""
    kinds: dict[str, Catch] = {}
    for kpi in trial.asked_for[effect]:
        catch, kind = trial.catch(effect, kpi), str(trial.tables[kpi]["kpi"])
        if catch is not None and catch.margin > max(_CLEAR, kinds[kind].margin if kind in kinds else 0.0):
            kinds[kind] = catch
    own = [kinds[kind] for kind in search_spec(effect).watched_by if kind in kinds]
    ranked = sorted(own or kinds.values(), key=lambda catch: -catch.margin)
    return [catch.kpi for catch in ranked[:count]]


def _catches(trial: KpiTrial, chosen: Mapping[str, Sequence[str]]) -> dict[str, tuple[Catch, ...]]:
    """By effect those of its KPIs that catch its loss, the clearest first."""
    seen = {effect: [trial.catch(effect, kpi) for kpi in kpis] for effect, kpis in chosen.items()}
    caught = {effect: [catch for catch in found if catch and catch.margin > 1.0] for effect, found in seen.items()}
    return {effect: tuple(sorted(found, key=lambda catch: -catch.margin)) for effect, found in caught.items()}


def _written(
    trial: KpiTrial, catches: Mapping[str, tuple[Catch, ...]], layout: Layout, description: str, jobs: int | None
) -> Proposed:
    """Write the files and leave the proposal; what was measured is said of what lies on disk."""
    kept = dict.fromkeys(catch.kpi for found in catches.values() for catch in found)
    if not kept:
        raise _nothing_caught(list(catches))
    named = ", ".join(effect for effect, found in catches.items() if found)
    tolerances = {kpi: trial.tolerance(kpi) for kpi in kept}
    files = write_files(trial, catches, tolerances, description or f"catches the loss of {named}")
    proposal = layout.proposal(trial.scenario.name)
    try:
        scenario = load_scenario(trial.scenario.path)
        _propose(scenario, trial.with_all, jobs)
        confirmed = _confirmed(scenario, proposal, trial.lost, catches)
    except BaseException:
        for path in (*files, proposal):
            path.unlink(missing_ok=True)
        raise
    uncaught = tuple(name for name, found in confirmed.items() if not found)
    return Proposed(scenario.path, tuple(files), proposal, {k: v for k, v in confirmed.items() if v}, uncaught)


def _propose(scenario: Scenario, measured: Mapping[int, SeedMeasurement], jobs: int | None) -> None:
    """Let a review leave the proposal; seeds that were measured are not run again if the files give the same echoes."""
    first = measure(scenario, scenario.model, GOLDEN_SEEDS[0], threads=1)
    known = measured if first.digest == measured[GOLDEN_SEEDS[0]].digest else {}

    def again(asked: Scenario, model: Model, seed: int) -> SeedMeasurement:
        return known[seed] if seed in known else measure(asked, model, seed, threads=1)

    review([scenario.path], jobs=jobs, measure=again)


def _confirmed(
    scenario: Scenario, proposal: Path, lost: Mapping[str, Model], catches: Mapping[str, tuple[Catch, ...]]
) -> dict[str, tuple[Catch, ...]]:
    """The catches as the files on disk have them: the proposal's reference against new runs without each effect."""
    golden = load_proposal(proposal)
    found = {}
    for effect, expected in catches.items():
        records = [record_of(measure(scenario, lost[effect], seed, threads=1)) for seed in LOST_SEEDS if expected]
        confirmed = []
        for catch in expected:
            kpi = golden.kpis[catch.kpi]
            missing = float(np.mean([record.values.get(catch.kpi, math.nan) for record in records]))
            smallest = sensitivity.smallest_change(kpi.spec, kpi.reference, SHARE)
            confirmed.append(dataclasses.replace(catch, present=kpi.reference.mean, lost=missing, smallest=smallest))
        found[effect] = tuple(catch for catch in confirmed if catch.margin > 1.0)
    return found
