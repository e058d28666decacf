"""`lidarcheck review`: what is proposed for the goldens, and accepting it."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, Jobs, JsonFile, MaxRows, Permitted, Quiet
from lidarcheck.cli.core.outputs import check_writable, json_text, write_result
from lidarcheck.cli.core.terminal import emit, hush, note, progress
from lidarcheck.errors import UsageError
from lidarcheck.formats.limits import limit_rows

__all__ = ["review"]

Accept = Annotated[str, Parameter(help="KPIs to accept, with commas between them, or `all`.")]
Release = Annotated[bool, Flag, Parameter(help="Make the goldens the last release's: the second reference.")]


def review(
    *scenario: Annotated[str, Parameter(help="Scenario files, directories of them, or names; all by default.")],
    accept: Accept | None = None,
    reason: Annotated[str, Parameter(show_default=False, help="Why; the golden keeps it.")] = "",
    by: Annotated[
        str, Parameter(show_default=False, help="Who accepts; git's user or the login name by default.")
    ] = "",
    release: Release = False,
    jobs: Jobs | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Show what is proposed for the goldens, and accept it."""
    hush(quiet)
    limit_rows(max_rows)
    if reason and accept is None:
        raise UsageError("--reason without --accept says why of nothing", fix="add --accept")
    if by and accept is None:
        raise UsageError("--by without --accept says who of nothing", fix="add --accept")
    if release:
        if accept is not None:
            raise UsageError("--release does not go with --accept", fix="accept first, then release")
        return _release(scenario)
    if json is not None:
        check_writable(json, option="--json")
    from lidarcheck.cli.harness.review_text import review_text
    from lidarcheck.harness.review.accept import accept as write
    from lidarcheck.harness.review.review import review as run

    with progress("reviewing") as show:
        report = run(scenario, jobs=jobs, progress=show)
    if json is not None:
        write_result(json, json_text(report.to_dict()))
    if json != "-":
        emit(review_text(report, hint=accept is None))
    if accept is not None:
        names = [name for name in (part.strip() for part in accept.split(",")) if name]
        for path in write(report, names, reason=reason, by=by):
            note(f"accepted {path}")
    return 0


def _release(scenario: tuple[str, ...]) -> int:
    from lidarcheck.harness.review.accept import release as write

    for path in write(scenario):
        note(f"released {path}")
    return 0
