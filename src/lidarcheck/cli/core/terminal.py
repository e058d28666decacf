"""What a person sees: tables on standard output; progress, notes and warnings on standard error.

Colour and moving progress are for terminals only and follow NO_COLOR; nothing is said by colour alone.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import logging
import math
import os
import re
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

from lidarcheck.cli.core.table_blocks import Column, blocks, columns, number_text
from lidarcheck.printable import printable, printable_lines

__all__ = [
    "Column",
    "columns",
    "complain",
    "emit",
    "hush",
    "logs_on_stderr",
    "note",
    "number_text",
    "paragraphs",
    "progress",
    "stage",
    "table",
]

_LOG = logging.getLogger("lidarcheck")
_NARROWEST = 40
_PROGRESS, _EVERY_S = "LIDARCHECK_PROGRESS", 0.2
"""What says how a program that runs this one wants to be told how far it is, and how often that is said."""
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
Show = Callable[[int, int, str], None]


class _Warnings(logging.Handler):
    """Warnings of the package as `warning: ...`, each once."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        text = f"{record.levelname.lower()}: {record.getMessage()}"
        if text not in self.said:
            self.said.add(text)
            complain(text)


@contextlib.contextmanager
def logs_on_stderr() -> Iterator[None]:
    """Show the package's warnings while the block runs."""
    handler = _Warnings()
    propagates = _LOG.propagate
    _LOG.addHandler(handler)
    try:
        yield
    finally:
        _LOG.removeHandler(handler)
        _LOG.propagate = propagates


def hush(quiet: bool) -> None:
    """With `quiet`, keep warnings, notes and progress of this command to itself."""
    for handler in _LOG.handlers:
        if isinstance(handler, _Warnings):
            handler.setLevel(logging.ERROR if quiet else logging.WARNING)


def _is_quiet() -> bool:
    return any(isinstance(handler, _Warnings) and handler.level > logging.WARNING for handler in _LOG.handlers)


def complain(line: str) -> None:
    """One line on standard error. What a file says cannot drive the terminal: control characters are spelled out."""
    text = printable(line)
    # Standard output that is gone is the caller's to notice; without standard error there is nobody to tell.
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()  # what was said before stands above it
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


def note(line: str) -> None:
    """Something for the person at the terminal, on standard error."""
    if not _is_quiet():
        complain(printable_lines(line))


def emit(text: str) -> None:
    """A result, on standard output. Colours are a terminal's alone; all else that would drive it is spelled out."""
    colours = _COLOUR.findall(text) if sys.stdout.isatty() else []
    parts = _COLOUR.split(text) if colours else [text]
    text = "".join(printable_lines(part) + colour for part, colour in zip(parts, [*colours, ""], strict=True))
    sys.stdout.write(text if text.endswith("\n") else f"{text}\n")


def table(columns: Sequence[Column], rows: Sequence[Sequence[str]], *, styles: Sequence[str] = ()) -> str:
    """Text of a table: drawn and fitted to a terminal, aligned plain columns elsewhere. `styles`: one a row."""
    rows = [[printable(cell) for cell in row] for row in rows]
    if sys.stdout.isatty():
        return _drawn(columns, rows, styles)
    widths = [max(len(row[i]) for row in [columns, *rows]) for i in range(len(columns))]
    lines = [
        "  ".join(
            cell.rjust(width) if column.right else cell.ljust(width)
            for cell, width, column in zip(row, widths, columns, strict=True)
        ).rstrip()
        for row in [columns, *rows]
    ]
    return "\n".join(lines) + "\n"


def _drawn(columns: Sequence[Column], rows: Sequence[Sequence[str]], styles: Sequence[str]) -> str:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(file=sys.stdout)
    parts = []
    for block in blocks(columns, rows, console.width):
        # No box: over a slow line every byte counts, and 80 columns are few.
        drawn = Table(box=None, pad_edge=False, padding=(0, 1))
        for at, width in block:
            justify: Literal["left", "right"] = "right" if columns[at].right else "left"
            drawn.add_column(Text(columns[at]), justify=justify, overflow="fold", width=width)
        for i, row in enumerate(rows):
            drawn.add_row(*(Text(row[at]) for at, _ in block), style=styles[i] if styles else None)
        with console.capture() as capture:
            console.print(drawn)
        parts.append("".join(f"{line.rstrip()}\n" for line in capture.get().splitlines()))
    return "\n".join(parts)


def paragraphs(text: str) -> str:
    """Text of paragraphs, filled to the width of a terminal; as it is elsewhere."""
    if not sys.stdout.isatty():
        return text
    width = max(shutil.get_terminal_size().columns, _NARROWEST)
    parts = [inspect.cleandoc(part) for part in text.split("\n\n")]
    return "\n\n".join(part if "\n  " in part else textwrap.fill(part, width) for part in parts)


@contextlib.contextmanager
def progress(what: str) -> Iterator[Show]:
    """A bar with the time left, on standard error; yields a function of (done, to do, what is being done)."""
    if _is_told_as_json():
        yield _as_json(what)
        return
    bars = _bars()
    if bars is None:
        yield lambda _done, _total, _label: None
        return
    with bars:
        task = bars.add_task(printable(what), total=None)

        def show(done: int, total: int, label: str) -> None:
            bars.update(task, completed=done, total=total, description=printable(f"{what} {label}"))

        yield show


@contextlib.contextmanager
def stage(what: str) -> Iterator[None]:
    """Say what is going on, with the time it has taken, while something of unknown length runs."""
    if _is_told_as_json():
        _as_json(what)(0, 0, "")
        yield
        return
    bars = _bars(known=False)
    if bars is None:
        yield
        return
    with bars:
        bars.add_task(printable(what), total=None)
        yield


def _is_told_as_json() -> bool:
    return os.environ.get(_PROGRESS) == "json" and not _is_quiet()


def _as_json(what: str) -> Show:
    """Lines of JSON on standard error: what is done `now`, how much is `done` and `of` how much, 0 where nobody knows.

    The beginning and the end of the work, and in between five times a second at most.
    """
    said_s = -math.inf

    def show(done: int, total: int, label: str) -> None:
        nonlocal said_s
        now = time.monotonic()
        if done < total and now - said_s < _EVERY_S:
            return
        said_s = now
        complain(json.dumps({"now": f"{what} {label}".strip(), "done": done, "of": total}))

    return show


def _bars(known: bool = True) -> Any:
    """A bar of progress that wipes itself when done; None where nobody watches."""
    if _is_quiet() or not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        return None
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    tail = (
        (BarColumn(None), MofNCompleteColumn(), TimeRemainingColumn(compact=True)) if known else (TimeElapsedColumn(),)
    )
    # Twice a second: over a slow line every redraw is paid for.
    return Progress(
        TextColumn("{task.description}", markup=False), *tail, console=console, transient=True, refresh_per_second=2
    )
