"""How closely a frame is simulated: from a library of echoes, by the exact chain, or detector by detector."""

from __future__ import annotations

from typing import Literal, get_args

from lidarcheck.errors import UsageError
from lidarcheck.model.spec import Model

__all__ = ["FIDELITIES", "Fidelity", "check_fidelity", "fidelity_of"]

Fidelity = Literal["fast", "exact", "reference"]
FIDELITIES: tuple[Fidelity, ...] = get_args(Fidelity)


def fidelity_of(word: str) -> Fidelity:
    """The fidelity of that name; `UsageError` where there is none."""
    for fidelity in FIDELITIES:
        if fidelity == word:
            return fidelity
    raise UsageError(f"there is no fidelity {word!r}", fix=f"use one of {', '.join(FIDELITIES)}")


def check_fidelity(fidelity: str, model: Model | None = None) -> None:
    """Refuse a fidelity that there is none of, and any but "exact" for an external model, which runs as it is."""
    if fidelity_of(fidelity) != "exact" and model is not None and model.external is not None:
        what = f"an external model runs as it is and knows no fidelity {fidelity!r}"
        raise UsageError(what, file=model.file, fix="leave the fidelity out")
