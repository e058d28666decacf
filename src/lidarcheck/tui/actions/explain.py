"""What can be done on the screen Explain."""

from __future__ import annotations

from lidarcheck.tui.actions.action import MOVE, PLACE, Action

__all__ = ["EXPLAIN"]

_BACK = "version control does it; the interface keeps what was there before"
_BY_HAND = "model.toml in --out is copied by hand"

EXPLAIN: tuple[Action, ...] = (
    Action("move", "explain", ("up", "down"), "", "the case above, below, or the text up and down; also Page Up, Page Down, Home, End", "", reason=MOVE),
    Action("explain", "explain", ("r", "enter"), "Run", "explain the case under the cursor; goes on where it was stopped", "explain", "explain", "CASE"),
    Action("stop", "explain", ("escape", "x"), "Stop", "stop, what was done is kept; once more: end it at once", "stop", reason="Ctrl+C stops a command"),
    Action("view", "explain", ("v",), "View", "the next part of the answer: effects, gap, where, candidates ...", "view(1)", reason=PLACE),
    Action("view before", "explain", ("b",), "", "the part of the answer before", "view(-1)", reason=PLACE),
    Action("seed", "explain", ("s",), "Seed", "the seed of the next run", "seed", "explain", "--seed"),
    Action("exclude", "explain", ("e",), "", "effects that the next run is not to name", "exclude", "explain", "--exclude"),
    Action("accept", "explain", ("a",), "Accept", "take the explained model over: show the difference, then write", "accept", reason=_BY_HAND),
    Action("take back", "explain", ("u", "ctrl+z"), "Undo", "take back what was accepted last", "take_back", reason=_BACK),
    Action("look again", "explain", ("ctrl+r", "R"), "", "look at the cases and their results again", "look", "info", "what is in it"),
)  # fmt: skip
