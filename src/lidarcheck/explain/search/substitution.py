"""What an effect does that is left out, taken over by another one that can do exactly that: no fit has to find it."""

from __future__ import annotations

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.inference.effect_fit import Fit

__all__ = ["is_within_another", "others_of"]


def others_of(now: Fit, left_out: int) -> tuple[list[Probe], list[FloatArray]]:
    """The effects without one of them, as probes with their points; those that can take over what that one does."""
    probes, x = list(now.probes), list(now.x)
    gone, at = probes.pop(left_out), x.pop(left_out)
    settings = gone.effect(at).settings()
    for i, probe in enumerate(probes):
        take_over = search_spec(probe.name).takes_over
        if take_over is not None and take_over.of == gone.name and take_over.can(probe):
            probes[i], x[i] = take_over.take(probe, x[i], settings)
    return probes, x


def is_within_another(now: Fit, at: int) -> bool:
    """Whether what one of the effects does is no more than a factor on what another one does."""
    others = ((probe, search_spec(probe.name).takes_over) for probe in now.probes)
    return any(it is not None and it.wholly and it.of == now.probes[at].name and it.can(probe) for probe, it in others)
