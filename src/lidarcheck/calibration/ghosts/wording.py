"""What is said of signs: why there is none, that one is not where it should be, what a user should know of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.calibration.ghosts.returns import Brightness, returns_of
from lidarcheck.calibration.ghosts.sign import Sign
from lidarcheck.errors import InputError
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

__all__ = ["LARGEST_M", "no_sign", "notes_on", "those_expected"]

LARGEST_M = 5.0
"""Signs are smaller than this; a larger bright cluster is a wall."""
EXPECTED_WITHIN = 0.05


def those_expected(signs: list[Sign], expected_m: Sequence[float], name: str) -> list[Sign]:
    """The signs near the expected ranges, each of which must have one; all signs where none is expected."""
    if not expected_m:
        return signs
    near = [[abs(s.range_m - m) <= EXPECTED_WITHIN * m + 1.0 for s in signs] for m in expected_m]
    for row, m in zip(near, expected_m, strict=True):
        if not any(row):
            there = ", ".join(f"{len(s.rows)} echoes at {s.range_m:.2f} m" for s in signs) or "none anywhere"
            within = f"within {EXPECTED_WITHIN * m + 1.0:.1f} m of it"
            raise InputError(
                f"there is no sign at {m:g} m ({within}); signs found: {there}",
                file=name,
                fix="check the expected range, or leave it out to take what is there",
            )
    return [sign for sign, here in zip(signs, np.any(near, axis=0), strict=True) if here]


def no_sign(scan: Scan, range_m: FloatArray, bright: Brightness, others: Sequence[str], name: str) -> InputError:
    """What there is instead of a sign; `others`: words on bright clusters that an ordinary surface could be."""
    if not len(scan):
        return InputError("the scan has no echoes, so no sign", file=name, fix="give a scan of a traffic sign")
    top = int(np.argmax(bright.values))
    most = f"the brightest of {len(scan)} echoes has {bright.column} {bright.values[top]:g} at {range_m[top]:.2f} m"
    least = f"{bright.above:.0f}, {bright.why}"
    count = len(returns_of(scan, range_m, bright).bright(bright))
    if not count:
        what = f"no sign: {most}, and a sign's have at least {least}"
        return InputError(what, file=name, fix="check the sensor variant, or set the least with --bright")
    if not others:
        what = f"no sign: {count} returns are bright ({bright.column} from {least}), but no three of them side by side"
        return InputError(f"{what} within {LARGEST_M:g} m; {most}", file=name, fix="lower or raise --bright")
    near = "; ".join(others[:3]) + (f"; and {len(others) - 3} more" if len(others) > 3 else "")
    return InputError(
        f"no sign: what is bright ({bright.column} from {least}) could be ordinary surfaces that are near ({near})",
        file=name,
        fix="a sign is told by a ghost, or by standing beyond such surfaces; raise --bright where it is brighter",
    )


def notes_on(signs: Sequence[Sign], sensor: Sensor | None) -> list[str]:
    """That a sign is cut, has no ghost, or has echoes that noise drew away."""
    notes = []
    for i, sign in enumerate(signs, start=1):
        which = f"sign {i} at {sign.range_m:.2f} m"
        if sign.cut:
            notes.append(
                f"{which} is cut by the field of view ({', '.join(sign.cut)}): its size and counts are too small"
            )
        if not sign.has_ghost and sensor is not None and 2.0 * sign.range_m > sensor.max_range_m:
            notes.append(f"{which}: a ghost would stand beyond the {sensor.max_range_m:g} m that the sensor measures")
        elif not sign.has_ghost:
            share = f"on less than {100 * sign.fraction_high:.2g} % of its beams (95 %)"
            notes.append(f"{which} has no ghost: {sign.why}; a ghost would be seen {share}")
        if sign.pulled:
            notes.append(f"{which}: on {sign.pulled} of its beams noise drew the echo away from its own range")
    return notes
