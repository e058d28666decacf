"""The themes: colours for textual, and what each role of a text looks like. No role is told by its colour alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Literal

from rich.style import Style
from textual.theme import BUILTIN_THEMES, Theme

from lidarcheck.tui.plots.colours import PLOT_ROLES, Depth, plot_style

__all__ = ["ROLES", "THEMES", "Role", "style", "textual_themes"]

Role = Literal[
    "text", "dim", "title", "focus", "cursor", "edited", "good", "bad", "real", "now", "saved", "wanted", "both"
]
"""The looks of text, and of what plots show (`plots.colours`)."""
ROLES: tuple[Role, ...] = ("text", "dim", "title", "focus", "cursor", "edited", "good", "bad")

_TEXT: dict[str, dict[Role, str]] = {
    "dark": {
        "text": "#c8ccd0", "dim": "#8a9198", "title": "bold #8fb8de", "focus": "bold underline #8fb8de",
        "cursor": "reverse", "edited": "bold #e0c060", "good": "#7fc08f", "bad": "bold #f08070",
    },
    "light": {
        "text": "#202428", "dim": "#5c646c", "title": "bold #0b4a82", "focus": "bold underline #0b4a82",
        "cursor": "reverse", "edited": "bold #7a5200", "good": "#1d6b33", "bad": "bold #a8200d",
    },
    "high-contrast": {
        "text": "#ffffff", "dim": "#ffffff", "title": "bold #ffff00", "focus": "bold underline #ffff00",
        "cursor": "reverse", "edited": "bold #00ffff", "good": "#00ff00", "bad": "bold reverse #ff8080",
    },
    "plain": {
        "text": "", "dim": "", "title": "bold", "focus": "bold underline", "cursor": "reverse", "edited": "bold",
        "good": "green", "bad": "bold red",
    },
}  # fmt: skip
_BACK = {"dark": ("#101418", "#c8ccd0"), "light": ("#ffffff", "#202428"), "high-contrast": ("#000000", "#ffffff")}

THEMES = tuple(_TEXT)
"""The themes' names; `plain` leaves the terminal's own colours as they are and keeps to its sixteen."""


@cache
def style(theme: str, role: Role, depth: Depth = "true") -> Style:
    """How a role looks in a theme; `depth`: how many colours the terminal has, for plots."""
    if role in PLOT_ROLES:
        return style(theme, "text", depth) + plot_style(theme, role, depth)
    look = Style.parse(_TEXT[theme][role] or "none")
    back = _BACK.get(theme)
    return look if back is None else Style.parse(f"{back[1]} on {back[0]}") + look


def textual_themes() -> list[Theme]:
    """The themes as textual is told of them."""
    found = [
        Theme(name, primary=fore, foreground=fore, background=back, surface=back, panel=back, dark=name != "light")
        for name, (back, fore) in _BACK.items()
    ]
    # Textual's own theme of the terminal's colours brings variables that its style sheets then ask for.
    found.append(replace(BUILTIN_THEMES["ansi-dark"], name="plain"))
    return found
