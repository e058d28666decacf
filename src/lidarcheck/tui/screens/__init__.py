"""The screens, a file or a folder each: what stands in `actions.SCREENS` by its name."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from lidarcheck.tui.screens.shared.view import View

__all__ = ["later_screens"]

_LATER = {
    "Histograms": "histograms",
    "Noise": "noise",
    "Blooming": "blooming.screen",
    "Ghosts": "ghosts",
    "Cloud": "cloud.screen",
    "Explain": "explain.screen",
    "Goldens": "goldens.screen",
}
"""Class to module."""


def later_screens() -> list[type[View]]:
    """All screens but the first: numbers and tables are heavy to load, and the first one does without."""
    modules = {name: importlib.import_module(f"{__name__}.{module}") for name, module in _LATER.items()}
    return [cast("type[View]", getattr(module, name)) for name, module in modules.items()]
