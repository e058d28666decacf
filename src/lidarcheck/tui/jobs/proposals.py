"""What waits for review in a project: the proposals that runs have left, and scenarios that have no golden."""

from __future__ import annotations

import difflib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarcheck.errors import GoldenError, LidarcheckError
from lidarcheck.harness.gate import evidence, sensitivity
from lidarcheck.harness.gate.evidence import KpiVerdict
from lidarcheck.harness.goldens.file import load_golden, load_proposal
from lidarcheck.harness.goldens.golden import Golden
from lidarcheck.harness.goldens.provenance import Provenance, parameters_hash, source_hash
from lidarcheck.harness.layout import Layout, layout_of
from lidarcheck.harness.review.review import KpiReview, ReviewReport, ScenarioReview, file_hash
from lidarcheck.harness.review.wording import verdict_word
from lidarcheck.harness.scenario.scenario import load_scenario
from lidarcheck.harness.scenario_run import kpis_in_goldens
from lidarcheck.session.inputs import files_named_by
from lidarcheck.session.node import Cancelled, Node, ProgressCallback
from lidarcheck.session.session import CURRENT, OLD, SAVED, Session
from lidarcheck.tui.jobs.checks import KpiLine, known, limits_of, unit_of

__all__ = ["Review", "Waiting", "changes", "kpi_line", "reasons", "reviewed", "run_reviews", "state_of", "waiting"]

Review = Callable[..., ReviewReport]


@dataclass(frozen=True)
class Waiting:
    """A scenario with something to review.

    `kpis`: golden beside proposal; `drawn`: the proposal's seeds, 0 without one;
    `share`: each KPI's part of the error budget; `found`: what a review said of this proposal, None before one;
    `stamp`: the hashes of golden and proposal; `made`: where the proposal came from; `fault`: why one of them cannot be
    read, or why a review failed.
    """

    name: str
    path: Path
    layout: Layout
    kpis: tuple[KpiReview, ...]
    drawn: int
    share: float
    stamp: str
    found: ScenarioReview | None = None
    fault: str = ""
    made: Provenance | None = None

    @property
    def golden(self) -> bool:
        """Whether there is a golden."""
        return self.layout.golden(self.name).is_file()

    @property
    def state(self) -> str:
        """How far it is, in a few words."""
        if self.fault:
            return "FAULT, see below"
        if self.found is None:
            seeds = f"{self.drawn} of {evidence.FULL_SEEDS} seeds" if self.drawn else "not run"
            return f"{seeds}{'' if self.golden else ', no golden'}"
        if any(kpi.refused for kpi in self.kpis):
            return "CANNOT be accepted"
        return "needs a reason" if reasons([self.found]) else "can be accepted"


def waiting(path: Path) -> Waiting | None:
    """What waits for review of a scenario file, from what lies on the disk; None where nothing does."""
    layout, name = layout_of(path), path.stem
    file, proposed = layout.golden(name), layout.proposal(name)
    if file.is_file() and not proposed.is_file():
        return None
    golden, fault = _read(file, load_golden)
    proposal, other = _read(proposed, load_proposal)
    share = evidence.error_share(
        max(kpis_in_goldens(layout) + (0 if golden else len(proposal.kpis) if proposal else 0), 1)
    )
    drawn = min((kpi.reference.drawn for kpi in proposal.kpis.values()), default=0) if proposal else 0
    kpis = _kpis(golden, proposal) if proposal else ()
    made = proposal.provenance if proposal else None
    return Waiting(name, path, layout, kpis, drawn, share, stamp_of(layout, name), fault=fault or other, made=made)


def reviewed(path: Path, found: ScenarioReview) -> Waiting | None:
    """The same after a review; None where there is nothing to accept."""
    if found.settled:
        return None
    size = max(kpis_in_goldens(found.layout) + (0 if found.golden else len(found.kpis)), 1)
    drawn = min((kpi.reference.drawn for kpi in found.proposal.kpis.values()), default=0)
    stamp = stamp_of(found.layout, found.name)
    made = found.proposal.provenance
    return Waiting(
        found.name, path, found.layout, found.kpis, drawn, evidence.error_share(size), stamp, found, made=made
    )


def state_of(session: Session, one: Waiting) -> str:
    """Whether a proposal is of the saved scenario, model and source, in words; empty without one. Reads files."""
    if one.made is None:
        return ""
    node = Node("where a proposal comes from", 1, one.path, (one.path,), lambda _told: _origin(one.path))
    try:
        scenario, parameters, source = session.compute(node, saved=True).value
    except (LidarcheckError, OSError):
        return f"{OLD}, the scenario cannot be read"
    now = {"the scenario": scenario, "the model": parameters, "lidarcheck": source}
    then = (one.made.scenario, one.made.parameters, one.made.model_source)
    changed = [name for (name, value), was in zip(now.items(), then, strict=True) if value != was]
    if changed:
        return f"{OLD}, {' and '.join(changed)} changed"
    return SAVED if session.edited_of([one.path, *files_named_by(one.path)]) else CURRENT


def _origin(path: Path) -> tuple[str, str, str]:
    """What a proposal says of where it comes from, were it made now."""
    scenario = load_scenario(path)
    return scenario.content_hash, parameters_hash(scenario.model), source_hash()


def stamp_of(layout: Layout, name: str) -> str:
    """The state of a scenario's golden and proposal."""
    return " ".join(file_hash(path) for path in (layout.golden(name), layout.proposal(name)))


def _read(path: Path, load: Callable[[Path], Golden]) -> tuple[Golden | None, str]:
    try:
        return (load(path) if path.is_file() else None), ""
    except GoldenError as error:
        return None, error.lines()[0].removeprefix("error: ")


def _kpis(golden: Golden | None, proposal: Golden) -> tuple[KpiReview, ...]:
    """The KPIs with the verdicts of the run that left the proposal."""
    old = golden.kpis if golden else {}
    found = []
    for name in dict.fromkeys([*proposal.kpis, *old]):
        mine, new = old.get(name), proposal.kpis.get(name)
        verdict = KpiVerdict(new.verdict) if new and new.verdict else KpiVerdict.MISSING
        if mine and new and mine.same_values(new):
            verdict = KpiVerdict.IDENTICAL
        found.append(KpiReview(name, mine, new, verdict))
    return tuple(found)


def kpi_line(kpi: KpiReview, share: float) -> KpiLine:
    """A KPI as it is shown; `catches` is what the proposed value would catch as a golden."""
    kept = kpi.new or kpi.old
    if kept is None:
        return KpiLine(kpi.name, verdict_word(kpi), False, "", None, None, None, None, "", "")
    speaks = "; ".join([*(f"cannot be accepted: {text}" for text in kpi.refused), *kpi.needs_reason])
    fails = bool(speaks) or (kpi.verdict.fails and kpi.old is not None and kpi.new is not None)
    old, new = (None if side is None else known(side.reference.mean) for side in (kpi.old, kpi.new))
    smallest = (
        known(sensitivity.smallest_change(kept.spec, kept.reference, share)) if kept.reference.seeds > 1 else None
    )
    return KpiLine(
        kpi.name, verdict_word(kpi), fails, unit_of(kept.spec), old, new, known(kept.spec.tolerance), smallest,
        limits_of(kept.spec), speaks,
    )  # fmt: skip


def reasons(found: Sequence[ScenarioReview], names: Sequence[str] = ()) -> list[str]:
    """What must be answered with a reason to accept these KPIs, all of them without names."""
    lines = []
    for one in found:
        chosen = [kpi for kpi in one.kpis if kpi.open and (not names or kpi.name in names)]
        if chosen or not any(kpi.open for kpi in one.kpis):
            lines += [f"{one.name}: {text}" for text in one.needs_reason]
        lines += [f"{one.name}, {kpi.name}: {text}" for kpi in chosen for text in kpi.needs_reason]
    return lines


def changes(texts: Mapping[Path, str]) -> list[str]:
    """How files would change: the lines of a unified diff, each file's behind its name."""
    lines: list[str] = []
    for path, text in texts.items():
        old = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
        difference = list(difflib.unified_diff(old.splitlines(), text.splitlines(), n=1, lineterm=""))[2:]
        lines += [f"@@ {path}", *difference]
    return lines


def run_reviews(
    groups: Sequence[Sequence[Path]],
    *,
    review: Review,
    on_progress: ProgressCallback,
    on_result: Callable[[Sequence[Path], Any], object],
    stop: threading.Event,
) -> None:
    """Review group by group; `on_result` gets each with its report, or the `LidarcheckError` that it ended with.

    `on_progress` gets (groups done, groups to do, what runs now). `Cancelled` when `stop` is set.
    """
    for number, paths in enumerate(groups):

        def progress(done: int, total: int, label: str, number: int = number) -> None:
            if stop.is_set():
                raise Cancelled
            on_progress(number, len(groups), f"{label} {done}/{total}")

        progress(0, 0, paths[0].stem)
        try:
            on_result(paths, review(paths, progress=progress))
        except LidarcheckError as error:
            on_result(paths, error)
