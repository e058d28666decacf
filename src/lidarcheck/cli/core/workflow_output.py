"""What every calibration workflow gives: words and tables on standard output, and its files in `--out`.

`report.html`: the page; `result.json`: the numbers, with where they came from; `pictures/`: a PNG of each figure.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.command import ARGUMENTS
from lidarcheck.cli.core.outputs import check_writable, with_origin, write_result
from lidarcheck.cli.core.terminal import Column, emit, note, paragraphs, stage, table
from lidarcheck.errors import UsageError
from lidarcheck.figures.files.result_folder import (
    ALL,
    PAGE,
    PICTURES,
    RESULT,
    Folder,
    Writer,
    check_out_dir,
    page_text,
    stamped,
    write_page,
)

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page

__all__ = ["PAGE", "PICTURES", "PLOTS", "RESULT", "Folder", "Plot", "check_out_dir", "check_places", "drawn", "finish"]

PLOTS = ("histogram", "qq", "kde", "cdf", "violin", "top", "side", "front", ALL)
"""How a figure can be shown; but for `all`, `lidarcheck.figures.axes` has the same, which a test holds."""


def _plot(_type: Any, tokens: Sequence[Any]) -> str:
    kind = str(tokens[0].value)
    if kind not in PLOTS:
        from lidarcheck.config.words import nearest

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


def check_places(
    out: Path | None, json: str | None, read: Sequence[str | Path | None], files: Sequence[str] = ()
) -> None:
    """Refuse, before the work, results that could not be written or would replace what the command reads.

    `files`: names of the results in `out` that are not every workflow's.
    """
    if out is not None:
        check_out_dir(out, besides=(*read, json), files=files)
    if json is not None:
        check_writable(json, option="--json", besides=read)


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
    from lidarcheck.session.origin import COMPUTED_FROM

    made = with_origin({}).get(COMPUTED_FROM) if out is not None or json is not None else None
    page = stamped(page, made)
    if out is None:
        text = page_text(page, document, command=_command(), origin=made)
    else:
        with stage("drawing"):
            text = write_page(
                page, document, out, command=_command(), kind=plot or "histogram", files=files, folders=folders,
                origin=made,
            )  # fmt: skip
    if json is not None:
        write_result(json, text)
    if json != "-":
        _show(page, plot)
    if out is not None:
        note(f"{out}: {PAGE}, {RESULT}{f', {PICTURES}/' if page.figures() else ''}")


def _command() -> str:
    """The name of the command that is running, as `panels` or `lut show`; empty without one."""
    from lidarcheck.cli.core.app import COMMANDS

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
            emit(drawn(figure, kind))


def _shown(figures: Sequence[Figure], plot: str | None) -> list[tuple[Figure, str]]:
    """The figures with the kinds in which they are drawn; none without `plot`."""
    from lidarcheck.figures.axes import kinds_of

    if plot is None:
        return []
    return [
        (figure, kind)
        for figure in figures
        for kind in (kinds_of(figure) or ("histogram",) if plot == ALL else (plot,))
    ]


def drawn(figure: Figure, kind: str) -> str:
    """The figure in the terminal's width and with its colours, where it has them."""
    from lidarcheck.figures.terminal import figure_text

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
