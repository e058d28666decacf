"""The files that a workflow's page is written as: all or none.

`report.html`: the page; `result.json`: the numbers, with where they came from; `pictures/`: a PNG of each figure.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck import __version__
from lidarcheck.errors import InputError
from lidarcheck.plots.outputs import check_writable, json_text, make_directory, write_file, write_together

if TYPE_CHECKING:
    from lidarcheck.calibration.figures import Figure, Page

__all__ = ["ALL", "PAGE", "PICTURES", "RESULT", "check_out_dir", "page_text", "write_page"]

PAGE, RESULT, PICTURES = "report.html", "result.json", "pictures"
ALL = "all"
"""In the place of a kind of picture: each of them."""


def check_out_dir(out: Path, besides: Iterable[str | Path | None] = (), *, option: str = "--out") -> None:
    """Refuse now, with an `InputError`, a directory that could not be written after minutes of work.

    `besides`: the files that the command reads or writes otherwise, which no result may replace. `option`: what asked
    for the directory, in words.
    """
    if out.exists() and not out.is_dir():
        raise InputError("is not a directory", file=out, fix=f"name a directory for {option}")
    where = Path(os.path.realpath(out))
    new = not out.exists()
    if new:
        where = where.parent
        if not where.is_dir():
            raise InputError("its directory does not exist", file=out, fix=f"make {where} first")
    if not os.access(where, os.W_OK | os.X_OK):
        raise InputError("cannot be written", file=out, fix="check its permissions, or choose another place")
    for name in () if new else (PAGE, RESULT):
        check_writable(out / name, option=option, besides=besides)
    pictures = out / PICTURES
    if pictures.exists() and not (pictures.is_dir() and os.access(pictures, os.W_OK | os.X_OK)):
        raise InputError("cannot be replaced", file=pictures, fix=f"move it away, or choose another place for {option}")


def page_text(page: Page, document: Any, *, command: str = "", html: str = "") -> str:
    """The result with what it is of, as JSON, which `lidarcheck report` reads.

    `document`: what `formats.plain` can turn into JSON. The hash of `html` says which page belongs to it.
    """
    return json_text(
        {
            "workflow": command or page.title,
            "title": page.title,
            "lidarcheck": __version__,
            "summary": page.summary,
            "result": document,
            "provenance": dict(page.provenance),
            "page": {"file": PAGE, "sha256": hashlib.sha256(html.encode()).hexdigest()} if html else None,
        }
    )


def write_page(page: Page, document: Any, out: Path, *, command: str = "", kind: str = "histogram") -> str:
    """Write the page, the numbers and the pictures, all or none; the text of `result.json`.

    `kind`: as what the pictures are drawn, one of `lidarcheck.plots.panels`' or `ALL`. The pictures are drawn beside
    their place and take it together with the other files.
    """
    from lidarcheck.plots.page_html import page_html

    html = page_html(page)
    text = page_text(page, document, command=command, html=html)
    make_directory(out)
    new = out / f".{PICTURES}.{secrets.token_hex(8)}.part"
    try:
        _draw_pictures(page.figures(), new, kind)
        write_together(
            out,
            {RESULT: lambda path: write_file(path, text), PAGE: lambda path: write_file(path, html)},
        )
        _replace_directory(new, out / PICTURES)
    finally:
        shutil.rmtree(new, ignore_errors=True)
    return text


def _draw_pictures(figures: Sequence[Figure], directory: Path, kind: str) -> None:
    from lidarcheck.plots.figure_image import save_figure
    from lidarcheck.plots.panels import kinds_of

    if not figures:
        return
    directory.mkdir()
    for number, figure in enumerate(figures, 1):
        for one in (kinds_of(figure) or ("histogram",)) if kind == ALL else (kind,):
            view = f"-{one}" if one in kinds_of(figure) else ""
            save_figure(figure, directory / f"{number:02d}-{_slug(figure.title)}{view}.png", kind=one)


def _slug(title: str) -> str:
    """A file's name from a title."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60] or "figure"


def _replace_directory(new: Path, place: Path) -> None:
    """Put the new pictures in the place of an earlier run's; files of other names there stay."""
    place.mkdir(exist_ok=True)
    for old in place.glob("[0-9][0-9]*-*.png"):
        if old.name.partition("-")[0].isdigit():
            old.unlink()
    for picture in sorted(new.iterdir()) if new.is_dir() else ():
        picture.replace(place / picture.name)
