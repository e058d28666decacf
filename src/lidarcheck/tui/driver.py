"""The terminal as the interface drives it: few bytes, and nothing from a mouse that only moves."""

from __future__ import annotations

import os
from typing import Any

from textual.drivers.linux_driver import LinuxDriver

from lidarcheck.tui.few_bytes import FewBytes
from lidarcheck.tui.widgets.seven_bit import is_seven_bit

__all__ = ["TerminalDriver"]

_MOUSE = "\x1b[?1000h\x1b[?1002h\x1b[?1006h"
"""Buttons, motion while one is held, and columns beyond 223. Textual asks for any motion, each a line over SSH."""


class TerminalDriver(LinuxDriver):
    """Textual's, with what it writes made shorter."""

    def __init__(self, *arguments: Any, **how: Any) -> None:
        super().__init__(*arguments, **how)
        self._few = FewBytes(is_seven_bit(os.environ))

    def write(self, data: str) -> None:
        """Write to the terminal."""
        super().write(self._few(data))

    def _enable_mouse_support(self) -> None:
        if self._mouse:
            self.write(_MOUSE)
            self.flush()
