"""What can be done on every screen that shows pages of a workflow."""

from __future__ import annotations

from lidarcheck.tui.actions.action import MOVE, Action

__all__ = ["page_actions"]


def page_actions(screen: str, twin: str, says: str) -> tuple[Action, ...]:
    """The actions of a screen whose pages the command `twin` computes; `says`: a word of its help."""
    return (
        Action("move", screen, ("up", "down"), "", "the line above, below; also Page Up, Page Down, Home, End", "", reason=MOVE),
        Action("compute", screen, ("r", "enter"), "Run", "compute what is under the cursor", "compute", twin, says),
        Action("stop", screen, ("x", "escape"), "Stop", "stop what is computed", "stop", reason="Ctrl+C stops a command"),
        Action("next figures", screen, ("n", "right"), "Next", "the next figures of the page", "turn(1)", twin, "--plot"),
        Action("figures before", screen, ("p", "left"), "", "the figures before", "turn(-1)", twin, "--plot"),
        Action("kind", screen, ("v",), "View", "histogram, Q-Q, KDE, CDF, violin; clouds from top, side, front", "kind", twin, "--plot"),
        Action("words", screen, ("t",), "Tables", "words and tables of the page, or its figures", "words", twin, "--json"),
        Action("export", screen, ("e",), "Export", "write the page, the numbers and the pictures to a directory", "export", twin, "--out"),
        Action("look again", screen, ("ctrl+r", "R"), "", "look at the project's files again", "look_again", "info", "what is in it"),
    )  # fmt: skip
