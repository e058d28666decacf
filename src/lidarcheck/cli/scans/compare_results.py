"""What `lidarcheck compare` shows and writes of a verdict: table, lines of text, JSON, CSV and the picture."""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.core.outputs import check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import Column, emit, note, table

if TYPE_CHECKING:
    from lidarcheck.cli.scans.fail_on import Outcome
    from lidarcheck.kpi.chance.verdict import Verdict

__all__ = ["chance_cells", "check_places", "say", "write"]

RESULT, TABLE, PICTURE = "result.json", "kpis.csv", "chance.svg"
_WIDTH = 80


def check_places(out: Path | None, json: str | None, besides: Iterable[str | Path | None]) -> None:
    """Refuse outputs that could not be written, before the work."""
    besides = list(besides)
    if json is not None:
        check_writable(json, option="--json", besides=besides)
    if out is not None:
        from lidarcheck.figures.files.result_folder import check_out_dir

        check_out_dir(out, besides=[*besides, json], files=(RESULT, TABLE, PICTURE))


def chance_cells(verdict: Verdict, kpi: str, of: str) -> tuple[float, str]:
    """What chance gives for a KPI, and the verdict on it in a word."""
    found = verdict.kpis.get((kpi, of))
    return (float("nan") if found is None else found.chance), verdict.word(kpi, of)


def say(
    columns: Sequence[Column], rows: Sequence[Sequence[str]], verdict: Verdict, left_out: Iterable[str],
    failed: Sequence[Outcome], words: Sequence[str] = (),
) -> None:  # fmt: skip
    """The table, what else is to be known, what was not judged and why, what failed, and the closing line, last."""
    emit(table(columns, rows))
    for line in words:
        emit(line)
    for reason in left_out:
        note(f"not compared: {reason}")
    for reason, names in verdict.reasons().items():
        emit(textwrap.fill(f"not judged, {reason}: {', '.join(names)}", _WIDTH, subsequent_indent="  "))
    for one in failed:
        emit(f"--fail-on {one.condition}: {'met' if one.met else 'not met'}: {one.by}")
    emit(verdict.closing)


def write(
    out: Path | None, json: str | None, document: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], verdict: Verdict
) -> None:
    """The result as JSON, and into the directory besides the lines as CSV and the picture; all or none."""
    text = json_text(with_origin(document))
    if out is not None:
        from lidarcheck.figures.files.outputs import write_file
        from lidarcheck.figures.files.sets import write_set
        from lidarcheck.figures.svg.chance import chance_svg

        picture = chance_svg(verdict)
        files = {RESULT: text, TABLE: _csv(rows), PICTURE: picture}
        write_set(out, {name: _writer(write_file, content) for name, content in files.items()})
    if json is not None:
        write_result(json, text)


def _writer(write_file: Any, content: str) -> Any:
    return lambda path: write_file(path, content)


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: "" if value != value else value for key, value in row.items()} for row in rows)
    return stream.getvalue()
