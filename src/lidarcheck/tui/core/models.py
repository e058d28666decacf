"""Which of a project's models a screen simulates with: what was chosen, else the one that can be meant, else none."""

from __future__ import annotations

from pathlib import Path

from lidarcheck.tui.core.project import Entry, Project

__all__ = ["NONE", "chosen_model", "next_model"]

NONE = "-"
"""Kept in the state for the choice of no model."""


def chosen_model(project: Project, wanted: str, beside: Path) -> Entry | None:
    """The model called `wanted`; without such the only one in the directory `beside`, or the only one there is."""
    models = project.of("model")
    if wanted == NONE:
        return None
    named = [entry for entry in models if entry.name == wanted]
    near = [entry for entry in models if entry.path.parent == beside]
    return next((some[0] for some in (named, near, models) if len(some) == 1), None)


def next_model(project: Project, now: Entry | None) -> str:
    """The name of the model after this one; `NONE` after the last."""
    names = [*(entry.name for entry in project.of("model")), NONE]
    at = names.index(now.name) if now is not None and now.name in names else len(names) - 1
    return names[(at + 1) % len(names)]
