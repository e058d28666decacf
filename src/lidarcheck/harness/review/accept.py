"""Accepting proposals into goldens, and goldens into release goldens: the only code that writes either."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import difflib
import os
import time
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from lidarcheck.errors import UsageError
from lidarcheck.formats.atomic import write_bytes
from lidarcheck.harness.goldens.file import dump_golden, load_golden, save_golden
from lidarcheck.harness.goldens.git_state import acceptor
from lidarcheck.harness.goldens.golden import Golden, KpiGolden
from lidarcheck.harness.layout import Layout, layout_of, make_directory, select
from lidarcheck.harness.review.review import KpiReview, ReviewReport, ScenarioReview, file_hash
from lidarcheck.trust.places import own_place

__all__ = ["ALL", "accept", "preview", "reject", "release"]

ALL = "all"
_LOCK_TIMEOUT_S = 30.0


def accept(report: ReviewReport, names: Collection[str], *, reason: str = "", by: str = "") -> list[Path]:
    """Write the proposals of the KPIs `names` (`all`: every one) into the goldens; returns the goldens written.

    `UsageError`, with nothing written, for an unknown name, for what needs a reason and has none, for what cannot be
    accepted at all, and for a golden that has changed since the review. `reason`: one line that the golden
    carries; `by`: who accepts, by default whom git or the system knows.
    """
    reason, chosen = _acceptable(report, names, reason)
    with contextlib.ExitStack() as stack:
        for layout in dict.fromkeys(found.layout for found, _ in chosen):
            stack.enter_context(_lock(layout))
        for found, _ in chosen:
            _refuse_changed(found)
        return [_write(found, kpis, reason, by) for found, kpis in chosen]


def preview(report: ReviewReport, names: Collection[str], *, reason: str = "", by: str = "") -> dict[Path, str]:
    """What `accept` would write, by the golden's path: the whole new text. Raises as `accept` does; writes nothing."""
    reason, chosen = _acceptable(report, names, reason)
    for found, _ in chosen:
        _refuse_changed(found)
    return {found.layout.golden(found.name): dump_golden(_accepted(found, kpis, reason, by)) for found, kpis in chosen}


def reject(layout: Layout, name: str) -> bool:
    """Drop the proposal for a scenario, whose golden stays; whether there was one."""
    path = layout.own(layout.proposal(name))
    with _lock(layout):
        there = path.exists()
        path.unlink(missing_ok=True)
    return there


def release(paths: Sequence[Path | str] = ()) -> list[Path]:
    """Make the goldens of the scenarios the release's, the second reference; returns the files written.

    Of a whole project, release goldens without a scenario are removed. `UsageError` for a scenario without a golden,
    `GoldenError` for a damaged one; nothing is written then.
    """
    selection = select(paths)
    pairs = []
    layouts = {file: layout_of(file) for file in selection.files}
    for file, layout in layouts.items():
        source = layout.golden(file.stem)
        if not source.is_file():
            raise UsageError(f"{file.stem} has no golden to release", fix=f"run `lidarcheck review {file.stem}` first")
        load_golden(source)
        pairs.append((source, layout.own(layout.release(file.stem))))
    with contextlib.ExitStack() as stack:
        for layout in dict.fromkeys(layouts.values()):
            stack.enter_context(_lock(layout))
        for source, target in pairs:
            make_directory(target.parent)
            write_bytes(target, source.read_bytes())
        for layout in selection.whole:
            for path in (path for path in layout.orphans() if path.parent == layout.releases):
                layout.own(path).unlink()
    return [target for _, target in pairs]


def _acceptable(
    report: ReviewReport, names: Collection[str], reason: str
) -> tuple[str, list[tuple[ScenarioReview, list[KpiReview]]]]:
    """The reason as one line, and what is to be written; `UsageError` where that is refused."""
    reason = " ".join(reason.split())
    chosen = [(found, _chosen(found, names)) for found in report.scenarios if not found.settled]
    _refuse_unknown(report, names)
    chosen = [(found, kpis) for found, kpis in chosen if kpis or (ALL in names and _only_restated(found))]
    faults = [fault for found, kpis in chosen for fault in _faults(found, kpis, reason)]
    if faults:
        more = f" (and {len(faults) - 3} more)" if len(faults) > 3 else ""
        hard = any(kpi.refused for _, kpis in chosen for kpi in kpis)
        fix = "change the scenario or the model" if hard else "put it right, or say why with --reason"
        raise UsageError(f"not accepted: {'; '.join(faults[:3])}{more}", fix=fix)
    return reason, chosen


def _chosen(found: ScenarioReview, names: Collection[str]) -> list[KpiReview]:
    return [kpi for kpi in found.kpis if kpi.open and (ALL in names or kpi.name in names)]


def _only_restated(found: ScenarioReview) -> bool:
    """Whether the golden only has to say that the scenario's file is another, every KPI as it was."""
    return not any(kpi.open for kpi in found.kpis)


def _refuse_unknown(report: ReviewReport, names: Collection[str]) -> None:
    known = {kpi.name for found in report.scenarios for kpi in found.kpis}
    for name in names:
        if name != ALL and name not in known:
            near = difflib.get_close_matches(name, known, 1)
            fix = f"did you mean {near[0]}?" if near else "`lidarcheck review` lists the names"
            raise UsageError(f"no reviewed scenario has a KPI {name!r}", fix=fix)


def _faults(found: ScenarioReview, kpis: Sequence[KpiReview], reason: str) -> list[str]:
    faults = [f"{found.name}, {kpi.name}: {text}" for kpi in kpis for text in kpi.refused]
    if not reason:
        faults += [f"{found.name}: {text}" for text in found.needs_reason]
        faults += [f"{found.name}, {kpi.name}: {text}" for kpi in kpis for text in kpi.needs_reason]
    return faults


def _refuse_changed(found: ScenarioReview) -> None:
    if file_hash(found.layout.golden(found.name)) != found.base:
        raise UsageError(
            f"the golden of {found.name} has changed since it was reviewed", fix="run `lidarcheck review` again"
        )


def _write(found: ScenarioReview, kpis: Sequence[KpiReview], reason: str, by: str) -> Path:
    """Put the chosen KPIs into the golden; what is left open stays in the proposal."""
    path = found.layout.own(found.layout.golden(found.name))
    make_directory(path.parent)
    kept = _kept(found, kpis)
    save_golden(_accepted(found, kpis, reason, by), path)
    proposal = found.layout.own(found.layout.proposal(found.name))
    if kept:
        left = dataclasses.replace(found.proposal.provenance, base=file_hash(path))
        save_golden(dataclasses.replace(found.proposal, provenance=left), proposal)
    else:
        proposal.unlink(missing_ok=True)
    return path


def _kept(found: ScenarioReview, kpis: Sequence[KpiReview]) -> list[KpiReview]:
    """What stays open beside the chosen KPIs."""
    taken = {kpi.name for kpi in kpis}
    return [kpi for kpi in found.kpis if kpi.open and kpi.name not in taken]


def _accepted(found: ScenarioReview, kpis: Sequence[KpiReview], reason: str, by: str) -> Golden:
    """The golden with the chosen KPIs in it, each with who took it and when."""
    who = " ".join(by.split()) or acceptor(found.layout.root)
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    taken = {kpi.name: _with_reason(found, kpi, reason, today) for kpi in kpis}
    signed = {
        name: None if kpi is None else dataclasses.replace(kpi, accepted_by=who, accepted_date=today)
        for name, kpi in taken.items()
    }
    return _merged(found, signed, _kept(found, kpis))


def _merged(found: ScenarioReview, taken: dict[str, KpiGolden | None], kept: Sequence[KpiReview]) -> Golden:
    """The golden with the taken KPIs as proposed and the others as they were, in the proposal's order."""
    merged: dict[str, KpiGolden] = {}
    for kpi in found.kpis:
        entry = taken.get(kpi.name, kpi.old)
        if entry is not None:
            merged[kpi.name] = dataclasses.replace(entry, verdict="")
    names = tuple(kpi.name for kpi in kept if kpi.old is not None)
    provenance = dataclasses.replace(found.proposal.provenance, base="", kept=names)
    return Golden(found.name, merged, found.proposal.digests, provenance)


def _with_reason(found: ScenarioReview, kpi: KpiReview, reason: str, today: str) -> KpiGolden | None:
    """The proposed KPI with the reason if it needed one, else with the one that it had."""
    if kpi.new is None:
        return None
    if reason and (found.needs_reason or kpi.needs_reason):
        return dataclasses.replace(kpi.new, reason=reason, reason_date=today)
    if kpi.old is not None:
        return dataclasses.replace(kpi.new, reason=kpi.old.reason, reason_date=kpi.old.reason_date)
    return kpi.new


@contextlib.contextmanager
def _lock(layout: Layout) -> Iterator[None]:
    """Hold the project's lock; a process that dies releases it. Systems without flock rely on the comparison alone."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    path = own_place(layout.private() / "lock", layout.root)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666), "a") as stream:
        deadline = time.monotonic() + _LOCK_TIMEOUT_S
        while True:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise UsageError("another review is writing goldens", fix="wait for it, then try again") from None
                time.sleep(0.05)
        yield
