"""Maps of the field of view, as the sensor sees it: left is left, up is up.

A block is the darker the farther it is from zero, blue below and orange above it, and from the second shade on it
also bears its sign. Before and after share one scale.
"""

from __future__ import annotations

import math

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray
from lidarcheck.figures.gap.data import FieldMap
from lidarcheck.figures.svg.shades import LEVELS, box, levels_of, shade, shaded
from lidarcheck.figures.svg.shapes import svg, text
from lidarcheck.figures.words import amount

__all__ = ["map_svg", "reach_of", "scale_svg"]


_MARKED, _STRONG = 2, 4
"""From the first on a block bears its sign, from the second on in the other ink."""
_STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
_LEFT, _TOP, _WIDE, _HIGH = 26.0, 4.0, 240.0, 84.0
_WIDTH, _HEIGHT = 270.0, 104.0
_SCALE_WIDTH, _SCALE_HEIGHT = 260.0, 26.0


def reach_of(one: FieldMap) -> float:
    """Where the scale of both maps ends: all but the farthest 2 % of the blocks lie within; 1 where all are zero."""
    values = np.abs(np.concatenate([one.before.ravel(), one.after.ravel()]))
    values = values[np.isfinite(values)]
    reach = float(np.quantile(values, 0.98)) if len(values) else 0.0
    reach = reach or float(values.max(initial=0.0))
    return _round_up(reach) if reach > 0.0 else 1.0


def _round_up(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in _STEPS if step * power >= value * (1.0 - 1e-9))


def map_svg(one: FieldMap, side: str, reach: float) -> str:
    """The map of one side, `before` or `after`. Empty without a block to show."""
    values: FloatArray = getattr(one, side)
    seen = np.isfinite(values)
    if not seen.any():
        return ""
    level = levels_of(values / reach)
    parts = shaded(level, seen, _boxes)
    strong = np.abs(level) >= _STRONG
    for name, chosen in (("sign", ~strong & (np.abs(level) >= _MARKED)), ("sign strong", strong)):
        signs = _signs(seen & chosen, level > 0)
        parts += [f'<path class="{name}" d="{signs}"/>'] if signs else []
    parts.append(f'<rect class="rim" x="{_LEFT:g}" y="{_TOP:g}" width="{_WIDE:g}" height="{_HIGH:g}"/>')
    return svg(_words(one, side, values), "".join([*parts, *_ends(one)]), name="map", width=_WIDTH, height=_HEIGHT)


def _place(row: int, column: int, shape: tuple[int, ...]) -> tuple[float, float, float, float]:
    """Left, top, width and height of a block: high layers are above, high points to the left."""
    wide, high = _WIDE / shape[1], _HIGH / shape[0]
    return _LEFT + (shape[1] - 1 - column) * wide, _TOP + (shape[0] - 1 - row) * high, wide, high


def _boxes(chosen: BoolArray) -> str:
    """Blocks as one path."""
    return "".join(box(*_place(row, column, chosen.shape)) for row, column in np.argwhere(chosen).tolist())


def _signs(chosen: BoolArray, positive: BoolArray) -> str:
    path = []
    for row, column in np.argwhere(chosen).tolist():
        x, y, wide, high = _place(row, column, chosen.shape)
        half = min(wide, high, 8.0) / 4.0
        path.append(f"M{x + wide / 2.0 - half:.1f} {y + high / 2.0:.1f}h{2.0 * half:.1f}")
        if positive[row, column]:
            path.append(f"m{-half:.1f} {-half:.1f}v{2.0 * half:.1f}")
    return "".join(path)


def _ends(one: FieldMap) -> list[str]:
    """The angles at the map's corners."""
    up, down = (amount(round(angle, 1)) for angle in reversed(one.elevation_deg))
    sides = [_side(angle) for angle in reversed(one.azimuth_deg)]
    return [
        text(_LEFT - 3.0, _TOP + 7.0, f"{up}°", "end"),
        text(_LEFT - 3.0, _TOP + _HIGH, f"{down}°", "end"),
        text(_LEFT, _HEIGHT - 4.0, sides[0]),
        text(_LEFT + _WIDE, _HEIGHT - 4.0, sides[1], "end"),
    ]


def _side(azimuth: float) -> str:
    return f"{amount(abs(round(azimuth, 1)))}° {'left' if azimuth > 0.0 else 'right'}"


def _words(one: FieldMap, side: str, values: FloatArray) -> str:
    finite = np.where(np.isfinite(values), values, 0.0)
    row, column = np.unravel_index(int(np.argmax(np.abs(finite))), values.shape)
    layers, points = one.layers[int(row)], one.points[int(column)]
    rms = float(np.sqrt(np.nanmean(values**2)))
    return (
        f"Map of {one.words}, measured less simulated, {side}: root mean square of the blocks {amount(rms)}, "
        f"farthest {amount(float(finite[row, column]))} {_unit(one.unit)} in layers {layers[0]} to {layers[1]}, "
        f"points {points[0]} to {points[1]}"
    )


def scale_svg(one: FieldMap, reach: float) -> str:
    """The shades with the numbers that they stand for."""
    count = 2 * LEVELS + 1
    wide = (_SCALE_WIDTH - 20.0) / count
    parts = []
    for i, level in enumerate(range(-LEVELS, LEVELS + 1)):
        x = 10.0 + i * wide
        parts.append(f'<path class="{shade(level)}" d="M{x:.1f} 2h{wide:.1f}v9h{-wide:.1f}z"/>')
        if abs(level) >= _MARKED:
            cross = "m-2 -2v4" if level > 0 else ""
            name = "sign strong" if abs(level) >= _STRONG else "sign"
            parts.append(f'<path class="{name}" d="M{x + wide / 2.0 - 2.0:.1f} 6.5h4{cross}"/>')
    for i, words in ((0, f"−{amount(reach)}"), (LEVELS, "0"), (count - 1, f"+{amount(reach)} {_unit(one.unit)}")):
        anchor = "start" if i == 0 else "middle" if i == LEVELS else "end"
        x = 10.0 if i == 0 else 10.0 + (i + 0.5) * wide if i == LEVELS else _SCALE_WIDTH - 10.0
        parts.append(text(x, 22.0, words.strip(), anchor))
    label = f"scale from {amount(-reach)} to {amount(reach)} {_unit(one.unit)}, blue with minus to orange with plus"
    return svg(label, "".join(parts), name="scale", width=_SCALE_WIDTH, height=_SCALE_HEIGHT)


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
