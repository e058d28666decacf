"""What can be done on the screen Goldens."""

from __future__ import annotations

from lidarcheck.tui.actions.action import MOVE, Action

__all__ = ["GOLDENS"]

_DROPPED = "a proposal is a file in .lidarcheck/proposals; the next check writes it anew"

GOLDENS: tuple[Action, ...] = (
    Action("move", "goldens", ("up", "down"), "", "the line above, below; also Page Up, Page Down, Home, End", "", reason=MOVE),
    Action("review", "goldens", ("r", "enter"), "Review", "run all 64 seeds of the scenario under the cursor, and say what speaks against accepting", "review_one", "review", "SCENARIO"),
    Action("review every", "goldens", ("e",), "Every", "review every scenario of the project", "review_every", "review", "all by default"),
    Action("accept", "goldens", ("a",), "Accept", "accept the marked KPIs of the scenario, or all of it: review, reason, diff, then write", "accept", "review", "--accept"),
    Action("accept all", "goldens", ("A",), "", "accept all that is listed", "accept_all", "review", "all"),
    Action("mark", "goldens", ("space",), "Mark", "mark the KPI for accepting, or not", "mark", "review", "KPIs to accept"),
    Action("drop", "goldens", ("d",), "Drop", "reject: drop the proposal, the golden stays", "drop", reason=_DROPPED),
    Action("stop", "goldens", ("escape", "x"), "Stop", "stop the review", "stop", reason="Ctrl+C stops a command"),
    Action("look", "goldens", ("ctrl+r", "R"), "", "look at goldens and proposals again", "look", "review", "proposed"),
)  # fmt: skip
