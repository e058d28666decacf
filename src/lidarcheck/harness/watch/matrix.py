"""The matrix of a suite: for each parameter the scenarios that turn red when it changes by what its user would notice.

A scenario's model has the parameter changed and is judged as the gate judges: paired seeds, fresh ones, the golden as
it is. Scenarios that have not the effect on are not asked; the cheapest is asked first.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import LidarcheckError, UsageError
from lidarcheck.formats.plain import plain
from lidarcheck.harness.check import judged
from lidarcheck.harness.gate.evidence import error_share
from lidarcheck.harness.gate.seeds import Runner
from lidarcheck.harness.goldens.provenance import source_hash, versions
from lidarcheck.harness.layout import Layout, select
from lidarcheck.harness.reports.results import ScenarioResult
from lidarcheck.harness.scenario_run import ScenarioRun, open_run, suite_size
from lidarcheck.harness.watch.changes import Change, change_of, parameters_of
from lidarcheck.harness.watch.store import Outcome, OutcomeStore

__all__ = ["Answer", "WatchReport", "WatchedParameter", "watch"]

Progress = Callable[[int, int, str], None]
"""Called with (scenarios asked, scenarios to ask at most, what is being asked)."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a scenario said to a change: from what to what it went there, and the outcome."""

    scenario: str
    change: str
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class WatchedParameter:
    """One parameter with the answers of the scenarios that were asked, in the order in which they were asked."""

    owner: str
    parameter: str
    answers: tuple[Answer, ...]

    @property
    def name(self) -> str:
        """Owner and parameter, as in "fog.mor_m"."""
        return f"{self.owner}.{self.parameter}"

    @property
    def red(self) -> tuple[Answer, ...]:
        """The scenarios that turned red."""
        return tuple(answer for answer in self.answers if answer.outcome.red)

    @property
    def change(self) -> str:
        """The change in the first scenario that turned red, else in the first asked; empty where none has a value."""
        return next((answer.change for answer in (*self.red, *self.answers)), "")


@dataclass(frozen=True, slots=True)
class WatchReport:
    """A run. `problems`: what fails it besides unwatched parameters; `asked`: scenarios that were run or known."""

    parameters: tuple[WatchedParameter, ...]
    problems: tuple[str, ...]
    seconds: float
    asked: int
    source: str

    @property
    def unwatched(self) -> tuple[WatchedParameter, ...]:
        """The parameters that no scenario watches."""
        return tuple(one for one in self.parameters if not one.red)

    @property
    def exit_code(self) -> int:
        """0: every parameter is watched; 1: one is not, or a scenario is red as it stands."""
        return 1 if self.unwatched or self.problems else 0

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        table: dict[str, Any] = plain(self)
        for entry, one in zip(table["parameters"], self.parameters, strict=True):
            entry |= {"name": one.name, "change": one.change, "watched_by": [answer.scenario for answer in one.red]}
        unwatched = [one.name for one in self.unwatched]
        return {**table, "unwatched": unwatched, "exit_code": self.exit_code, "versions": versions()}


def watch(
    paths: Sequence[Path | str] = (),
    *,
    only: str = "",
    every: bool = False,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> WatchReport:
    """Change each parameter in the models of scenarios, and say which of these turn red.

    `paths`: as of `harness.check.check`. `only`: parameters whose name (as "fog.mor_m") has this word in it. `every`:
    ask all scenarios, where else the first red one is enough. `jobs`: seeds side by side. Results are kept in
    `.lidarcheck/sensitivity.jsonl`, so that a run that is broken off goes on where it was. Goldens and proposals are
    not written. `UsageError` where nothing can be asked; what `check` raises where a scenario cannot be read.
    """
    start = time.monotonic()
    cases = [open_run(file) for file in select(paths).files]
    suite = _Suite(cases, jobs, progress or (lambda done, total, label: None))
    names = [name for name in parameters_of(case.model for case in suite.cases) if only in ".".join(name)]
    if not suite.cases or not names:
        what = f"no parameter has {only!r} in its name" if suite.cases else "no scenario has a golden and a model here"
        raise UsageError(what, fix="see the names with `lidarcheck effects`" if suite.cases else "make goldens first")
    suite.total = sum(len(suite.to_ask(*name)) for name in names)
    found = tuple(WatchedParameter(*name, suite.answers(*name, every=every)) for name in names)
    return WatchReport(found, suite.problems, time.monotonic() - start, suite.done, source_hash())


class _Suite:
    """The scenarios that can be asked, the cheapest first, and what is known of them."""

    def __init__(self, cases: Sequence[ScenarioRun], jobs: int | None, progress: Progress) -> None:
        able = [case for case in cases if case.golden is not None and case.model.external is None]
        self.cases = sorted(able, key=_cost)
        self._share = error_share(suite_size(cases)) if cases else math.nan
        self._jobs, self._progress = jobs, progress
        self._stores: dict[Layout, OutcomeStore] = {}
        self._red_already: dict[Path, bool] = {}
        self.total = self.done = 0

    @property
    def problems(self) -> tuple[str, ...]:
        """The scenarios that are red before anything is changed, which can prove nothing."""
        names = [path.stem for path, red in self._red_already.items() if red]
        return tuple(
            f"{name} falls out as it stands and was not counted: run `lidarcheck check {name}`" for name in names
        )

    def to_ask(self, owner: str, parameter: str) -> list[tuple[ScenarioRun, Change]]:
        """The scenarios whose model can have that parameter changed."""
        pairs = [(case, change_of(case.model, owner, parameter)) for case in self.cases]
        return [(case, change) for case, change in pairs if change is not None]

    def answers(self, owner: str, parameter: str, *, every: bool) -> tuple[Answer, ...]:
        """What the scenarios say to a change of that parameter, up to the first red one unless `every`."""
        answers: list[Answer] = []
        pairs = self.to_ask(owner, parameter)
        for case, change in pairs:
            self._progress(self.done, self.total, f"{owner}.{parameter} in {case.scenario.name}")
            outcome = self._outcome(case.with_model(change.model))
            self.done += 1
            if outcome.red and self._is_red_already(case):
                continue
            answers.append(Answer(case.scenario.name, change.words, outcome))
            if outcome.red and not every:
                break
        self.total -= len(pairs) - len(answers)  # what need not be asked any more
        return tuple(answers)

    def _is_red_already(self, case: ScenarioRun) -> bool:
        path = case.scenario.path
        if path not in self._red_already:
            self._red_already[path] = self._outcome(case.with_model(case.model)).red
        return self._red_already[path]

    def _outcome(self, case: ScenarioRun) -> Outcome:
        store = self._stores.get(case.layout) or self._stores.setdefault(case.layout, OutcomeStore(case.layout))
        key = store.key(case)
        known = store.get(key)
        if known is None:
            known = self._run(case)
            store.put(key, known)
        return known

    def _run(self, case: ScenarioRun) -> Outcome:
        start = time.monotonic()
        try:
            (result,) = judged([case], Runner(self._jobs), self._share)
        except LidarcheckError as error:
            # The change makes a model that cannot run: nobody could overlook that.
            return Outcome(kpi="the run", verdict=str(error).splitlines()[0], seconds=time.monotonic() - start)
        return dataclasses.replace(_first_red(result), seconds=round(time.monotonic() - start, 3))


def _cost(case: ScenarioRun) -> int:
    """How long a seed takes beside others: rows to follow."""
    return len(case.scenario.ideal) * case.scenario.frames


def _first_red(result: ScenarioResult) -> Outcome:
    """The KPI that fell out farthest beyond what would have been caught; an empty outcome if none did."""
    fallen = [kpi for kpi in result.kpis if kpi.fails]
    if not fallen:
        return Outcome(kpi="the scenario", verdict=result.problems[0]) if result.problems else Outcome()
    numbers = [(abs(kpi.new - kpi.old) / kpi.smallest, kpi) for kpi in fallen]
    _, worst = max(numbers, key=lambda pair: pair[0] if math.isfinite(pair[0]) else -1.0)
    old, new, smallest = (value if math.isfinite(value) else None for value in (worst.old, worst.new, worst.smallest))
    return Outcome(worst.name, worst.spec.unit, old, new, smallest, worst.verdict.value)
