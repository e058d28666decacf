"""How a frame is simulated: from a library of echoes, by the exact chain, or detector by detector; and on what."""

from __future__ import annotations

from typing import Literal, get_args

from lidarcheck.errors import UsageError
from lidarcheck.model.spec import Model

__all__ = ["DEVICES", "FIDELITIES", "Device", "Fidelity", "check_device", "check_fidelity"]

Fidelity = Literal["fast", "exact", "reference"]
FIDELITIES: tuple[Fidelity, ...] = get_args(Fidelity)
Device = Literal["cpu", "cuda"]
DEVICES: tuple[Device, ...] = get_args(Device)


def check_fidelity(fidelity: str, model: Model | None = None) -> None:
    """Refuse a fidelity that there is none of, and any but "exact" for an external model, which runs as it is."""
    if fidelity not in FIDELITIES:
        raise UsageError(f"there is no fidelity {fidelity!r}", fix=f"use one of {', '.join(FIDELITIES)}")
    if model is not None and model.external is not None and fidelity != "exact":
        what = f"an external model runs as it is and knows no fidelity {fidelity!r}"
        raise UsageError(what, file=model.file, fix="leave the fidelity out")


def check_device(device: str, fidelity: str = "exact", model: Model | None = None, *, here: bool = True) -> None:
    """Refuse a device that there is none of, a GPU that is not there, and what a GPU does not run.

    `here`: whether this machine is to simulate; of others it is not known what they have.
    """
    if device not in DEVICES:
        raise UsageError(f"there is no device {device!r}", fix=f"use one of {', '.join(DEVICES)}")
    if device == "cpu":
        return
    if fidelity != "exact":
        raise UsageError(f"a GPU runs the exact chain, not the fidelity {fidelity!r}", fix="leave one of the two out")
    if model is not None and model.external is not None:
        what = f"an external model runs as it is and knows no device {device!r}"
        raise UsageError(what, file=model.file, fix="leave the device out")
    if here:
        from lidarcheck.model.cuda.simulate import check_cuda

        check_cuda()
