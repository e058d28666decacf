"""Scenarios in a source with an error: `judge` runs them until one is red, `trace` says which lines they run.

Imported by `mutants_worker.py`, once it has the compiled kernels in their place.
"""

from __future__ import annotations

import functools
import importlib
import math
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

import mutants_marks

from lidarcheck.harness.check import check
from lidarcheck.harness.gate.evidence import GATE_LEVEL, PAIRED_SEEDS
from lidarcheck.harness.gate.seeds import GOLDEN_SEEDS, SeedRecord, record_of
from lidarcheck.harness.goldens.golden import KpiGolden, paired_identical, sample_of
from lidarcheck.harness.kpis.spec import SeedMeasurement
from lidarcheck.harness.scenario import measure as measuring
from lidarcheck.harness.scenario.scenario import Scenario
from lidarcheck.harness.scenario_run import ScenarioRun, open_run
from lidarcheck.model.spec import Model

DOUBTFUL = 6
"""How many scenarios whose paired seeds moved no KPI by its tolerance are given fresh seeds: those that moved most."""
PACKAGE = Path(measuring.__file__).parents[2]
_simulate = measuring.simulate


class Asked:
    """A scenario with its goldens, the seeds that have run, and how: `fidelity` is the path through the model."""

    def __init__(self, file: str, fidelity: str) -> None:
        self.file = Path(file)
        self.fidelity = fidelity
        self._kept: dict[int, SeedMeasurement] = {}
        self.run: ScenarioRun = open_run(self.file, measure=self.measure)
        self.run.paired = [record_of(self.run.run(seed)) for seed in GOLDEN_SEEDS[:PAIRED_SEEDS]]
        self.digests = [record.digest for record in self.run.paired]

    def measure(self, scenario: Scenario, model: Model, seed: int) -> SeedMeasurement:
        """A seed by this path, each once."""
        if seed not in self._kept:
            measuring.simulate = functools.partial(_simulate, fidelity=self.fidelity)
            self._kept[seed] = measuring.measure(scenario, model, seed, threads=1)
        return self._kept[seed]

    def is_golden(self) -> bool:
        """Whether every KPI is what the golden has, bit for bit."""
        golden = self.run.golden
        return golden is not None and all(paired_identical(golden, k, self.run.paired) for k in golden.kpis.values())

    def moved(self) -> float:
        """How far the paired seeds moved any KPI: 1 is its tolerance; infinite where one is no longer measured."""
        golden = self.run.golden
        return max((_moved(kpi, self.run.paired) for kpi in golden.kpis.values()), default=0.0) if golden else 0.0

    def red(self) -> str:
        """The first KPI that fails a check, empty if the check holds."""
        report = check([self.file], jobs=1, measure=self.measure, load=lambda file: self.run.scenario)
        failing = [kpi.spec.name for result in report.scenarios for kpi in result.kpis if kpi.verdict.fails]
        return (failing[0] if failing else "the run") if report.exit_code else ""


def _moved(kpi: KpiGolden, paired: Sequence[SeedRecord]) -> float:
    new, old = sample_of(kpi, paired, paired).fresh, kpi.reference.paired
    if kpi.spec.kind == "distance":
        shift = sorted(new)[len(new) // 2] - kpi.reference.null[GATE_LEVEL]
    else:
        pairs = [b - a for a, b in zip(old, new, strict=True) if not (math.isnan(a) and math.isnan(b))]
        shift = abs(math.fsum(pairs)) / max(len(pairs), 1)
    return math.inf if math.isnan(shift) else shift / kpi.spec.tolerance


def judge(tasks: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """A line a scenario, until one is red: `identical`, `red` with the KPI, or `changed`."""
    doubtful = []
    for task in tasks:
        signal.setitimer(signal.ITIMER_PROF, task["limit_s"])
        asked = Asked(task["file"], task["fidelity"])
        if asked.digests == task["digests"]:
            yield {"name": task["name"], "found": "identical"}
        elif asked.moved() > 1.0 and (kpi := asked.red()):
            yield {"name": task["name"], "found": "red", "kpi": kpi}
            return
        else:
            doubtful.append((asked.moved(), task["name"], asked))
    for rank, (moved, name, asked) in enumerate(sorted(doubtful, key=lambda entry: -entry[0])):
        if rank < DOUBTFUL and moved <= 1.0 and (kpi := asked.red()):
            yield {"name": name, "found": "red", "kpi": kpi}
            return
        yield {"name": name, "found": "changed", "moved": moved}


def trace(tasks: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """A line a scenario: its seconds, its echoes' digests, whether the check holds, and the lines that it runs."""
    for task in tasks:
        signal.setitimer(signal.ITIMER_PROF, task["limit_s"])
        begin = time.process_time()
        with Lines() as lines:
            asked = Asked(task["file"], task["fidelity"])
        seconds = time.process_time() - begin
        holds = asked.is_golden() if task["fidelity"] == "exact" else not asked.red()
        found = {file: sorted(numbers) for file, numbers in lines.found().items()}
        yield {
            "name": task["name"],
            "fidelity": task["fidelity"],
            "seconds": seconds,
            "digests": asked.digests,
            "holds": holds,
            "lines": found,
        }


class Lines:
    """Which lines of the model and the effects run inside a `with`; of unmarked kernels all that could be called."""

    def __init__(self) -> None:
        self._lines: dict[str, set[int]] = {}
        self._codes: dict[CodeType, dict[str, Any]] = {}
        self._ours = tuple(f"{PACKAGE / part}/" for part in ("model", "effects"))

    def __enter__(self) -> Lines:
        mutants_marks.clear()
        sys.settrace(self._called)
        return self

    def __exit__(self, *error: object) -> None:
        sys.settrace(None)

    def _called(self, frame: FrameType, event: str, argument: object) -> Callable[..., Any] | None:
        code = frame.f_code
        if not code.co_filename.startswith(self._ours):
            return None
        self._codes.setdefault(code, frame.f_globals)
        self._lines.setdefault(code.co_filename, set()).add(frame.f_lineno)
        return self._stepped

    def _stepped(self, frame: FrameType, event: str, argument: object) -> Callable[..., Any]:
        if event == "line":
            self._lines[frame.f_code.co_filename].add(frame.f_lineno)
        return self._stepped

    def found(self) -> dict[str, set[int]]:
        """Lines by file, as paths below the package."""
        lines = {file: set(numbers) for file, numbers in self._lines.items()}
        for file, numbers in mutants_marks.found().items():
            lines.setdefault(file, set()).update(numbers)
        for code in kernels_of(self._codes):
            if mutants_marks.NAME in code.co_names or not code.co_filename.startswith(self._ours):
                continue
            lines.setdefault(code.co_filename, set()).update(n for _, _, n in code.co_lines() if n is not None)
        return {Path(file).relative_to(PACKAGE).as_posix(): numbers for file, numbers in lines.items()}


def kernels(tasks: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """A line a compiled function: how its cache is called, and the lines of it and of all that it calls."""
    for task in tasks:
        module = importlib.import_module(task["name"])
        for thing in vars(module).values():
            function = getattr(thing, "py_func", None)
            if function is not None and function.__module__ == module.__name__:
                code = function.__code__
                codes = {code, *kernels_of({code: function.__globals__})}
                ours = [part for part in codes if part.co_filename.startswith(str(PACKAGE))]
                name = f"{module.__name__.split('.')[-1]}.{function.__qualname__}-{code.co_firstlineno}"
                yield {"name": name, "spans": sorted((_below(part), *_span(part)) for part in ours)}


def _below(code: CodeType) -> str:
    return Path(code.co_filename).relative_to(PACKAGE).as_posix()


def _span(code: CodeType) -> tuple[int, int]:
    return code.co_firstlineno, max(line for _, _, line in code.co_lines() if line is not None)


def kernels_of(codes: dict[CodeType, dict[str, Any]]) -> set[CodeType]:
    """The compiled functions that these name, and those that these name in their turn."""
    found: set[CodeType] = set()
    waiting = list(codes.items())
    while waiting:
        code, names = waiting.pop()
        # What a function defines inside it runs itself, if at all; what a kernel defines is compiled with it.
        inner = [(part, names) for part in code.co_consts if isinstance(part, CodeType) and code not in codes]
        modules = [names[name] for name in code.co_names if isinstance(names.get(name), ModuleType)]
        things = [space.get(name) for name in code.co_names for space in (names, *(vars(m) for m in modules))]
        functions = [getattr(thing, "py_func", None) or getattr(thing, "_defn", None) for thing in things]
        inner += [(function.__code__, function.__globals__) for function in functions if function is not None]
        new = [(part, space) for part, space in inner if part not in found]
        found.update(part for part, _ in new)
        waiting += new
    return found
