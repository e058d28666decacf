"""The help where nobody watches: plain lines, wrapped once, with the rest of an entry indented below it."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from cyclopts.help import PlainFormatter

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["HelpText"]


class HelpText(PlainFormatter):
    """Entries as paragraphs: the parser's own would wrap them twice, at two widths."""

    def _print_plain(self, console: Console, text: str) -> None:
        if text.startswith(self.indent):
            words = " ".join(text.split())
            hang = 3 * self.indent
            text = textwrap.fill(
                words, console.width, initial_indent=self.indent, subsequent_indent=hang, break_on_hyphens=False
            )
        console.print(text, highlight=False, markup=False, soft_wrap=text.startswith(self.indent))
