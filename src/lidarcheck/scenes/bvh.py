"""Which triangle a ray meets first: embree's bounding volume hierarchy, its single precision made good.

Embree finds the triangle in single precision (about 1e-5 m at 100 m); the distance to it is then computed again from
the triangle's plane in double precision. Which of two neighbouring triangles an edge belongs to is decided by embree.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray

__all__ = ["Bvh"]

_GRAZING = 1e-9
"""Below this cosine a plane tells no distance: embree's is taken."""

_ON_M = 1e-6
"""A surface so near is the one that the ray begins on; a distance of 0 would say that nothing is met."""

_AHEAD_M = (1e-4, 1e-3, 1e-2)
"""So far ahead the search goes on then: the first is beyond embree's precision, the others are for grazing rays."""


class Bvh:
    """Triangles, shape (n, 3, 3) in metres, that can be asked for the first one on a ray. Safe to share by threads."""

    def __init__(self, triangles_m: FloatArray) -> None:
        from embreex.mesh_construction import TriangleMesh  # type: ignore[import-untyped]
        from embreex.rtcore_scene import EmbreeScene  # type: ignore[import-untyped]

        edges = triangles_m[:, 1] - triangles_m[:, 0], triangles_m[:, 2] - triangles_m[:, 0]
        normal = np.cross(*edges)
        self.normal: FloatArray = normal / np.linalg.norm(normal, axis=1)[:, None]
        self._offset_m = np.einsum("ij,ij->i", self.normal, triangles_m[:, 0])
        # Robust: no ray slips through between two triangles that share an edge.
        self._scene: Any = EmbreeScene(robust=True)
        TriangleMesh(self._scene, np.ascontiguousarray(triangles_m, dtype=np.float32))
        # The first run builds the hierarchy, which threads must not do at the same time.
        self._scene.run(np.zeros((1, 3), dtype=np.float32), np.array([[1.0, 0.0, 0.0]], dtype=np.float32))

    def first(
        self, origin_m: FloatArray, direction: FloatArray
    ) -> tuple[npt.NDArray[np.int32], FloatArray, FloatArray]:
        """For rays, shape (n, 3) each: index of the triangle, -1 for none; distance [m], infinite for none; cosine.

        A surface within a micrometre of the ray's origin is passed over. The cosine is that between the ray and the
        triangle's `normal`, negative where the normal looks at the ray's origin; shape (n,) each.
        """
        face, near_m, cosine = self._seen(origin_m, direction, 0.0)
        for ahead_m in _AHEAD_M:
            rows = np.flatnonzero(near_m <= _ON_M)
            if not len(rows):
                break
            face[rows], near_m[rows], cosine[rows] = self._seen(origin_m[rows], direction[rows], ahead_m)
        else:
            on = near_m <= _ON_M
            face[on], near_m[on] = -1, np.inf
        return face, near_m, cosine

    def _seen(
        self, origin_m: FloatArray, direction: FloatArray, ahead_m: float
    ) -> tuple[npt.NDArray[np.int32], FloatArray, FloatArray]:
        """As `first`, of triangles at least `ahead_m` away, also that on which the ray begins."""
        begin_m = origin_m + ahead_m * direction if ahead_m else origin_m
        found = self._scene.run(_single(begin_m), _single(direction), output=1)
        face, near_m = found["primID"], found["tfar"].astype(np.float64) + ahead_m
        normal = self.normal[face]
        cosine = np.einsum("ij,ij->i", normal, direction)
        along_m = self._offset_m[face] - np.einsum("ij,ij->i", normal, origin_m)
        usable = np.abs(cosine) > _GRAZING
        np.divide(along_m, cosine, out=near_m, where=usable & (face >= 0))
        near_m[face < 0] = np.inf
        return face, near_m, cosine


def _single(vectors: FloatArray) -> npt.NDArray[np.float32]:
    return np.ascontiguousarray(vectors, dtype=np.float32)
