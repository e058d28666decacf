"""The rays of a recording as an image: which lie beside which."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray, IntArray
from lidarcheck.sensor import Beams

__all__ = ["Rays"]

_WHOLE_TURN_DEG = 359.0


@dataclass(frozen=True)
class Rays:
    """The beams of all frames between their outermost layers and points, one after another by (layer, point).

    `first_layer`, `first_point`, `layers`, `points`: the block. `beams`: of the frame that is judged.
    """

    beams: Beams
    first_layer: int
    first_point: int
    layers: int
    points: int

    def __len__(self) -> int:
        return self.layers * self.points

    @functools.cached_property
    def layer(self) -> IntArray:
        """Layer of each ray, shape (n,)."""
        return np.repeat(np.arange(self.layers, dtype=np.int32), self.points) + np.int32(self.first_layer)

    @functools.cached_property
    def point(self) -> IntArray:
        """Point of each ray, shape (n,)."""
        return np.tile(np.arange(self.points, dtype=np.int32), self.layers) + np.int32(self.first_point)

    def index(self, layer: IntArray, point: IndexArray) -> IndexArray:
        """The ray of each beam, shape (m,); -1 for one outside of the block."""
        down, along = layer.astype(np.int64) - self.first_layer, point.astype(np.int64) - self.first_point
        inside = (down >= 0) & (down < self.layers) & (along >= 0) & (along < self.points)
        return np.where(inside, down * self.points + along, -1)

    @functools.cached_property
    def _cell(self) -> IndexArray:
        """The cell of the image of each ray, rows by elevation, columns as they lie together."""
        elevation, _ = self.beams.angles_deg(
            np.arange(self.layers) + self.first_layer, np.full(self.layers, self.first_point)
        )
        rank = np.argsort(np.argsort(elevation, kind="stable"), kind="stable")
        row = rank[self.layer - self.first_layer]
        column = np.asarray(self.beams.image_column(self.layer, self.point), dtype=np.int64)
        if not self._turns:
            # A sector's columns lie together wherever the image of a whole turn is cut.
            column = np.mod(column - self.first_point + self.beams.points // 4, self.beams.points)
            column -= column.min()
        return row * self._width + column

    @functools.cached_property
    def _turns(self) -> bool:
        if self.first_point or self.points < self.beams.points:
            return False
        return self.points * self.aside_deg > _WHOLE_TURN_DEG

    @functools.cached_property
    def aside_deg(self) -> float:
        """From a ray to the next of its layer [deg]."""
        return float(np.median(self.beams.spacing_deg(self.layer[:1], self.point[:1])[1]))

    @functools.cached_property
    def _width(self) -> int:
        return self.beams.points if not self._turns else self.points

    @functools.cached_property
    def there(self) -> BoolArray:
        """The cells that have a ray, shape (layers, width)."""
        return np.asarray(self.image(np.ones(len(self), dtype=np.bool_), False), dtype=np.bool_)

    def image(self, column: npt.NDArray[np.generic], fill: float | bool) -> npt.NDArray[np.generic]:
        """A column of the rays as an image, shape (layers, width), with `fill` in the place of rays that are none."""
        found = np.full(self.layers * self._width, fill, dtype=column.dtype)
        found[self._cell] = column
        return found.reshape(self.layers, self._width)

    def of_image(self, image: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
        """The image's cells as a column of the rays, shape (n,)."""
        return image.reshape(-1)[self._cell]

    def moved(
        self, image: npt.NDArray[np.generic], down: int, along: int, fill: float | bool
    ) -> npt.NDArray[np.generic]:
        """What stands `down` rows and `along` columns further, in the place of each cell; around a whole turn."""
        found = np.full_like(image, fill)
        rows = slice(max(-down, 0), self.layers - max(down, 0))
        source = image[max(down, 0) : self.layers + min(down, 0)]
        if self._turns:
            found[rows] = np.roll(source, -along, axis=1)
        elif abs(along) < self._width:
            columns = slice(max(-along, 0), self._width - max(along, 0))
            found[rows, columns] = source[:, max(along, 0) : self._width + min(along, 0)]
        return found

    def around(self, reach: tuple[int, int] = (1, 1)) -> Iterator[tuple[int, int]]:
        """The steps to the neighbours of a ray within so many rows and columns, itself left out."""
        for down in range(-reach[0], reach[0] + 1):
            for along in range(-reach[1], reach[1] + 1):
                if down or along:
                    yield down, along

    @functools.cached_property
    def angles(self) -> tuple[FloatArray, FloatArray]:
        """Elevation and azimuth of each ray [rad], shape (n,)."""
        elevation, azimuth = self.beams.angles_deg(self.layer, self.point)
        return np.deg2rad(elevation), np.deg2rad(azimuth)
