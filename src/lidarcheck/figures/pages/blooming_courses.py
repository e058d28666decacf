"""The curves of blooming: those of a table, and those of a profile over the offset from the target.

It loads little, since the terminal interface draws a table before anything of the calibration is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from lidarcheck.figures.data import Course, Curve

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.beside import BesideTarget
    from lidarcheck.calibration.blooming.cells import Profile
    from lidarcheck.formats.lut import Axis

__all__ = ["LABELS", "beside_course", "beside_curve", "profile_course", "profile_curve", "table_course"]

LABELS: Mapping[str, str] = {"range": "range [m]", "PEAK": "PEAK", "AREA": "AREA", "WIDTH": "WIDTH [ns]"}
"""What a profile shows, and how its axis is called."""
_OFFSETS: Mapping[Axis, str] = {"vertical": "SPAD rows, upward", "horizontal": "columns of 0.05 deg, to the left"}
_BEAMS: Mapping[Axis, str] = {"vertical": "layers", "horizontal": "points"}


def table_course(title: str, axis: Axis, curves: Iterable[Curve]) -> Course:
    """Curves of Y over X, as a table has them."""
    return Course(title, f"X [{_OFFSETS[axis]}]", "Y", tuple(curves), log_y=True)


def profile_course(title: str, feature: str, axis: Axis, curves: Iterable[Curve]) -> Course:
    """Curves of a feature, one of `LABELS`, over the offset."""
    log = feature in ("PEAK", "AREA")
    return Course(title, f"offset [{_OFFSETS[axis]}]", LABELS[feature], tuple(curves), log_y=log)


def profile_curve(name: str, profile: Profile, feature: str) -> Curve:
    """The feature of a profile."""
    from lidarcheck.calibration.blooming.response import FEATURES

    values = profile.range_m if feature == "range" else profile.value[:, FEATURES.index(feature)]
    return Curve(name, profile.offset, values)


def beside_course(title: str, feature: str, axis: Axis, curves: Iterable[Curve]) -> Course:
    """Curves of a feature of any sensor over the offset in beams."""
    label = LABELS["range"] if feature == "range" else f"mean {feature}"
    return Course(title, f"offset [{_BEAMS[axis]}]", label, tuple(curves))


def beside_curve(name: str, beside: BesideTarget, feature: str) -> Curve:
    """The feature of what any sensor shows beside a target."""
    return Curve(name, beside.offset, beside.range_m if feature == "range" else beside.features[feature])
