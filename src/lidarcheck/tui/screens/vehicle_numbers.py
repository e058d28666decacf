"""The numbers below one histogram: how far real and simulated are apart in each feature, now and before."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from lidarcheck.tui.context import value_text
from lidarcheck.tui.engine import Known
from lidarcheck.tui.widgets.lines import Line, is_old, line

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Number
    from lidarcheck.calibration.vehicles.compare import AtDistance

__all__ = ["number_lines"]


def number_lines(at: AtDistance, quantity: str, known: Known | None) -> tuple[str, list[Line]]:
    """A title and a line for each feature at a distance, `quantity` being the one that is seen: its part of the number
    now, before the last step and at the start, where these are known, and how far the two distributions are apart.
    """
    sides = [] if known is None or known.number is None else [known.number, known.before, known.start]
    lines: list[Line] = []
    for name, gap in at.features.items():
        chance = at.ks_chance[name]
        off = 100.0 * (gap.mean_simulated / gap.mean_measured - 1.0) if gap.mean_measured else math.nan
        apart = "within chance" if gap.ks <= chance else f"mean {off:+.1f} %, beyond chance"
        pointer = ">" if name == quantity else " "
        parts = "".join(f"{_part(side, name):>7}" for side in sides)
        words = f"{pointer}{name:9}{parts}{gap.ks:7.3f}{chance:10.3f}  {apart}"
        lines.append(line(words, "text" if gap.ks <= chance else "edited"))
    of = f"{at.distance_m:.0f} m"
    if known is None or known.number is None:
        return f"{of}      KS  by chance", lines
    kind = f"{known.number.kind} [sd]{f', {known.state}' if is_old(known.state) else ''}"
    return f"{of:5}{'now':>7}{'before':>7}{'start':>7}{'KS':>7}  by chance  {kind}", lines


def _part(number: Number | None, feature: str) -> str:
    return "-" if number is None or feature not in number.parts else value_text(number.parts[feature])
