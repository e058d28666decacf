"""`lidarcheck check`: scenarios against their goldens."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, Jobs, JsonFile, MaxRows, Permitted, Quiet, Seed
from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import complain, emit, hush, progress, stage
from lidarcheck.cli.core.workers import Scheduler, workers
from lidarcheck.errors import LidarcheckError, UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.harness.reports.results import CheckReport

__all__ = ["check"]


def check(
    *scenario: Annotated[str, Parameter(help="Scenario files, directories of them, or names; all by default.")],
    seed: Annotated[Seed | None, Parameter(help="Also run fresh seeds, drawn from this one, 0 to 2^64 - 1.")] = None,
    model: Annotated[Path | None, Parameter(help="A model to ask in the place of the scenarios' own.")] = None,
    jobs: Jobs | None = None,
    scheduler: Scheduler | None = None,
    json: JsonFile | None = None,
    html: Annotated[Path | None, Parameter(help="Also write a page with plots to this file.")] = None,
    junit: Annotated[Path | None, Parameter(help="Also write a JUnit report for a CI server to this file.")] = None,
    max_rows: MaxRows | None = None,
    sensitivity: Annotated[
        bool, Flag, Parameter(help="Change each parameter noticeably, and say which scenario turns red.")
    ] = False,
    every: Annotated[
        bool, Flag, Parameter(name="--all", help="With --sensitivity: go on beyond the first red scenario.")
    ] = False,
    only: Annotated[
        str | None, Parameter(help="With --sensitivity: parameters with this in their name, as fog.mor_m.")
    ] = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Run scenarios against their goldens."""
    hush(quiet)
    limit_rows(max_rows)
    if sensitivity:
        _refuse(
            "cannot be combined with --sensitivity", seed=seed, model=model, scheduler=scheduler, html=html, junit=junit
        )
        from lidarcheck.cli.harness.sensitivity import sensitivity as matrix

        return matrix(scenario, every=every, only=only or "", jobs=jobs, json=json)
    _refuse("needs --sensitivity", all=every or None, only=only)
    outputs = {"--json": json, "--html": html, "--junit": junit}
    for option, place in outputs.items():
        if place is not None:
            others = [other for name, other in outputs.items() if name != option]
            check_writable(place, option=option, besides=(*scenario, model, *others))
    from lidarcheck.cli.harness.check_text import report_text
    from lidarcheck.harness.check import check as run
    from lidarcheck.harness.reports.annotations import annotations
    from lidarcheck.harness.reports.junit import junit_text

    try:
        with workers(scheduler, jobs) as pool, progress("checking") as show:
            report = run(scenario, seed=seed, model=model, jobs=jobs, pool=pool, progress=show)
    except LidarcheckError as error:
        if junit is not None:
            write_result(junit, junit_text(error))
        raise
    if json != "-":
        emit(report_text(report))
    for line in annotations(report, os.environ):
        complain(line)
    if json is not None:
        write_result(json, json_text(with_origin(report.to_dict(), _files_of(report))))
    if junit is not None:
        write_result(junit, junit_text(report))
    if html is not None:
        _write_page(report, html)
    return report.exit_code


def _refuse(why: str, **options: object) -> None:
    """`UsageError` for the first of those options that is given."""
    for name, value in options.items():
        if value is not None:
            raise UsageError(f"--{name} {why}", fix="leave one of them out" if "combined" in why else "add it")


def _files_of(report: CheckReport) -> list[Path]:
    """The scenarios, their goldens, and all that they name."""
    from lidarcheck.harness.layout import layout_of
    from lidarcheck.session.inputs import files_named_by

    found = []
    for one in report.scenarios:
        found += [one.file, layout_of(one.file).golden(one.name), *files_named_by(one.file)]
    return found


def _write_page(report: CheckReport, html: Path) -> None:
    from lidarcheck.figures.html.check import report_html

    with stage("drawing the page"):
        write_result(html, report_html(report))
