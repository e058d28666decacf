"""`lidarcheck case check`: what a case's data can show, before hours are spent on it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.options import Jobs, JsonFile, MaxRows, Permitted, Quiet, Seed
from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import columns, emit, hush, stage, table
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.explain.showing import Showing

__all__ = ["check", "showing_text"]

COLUMNS = columns("not testable", "why")


def check(
    case: Annotated[Path, Parameter(help="The case: a directory with case.toml, or that file.")],
    /,
    *,
    seed: Seed = 0,
    jobs: Jobs | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Say what a case's data can show."""
    hush(quiet)
    limit_rows(max_rows)
    from lidarcheck.cases.case import load_case
    from lidarcheck.cli.explain.watch import watched
    from lidarcheck.explain.showing import SHOWING, what_shows
    from lidarcheck.workers.cores import usable_cores

    with stage("reading the case"):
        loaded = load_case(case, fewest=1)
    if json is not None:
        check_writable(json, option="--json", besides=loaded.files)
    with watched(SHOWING.shares, quiet=quiet) as on_progress:
        found = what_shows(loaded, seed=seed, jobs=jobs or usable_cores(), on_progress=on_progress)
    if json is not None:
        write_result(json, json_text(with_origin(found.to_dict(), loaded.files)))
    if json != "-":
        emit(showing_text(found))
    return 0 if found.shown else 1


def showing_text(found: Showing) -> str:
    """What the data can show, the number of effects first."""
    named = f": {', '.join(found.shown)}" if found.shown else ""
    lines = [f"{found.words}{named}"]
    if found.ideals_from:
        lines.append(f"the ideal scans were made from {_SOURCES[found.ideals_from]}")
    lines += [f"{name}: frames {', '.join(map(str, numbers))}" for name, numbers in found.parts.items()]
    lines += [f"{name} is left out: {why}" for name, why in found.left_out.items()]
    lines.append(found.geometry)
    if found.before is not None and found.floor is not None:
        lines.append(f"distance {found.before:.0f} before any fit, {found.floor:.0f} where nothing is missing")
    rows: list[tuple[str, Any]] = list(found.not_testable.items())
    return "\n".join([*lines, *(["", table(COLUMNS, rows).rstrip("\n")] if rows else [])])


_SOURCES = {"repeats": "repeats of these scans", "snippet": "a target that was cut out", "map": "a registered map"}
