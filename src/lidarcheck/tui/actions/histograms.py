"""What can be done on the screen Histograms."""

from __future__ import annotations

from lidarcheck.tui.actions.action import Action
from lidarcheck.tui.actions.pages import page_actions

__all__ = ["HISTOGRAMS"]

_COMPARE, _MERGE = "vehicles compare", "vehicles merge"
HISTOGRAMS: tuple[Action, ...] = (
    *page_actions("histograms", _COMPARE, "real against simulated"),
    Action("model", "histograms", ("m",), "Model", "simulated files, or the next model to simulate with", "next_source", _COMPARE, "--model"),
    Action("beside", "histograms", ("b",), "Beside", "both vehicles beside each other, from top and side, or the histograms", "beside", _MERGE, "beside"),
    Action("to the left", "histograms", ("plus", "equals_sign"), "", "beside: the simulated vehicle 0.25 m to the left (Y)", "nudge(0, 1)", _MERGE, "--y"),
    Action("to the right", "histograms", ("minus",), "", "beside: 0.25 m to the right (Y)", "nudge(0, -1)", _MERGE, "--y"),
    Action("forward", "histograms", ("right_square_bracket",), "", "beside: 0.25 m forward (X)", "nudge(1, 0)", _MERGE, "--x"),
    Action("backward", "histograms", ("left_square_bracket",), "", "beside: 0.25 m backward (X)", "nudge(-1, 0)", _MERGE, "--x"),
    Action("suggested", "histograms", ("s",), "", "beside: the offset that the vehicle's size suggests", "suggested", _MERGE, "suggested"),
    Action("merged cloud", "histograms", ("o",), "", "write both vehicles as one cloud (PCD)", "write_cloud", _MERGE, "--out"),
    Action("sheet", "histograms", ("i",), "Sheet", "write the histograms of all distances as one picture (PNG)", "write_sheet", _COMPARE, "--out"),
)  # fmt: skip
