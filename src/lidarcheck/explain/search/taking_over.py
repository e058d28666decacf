"""What an effect does that is left out, taken over by another one that can do exactly that: no fit has to find it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lidarcheck.effects.walk_error import LARGEST_REFERENCE, WalkError
from lidarcheck.explain.search.starts import Probe
from lidarcheck.inference.gauss_newton import Fit

__all__ = ["is_within_another", "others_of"]

FloatArray = npt.NDArray[np.float64]


def others_of(now: Fit, left_out: int) -> tuple[list[Probe], list[FloatArray]]:
    """The effects without one of them, as probes with their points; a walk takes over an offset, which is a walk about
    another amplitude, and the gains of all layers what all have in common."""
    probes, x = list(now.probes), list(now.x)
    gone, at = probes.pop(left_out), x.pop(left_out)
    settings = gone.effect(at).settings()
    for i, probe in enumerate(probes):
        if gone.name == "range_offset" and probe.name == "walk_error":
            probes[i], x[i] = _shifted(probe, x[i], float(settings["offset_m"]))
        if gone.name == "signal_gain" and "gains" in probe.settings:
            probes[i] = _brighter(probe, float(settings["gain"]))
    return probes, x


def is_within_another(now: Fit, at: int) -> bool:
    """Whether what one of the effects does is no more than a factor on another one's list of gains."""
    return now.probes[at].name == "signal_gain" and any("gains" in probe.settings for probe in now.probes)


def _brighter(probe: Probe, gain: float) -> Probe:
    """A gain for every layer that makes all so many times as bright, where it can."""
    gains = np.asarray(probe.settings["gains"]) * gain
    return replace(probe, settings={**probe.settings, "gains": tuple(np.round(np.minimum(gains, 10.0), 4).tolist())})


def _shifted(probe: Probe, x: FloatArray, offset_m: float) -> tuple[Probe, FloatArray]:
    """A walk that shifts all echoes by so much more, where its curve can; else as it is."""
    walk = WalkError(**probe.effect(x).settings())
    values = _about_its_zero(walk, offset_m)
    if values is None:
        return probe, x
    ranges = {p.name: p for p in walk.parameters()}
    if any(not ranges[name].low <= value <= ranges[name].high for name, value in values.items()):
        return probe, x
    moved = replace(probe, settings={**probe.settings, **values})
    return moved, moved.start()


def _about_its_zero(walk: WalkError, offset_m: float) -> dict[str, float] | None:
    """The numbers of the same curve so much higher, about the AREA where that is zero; None where it is so nowhere."""
    slope, bend, power = walk.per_decade_m, walk.bend_m, walk.power
    if abs(power) >= 1e-6:
        if bend != 0.0 or slope == 0.0:
            return None
        # slope (u - 1) / (q ln 10) + offset, u = (AREA / reference)^q, is zero at this u. Without one the curve ends at
        # a level of its own, and the reference is taken far off: a power with nothing beside it has none.
        zero = max(1.0 - offset_m * power * math.log(10.0) / slope, 1e-6)
        reference = float(np.clip(walk.reference_area * zero ** (1.0 / power), 1.0, LARGEST_REFERENCE))
        return {
            "per_decade_m": slope * (reference / walk.reference_area) ** power,
            "reference_area": reference,
        }
    roots = np.roots([bend, slope, offset_m])
    real = roots[np.abs(roots.imag) < 1e-9].real
    if not len(real):
        return None
    zero = float(real[np.argmin(np.abs(real))])
    moved = {"per_decade_m": slope + 2.0 * bend * zero, "bend_m": bend}
    return moved | {"reference_area": walk.reference_area * 10.0**zero}
