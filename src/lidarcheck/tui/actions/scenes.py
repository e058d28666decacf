"""What can be done on the screen Scenes."""

from __future__ import annotations

from lidarcheck.tui.actions.action import Action
from lidarcheck.tui.actions.pages import page_actions

__all__ = ["SCENES"]

_COMPARE = "scenes compare"
SCENES: tuple[Action, ...] = (
    *page_actions("scenes", _COMPARE, "measured frames"),
    Action("model", "scenes", ("m",), "Model", "the next model to simulate with", "next_model", _COMPARE, "--model"),
    Action("effects", "scenes", ("f",), "Effects", "switch effects of the model, and others, on and off", "effects", _COMPARE, "--effects"),
    Action("all effects", "scenes", ("d",), "", "the model's own effects again, and no others", "own_effects", _COMPARE, "--without"),
)  # fmt: skip
