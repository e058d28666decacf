"""What every calibration workflow gives: words and tables on standard output, and its files in `--out`.

`report.html`: the page; `result.json`: the numbers, with where they came from; `pictures/`: a PNG of each figure.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck import __version__
from lidarcheck.cli.command import ARGUMENTS
from lidarcheck.cli.outputs import json_text, write_result
from lidarcheck.cli.terminal import Column, emit, note, paragraphs, stage, table
from lidarcheck.cli.workflow_files import (
    ALL,
    PAGE,
    PICTURES,
    RESULT,
    Folder,
    Writer,
    check_out_dir,
    draw_pictures,
    write_results,
)
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.calibration.figures import Figure, Page

__all__ = ["PAGE", "PICTURES", "PLOTS", "RESULT", "Folder", "Plot", "check_out_dir", "finish"]

_PICTURE = re.compile(r"[0-9]{2,}-.*\.png")
PLOTS = ("histogram", "qq", "kde", "cdf", "violin", "top", "side", "front", ALL)
"""How a figure can be shown; but for `all`, `lidarcheck.plots.panels` has the same, which a test holds."""


def _plot(_type: Any, tokens: Sequence[Any]) -> str:
    kind = str(tokens[0].value)
    if kind not in PLOTS:
        from lidarcheck.formats.config_words import nearest

        near = nearest(kind, PLOTS)
        fix = f"did you mean {near}?" if near else f"use one of {', '.join(PLOTS)}"
        raise UsageError(f"--plot {kind} is no kind of picture", fix=fix)
    return kind


Plot = Annotated[
    str,
    Parameter(
        converter=_plot,
        help="Also draw the figures in the terminal: distributions as histogram, qq, kde, cdf or violin, "
        "clouds from top, side or front, or `all`. Pictures in --out are drawn alike.",
    ),
]


def finish(
    page: Page,
    document: Any,
    *,
    out: Path | None,
    json: str | None,
    plot: str | None,
    files: Mapping[str, Writer] | None = None,
    folders: Mapping[str, Folder] | None = None,
) -> None:
    """Show a workflow's result and write what was asked for.

    Standard output gets the summary and the tables, with `plot` the figures as well, unless `json` is `-`. `out` gets
    `report.html`, `result.json` and `pictures/`, and what this workflow has besides, `files` and `folders`, all or
    none, before anything is shown: who reads the output may go early. `json` gets the same text as `result.json`.
    `document`: what `formats.plain` can turn into JSON.
    """
    if out is None:
        text = json_text(_record(page, document, ""))
    else:
        from lidarcheck.plots.page_html import page_html

        with stage("drawing"):
            html = page_html(page)
            text = json_text(_record(page, document, html))
            drawn = Folder(lambda place: draw_pictures(page.figures(), place, plot or "histogram"), _PICTURE)
            write_results(out, text, html, files=files or {}, folders={PICTURES: drawn, **(folders or {})})
    if json is not None:
        write_result(json, text)
    if json != "-":
        _show(page, plot)
    if out is not None:
        note(f"{out}: {PAGE}, {RESULT}{f', {PICTURES}/' if page.figures() else ''}")


def _record(page: Page, document: Any, html: str) -> dict[str, Any]:
    """The result with what it is of: what `lidarcheck report` reads. The page's hash says which one belongs to it."""
    return {
        "workflow": _command() or page.title,
        "title": page.title,
        "lidarcheck": __version__,
        "summary": page.summary,
        "result": document,
        "provenance": dict(page.provenance),
        "page": {"file": PAGE, "sha256": hashlib.sha256(html.encode()).hexdigest()} if html else None,
    }


def _command() -> str:
    """The name of the command that is running, as `panels` or `lut show`; empty without one."""
    from lidarcheck.cli.app import COMMANDS

    words = [word for word in ARGUMENTS.get()[:2] if not word.startswith("-")]
    names = {command.name for command in COMMANDS}
    return next((name for name in (" ".join(words), *words[:1]) if name in names), "")


def _show(page: Page, plot: str | None) -> None:
    emit(paragraphs(page.summary))
    for section in page.sections:
        if section.words or section.tables or (plot and section.figures):
            emit(f"\n{section.title}")
        for words in section.words:
            emit(paragraphs(words))
        for one in section.tables:
            emit(f"{one.title}" if one.title else "")
            emit(table([Column(name, right=name in one.right) for name in one.header], one.rows))
        for figure, kind in _shown(section.figures, plot):
            emit("")
            emit(_drawn(figure, kind))


def _shown(figures: Sequence[Figure], plot: str | None) -> list[tuple[Figure, str]]:
    """The figures with the kinds in which they are drawn; none without `plot`."""
    from lidarcheck.plots.panels import kinds_of

    if plot is None:
        return []
    return [
        (figure, kind)
        for figure in figures
        for kind in (kinds_of(figure) or ("histogram",) if plot == ALL else (plot,))
    ]


def _drawn(figure: Figure, kind: str) -> str:
    """The figure in the terminal's width and with its colours, where it has them."""
    from lidarcheck.plots.figure_text import figure_text

    terminal = sys.stdout.isatty()
    size = shutil.get_terminal_size() if terminal else os.terminal_size((80, 24))
    height = min(max(size.lines - 4, 10), 24) if terminal else 15
    dumb = os.environ.get("TERM") == "dumb"
    colour = terminal and not dumb and not os.environ.get("NO_COLOR")
    return figure_text(figure, kind=kind, width=size.columns, height=height, colour=colour, plain=_plain(dumb))


def _plain(dumb: bool) -> bool:
    """Whether the output can hold no more than ASCII."""
    encoding = (sys.stdout.encoding or "ascii").lower().replace("-", "")
    return dumb or not encoding.startswith("utf")
