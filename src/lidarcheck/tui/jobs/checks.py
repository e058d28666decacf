"""Running scenarios against their goldens, one after the other, and what the last run of each found."""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.reading import Reading, reading
from lidarcheck.session.digests import Digests
from lidarcheck.session.inputs import Inputs, files_named_by
from lidarcheck.session.node import Cancelled, ProgressCallback
from lidarcheck.session.own_files import own_directory, own_file
from lidarcheck.workers.identity import source_of_results

if TYPE_CHECKING:
    from lidarcheck.harness.kpis.spec import KpiSpec

__all__ = ["Check", "KpiLine", "Outcome", "Runs", "check_scenario", "run_scenarios"]

Check = Callable[..., Any]


@dataclass(frozen=True)
class KpiLine:
    """A KPI of a run; numbers are None where there are none. `limit`: the absolute limits, in words."""

    name: str
    verdict: str
    fails: bool
    unit: str
    golden: float | None
    now: float | None
    tolerance: float | None
    catches: float | None
    limit: str
    note: str


@dataclass(frozen=True)
class Outcome:
    """What the last run of a scenario found. `verdict`: holds, changed, fell out, or fault; `problems` in lines.

    `read`: SHA-256 of every file that it was computed from, by path, and `code` of lidarcheck's source, so that it
    shows when one of them has changed since.
    """

    name: str
    verdict: str
    time: float
    seconds: float
    kpis: tuple[KpiLine, ...] = ()
    problems: tuple[str, ...] = ()
    read: Mapping[str, str] = field(default_factory=dict)
    code: str = ""

    @property
    def fallen(self) -> int:
        """How many KPIs fell out."""
        return sum(kpi.fails for kpi in self.kpis)

    @property
    def moved(self) -> int:
        """How many KPIs are not as the golden has them, whether that matters or not."""
        return sum(kpi.verdict not in ("identical", "equivalent") for kpi in self.kpis)


class Runs:
    """The last outcome of each scenario, kept in the project."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.last: dict[str, Outcome] = {}
        with contextlib.suppress(OSError, ValueError, TypeError, KeyError, AttributeError):
            text = (own_directory(root) / "runs.json").read_text(encoding="utf-8")
            self.last = {str(name): _outcome(found) for name, found in json.loads(text).items()}

    def add(self, outcome: Outcome) -> None:
        """Note an outcome, and keep it if the project can be written."""
        self.last[outcome.name] = outcome
        with contextlib.suppress(InputError, OSError):
            document = {name: asdict(found) for name, found in self.last.items()}
            from lidarcheck.formats.atomic import write_text

            write_text(own_file(self.root, "runs.json"), json.dumps(document) + "\n")


def _outcome(found: Mapping[str, Any]) -> Outcome:
    kpis = tuple(KpiLine(**kpi) for kpi in found["kpis"])
    known = {name: value for name, value in found.items() if name in Outcome.__dataclass_fields__}
    return Outcome(**{**known, "kpis": kpis, "problems": tuple(found["problems"])})


def read_by(path: Path) -> dict[str, str]:
    """The digests of a scenario, its golden, and all that the scenario names, by real path."""
    from lidarcheck.harness.layout import layout_of

    disk = Inputs()
    files = [path, layout_of(path).golden(path.stem), *files_named_by(path)]
    return {os.path.realpath(file): disk.digest(file) for file in files}


def run_scenarios(
    paths: Sequence[Path],
    *,
    on_progress: ProgressCallback,
    on_outcome: Callable[[Outcome], object],
    stop: threading.Event,
    check: Check | None = None,
) -> None:
    """Run scenarios one by one; `on_outcome` gets each outcome. A fault of one does not keep the others from running.

    `on_progress` gets (scenarios done, scenarios to do, what runs now). `Cancelled` when `stop` is set.
    """
    for number, path in enumerate(paths):

        def progress(done: int, total: int, _label: str, number: int = number, path: Path = path) -> None:
            if stop.is_set():
                raise Cancelled
            on_progress(number, len(paths), f"{path.stem} {done}/{total}")

        progress(0, 0, path.stem)
        on_outcome(check_scenario(path, progress, check))
    on_progress(len(paths), len(paths), "")


def check_scenario(path: Path, progress: ProgressCallback | None = None, check: Check | None = None) -> Outcome:
    """Run one scenario against its golden."""
    start, before = time.time(), read_by(path)
    with reading() as read:
        try:
            report = (check or _harness())([path], progress=progress)
        except LidarcheckError as error:
            lines = tuple(line.removeprefix("error: ") for line in error.lines())
            seconds, files = time.time() - start, _with_opened(before, read)
            return Outcome(path.stem, "fault", start, seconds, (), lines, files, source_of_results())
    result = report.scenarios[0]
    kpis = tuple(_line(kpi) for kpi in result.kpis)
    moved = any(kpi.verdict not in ("identical", "equivalent") for kpi in kpis)
    verdict = "fell out" if result.failed else "changed" if moved else "holds" if kpis else "not run"
    problems = (*result.problems, *result.notes)
    files = _with_opened(before, read)
    return Outcome(result.name, verdict, start, time.time() - start, kpis, problems, files, source_of_results())


def _with_opened(before: Mapping[str, str], read: Reading) -> dict[str, str]:
    """The files that a run is known to depend on with what they held before it, and whatever else it opened."""
    disk = Digests()
    return {name: disk.of(name) for name in sorted(read.files)} | dict(before)


def _harness() -> Check:
    from lidarcheck.harness.check import check

    return check


def _line(kpi: Any) -> KpiLine:
    spec = kpi.spec
    now = kpi.old if kpi.verdict == "identical" and not kpi.fresh else kpi.new
    return KpiLine(
        kpi.name, kpi.verdict.value, kpi.fails, unit_of(spec), known(kpi.old), known(now), known(spec.tolerance),
        known(kpi.smallest), limits_of(spec), kpi.note,
    )  # fmt: skip


def unit_of(spec: KpiSpec) -> str:
    """The unit of a KPI; empty for a pure number."""
    return "" if spec.unit == "1" else spec.unit


def limits_of(spec: KpiSpec) -> str:
    """The absolute limits of a KPI, in words."""
    ends = ((">=", spec.low), ("<=", spec.high))
    return " ".join(f"{sign} {end:g}" for sign, end in ends if end is not None and abs(end) < 1e300)


def known(value: float | None) -> float | None:
    """A number; None for what is none."""
    return None if value is None or value != value else float(value)
