"""`lidarcheck sensor show`: what a sensor file says, as tables and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, JsonFlag, Quiet, Rooted
from lidarcheck.cli.core.outputs import check_writable, json_text, write_result
from lidarcheck.cli.core.terminal import Column, emit, hush, note, paragraphs, stage, table
from lidarcheck.errors import UsageError

if TYPE_CHECKING:
    from lidarcheck.figures.data import Page

__all__ = ["show"]

_PICTURES = (".png", ".svg", ".html")


def show(
    sensor: Annotated[str, Parameter(help="A shipped sensor's name, or a sensor file.")],
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(help="Also write the pictures: all to .png, with the tables to .html, the whole frame to .svg."),
    ] = None,
    no_plot: Annotated[bool, Flag, Parameter(name="--no-plot", help="Tables alone, without the pattern.")] = False,
    json: JsonFlag = False,
    quiet: Quiet = False,
    permitted: Rooted | None = None,
) -> int:
    """Show what a sensor file says."""
    hush(quiet)
    from lidarcheck.figures.pages.sensor import document, page
    from lidarcheck.formats.plain import plain
    from lidarcheck.model.files.sensor_file import load_sensor

    if out is not None:
        if out.suffix.lower() not in _PICTURES:
            raise UsageError(f"--out {out} is no name of a picture", fix="end it with .png, .svg or .html")
        check_writable(out, option="--out", besides=(sensor,))
    found = load_sensor(sensor)
    shown = page(found)
    if out is not None:
        with stage("drawing"):
            _draw(shown, out)
    if json:
        emit(json_text(plain(document(found))))
    else:
        _print(shown, plot=not no_plot)
    if out is not None:
        note(f"{out}: written")
    return 0


def _draw(page: Page, out: Path) -> None:
    from lidarcheck.figures.files.pictures import save_figure, save_sheet

    if out.suffix.lower() == ".html":
        from lidarcheck.figures.html.page import page_html

        write_result(out, page_html(page))
        return
    figures = page.figures()
    if not figures:
        raise UsageError("the sensor has no beams of its own to draw", fix="leave out --out, or name a .html")
    if out.suffix.lower() == ".png":
        save_sheet(figures, out, columns=2)
    else:
        save_figure(figures[1], out)


def _print(page: Page, *, plot: bool) -> None:
    from lidarcheck.cli.core.workflow_output import drawn

    emit(paragraphs(page.summary))
    for section in page.sections:
        emit(f"\n{section.title}")
        for words in section.words:
            emit(paragraphs(words))
        for one in section.tables:
            emit(table([Column(name, right=name in one.right) for name in one.header], one.rows))
        for figure in section.figures[:2] if plot else ():
            emit("")
            emit(drawn(figure, "histogram"))
