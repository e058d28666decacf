"""What can be done on the screen Ghosts."""

from __future__ import annotations

from lidarcheck.tui.actions.action import Action
from lidarcheck.tui.actions.pages import page_actions

__all__ = ["GHOSTS"]

GHOSTS: tuple[Action, ...] = (
    *page_actions("ghosts", "ghosts find", "--model"),
    Action("step", "ghosts", ("s",), "Step", "the next step of the extraction, from all points to what is left", "step(1)", "ghosts find", "--steps"),
    Action("step back", "ghosts", ("b",), "", "the step before", "step(-1)", "ghosts find", "--steps"),
    Action("model", "ghosts", ("m",), "Model", "the next model of the project, or none", "model", "ghosts find", "--model"),
    Action("least", "ghosts", ("i",), "", "the least AREA (or INTENSITY, ...) of a sign's echo; 0: by the sensor", "least", "ghosts find", "--bright"),
    Action("strip", "ghosts", ("d",), "PCD", "write what is left as PCD; of a fit, the model with the effect", "strip", "ghosts find", "stripped"),
)  # fmt: skip
