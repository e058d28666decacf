"""The screens, a file each: what stands in `core.actions.SCREENS` by its name."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from lidarcheck.tui.screens.base import View

__all__ = ["later_screens"]

_LATER = ("Histograms", "Noise", "Blooming", "Ghosts", "Scenes", "Explain", "Goldens")


def later_screens() -> list[type[View]]:
    """All screens but the first: numbers and tables are heavy to load, and the first one does without."""
    modules = [importlib.import_module(f"{__name__}.{name.lower()}") for name in _LATER]
    return [cast("type[View]", getattr(module, name)) for module, name in zip(modules, _LATER, strict=True)]
