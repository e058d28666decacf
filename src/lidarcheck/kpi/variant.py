"""Which sensor variant measured: PEAK cannot pass the saturation, and strong echoes pile up there."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.errors import InputError
from lidarcheck.scan import Scan
from lidarcheck.sensor import Beams, Sensor, SpadArray, shipped, shipped_names

if TYPE_CHECKING:
    from lidarcheck.model.spec import Model

__all__ = [
    "ABOVE_SATURATION",
    "OneVariant",
    "above_saturation",
    "check_variant",
    "check_variants",
    "other_variant",
    "variant_of",
]

ABOVE_SATURATION, FEWEST_ABOVE = 1.05, 3
FEWEST_AT_TOP = 10
PILE_PEAKS, FEWEST_PILED, PILE_RATIO = 5, 20, 3


@functools.lru_cache(maxsize=16)
def _variants(beams: Beams) -> tuple[SpadArray, ...]:
    """The shipped SPAD arrays with these beams, in order of their saturation; none for beams of any other sensor."""
    found = [shipped(name) for name in shipped_names()]
    own = [sensor for sensor in found if isinstance(sensor, SpadArray) and sensor.beams == beams]
    return tuple(sorted(own, key=lambda sensor: sensor.peak_saturation))


def above_saturation(scan: Scan, sensor: Sensor, file: str | Path, asked: str = "model") -> InputError | None:
    """More detectors ON than there are: no effect does that, another sensor does. `asked`: what named the sensor."""
    if not isinstance(sensor, SpadArray) or "PEAK" in scan.defaulted:
        return None
    top = sensor.peak_saturation
    above = int(np.count_nonzero(scan.peak > ABOVE_SATURATION * top))
    if above < FEWEST_ABOVE:
        return None
    what = f"PEAK reaches {float(scan.peak.max()):g} ({above} echoes), above the {top:g} at which the {asked}'s "
    what += f"sensor, {sensor.variant}, saturates"
    row = int(np.flatnonzero(scan.peak > ABOVE_SATURATION * top)[0])
    what += f", first on Layer {scan.layer[row]}, Point {scan.point[row]}"
    return InputError(what, file=file, fix=f"name the {asked} of the variant that measured{_who(scan, top)}")


def _who(scan: Scan, top: float) -> str:
    """A variant that does saturate that high."""
    fits = [one.variant for one in _variants(scan.beams) if one.peak_saturation >= scan.peak.max() > top]
    return f", {fits[0]}?" if fits else ""


def other_variant(scans: Sequence[Scan], sensor: Sensor) -> str:
    """What shows that a variant measured that saturates lower than the sensor's; empty where nothing does.

    Strong echoes then end exactly at that variant's saturation and pile up there.
    """
    if not isinstance(sensor, SpadArray):
        return ""
    peak = np.concatenate([scan.peak for scan in scans]) if scans else np.zeros(0)
    top = sensor.peak_saturation
    for variant in _variants(sensor.beams):
        name, other = variant.variant, variant.peak_saturation
        if name == sensor.variant or other >= top or not len(peak) or peak.max() != other:
            continue
        piled = int(np.count_nonzero(peak > other - PILE_PEAKS))
        at_top, next_to_it = (int(np.count_nonzero(peak == other - step)) for step in (0, 1))
        below = int(np.count_nonzero((peak <= other - PILE_PEAKS) & (peak > other - 2 * PILE_PEAKS)))
        # A tail that ends by chance at that value would have one or two there, and more beside it.
        ends = at_top >= FEWEST_AT_TOP and at_top > next_to_it
        if ends or (piled >= FEWEST_PILED and piled > PILE_RATIO * below):
            return (
                f"no PEAK is above {other:g}, where {piled} echoes pile up: that is how {name} saturates, "
                f"not {sensor.variant} at {top:g}"
            )
    return ""


def variant_of(scan: Scan) -> str:
    """The variant that a scan's saturation gives away; empty where it does not, and for sensors without variants."""
    if "PEAK" in scan.defaulted or not len(scan):
        return ""
    variants = _variants(scan.beams)
    for low, high in itertools.pairwise(variants):
        if above_saturation(scan, low, "") is None:
            return low.variant if other_variant([scan], high) else ""
    return variants[-1].variant if len(variants) > 1 else ""


def check_variants(measured: Scan, simulated: Scan, file: str | Path) -> None:
    """Refuse scans whose saturations give away two variants: `InputError` names the measured file."""
    one, other = variant_of(measured), variant_of(simulated)
    if one and other and one != other:
        what = f"saturates as {one} does (PEAK up to {measured.peak.max():g}), the simulated scan as "
        what += f"{other} (up to {simulated.peak.max():g})"
        raise InputError(what, file=file or None, fix="compare scans of one variant")


def check_variant(scan: Scan, sensor: Sensor, file: str | Path, asked: str = "model") -> None:
    """Refuse a scan that another variant measured than the sensor's: `InputError` says by what that is seen."""
    fault = above_saturation(scan, sensor, file, asked)
    if fault is not None:
        raise fault
    what = other_variant([scan], sensor)
    if what:
        raise InputError(what, file=file or None, fix=f"name the {asked} of the variant that measured")


class OneVariant:
    """Holds all scans of a command to one variant: its model's, else that of the first scan that gives one away."""

    def __init__(self, model: Model | None = None, sensor: Sensor | None = None) -> None:
        """`model`: None where none is known; a model that runs a program may see with any detector. `sensor`: named
        besides."""
        self._sensor = model.sensor if model is not None and model.external is None else sensor
        self._first: tuple[str, str] | None = None

    def check(self, scan: Scan, file: str | Path) -> None:
        """`InputError` names the file that another variant has measured, and by what that is seen."""
        if self._sensor is not None:
            check_variant(scan, self._sensor, file)
            return
        found = variant_of(scan)
        if self._first is None:
            self._first = (found, str(file)) if found else None
        elif found and found != self._first[0]:
            what = f"saturates as {found} does (PEAK up to {scan.peak.max():g}), {self._first[1]} as {self._first[0]}"
            raise InputError(what, file=file, fix="give scans of one variant")
