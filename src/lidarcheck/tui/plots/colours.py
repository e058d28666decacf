"""Colours of plots, after Okabe and Ito, told in the depth that the terminal has: rounding never makes two the same.

Form comes before colour: what is told apart here by colour is told apart by its marks as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from rich.style import Style

if TYPE_CHECKING:
    from textual.app import App

__all__ = ["PLOT_ROLES", "Depth", "PlotRole", "depth_of", "plot_style"]

Depth = Literal["true", "256", "16", "none"]
PlotRole = Literal["real", "now", "saved", "wanted", "both"]
PLOT_ROLES: tuple[PlotRole, ...] = ("real", "now", "saved", "wanted", "both")

# The colours of 256 and of 16 are given as what the palette has there, which is rounded to just that entry.
_DARK: dict[Depth, dict[PlotRole, str]] = {
    "true": {"real": "#56b4e9", "now": "#e69f00", "saved": "#8a9198"},
    "256": {"real": "#5fafd7", "now": "#ffaf00", "saved": "#8a8a8a"},  # 74, 214, 245
    "16": {"real": "#55ffff", "now": "#ffff55", "saved": "#555555"},  # 14, 11, 8
}
_LIGHT: dict[Depth, dict[PlotRole, str]] = {
    "true": {"real": "#0072b2", "now": "#d55e00", "saved": "#5c646c"},
    "256": {"real": "#005faf", "now": "#d75f00", "saved": "#626262"},  # 25, 166, 241
    "16": {"real": "#0000aa", "now": "#aa0000", "saved": "#555555"},  # 4, 1, 8
}
# The terminal's own colours, on a background that nobody knows.
_PLAIN: dict[PlotRole, str] = {"real": "color(6)", "now": "color(3)", "saved": "color(8)"}


def depth_of(app: App[object]) -> Depth:
    """How many colours the app's terminal has; none where NO_COLOR says so."""
    if app.no_color:
        return "none"
    depths: dict[str, Depth] = {"truecolor": "true", "256": "256", "standard": "16", "windows": "16"}
    return depths.get(app.console.color_system or "", "none")


def plot_style(theme: str, role: PlotRole, depth: Depth) -> Style:
    """What a role adds to the look of text: a colour, or bold where both are in one cell; nothing for wanted."""
    if role == "both":
        return Style(bold=True)
    if depth == "none" or role == "wanted":
        return Style()
    colours = _PLAIN if theme == "plain" else (_LIGHT if theme == "light" else _DARK)[depth]
    return Style(color=colours[role])
