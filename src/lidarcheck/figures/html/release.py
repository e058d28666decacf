"""The page of a release: what every workflow has found, and how the goldens stand, in one self-contained HTML file."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck import __version__
from lidarcheck.figures.data import Table
from lidarcheck.figures.html.environment import page_environment
from lidarcheck.figures.html.page import main_of, right_of
from lidarcheck.figures.words import amount
from lidarcheck.harness.review.release import GoldenState, LastCheck

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = [
    "Outcome",
    "Release",
    "golden_table",
    "made_table",
    "outcome_table",
    "release_html",
    "shift_table",
    "summary_of",
]


@dataclass(frozen=True)
class Outcome:
    """What one run of a workflow has found.

    `workflow`: its command, as `panels`; `page`: its HTML, empty where there is none, for which `note` says why.
    """

    workflow: str
    title: str
    summary: str
    version: str
    file: Path
    provenance: Mapping[str, str] = field(default_factory=dict)
    page: str = ""
    note: str = ""


@dataclass(frozen=True)
class Release:
    """All that a release report says.

    `missing`: workflows without a result, and what each is for; `amiss`: what was found in their directories and is no
    result; `goldens`: None where there is no project with goldens; `source`: hash of this installation's code, as far
    as it determines results; `check`: None where no check's JSON was given.
    """

    outcomes: tuple[Outcome, ...]
    missing: Mapping[str, str]
    amiss: tuple[str, ...]
    goldens: tuple[GoldenState, ...] | None
    project: str = ""
    source: str = ""
    check: LastCheck | None = None

    @property
    def complete(self) -> bool:
        """Whether nothing is missing: every workflow has a result, every scenario a golden, a check that holds."""
        checked = self.check is not None and self.check.verdict == "holds" and self.check.current
        goldens = bool(self.goldens) and all(not one.problem and one.verdict != "not run" for one in self.goldens or ())
        return not self.missing and not self.amiss and checked and goldens


def release_html(release: Release) -> str:
    """The page as text; the same release gives the same bytes."""
    pages = [main_of(one.page, f"w{i}-") if one.page else "" for i, one in enumerate(release.outcomes, 1)]
    shifts = shift_table(release.goldens or ())
    return _template().render(
        release=release,
        version=__version__,
        summary=summary_of(release),
        outcomes=list(zip(release.outcomes, pages, strict=True)),
        made=[(table, right_of(table)) for table in (made_table(release.goldens or ()),) if table.rows],
        goldens=[(table, right_of(table)) for table in (golden_table(release.goldens or ()),)],
        shifts=[(shifts, right_of(shifts))] if shifts.rows else [],
        check_words=check_words(release.check),
    )


def summary_of(release: Release) -> str:
    """The state of the release in a few sentences."""
    there = len({one.workflow for one in release.outcomes})
    words = [f"{there} workflow{'' if there == 1 else 's'} with a result"]
    words[0] += f"; missing: {', '.join(release.missing)}." if release.missing else ", none missing."
    if release.goldens is None:
        words.append("Goldens: none, there is no project with scenarios.")
    else:
        bad = [one.scenario for one in release.goldens if one.problem]
        moved = sum(len(one.shifts) for one in release.goldens)
        words.append(
            f"{len(release.goldens) - len(bad)} goldens"
            + (f", {len(bad)} scenarios without a valid one" if bad else "")
            + f"; {moved} KPIs other than at the last release."
        )
    words.append(check_words(release.check))
    return " ".join(words)


def check_words(check: LastCheck | None) -> str:
    """What the last check says, and whether it speaks of this code."""
    if check is None:
        return "Last check: not given, so nothing is known of the goldens' verdicts."
    counts = ", ".join(f"{count} {word}" for word, count in check.counts.items())
    about = "" if check.current else " It was made with other code than this installation's: run it again."
    whose = f" of the model {check.model}" if check.model else ""
    return f"Last check{whose}: {check.verdict} ({counts or 'no KPI'}).{about}"


def outcome_table(release: Release) -> Table:
    """A row for each result, and for each workflow that has none."""
    rows = [(one.workflow, "✓ there", one.summary, one.version, str(one.file)) for one in release.outcomes]
    rows += [(name, "∅ missing", words, "", "") for name, words in release.missing.items()]
    return Table("Workflows", ("workflow", "result", "what it says", "lidarcheck", "file"), tuple(rows))


def golden_table(goldens: Sequence[GoldenState]) -> Table:
    """A row for each golden: how it was made, the last check's verdict, the largest shift since the release."""
    header = ("scenario", "KPIs", "last check", "made", "scenario's hash", "parameters", "release", "shift", "note")
    return Table("", header, tuple(_golden_row(one) for one in goldens), ("KPIs", "shift"))


def _golden_row(one: GoldenState) -> tuple[str, ...]:
    made, released = one.made, one.released
    sizes = [abs(shift.in_tolerances) for shift in one.shifts]
    finite = [size for size in sizes if math.isfinite(size)]
    shift = (
        "" if released is None else "none" if not sizes else f"{amount(max(finite), 2)} tol." if finite else "new KPI"
    )
    notes = [one.problem, *one.fallen, *(f"accepted: {reason}" for reason in one.reasons)]
    notes += [] if one.complete or one.problem else ["not all seeds were run"]
    return (
        one.scenario,
        str(one.kpis) if made else "–",
        f"{_ICONS.get(one.verdict, '–')} {one.verdict}",
        made.date if made else "–",
        made.scenario[:8] if made else "–",
        made.parameters[:8] if made else "–",
        (f"{released.date}, {released.lidarcheck}" if released else "none") if made else "–",
        shift,
        "; ".join(note for note in notes if note),
    )


def made_table(goldens: Sequence[GoldenState]) -> Table:
    """A row for each way in which goldens were made, most goldens first."""
    ways = Counter(
        (p.date, p.lidarcheck, p.python, p.numpy, p.numba, p.seeds, p.reference_seeds, p.model_source[:16])
        for one in goldens
        if (p := one.made) is not None
    )
    rows = [(str(number), *way) for way, number in sorted(ways.items(), key=lambda pair: (-pair[1], pair[0]))]
    header = ("goldens", "made", "lidarcheck", "Python", "numpy", "numba", "seeds", "of distances", "model's source")
    return Table("How they were made", header, tuple(rows), ("goldens",))


_ICONS = {"identical": "=", "holds": "✓", "failed": "✗"}


_TOLD = ("requirement", "accepted by", "on")


def shift_table(goldens: Sequence[GoldenState]) -> Table:
    """A row for each KPI whose golden is another than at the last release, the largest shift in tolerances first."""
    found = [(one.scenario, shift) for one in goldens for shift in one.shifts]
    found.sort(key=lambda pair: -abs(pair[1].in_tolerances) if math.isfinite(pair[1].in_tolerances) else -math.inf)
    rows = [
        (
            scenario,
            shift.kpi,
            "" if shift.unit == "1" else shift.unit,
            amount(shift.release, 4),
            amount(shift.now, 4),
            amount(shift.change),
            amount(shift.in_tolerances, 2),
            shift.reason,
            shift.requirement,
            shift.accepted_by,
            shift.accepted_date,
        )
        for scenario, shift in found
    ]
    header = ("scenario", "KPI", "unit", "release", "now", "change", "in tolerances", "reason", *_TOLD)
    return Table("Since the last release", header, tuple(rows), header[3:7])


@cache
def _template() -> Template:
    return page_environment().get_template("release.html.jinja")
