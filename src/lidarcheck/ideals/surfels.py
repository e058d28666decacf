"""A cloud as a map: surfels, small flat pieces that the points of a cell lie on.

Space is cut into cells that hold some sixteen points of a surface. In each the plane nearest to the points around is
fitted, and a rectangle on it stands for the cell's own points, widened by their spacing so that no ray slips through.
How far points lie off their planes says how sure these are. Where too few points lie to tell a plane, a box about them
says that something is there; where nothing lies, nothing is said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.errors import UsageError
from lidarcheck.ideals.map import MapSurfaces
from lidarcheck.scenes.facets import box

__all__ = ["map_of_cloud", "spacing_of"]

_ACROSS = 4.0
"""A cell is so many spacings wide."""
_NEAREST, _FEWEST = 32, 6
"""Points that a plane is fitted to, and that it takes."""
_REACH = 1.5
"""They lie within so many cells."""
_ROUGH, _USUAL, _LINE = 0.1, 2.0, 0.3
"""Thicker than so much of a cell, and than so many times what is usual in the map, is a crease, or no surface; narrower
than so many spacings is a line, no plane."""
_SAMPLE = 20_000
_CHUNK = 100_000
_MOST_CELLS = 5_000_000


def spacing_of(place_m: FloatArray) -> float:
    """The distance of a cloud's points [m] if they lay evenly on their surfaces, by how near the fifth one is."""
    from scipy.spatial import cKDTree

    some = place_m[np.linspace(0, len(place_m) - 1, min(len(place_m), _SAMPLE)).astype(np.int64)]
    fifth = cKDTree(place_m).query(some, k=6)[0][:, 5]
    return float(np.median(fifth) * np.sqrt(np.pi / 5.0))


def map_of_cloud(
    place_m: FloatArray, material_id: IntArray, *, cell_m: float | None = None, error_m: float = 0.0
) -> MapSurfaces:
    """The surfels of a cloud, `place_m` (n, 3), each point of a material (n,).

    `cell_m`: None: by the points' spacing; `error_m`: standard error of the whole map, beside its points' scatter.
    `UsageError` for too few points, and for cells too small to be counted.
    """
    if len(place_m) < _FEWEST:
        raise UsageError(f"the map has {len(place_m)} points", fix="give a dense cloud, or a mesh")
    origin = np.median(place_m, axis=0)
    place = place_m - origin
    spacing = spacing_of(place)
    cell = _ACROSS * spacing if cell_m is None else cell_m
    if not cell > 0.0:
        raise UsageError("half of the map's points lie on one place", fix="thin the cloud out, or give --cell")
    cells = _Cells.of(place, cell)
    planes = _planes(place, cells, cell, spacing)
    flat = planes.flat
    usual = float(np.median(planes.thick_m[flat])) if flat.any() else 0.0
    rough = planes.thick_m > max(_ROUGH * cell, _USUAL * usual)
    corners = _rectangles(place, cells, planes, min(spacing, 0.5 * cell))
    boxes = _boxes(place, cells, ~flat, 0.5 * min(spacing, cell))
    material = material_id[cells.order[cells.start]]
    triangles = np.concatenate([corners, boxes])
    of_cell = np.concatenate([np.repeat(np.flatnonzero(flat), 2), np.repeat(np.flatnonzero(~flat), 12)])
    unknown = np.repeat([False, True], [len(corners), len(boxes)])
    error = np.sqrt(np.where(flat, planes.error_m, 0.0)[of_cell] ** 2 + error_m**2)
    return MapSurfaces(
        triangles, origin, material[of_cell].astype(np.int32), error, rough[of_cell] & ~unknown, unknown, closed=False
    )


@dataclass(frozen=True)
class _Cells:
    """The cells that hold points: `order` (n,) sorts the points by cell, `start` (m,) is where each cell begins."""

    order: IndexArray
    start: IndexArray
    middle_m: FloatArray

    @classmethod
    def of(cls, place: FloatArray, cell: float) -> _Cells:
        index = np.floor(place / cell).astype(np.int64)
        index -= index.min(axis=0)
        size = index.max(axis=0) + 1
        if float(size[0]) * float(size[1]) * float(size[2]) > 2.0**62:
            raise UsageError(f"cells of {cell:g} m are too small for a map of that size", fix="give --cell")
        key = (index[:, 0] * size[1] + index[:, 1]) * size[2] + index[:, 2]
        order = np.argsort(key, kind="stable")
        start = np.flatnonzero(np.diff(key[order], prepend=-1))
        if len(start) > _MOST_CELLS:
            what = f"the map has {len(start)} cells of {cell:g} m"
            raise UsageError(what, fix=f"the limit is {_MOST_CELLS}: give a larger --cell, or a part of the map")
        count = np.diff(start, append=len(order))
        middle = np.add.reduceat(place[order], start, axis=0) / count[:, None]
        return cls(order, start, middle)


@dataclass(frozen=True)
class _Planes:
    """Of each cell, shape (m,): middle and axes (columns: normal and two along the plane) of its plane, how thick its
    points are, the standard error of its place, and whether there is one."""

    middle_m: FloatArray
    axes: FloatArray
    thick_m: FloatArray
    error_m: FloatArray
    flat: BoolArray


def _planes(place: FloatArray, cells: _Cells, cell: float, spacing: float) -> _Planes:
    from scipy.spatial import cKDTree

    tree, parts = cKDTree(place), []
    for start in range(0, len(cells.middle_m), _CHUNK):
        middle = cells.middle_m[start : start + _CHUNK]
        near, which = tree.query(middle, k=min(_NEAREST, len(place)), distance_upper_bound=_REACH * cell)
        there = np.isfinite(near)
        count = there.sum(axis=1)
        around = np.where(there[..., None], place[np.minimum(which, len(place) - 1)], 0.0)
        centre = around.sum(axis=1) / np.maximum(count, 1)[:, None]
        off = np.where(there[..., None], around - centre[:, None], 0.0)
        size, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", off, off))
        free = np.maximum(count - 3, 1)
        thick = np.sqrt(np.maximum(size[:, 0], 0.0) / free)
        narrow = np.sqrt(np.maximum(size[:, 1], 0.0) / np.maximum(count, 1))
        flat = (count >= _FEWEST) & (narrow > _LINE * spacing)
        # Three numbers of a plane are fitted to its points: their places vary by 3/count of the scatter on average.
        parts.append(_Planes(centre, axes, thick, thick * np.sqrt(3.0 / np.maximum(count, 1)), flat))
    return _Planes(*(np.concatenate([getattr(part, name) for part in parts]) for name in _Planes.__dataclass_fields__))


def _rectangles(place: FloatArray, cells: _Cells, planes: _Planes, wider_m: float) -> FloatArray:
    """Two triangles of each plane about its cell's points, shape (2 k, 3, 3)."""
    own = np.repeat(np.arange(len(cells.start)), np.diff(cells.start, append=len(cells.order)))
    off = place[cells.order] - planes.middle_m[own]
    flat_off = np.einsum("ni,nij->nj", off, planes.axes[own][:, :, 1:])
    low, high = np.minimum.reduceat(flat_off, cells.start), np.maximum.reduceat(flat_off, cells.start)
    low, high = low - wider_m, high + wider_m
    corner = [
        planes.middle_m + np.einsum("nj,nij->ni", np.stack([u, v], axis=1), planes.axes[:, :, 1:])
        for u, v in ((low[:, 0], low[:, 1]), (high[:, 0], low[:, 1]), (high[:, 0], high[:, 1]), (low[:, 0], high[:, 1]))
    ]
    a, b, c, d = (one[planes.flat] for one in corner)
    return np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1).reshape(-1, 3, 3)


def _boxes(place: FloatArray, cells: _Cells, which: BoolArray, wider_m: float) -> FloatArray:
    """Twelve triangles about the points of each of those cells, shape (12 k, 3, 3)."""
    low = np.minimum.reduceat(place[cells.order], cells.start)[which] - wider_m
    high = np.maximum.reduceat(place[cells.order], cells.start)[which] + wider_m
    unit = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0).triangles_m
    return (low[:, None, None] + unit[None] * (high - low)[:, None, None]).reshape(-1, 3, 3)
