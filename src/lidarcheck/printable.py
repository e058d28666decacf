"""Text from files as it may stand in an output: what would drive a terminal, a page or a CI server is spelled out.

Names of files, KPIs, materials and columns, comments and messages of others are a stranger's words. Every output hands
them through here: an escape sequence, a line end in a name or a mark that turns the direction of writing is shown as
`\\x1b`, `\\n`, `\\u202e`.
"""

from __future__ import annotations

import re

__all__ = ["printable", "printable_json", "printable_lines"]

_COMMAND = re.compile(r"^(\s*)(::|##\[)", re.MULTILINE)
"""How a line begins that GitHub's runner takes for a command to itself."""


def printable(text: str) -> str:
    """The text in one line, of characters that show themselves; given again, the same."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def printable_lines(text: str) -> str:
    """The same line by line, tabs kept; no line begins as a command to a CI server does."""
    if not text.replace("\n", "").isprintable():
        text = "\n".join("\t".join(map(printable, line.split("\t"))) for line in text.split("\n"))
    return _COMMAND.sub(lambda found: f"{found[1]}\\x{ord(found[2][0]):02x}{found[2][1:]}", text)


def printable_json(text: str) -> str:
    """JSON that holds the same, with what does not show itself as JSON spells it."""
    if text.replace("\n", "").isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else _in_json(c) for c in text)


def _in_json(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[at : at + 4]}" for at in range(0, len(units), 4))
