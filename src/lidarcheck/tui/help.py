"""What is said in words: the lines of help, and the package's warnings for the log."""

from __future__ import annotations

import logging
import textwrap
from collections.abc import Callable
from typing import Any

from lidarcheck.tui.actions import actions_of, key_name
from lidarcheck.tui.widgets.lines import Line, line

__all__ = ["LogHandler", "help_lines"]

_KEYS = 12


class LogHandler(logging.Handler):
    """Hands warnings to `note`, through `soon`, which is for any thread."""

    def __init__(self, soon: Callable[..., Any], note: Callable[[str, bool], None]) -> None:
        super().__init__(logging.WARNING)
        self._soon, self._note = soon, note

    def emit(self, record: logging.LogRecord) -> None:
        """A warning, as a line."""
        self._soon(self._note, record.getMessage(), False)


def help_lines(words: str, screen: str, width: int, pane: str = "") -> list[Line]:
    """What a pane is (`pane`: its kind), then every action with its keys and its twin on the command line."""
    lines: list[Line] = [line(text) for text in textwrap.wrap(words, max(min(width, 100) - 2, 20))] + [line("")]
    for action in actions_of(screen, pane):
        keys = " ".join(key_name(key) for key in action.keys)
        lines += [line(text) for text in _beside(keys, action.help, width)]
        if action.twin:
            lines.append(line(f"{'':{_KEYS}}as: lidarcheck {action.twin}", "dim"))
    return lines


def _beside(keys: str, words: str, width: int) -> list[str]:
    """What keys do, in as many lines as it needs."""
    blank = " " * _KEYS
    return textwrap.wrap(
        words, max(width, 2 * _KEYS), initial_indent=f"{keys:{_KEYS}}", subsequent_indent=blank, break_on_hyphens=False
    )
