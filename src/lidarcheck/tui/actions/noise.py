"""What can be done on the screen Noise."""

from __future__ import annotations

from lidarcheck.tui.actions.action import Action
from lidarcheck.tui.actions.pages import page_actions

__all__ = ["NOISE"]

NOISE: tuple[Action, ...] = (
    *page_actions("noise", "panels", "--model"),
    Action("model", "noise", ("m",), "Model", "the next model of the project, or none", "model", "panels", "--model"),
    Action("all panels", "noise", ("a",), "All", "figures of all panels together, or of the one under the cursor", "over_all", "panels", "--plot"),
)  # fmt: skip
