"""How closely a frame is simulated: from a library of echoes, by the exact chain, or detector by detector."""

from __future__ import annotations

from typing import Literal, get_args

from lidarcheck.errors import UsageError
from lidarcheck.model.spec import Model

__all__ = ["FIDELITIES", "Fidelity", "check_fidelity"]

Fidelity = Literal["fast", "exact", "reference"]
FIDELITIES: tuple[Fidelity, ...] = get_args(Fidelity)


def check_fidelity(fidelity: str, model: Model | None = None) -> None:
    """Refuse a fidelity that there is none of, and any but "exact" for an external model, which runs as it is."""
    if fidelity not in FIDELITIES:
        raise UsageError(f"there is no fidelity {fidelity!r}", fix=f"use one of {', '.join(FIDELITIES)}")
    if model is not None and model.external is not None and fidelity != "exact":
        what = f"an external model runs as it is and knows no fidelity {fidelity!r}"
        raise UsageError(what, file=model.file, fix="leave the fidelity out")
