"""`lidarcheck tui`: the terminal interface."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from lidarcheck.cli.core.options import Flag, MaxRows, Permitted, Quiet
from lidarcheck.cli.core.terminal import hush
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.limits import limit_rows

__all__ = ["tui"]


def tui(
    project: Annotated[Path | None, Parameter(help="The project's directory; by default the one you are in.")] = None,
    /,
    *,
    screen: Annotated[
        Literal["overview", "histograms", "noise", "blooming", "ghosts", "cloud", "explain", "goldens"] | None,
        Parameter(help="The screen to begin with; by default the last one."),
    ] = None,
    theme: Annotated[
        Literal["dark", "light", "high-contrast", "plain"] | None,
        Parameter(help="dark, light, high-contrast, or plain: the terminal's own 16 colours; by default the last one."),
    ] = None,
    marks: Annotated[
        Literal["braille", "blocks", "ascii", "char"] | None,
        Parameter(
            help="What plots are made of: braille, blocks, ascii, or char, a character a cell; by default the last, "
            "at first what the terminal shows. Without UTF-8 they are ascii."
        ),
    ] = None,
    no_mouse: Annotated[bool, Flag, Parameter(help="Leave the mouse to the terminal, to select text with.")] = False,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Open the terminal interface on a project."""
    root = project or Path()
    if not root.is_dir():
        what = "is not a directory" if root.exists() else "there is no such directory"
        raise InputError(what, file=root, fix="give the directory with scenarios, models and tables")
    _check_terminal()
    limit_rows(max_rows)
    hush(True)  # what is said while it runs stands in its log
    from lidarcheck.tui.app import run

    # Short turns for threads: a key is answered while a simulation runs.
    sys.setswitchinterval(0.001)
    try:
        return run(root, theme=theme or "", screen=screen or "", marks=marks or "", mouse=not no_mouse)
    finally:
        hush(quiet)


def _check_terminal() -> None:
    """Refuse what cannot be drawn on, before anything is."""
    others = "lidarcheck --help lists the commands that do the same"
    for name in ("stdin", "stdout", "stderr"):
        if not getattr(sys, name).isatty():
            what = f"the terminal interface needs a terminal, and {name} is none"
            raise UsageError(what, fix=f"run it in a terminal without pipes; {others}")
    term = os.environ.get("TERM", "")
    if term in ("", "dumb", "unknown"):
        said = f"TERM={term}" if term else "TERM is not set, so it"
        raise UsageError(f"{said} says a terminal that cannot place text", fix=f"set TERM, as TERM=xterm; {others}")
