"""The terminal as the interface drives it: few bytes, and nothing from a mouse that only moves."""

from __future__ import annotations

import os
import selectors
from codecs import getincrementaldecoder
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from textual._parser import ParseError
from textual._xterm_parser import XTermParser
from textual.drivers.linux_driver import LinuxDriver

from lidarcheck.tui.few_bytes import FewBytes
from lidarcheck.tui.pasted import Pasted
from lidarcheck.tui.widgets.seven_bit import is_seven_bit

__all__ = ["TerminalDriver"]

_MOUSE = "\x1b[?1000h\x1b[?1002h\x1b[?1006h"
"""Buttons, motion while one is held, and columns beyond 223. Textual asks for any motion, each a line over SSH."""

_TICK_S, _MOST = 0.1, 4096


class TerminalDriver(LinuxDriver):
    """Textual's, with what it writes made shorter; and bytes that are no text do not end it."""

    def __init__(self, *arguments: Any, **how: Any) -> None:
        super().__init__(*arguments, **how)
        self._few = FewBytes(is_seven_bit(os.environ), *_erasing(os.environ))

    def write(self, data: str) -> None:
        """Write to the terminal."""
        if short := self._few(data):
            super().write(short)

    def forget(self) -> None:
        """The terminal may show something else than what was written to it."""
        self._few.forget()

    def run_input_thread(self) -> None:
        """Hand on what comes. What is pasted may be anything: Textual's own decoder ends at bytes that are no UTF-8."""
        parser, pasted = XTermParser(self._debug), Pasted()
        decode = getincrementaldecoder("utf-8")("replace").decode
        with selectors.SelectSelector() as selector:
            selector.register(self.fileno, selectors.EVENT_READ)
            while not self.exit_event.is_set():
                if selector.select(_TICK_S):
                    try:
                        text = decode(os.read(self.fileno, _MOST))
                    except OSError:  # the terminal is gone, which a signal tells as well
                        return
                    for event in parser.feed(keys) if (keys := pasted(text)) else ():
                        self.process_message(event)
                    if not text:
                        self.exit_event.wait(_TICK_S)
                for event in parser.tick():
                    self.process_message(event)
        with suppress(EOFError, ParseError):
            for _ in parser.feed(""):
                pass

    def _enable_mouse_support(self) -> None:
        if self._mouse:
            self.write(_MOUSE)
            self.flush()


def _erasing(environment: Mapping[str, str]) -> tuple[bool, bool]:
    """Whether the terminal can erase cells, and does so in the colour that is set."""
    if "TMUX" in environment:  # whose entries in the database are older than it
        return True, True
    try:
        import curses

        curses.setupterm(environment.get("TERM", ""), fd=1)
        return bool(curses.tigetstr("ech")), curses.tigetflag("bce") > 0
    except (ImportError, OSError, curses.error):
        return False, False
