"""Changes that may make points and beams agree, each as something that is done to the echoes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.formats.geometry.check import angle_errors
from lidarcheck.formats.geometry.columns import on_columns
from lidarcheck.formats.geometry.lattice import Beams, Lattice
from lidarcheck.formats.geometry.pose import angles_of, fit_pose

__all__ = [
    "Change",
    "Echoes",
    "angle_units",
    "axis_orders",
    "layer_medians",
    "one_number",
    "per_layer",
    "poses",
    "renumbered",
]

_FITTED = 3000
"""Rows that a pose is fitted to."""
_FEWEST_POSED = 50
"""Rows below which six numbers may fit whatever there is."""
_MOST_CALIBRATION_DEG = 3.0
"""Two units of one kind of sensor differ by no more in any layer."""
_FEWEST_IN_LAYER = 5
"""Rows a layer, on average, below which its median would fit whatever there is."""
_MIRROR_Y = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Echoes:
    """The rows that are tried: `position` (n, 3) [m], `layer`, `point` (n,), how far rounding may have moved them.

    `direction` (n, 3): where their beams point, if not where the lattice says.
    """

    position: FloatArray
    layer: IntArray
    point: IntArray
    error_m: float
    lattice: Lattice
    direction: FloatArray | None = None

    @property
    def beams(self) -> Beams:
        """Where the rows' beams point."""
        beams = self.lattice.beams(self.layer, self.point)
        return beams if self.direction is None else replace(beams, direction=self.direction)

    def placed(self) -> tuple[FloatArray, Beams]:
        """The points as their beams see them, shape (n, 3): from where the beams start; and the beams.

        Where columns do not repeat, each is turned onto its own first.
        """
        beams = self.beams
        if not self.lattice.repeats:
            return on_columns(self.position, self.point, beams, self.lattice.column_deg), beams
        return self.position if beams.origin_m is None else self.position - beams.origin_m, beams

    def take(self, rows: slice) -> Echoes:
        """Those rows."""
        direction = None if self.direction is None else self.direction[rows]
        return replace(
            self, position=self.position[rows], layer=self.layer[rows], point=self.point[rows], direction=direction
        )

    def thinned(self, most: int) -> Echoes:
        """At most about so many rows, evenly taken."""
        return self.take(slice(None, None, max(1, -(-len(self.layer) // most))))


@dataclass(frozen=True)
class Change:
    """One change. `said`: what is wrong; `how`: what was done to make it fit; `fix`: what the user does or declares."""

    said: str
    how: str
    fix: str
    apply: Callable[[Echoes], Echoes]


def axis_orders(lattice: Lattice) -> list[Change]:
    """Every order of the axes with every sign but the one that there is: mirrors first."""
    matrices = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), list(order)] = signs
            matrices.append(matrix)
    changes = [_axes(matrix, lattice) for matrix in matrices if not np.array_equal(matrix, np.eye(3))]
    first = ("Y is mirrored", "X is mirrored", "Z is mirrored")
    return sorted(changes, key=lambda change: first.index(change.said) if change.said in first else len(first))


def _axes(matrix: FloatArray, lattice: Lattice) -> Change:
    """Points times a matrix of one ±1 a row."""

    def apply(echoes: Echoes) -> Echoes:
        return replace(echoes, position=echoes.position @ matrix.T)

    names = [("-" if row.sum() < 0 else "") + "XYZ"[int(np.argmax(np.abs(row)))] for row in matrix]
    mirrored = [axis for axis, name in zip("XYZ", names, strict=True) if name == f"-{axis}"]
    straight = all(name.endswith(axis) for axis, name in zip("XYZ", names, strict=True))
    if straight and len(mirrored) == 1:
        axis = mirrored[0]
        fix = lattice.line(f"mirror {axis.lower()}") or f"give --mirror {axis.lower()}"
        return Change(f"{axis} is mirrored", f"{axis} negated", fix, apply)
    turn, mirror = (matrix, "") if np.linalg.det(matrix) > 0.0 else (matrix @ _MIRROR_Y, "--mirror y ")
    angles = angles_of(turn)
    fix = f'give {mirror}--pose "0,0,0,{",".join(f"{angle + 0.0:g}" for angle in angles)}"'
    if not mirror and angles[:2] == (0.0, 0.0):
        fix = lattice.line("yaw", -angles[2]) or fix
    if straight:
        said = f"{', '.join(mirrored[:-1])} and {mirrored[-1]} are mirrored"
        return Change(said, f"{' and '.join(mirrored)} negated", fix, apply)
    return Change(f"the axes are in another order (X, Y, Z should be {', '.join(names)})", "that order", fix, apply)


def renumbered(lattice: Lattice) -> list[Change]:
    """Beams numbered from the other end, beside their number, or with the two numbers exchanged."""
    last_layer, last_point = lattice.layers - 1, lattice.points - 1

    def change(said: str, how: str, by: Callable[[IntArray, IntArray], tuple[IntArray, IntArray]]) -> Change:
        def apply(echoes: Echoes) -> Echoes:
            layer, point = by(echoes.layer, echoes.point)
            return replace(echoes, layer=layer, point=point)

        return Change(said, how, lattice.line(said) or f"renumber: {how}", apply)

    return [
        change("layers count from the other end", f"Layer = {last_layer} - Layer", lambda i, j: (last_layer - i, j)),
        change("points count from the other end", f"Point = {last_point} - Point", lambda i, j: (i, last_point - j)),
        change("layers are numbered one too high", "Layer = Layer - 1", lambda i, j: (i - 1, j)),
        change("layers are numbered one too low", "Layer = Layer + 1", lambda i, j: (i + 1, j)),
        change("points are numbered one too high", "Point = Point - 1", lambda i, j: (i, j - 1)),
        change("points are numbered one too low", "Point = Point + 1", lambda i, j: (i, j + 1)),
        change("Layer and Point are exchanged", "Layer and Point exchanged", lambda i, j: (j, i)),
    ]


def angle_units() -> list[Change]:
    """Points that were made from angles taken for degrees, or for radians."""

    def change(said: str, factor: float) -> Change:
        def apply(echoes: Echoes) -> Echoes:
            azimuth, elevation = (np.deg2rad(a * factor) for a in echoes.lattice.angles_deg(echoes.layer, echoes.point))
            return replace(echoes, direction=_direction(azimuth, elevation))

        return Change(said, "the angles so", "make X, Y, Z again from the angles", apply)

    return [
        change("X, Y, Z were made from degrees taken for radians", 180.0 / np.pi),
        change("X, Y, Z were made from radians taken for degrees", np.pi / 180.0),
    ]


def one_number(echoes: Echoes) -> Iterator[Change]:
    """A turn about Z, a shift of the elevations and a scale of them, each fitted; alone, then after a mirror."""
    lattice = echoes.lattice
    for first in (None, *axis_orders(lattice)[:3]):
        changed = echoes if first is None else first.apply(echoes)
        position = changed.position
        before, then = ("", "") if first is None else (f"{first.said} and ", first.fix)
        yaw = _yaw_deg(changed)
        said = f"{before}the points are turned by {-yaw:.4g} deg about Z"
        yield _turned(position, said, then, yaw, lattice.line("yaw", -yaw))
        relative, beams = changed.placed()
        (_, elevation), (_, own) = _angles(relative), _angles(beams.direction)
        shift = float(np.median(elevation - own))
        said = f"{before}elevations are {np.rad2deg(shift):+.4g} deg off"
        fix = lattice.line("elevation shift", float(np.rad2deg(shift)))
        yield _elevated(position, said, fix, lambda e, by=shift: e + by)  # type: ignore[misc]
        steep = np.abs(own) > np.median(np.abs(own))
        scale = float(np.median(elevation[steep] / own[steep])) if steep.any() else 1.0
        said = f"{before}elevations are {scale:.4g} times as large as they should be"
        fix = lattice.line("elevation scale", scale)
        yield _elevated(position, said, fix, lambda e, by=scale: e * by)  # type: ignore[misc]


def _yaw_deg(echoes: Echoes) -> float:
    """The turn about Z that brings the points onto their beams."""
    yaw, turned = 0.0, echoes
    # A beam that starts elsewhere than at 0 is seen right only once the points are turned.
    for _ in range(1 if echoes.beams.origin_m is None else 3):
        relative, beams = turned.placed()
        azimuth, own = _angles(relative)[0], _angles(beams.direction)[0]
        yaw += float(np.rad2deg(_circular_median(own - azimuth)))
        turned = replace(echoes, position=_about_z(echoes.position, yaw))
    return (yaw + 180.0) % 360.0 - 180.0 if abs(yaw) > 180.0 else yaw


def _about_z(position: FloatArray, yaw_deg: float) -> FloatArray:
    cosine, sine = np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))
    return np.asarray(position @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]))


def _turned(position: FloatArray, said: str, then: str, yaw_deg: float, line: str) -> Change:
    placed = _about_z(position, yaw_deg)
    pose = f'--pose "0,0,0,0,0,{round(yaw_deg, 5):g}"'
    mirror = f"{then.removeprefix('give ')} " if then.startswith("give --") else ""
    fix = " and ".join(part for part in (then, line) if part) if line else f"give {mirror}{pose}"
    return Change(said, "that taken out", fix, lambda echoes: replace(echoes, position=placed))


def _elevated(position: FloatArray, said: str, line: str, change: Callable[[FloatArray], FloatArray]) -> Change:
    """Beams with other elevations [rad]."""

    def apply(echoes: Echoes) -> Echoes:
        azimuth, elevation = _angles(echoes.beams.direction)
        return replace(echoes, position=position, direction=_direction(azimuth, change(elevation)))

    return Change(said, "that taken out", line or "make X, Y, Z again with the sensor's own elevations", apply)


def per_layer(echoes: Echoes) -> Iterator[Change]:
    """Each layer's own constants: another order of the layers, or another unit's calibration."""
    if len(echoes.layer) < _FEWEST_IN_LAYER * len(np.unique(echoes.layer)):
        return
    relative, beams = echoes.placed()
    around, up = (layer_medians(error, echoes.layer) for error in angle_errors(relative, beams.direction))
    layers = echoes.lattice.layers_beside(echoes.layer, up)
    if np.any(layers != echoes.layer) and layers.min() >= 0 and layers.max() < echoes.lattice.layers:
        yield Change(
            "layers are in another order",
            "each layer at the elevation of its points",
            echoes.lattice.line("layer order") or "give each echo the Layer of its beam",
            lambda e: replace(e, layer=layers.astype(np.int32)),
        )
    if float(np.max(np.abs(up))) <= _MOST_CALIBRATION_DEG and float(np.max(np.abs(around))) <= _MOST_CALIBRATION_DEG:

        def apply(e: Echoes) -> Echoes:
            azimuth, elevation = _angles(e.beams.direction)
            level = np.cos(elevation)
            return replace(e, direction=_direction(azimuth + np.deg2rad(around / level), elevation + np.deg2rad(up)))

        most = max(float(np.max(np.abs(up))), float(np.max(np.abs(around))))
        line = echoes.lattice.line("calibration", most)
        said = "each layer is off by a constant of its own, as with another unit's calibration"
        said += f": up to {most:.2g} deg" if line else ""
        yield Change(said, "the constants taken out", line or "make X, Y, Z again with this unit's angles", apply)


def layer_medians(error: FloatArray, layer: IntArray) -> FloatArray:
    """The median error of each row's layer, shape (n,)."""
    order = np.lexsort((error, layer))
    names, start, counts = np.unique(layer[order], return_index=True, return_counts=True)
    ordered = error[order]
    medians = 0.5 * (ordered[start + (counts - 1) // 2] + ordered[start + counts // 2])
    return np.asarray(medians[np.searchsorted(names, layer)])


def poses(echoes: Echoes) -> Iterator[Change]:
    """A rigid pose, alone, after a mirror, or with the layers from the other end."""
    if len(echoes.layer) < _FEWEST_POSED:
        return
    some = echoes.thinned(_FITTED)
    other_end = renumbered(echoes.lattice)[0]
    for mirror, layers in ((False, False), (True, False), (False, True)):
        sign = _MIRROR_Y if mirror else np.eye(3)
        beams = other_end.apply(some).beams if layers else some.beams
        turn, move = fit_pose(beams.direction, some.position @ sign, beams.origin_m)
        said = "Y is mirrored and " * mirror + f"{other_end.said} and " * layers + "the cloud stands in another frame"
        numbers = ",".join(f"{round(float(value), 5) + 0.0:g}" for value in (*move, *angles_of(turn)))
        fix = "give " + "--mirror y " * mirror + f'--pose "{numbers}"' + f", and {other_end.fix}" * layers

        def apply(
            e: Echoes, sign: FloatArray = sign, turn: FloatArray = turn, move: FloatArray = move, layers: bool = layers
        ) -> Echoes:
            own = other_end.apply(e) if layers else e
            return replace(own, position=e.position @ sign @ turn.T + move)

        yield Change(said, "that pose taken out", fix, apply)


def _angles(vector: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Azimuth and elevation [rad] of vectors, shape (n, 3)."""
    return np.arctan2(vector[:, 1], vector[:, 0]), np.arctan2(vector[:, 2], np.hypot(vector[:, 0], vector[:, 1]))


def _direction(azimuth: FloatArray, elevation: FloatArray) -> FloatArray:
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)


def _circular_median(angle: FloatArray) -> float:
    """A median of angles [rad]: about the middle of their directions."""
    middle = float(np.angle(np.median(np.cos(angle)) + 1j * np.median(np.sin(angle))))
    return middle + float(np.median((angle - middle + np.pi) % (2.0 * np.pi) - np.pi))
