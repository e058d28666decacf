"""Which flat pieces are panels: of a panel's size, facing the sensor, standing free; and why the others are not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.panels.image import BeamImage
from lidarcheck.calibration.panels.masks import FEWEST
from lidarcheck.calibration.panels.outline import Outline, outline_of
from lidarcheck.calibration.panels.pieces import Piece, pieces_of
from lidarcheck.calibration.panels.planes import FittedPlane, FloorOrRoof, level_of
from lidarcheck.calibration.panels.settings import PanelSettings

__all__ = ["FoundPanels", "Panel", "Reject", "find_panels"]

HIDDEN_SHARE = 0.8
ROUGH_SHARE = 0.03
HIDES_M = 0.5
"""What hides part of a surface stands this far before it; less may be an echo of the surface itself that split."""
MOST_REJECTS = 12


@dataclass(frozen=True)
class Panel:
    """A flat target and the beams that geometry says must hit it.

    `range_m`, `azimuth_deg`, `elevation_deg`: its middle. `width_m`, `height_m`: what is seen of it. `incidence_deg`:
    between the middle beam and the normal. `material`: its number in the ideal scan, -1 where not known. `plane`: in
    the sensor frame. `outline_beams`: beams on it; `layer`, `point` (n,): those left once the borders are trimmed;
    `expected_m` (n,): where they must meet it. `hidden_share`: part of its border that something nearer covers.
    """

    number: int
    range_m: float
    azimuth_deg: float
    elevation_deg: float
    width_m: float
    height_m: float
    incidence_deg: float
    material: int
    plane: FittedPlane
    outline_beams: int
    layer: IndexArray
    point: IndexArray
    expected_m: FloatArray
    hidden_share: float


@dataclass(frozen=True)
class Reject:
    """A flat surface that is no panel: its middle [m, deg], what is seen of it [m], how many beams, and why."""

    range_m: float
    azimuth_deg: float
    elevation_deg: float
    width_m: float
    height_m: float
    beams: int
    why: str


@dataclass(frozen=True)
class FoundPanels:
    """What a scene holds: the panels in order of range, the largest flat surfaces that are none, floor and roof."""

    panels: tuple[Panel, ...]
    rejects: tuple[Reject, ...]
    floor: FloorOrRoof | None
    roof: FloorOrRoof | None


def find_panels(image: BeamImage, settings: PanelSettings) -> FoundPanels:
    """Trim floor and roof, cut what is left into flat pieces, and tell the panels among them."""
    floor, roof = _levels(image, settings)
    taking_part = _between(image, floor, roof, settings.clearance_m)
    pieces = _whole_again(image, pieces_of(image, taking_part))
    panels: list[Panel] = []
    rejects: list[Reject] = []
    taken = np.zeros(image.shape, dtype=np.bool_)
    for piece in sorted(pieces, key=lambda piece: -piece.beams):
        outline = outline_of(image, piece, taking_part)
        if not np.isfinite(outline.width_m * outline.height_m * outline.range_m):
            continue  # a plane that the beams of its piece do not all meet: scattered points, no surface
        trimmed = outline.trimmed(image, settings)
        left = int(np.count_nonzero(trimmed))
        why = outline.against(settings)
        if not why and left < FEWEST // 2:
            why = f"a panel, of {outline.beams} beams, but its trimmed borders leave {left}"
        if why:
            rejects.append(_reject(outline, why))
        elif np.mean(taken[outline.box][outline.inside]) < 0.5:
            # The second of two planes through one surface has the same outline; it is no other panel.
            taken[outline.box] |= outline.inside
            panels.append(_panel(image, outline, trimmed))
    panels.sort(key=lambda panel: (panel.range_m, panel.azimuth_deg))
    rejects.sort(key=lambda reject: -reject.beams)
    numbered = tuple(replace(panel, number=i) for i, panel in enumerate(panels, start=1))
    return FoundPanels(numbered, tuple(rejects[:MOST_REJECTS]), floor, roof)


def _panel(image: BeamImage, outline: Outline, trimmed: BoolArray) -> Panel:
    """The panel of an outline; it has no number yet."""
    layer, point = np.divmod(image.beam[outline.box][trimmed], image.points)
    azimuth, elevation = _angles_deg(outline.middle)
    material = image.material[outline.box][trimmed]
    return Panel(
        number=0,
        range_m=outline.range_m,
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        width_m=outline.width_m,
        height_m=outline.height_m,
        incidence_deg=outline.incidence_deg,
        material=int(material[0]),
        plane=outline.piece.plane,
        outline_beams=outline.beams,
        layer=layer,
        point=point,
        expected_m=outline.expected_m[trimmed],
        hidden_share=outline.hidden / max(outline.free + outline.joined + outline.hidden, 1e-12),
    )


def _reject(outline: Outline, why: str) -> Reject:
    azimuth, elevation = _angles_deg(outline.middle)
    size = (outline.width_m, outline.height_m)
    return Reject(outline.range_m, azimuth, elevation, *size, outline.beams, why)


def _angles_deg(direction: FloatArray) -> tuple[float, float]:
    x, y, z = (float(v) for v in direction)
    return math.degrees(math.atan2(y, x)), math.degrees(math.atan2(z, math.hypot(x, y)))


def _levels(image: BeamImage, settings: PanelSettings) -> tuple[FloorOrRoof | None, FloorOrRoof | None]:
    """Floor and roof, as given or as the points show them."""
    seen = np.isfinite(image.range_m)
    x, y, z = (image.direction[seen] * image.range_m[seen][:, None]).T
    floor = level_of(x, y, z) if settings.floor_m is None else FloorOrRoof(settings.floor_m)
    roof = level_of(x, y, z, roof=True) if settings.roof_m is None else FloorOrRoof(settings.roof_m)
    return floor, roof


def _between(image: BeamImage, floor: FloorOrRoof | None, roof: FloorOrRoof | None, clearance_m: float) -> BoolArray:
    """Beams that meet something between floor and roof, shape of the image."""
    x, y, z = np.moveaxis(image.direction * image.range_m[..., None], -1, 0)
    part = np.isfinite(image.range_m)
    if floor is not None:
        part &= z > floor.height_m(x, y) + clearance_m
    if roof is not None:
        part &= z < roof.height_m(x, y) - clearance_m
    return part


def _whole_again(image: BeamImage, pieces: list[Piece]) -> list[Piece]:
    """Pieces of one surface that something nearer parts, as a wall behind panels, put together."""
    if len(pieces) < 2:
        return pieces
    centre = np.array([image.direction[piece.centre] for piece in pieces])
    own = np.array([piece.plane.range_m(u) for piece, u in zip(pieces, centre, strict=True)])
    slack = np.array([max(1.5 * piece.tolerance_m, 0.004 * r) for piece, r in zip(pieces, own, strict=True)])
    at = np.stack([piece.plane.range_m(centre) for piece in pieces])  # at[i, j]: plane i under the middle of piece j
    off = np.abs(at - own[None, :])
    close = off <= np.maximum(slack[:, None], slack[None, :])
    # One plane through the other piece could be chance; the plane of a small piece is too rough to ask for both.
    one_plane = close & (off <= ROUGH_SHARE * own[None, :]).T
    root = list(range(len(pieces)))
    for i, j in zip(*np.nonzero(np.triu(one_plane | one_plane.T, 1)), strict=True):
        a, b = _root(root, int(i)), _root(root, int(j))
        if a != b and pieces[i].key == pieces[j].key and _hidden_between(image, pieces[i], pieces[j]):
            root[b] = a
    groups: dict[int, list[Piece]] = {}
    for i, piece in enumerate(pieces):
        groups.setdefault(_root(root, i), []).append(piece)
    return [group[0] if len(group) == 1 else _union(group) for group in groups.values()]


def _root(root: list[int], i: int) -> int:
    while root[i] != i:
        i = root[i]
    return i


def _hidden_between(image: BeamImage, a: Piece, b: Piece) -> bool:
    """Whether something nearer stands in the way on the line from one piece to the other."""
    (l0, p0), (l1, p1) = a.centre, b.centre
    steps = max(abs(l1 - l0), abs(p1 - p0), 1)
    layer, point = (np.rint(np.linspace(s, e, steps + 1)).astype(np.int64) for s, e in ((l0, l1), (p0, p1)))
    between = ~(_holds(a, layer, point) | _holds(b, layer, point))
    layer, point = layer[between], point[between]
    if layer.size < 2:
        return False
    plane_m = np.minimum(*(piece.plane.range_m(image.direction[layer, point]) for piece in (a, b)))
    nearer = image.range_m[layer, point] < plane_m - HIDES_M
    return bool(np.mean(nearer) >= HIDDEN_SHARE)


def _holds(piece: Piece, layer: IndexArray, point: IndexArray) -> BoolArray:
    row, column = layer - piece.layers.start, point - piece.points.start
    inside = (row >= 0) & (column >= 0) & (row < piece.mask.shape[0]) & (column < piece.mask.shape[1])
    out = np.zeros(len(layer), dtype=np.bool_)
    out[inside] = piece.mask[row[inside], column[inside]]
    return out


def _union(group: Sequence[Piece]) -> Piece:
    """One piece of several, on the plane of the largest."""
    layers = slice(min(p.layers.start for p in group), max(p.layers.stop for p in group))
    points = slice(min(p.points.start for p in group), max(p.points.stop for p in group))
    mask = np.zeros((layers.stop - layers.start, points.stop - points.start), dtype=np.bool_)
    for piece in group:
        top, left = piece.layers.start - layers.start, piece.points.start - points.start
        mask[top : top + piece.mask.shape[0], left : left + piece.mask.shape[1]] |= piece.mask
    largest = max(group, key=lambda piece: piece.beams)
    return replace(largest, layers=layers, points=points, mask=mask)
