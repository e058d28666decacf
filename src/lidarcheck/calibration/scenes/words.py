"""A disagreement of a scene comparison in plain words: how much of what, on which object, where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.scenes.rank import DisagreeingGroup
from lidarcheck.calibration.scenes.units import NOTHING, Units, Values

__all__ = ["Disagreement", "disagreement"]


@dataclass(frozen=True)
class Disagreement:
    """Where measured and simulated disagree: by which feature most, from what to what, and by how much over chance.

    `measured`, `simulated`: means over the units that have the feature in
    both, of the two simulations where there are two; `also`: the other
    features in which the same units stand out, in words. Angles are (least, largest) [deg]; `distance_m`: the median,
    NaN where the beams meet nothing.
    """

    words: str
    kind: str
    name: str
    feature: str
    measured: float
    simulated: float
    strength: float
    z: float
    also: tuple[str, ...]
    units: int
    azimuth_deg: tuple[float, float]
    elevation_deg: tuple[float, float]
    distance_m: float


def disagreement(
    found: DisagreeingGroup, units: Units, measured: Values, simulated: Values, again: Values | None
) -> Disagreement:
    """A finding in words and numbers."""
    own = found.units
    sides = [measured, simulated] if again is None else [measured, simulated, again]

    def means(feature: str) -> tuple[float, float]:
        columns = np.stack([values.of[feature][own] for values in sides])
        both = columns[:, np.isfinite(columns).all(axis=0)]
        return (float(both[0].mean()), float(both[1:].mean())) if both.size else (float("nan"), float("nan"))

    m, s = means(found.feature)
    elevation, azimuth = (angle[own] for angle in units.angles_deg)
    distance = units.distance_m[own & (units.label != NOTHING)]
    middle = float(np.median(distance)) if len(distance) else float("nan")
    on = "in the whole frame" if found.kind == "frame" else f"{_preposition(found.kind)} {found.name}"
    place = "" if found.kind == "frame" else f", {_place(azimuth, elevation, middle)}"
    offset = _went(found.feature, m, s, measured, own)
    also = tuple(_how_much(name, *means(name)) for name in found.features if name != found.feature)
    return Disagreement(
        words=f"{_how_much(found.feature, m, s)} {on}{place}{offset}",
        kind=found.kind,
        name=found.name,
        feature=found.feature,
        measured=m,
        simulated=s,
        strength=found.strength,
        z=found.z,
        also=also,
        units=int(own.sum()),
        azimuth_deg=(float(azimuth.min()), float(azimuth.max())),
        elevation_deg=(float(elevation.min()), float(elevation.max())),
        distance_m=middle,
    )


def _how_much(feature: str, measured: float, simulated: float) -> str:
    difference = measured - simulated
    if feature == "echo":
        if simulated == 0.0:
            return f"echoes on {_digits(100.0 * measured)} % of the beams instead of none"
        share = 100.0 * difference / simulated
        return f"{_digits(abs(share))} % {'more' if share > 0 else 'fewer'} echoes"
    if feature == "stray":
        return f"{measured:.3g} stray echoes a beam instead of {simulated:.3g}"
    if feature == "log10_area":
        share = 100.0 * (10.0**difference - 1.0)
        return f"AREA {_digits(abs(share))} % {'higher' if share > 0 else 'lower'}"
    if feature == "range_residual":
        return f"range {_digits(abs(100.0 * difference))} cm {'longer' if difference > 0 else 'shorter'}"
    if feature == "width":
        return f"WIDTH {_digits(abs(difference))} ns {'longer' if difference > 0 else 'shorter'}"
    name = "PEAK" if feature == "peak" else feature
    return f"{name} {_digits(abs(difference))} {'higher' if difference > 0 else 'lower'}"


def _digits(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def _preposition(kind: str) -> str:
    return {"distance": "at", "sector": "in", "layer": "in", "point": "in"}.get(kind, "on")


def _place(azimuth: FloatArray, elevation: FloatArray, distance_m: float) -> str:
    where = f"az {_interval(azimuth)}, el {_interval(elevation)}"
    return where if np.isnan(distance_m) else f"{where}, {distance_m:.0f} m"


def _interval(angle_deg: FloatArray) -> str:
    low, high = (f"{value:.1f}".replace("-", "−") for value in (angle_deg.min(), angle_deg.max()))
    return f"{low}°" if low == high else f"{low}…{high}°"


def _went(feature: str, m: float, s: float, measured: Values, own: npt.NDArray[np.bool_]) -> str:
    """Where the stray echoes are, or where lost echoes may have gone, seen from the surface."""
    if feature not in ("echo", "stray") or (feature == "echo" and m >= s):
        return ""
    offset = measured.stray_offset_m[own]
    offset = offset[np.isfinite(offset)]
    if len(offset) < 0.3 * np.count_nonzero(own):
        return ""
    middle = float(np.median(offset))
    return f"; stray echoes {abs(middle):.1f} m {'behind' if middle > 0 else 'before'} it"
