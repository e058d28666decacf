"""Which of a project's models a screen simulates with: what was chosen, else the one that can be meant, else none."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lidarcheck.session.project import Entry, Project

__all__ = ["NONE", "chosen_model", "likely_model", "model_after", "which_model"]

NONE = "-"
"""Kept in the state for the choice of no model."""


def chosen_model(project: Project, wanted: str, beside: Path, variant: str = "") -> Entry | None:
    """The model called `wanted`; without such the likely one; `beside`: the measurement's directory."""
    models = project.of("model")
    if wanted == NONE:
        return None
    named = next((entry for entry in models if entry.name == wanted), None)
    return named or likely_model(models, beside, variant)


def likely_model(models: Sequence[Entry], beside: Path, variant: str) -> Entry | None:
    """Of those with the variant in their name, else of all: the only one in the directory `beside`, or the only one.

    Of several with the variant the first. None where several are left: a wrong one would say wrong things.
    """
    alike = [entry for entry in models if variant and variant.lower() in entry.name.lower()]
    could = alike or list(models)
    near = [entry for entry in could if entry.path.parent == beside]
    return next((some[0] for some in (near, could, alike[:1]) if len(some) == 1), None)


def which_model(models: Sequence[Entry]) -> str:
    """Why there is none, to be said where one is needed."""
    return (
        "there is no model in this project"
        if not models
        else f"any of {len(models)} models could be meant: m chooses one"
    )


def model_after(project: Project, now: Entry | None) -> str:
    """The name of the model after this one; `NONE` after the last."""
    names = [*(entry.name for entry in project.of("model")), NONE]
    at = names.index(now.name) if now is not None and now.name in names else len(names) - 1
    return names[(at + 1) % len(names)]
