"""What can be done on the screen Overview."""

from __future__ import annotations

from lidarcheck.tui.actions.action import Action

__all__ = ["OVERVIEW"]

OVERVIEW: tuple[Action, ...] = (
    Action("run", "overview", ("r", "enter"), "Run", "run the scenario under the cursor", "run_one", "check", "SCENARIO"),
    Action("run all", "overview", ("a",), "All", "run all scenarios", "run_all", "check", "all by default"),
    Action("cancel", "overview", ("escape", "x"), "Stop", "stop the run", "stop", reason="Ctrl+C stops a command"),
    Action("only fallen", "overview", ("f",), "Fallen", "show only what fell out or has a fault", "only_fallen", "check", "fell out"),
    Action("look again", "overview", ("ctrl+r", "R"), "", "look at the project's files again", "look_again", "info", "what is in it"),
)  # fmt: skip
