"""The files that a workflow leaves in its directory: checked before the work, written all or none.

`report.html`: the page; `result.json`: the numbers, with where they came from; `pictures/`: a PNG of each figure; and
what a workflow has besides.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck import __version__
from lidarcheck.errors import InputError
from lidarcheck.figures.files.outputs import check_writable, json_text, same_file, write_file
from lidarcheck.figures.files.sets import Folder, Writer, write_set
from lidarcheck.formats.atomic import is_read_only

if TYPE_CHECKING:
    from lidarcheck.figures.data import Figure, Page
    from lidarcheck.workers import WorkerPool

__all__ = [
    "ALL",
    "PAGE",
    "PICTURES",
    "RESULT",
    "Folder",
    "Writer",
    "check_out_dir",
    "draw_pictures",
    "drawing_ahead",
    "page_text",
    "stamped",
    "write_page",
]

PAGE, RESULT, PICTURES = "report.html", "result.json", "pictures"
ALL = "all"
"""In the place of a kind of picture: each of them."""
_WORTH_A_PROCESS = 12
"""Pictures that take about as long as a process to begin."""
_ready: list[WorkerPool] = []
"""Processes that are ready to draw, of the command that is running."""
_PICTURE = re.compile(r"[0-9]{2,}-.*\.png")


def check_out_dir(
    out: Path, besides: Iterable[str | Path | None] = (), *, files: Iterable[str] = (), option: str = "--out"
) -> None:
    """Refuse now, with an `InputError`, a directory that could not be written after minutes of work.

    `besides`: the files that the command reads or writes otherwise, which no result may replace. `files`: names of
    the results that are not every workflow's. `option`: what asked for the directory, in words.
    """
    besides = list(besides)
    if out.exists() and not out.is_dir():
        raise InputError("is not a directory", file=out, fix=f"name a directory for {option}")
    where = Path(os.path.realpath(out))
    new = not out.exists()
    if new:
        where = where.parent
        if not where.is_dir():
            raise InputError("its directory does not exist", file=out, fix=f"make {where} first")
    if is_read_only(where) or not os.access(where, os.X_OK):
        raise InputError("cannot be written", file=out, fix="check its permissions, or choose another place")
    for name in () if new else (PAGE, RESULT):
        check_writable(out / name, option=option, besides=besides)
    read = [path for path in besides if path is not None and str(path) != "-"]
    for name in files:
        _check_file(out / name, read, option)
    pictures = out / PICTURES
    if pictures.exists() and (not pictures.is_dir() or is_read_only(pictures)):
        raise InputError("cannot be replaced", file=pictures, fix=f"move it away, or choose another place for {option}")


def _check_file(place: Path, read: Iterable[str | Path], option: str) -> None:
    if any(same_file(place, path) for path in read):
        fix = f"name another directory for {option}"
        raise InputError("would replace a file of this command", file=place, fix=fix)
    if place.is_dir() or is_read_only(place):
        raise InputError("cannot be replaced", file=place, fix=f"move it away, or choose another place for {option}")


def page_text(
    page: Page, document: Any, *, command: str = "", html: str = "", origin: Mapping[str, Any] | None = None
) -> str:
    """The result with what it is of, as JSON, which `lidarcheck report` reads.

    `document`: what `formats.plain` can turn into JSON. The hash of `html` says which page belongs to it. `origin`: the
    hashes of all that it was computed from.
    """
    return json_text(
        {
            **({} if origin is None else {"computed_from": origin}),
            "workflow": command or page.title,
            "title": page.title,
            "lidarcheck": __version__,
            "summary": page.summary,
            "result": document,
            "provenance": dict(page.provenance),
            "page": {"file": PAGE, "sha256": hashlib.sha256(html.encode()).hexdigest()} if html else None,
        }
    )


def stamped(page: Page, origin: Mapping[str, Any] | None) -> Page:
    """The page with the key of all that it was computed from; as it is where that is not known."""
    if origin is None:
        return page
    return replace(page, provenance={**page.provenance, "computed from": f"sha256 {origin['key']}"})


def write_page(
    page: Page,
    document: Any,
    out: Path,
    *,
    command: str = "",
    kind: str = "histogram",
    files: Mapping[str, Writer] | None = None,
    folders: Mapping[str, Folder] | None = None,
    origin: Mapping[str, Any] | None = None,
) -> str:
    """Write the page, the numbers, the pictures and what is this workflow's own, all or none; `result.json`'s text.

    `kind`: how the pictures are drawn, one of `axes.KINDS`, `axes.VIEWS` or `ALL`. `files` are written in this order,
    so that a model finds the table that it names. On an error or interrupt all is as it was.
    """
    from lidarcheck.figures.html.page import page_html

    html = page_html(page)
    text = page_text(page, document, command=command, html=html, origin=origin)
    drawn = Folder(lambda place: draw_pictures(page.figures(), place, kind), _PICTURE)
    pages: dict[str, Writer] = {RESULT: lambda path: write_file(path, text), PAGE: lambda path: write_file(path, html)}
    write_set(out, {**(files or {}), **pages}, {PICTURES: drawn, **(folders or {})})
    return text


@contextlib.contextmanager
def drawing_ahead(out: Path | None) -> Iterator[None]:
    """Meanwhile processes get ready to draw many pictures into `out`; nothing where that is None."""
    if out is None:
        yield
        return
    from lidarcheck.workers import Processes
    from lidarcheck.workers.cores import usable_cores

    with Processes(usable_cores() - 1, _wake, least=1) as pool:
        _ready.append(pool)
        try:
            yield
        finally:
            _ready.remove(pool)


def _wake() -> None:
    """Load what every picture needs."""
    from lidarcheck.figures.png.figure import load

    load()


def draw_pictures(figures: Sequence[Figure], directory: Path, kind: str) -> None:
    """A PNG of each figure, as `kind` or in `all` the ways that it can be shown; on all cores where they are many."""
    from lidarcheck.workers import Processes
    from lidarcheck.workers.cores import usable_cores

    numbered = [*enumerate(figures, 1)]
    others = max(min(usable_cores(), len(figures) // _WORTH_A_PROCESS), 1) - 1
    # This process draws too, and as many pictures more as others need to begin that are not ready.
    own = (len(figures) + (0 if _ready else _WORTH_A_PROCESS * others)) // (others + 1)
    new = contextlib.nullcontext(_ready[-1]) if _ready else Processes(others, least=1)
    with new as pool:
        drawn = [pool.submit(_draw, numbered[own + k :: others], directory, kind) for k in range(others)]
        _draw(numbered[:own], directory, kind)
        for wait in drawn:
            wait()


def _draw(numbered: Sequence[tuple[int, Figure]], directory: Path, kind: str) -> None:
    from lidarcheck.figures.axes import kinds_of
    from lidarcheck.figures.files.pictures import save_figure

    for number, figure in numbered:
        for one in (kinds_of(figure) or ("histogram",)) if kind == ALL else (kind,):
            view = f"-{one}" if one in kinds_of(figure) else ""
            save_figure(figure, directory / f"{number:02d}-{_slug(figure.title)}{view}.png", kind=one)


def _slug(title: str) -> str:
    """A file's name from a title."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:60] or "figure"
