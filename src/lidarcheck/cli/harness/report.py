"""`lidarcheck report`: what all workflows have found, and how the goldens stand, on one page."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck import __version__
from lidarcheck.cli.core.options import JsonFile, Quiet
from lidarcheck.cli.core.outputs import check_writable, json_text, write_result
from lidarcheck.cli.core.terminal import Column, emit, hush, note, paragraphs, stage, table
from lidarcheck.errors import UsageError
from lidarcheck.formats.plain import plain

if TYPE_CHECKING:
    from lidarcheck.figures.html.release import Outcome, Release
    from lidarcheck.harness.review.release import LastCheck

__all__ = ["report", "workflows"]


def report(
    *directory: Annotated[Path, Parameter(help="Directories that workflows wrote with --out, or that hold such.")],
    out: Annotated[Path, Parameter(help="The page: one HTML file.")],
    goldens: Annotated[
        Path | None,
        Parameter(help="The project whose goldens count, or its goldens/; by default that of the current directory."),
    ] = None,
    check: Annotated[
        Path | None, Parameter(help="The JSON of the last check; by default check.json in the directories.")
    ] = None,
    between: Annotated[
        tuple[str, str] | None,
        Parameter(
            negative=(), help="Two releases to put side by side instead: folders of goldens, or revisions of git."
        ),
    ] = None,
    json: JsonFile | None = None,
    quiet: Quiet = False,
) -> int:
    """Put what all workflows have found, and the goldens, on one page."""
    hush(quiet)
    if between is not None:
        if directory or check is not None:
            raise UsageError("--between does not go with DIR or --check", fix="leave out one of them")
        return _between(between, goldens, out, json)
    if not directory:
        raise UsageError("lidarcheck report needs DIR", fix="give the directories that workflows wrote with --out")
    from lidarcheck.cli.harness.report_files import outcomes_in

    outcomes, amiss = outcomes_in(directory)
    read = [path for one in outcomes for path in (one.file, one.file.with_name("report.html"))]
    check_writable(out, option="--out", besides=(json, check, *read))
    if json is not None:
        check_writable(json, option="--json", besides=(out, check, *read))
    with stage("reading the goldens"):
        release = _release(outcomes, amiss, goldens, _check(check, directory))
    from lidarcheck.figures.html.release import release_html

    with stage("drawing the page"):
        write_result(out, release_html(release))
    if json is not None:
        write_result(json, json_text(_document(release)))
    if json != "-":
        _show(release)
    note(f"{out}: the report")
    return 0


def _between(names: tuple[str, str], goldens: Path | None, out: Path, json: str | None) -> int:
    """Two releases side by side, KPI by KPI."""
    check_writable(out, option="--out", besides=(json,))
    if json is not None:
        check_writable(json, option="--json", besides=(out,))
    from lidarcheck.figures.data import Page, Section, Table
    from lidarcheck.figures.html.page import page_html
    from lidarcheck.figures.words import amount
    from lidarcheck.harness.review.between import changes_between
    from lidarcheck.harness.review.release import project_of

    layout = project_of(goldens)
    changes = changes_between(*names, Path.cwd() if layout is None else layout.root)
    moved = [one for one in changes if one.old != one.new and not (one.old != one.old and one.new != one.new)]
    header = ("scenario", "KPI", "unit", "old", "new", "difference", "requirement", "accepted by", "on", "reason")
    rows = {
        id(one): (
            one.scenario,
            one.kpi,
            "" if one.unit == "1" else one.unit,
            *("–" if number is None else amount(number, 4) for number in (one.old, one.new, one.difference)),
            *(one.requirement, one.accepted_by, one.accepted_date, one.reason),
        )
        for one in changes
    }
    summary = f"{names[0]} against {names[1]}: {len(moved)} of {len(changes)} KPIs differ."
    whole = Table("", header, tuple(rows.values()), header[3:6])
    write_result(out, page_html(Page("Two releases", summary, (Section("KPIs", tables=(whole,)),))))
    if json is not None:
        kpis = [{**dataclasses.asdict(one), "difference": one.difference} for one in changes]
        document = {"lidarcheck": __version__, "old": names[0], "new": names[1], "kpis": plain(kpis)}
        write_result(json, json_text(document))
    if json != "-":
        emit(summary)
        if moved:
            shown = [Column(name, right=name in whole.right) for name in header]
            emit(table(shown, [rows[id(one)] for one in moved]))
    note(f"{out}: the report")
    return 0


def _check(check: Path | None, directories: Sequence[Path]) -> LastCheck | None:
    """The last check: what was asked for, else the newest check.json that is one."""
    from lidarcheck.cli.harness.report_files import checks_in
    from lidarcheck.errors import InputError
    from lidarcheck.harness.review.release import last_check

    if check is not None:
        return last_check(check)
    for file in sorted(checks_in(directories), key=lambda file: file.stat().st_mtime, reverse=True):
        try:
            return last_check(file)
        except InputError as error:
            note(f"{file}: {error.what}, left out")
    return None


def _release(outcomes: list[Outcome], amiss: list[str], goldens: Path | None, check: LastCheck | None) -> Release:
    from lidarcheck.figures.html.release import Release
    from lidarcheck.harness.goldens.provenance import source_hash
    from lidarcheck.harness.review.release import golden_states, project_of

    layout = project_of(goldens)
    there = {one.workflow for one in outcomes}
    return Release(
        outcomes=tuple(outcomes),
        missing={name: words for name, words in workflows().items() if name not in there},
        amiss=tuple(amiss),
        goldens=None if layout is None else golden_states(layout, check),
        project="" if layout is None else str(layout.root),
        source=source_hash(),
        check=check,
    )


@cache
def workflows() -> Mapping[str, str]:
    """The workflows that a release should have a result of, and what each is for.

    They are the commands that take what `workflow_output.finish` needs, and `explain`.
    """
    from lidarcheck.cli.core.app import COMMANDS, make_app

    found, app = {}, make_app()
    for command in COMMANDS:
        parser = app
        for word in command.name.split():
            parser = parser[word]
        options = {name for argument in parser.assemble_argument_collection() for name in argument.names}
        if command.name == "explain" or {"--out", "--plot"} <= options:
            found[command.name] = command.summary
    return found


def _document(release: Release) -> dict[str, object]:
    """The report for machines; of a workflow its page is left out, which the HTML has."""
    return {
        "lidarcheck": __version__,
        "complete": release.complete,
        "model_source": release.source,
        "workflows": [
            {
                "workflow": one.workflow,
                "title": one.title,
                "summary": one.summary,
                "lidarcheck": one.version,
                "file": one.file,
                "provenance": one.provenance,
                "note": one.note,
            }
            for one in release.outcomes
        ],
        "missing": list(release.missing),
        "amiss": release.amiss,
        "goldens": release.goldens,
        "check": release.check,
    }


def _show(release: Release) -> None:
    from lidarcheck.figures.html.release import golden_table, outcome_table, shift_table, summary_of

    emit(paragraphs(summary_of(release)))
    workflows = outcome_table(release)
    emit(f"\n{workflows.title}")
    shown_columns = (0, 1, 4, 2)  # the file tells several results of one workflow apart
    emit(
        table(
            [Column(workflows.header[i]) for i in shown_columns],
            [[row[i] for i in shown_columns] for row in workflows.rows],
        )
    )
    for line in (*(f"{one.file}: {one.note}" for one in release.outcomes if one.note), *release.amiss):
        emit(line)
    doubtful = [one for one in release.goldens or () if one.problem or one.verdict == "failed"]
    shown = [golden_table(doubtful)] if doubtful else []
    shown += [shifts] if (shifts := shift_table(release.goldens or ())).rows else []
    for one in shown:
        emit(f"\n{one.title or 'Goldens that do not hold'}")
        emit(table([Column(name, right=name in one.right) for name in one.header], one.rows))
