"""Shapes that a scenario can put in front of the sensor without a ray caster: beams whose geometry is a formula.

Each shape is one class: its keys as they stand in a `[[beams]]` table, and `geometry`, which gives the range and the
angle of incidence of every beam. A new shape is a class here and its name in `BeamShape`.
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray, IntArray
from lidarcheck.config.schema import Config
from lidarcheck.scan import IdealScan
from lidarcheck.scenes.files.spans import Span
from lidarcheck.scenes.firing import places
from lidarcheck.sensor import Beams, reference_beams

__all__ = [
    "BeamShape",
    "Ground",
    "Incidence",
    "Nothing",
    "Panels",
    "Shape",
    "Stripes",
    "Surface",
    "Target",
    "Wall",
    "lay_beams",
]

_MAX_RANGE_M = 1000.0


_Number = Annotated[int, Field(ge=0, le=1_000_000_000)]
_Count = Annotated[int, Field(ge=1, le=10_000_000)]
_RangeM = Annotated[float, Field(gt=0.0, le=_MAX_RANGE_M)]
_AngleDeg = Annotated[float, Field(ge=0.0, lt=90.0)]


class Aimed(NamedTuple):
    """Beams of a shape, shape (n,), with their unit vectors and where they begin [m], (n, 3); None: all at 0."""

    layer: IntArray
    point: IntArray
    direction: FloatArray
    origin_m: FloatArray | None


class Geometry(NamedTuple):
    """What the beams of a shape meet, shape (n,) each: way [m], 0 for nothing; incidence [deg]; object from 0.

    `material_id`: None where all of it is the shape's material.
    """

    range_m: FloatArray
    incidence_deg: FloatArray
    object_index: IntArray
    material_id: IntArray | None = None


class Shape(Config, abc.ABC):
    """What every `[[beams]]` table has: its beams as [first, last], both included, and the ID of its first object."""

    layers: Span
    points: Span
    material: _Number = 0
    object: _Number | None = None

    @property
    def objects(self) -> int:
        """How many objects the shape consists of."""
        return 1

    def beams(self) -> tuple[IntArray, IntArray]:
        """(layer, point) of every beam, layer by layer."""
        layer = np.arange(self.layers[0], self.layers[1] + 1, dtype=np.int32)
        point = np.arange(self.points[0], self.points[1] + 1, dtype=np.int32)
        return np.repeat(layer, len(point)), np.tile(point, len(layer))

    def aimed(self, beams: Beams) -> Aimed:
        """The shape's beams as the sensor has them."""
        layer, point = self.beams()
        return Aimed(layer, point, beams.directions(layer, point), beams.origins_m(layer, point))

    @property
    def spans(self) -> dict[str, tuple[int, int]]:
        """The keys that name layers and points of the sensor."""
        return {"layers": self.layers, "points": self.points}

    def fault(self, beams: Beams) -> str:
        """What keeps the shape from standing before those beams, and what to do, after "; "; empty for nothing."""
        layer, point = self.beams()
        strange = np.flatnonzero(~beams.has(layer, point))
        if not len(strange):
            return ""
        return f"the sensor has no beam of Layer {layer[strange[0]]}, Point {point[strange[0]]}; use others"

    @abc.abstractmethod
    def geometry(self, aimed: Aimed) -> Geometry:
        """What those beams meet."""

    def _swept(self, point: IntArray, span: tuple[float, float]) -> FloatArray:
        """From span[0] at the first point to span[1] at the last, in equal steps."""
        first, last = self.points
        share = (point - first) / max(last - first, 1)
        return span[0] + share * (span[1] - span[0])


class Surface(Shape):
    """An endless surface perpendicular to each beam; its range is swept over the points from `range_m[0]` to `[1]`."""

    shape: Literal["surface"]
    material: _Number
    range_m: tuple[_RangeM, _RangeM]

    def geometry(self, aimed: Aimed) -> Geometry:
        """R swept, incidence 0."""
        return _one_object(self._swept(aimed.point, self.range_m), np.zeros(len(aimed.point)))


class _Plane(Shape):
    """A plane: R = (its distance from 0 - n·o)/(n·d) of a beam from o along d, n being the unit vector towards it."""

    def fault(self, beams: Beams) -> str:
        """A beam that does not look at the plane."""
        wrong, aimed = super().fault(beams), self.aimed(beams)
        if wrong or (self._cosine(aimed.direction).min() > 0.0 and self.geometry(aimed).range_m.min() > 0.0):
            return wrong
        return f"some of these beams look past the {type(self).__name__.lower()}; use other points, or turn it less"

    @abc.abstractmethod
    def _cosine(self, vectors: FloatArray) -> FloatArray:
        """n·v for each row."""

    def _way_m(self, aimed: Aimed, away_m: FloatArray | float) -> FloatArray:
        before = away_m if aimed.origin_m is None else away_m - self._cosine(aimed.origin_m)
        return np.asarray(before / self._cosine(aimed.direction))


class Panels(_Plane):
    """Flat panels at X = `x_m`, facing the sensor: R = x/(cosθ cosφ), incidence = arccos(cosθ cosφ).

    Several panels share the layers evenly, from the lowest layer up, and are an object each.
    """

    shape: Literal["panels"]
    material: _Number
    x_m: tuple[_RangeM, ...]

    @model_validator(mode="after")
    def _even(self) -> Panels:
        if not self.x_m:
            raise ValueError("x_m is empty; add the X of a panel")
        layers = self.layers[1] - self.layers[0] + 1
        if layers % len(self.x_m):
            raise ValueError(
                f"{layers} layers cannot be shared evenly by {len(self.x_m)} panels; "
                f"use a multiple of {len(self.x_m)} layers"
            )
        return self

    @property
    def objects(self) -> int:
        """A panel is an object."""
        return len(self.x_m)

    def geometry(self, aimed: Aimed) -> Geometry:
        """R and incidence on the planes X = x."""
        layers_each = (self.layers[1] - self.layers[0] + 1) // len(self.x_m)
        panel = ((aimed.layer - self.layers[0]) // layers_each).astype(np.int32)
        incidence = np.rad2deg(elementary.arccos(np.maximum(self._cosine(aimed.direction), -1.0)))
        return Geometry(self._way_m(aimed, np.array(self.x_m)[panel]), incidence, panel)

    def _cosine(self, vectors: FloatArray) -> FloatArray:
        return vectors[:, 0]


class Incidence(Shape):
    """A surface at one range whose incidence is swept over the points from `incidence_deg[0]` to `[1]`."""

    shape: Literal["incidence"]
    material: _Number
    range_m: _RangeM
    incidence_deg: tuple[_AngleDeg, _AngleDeg]

    def geometry(self, aimed: Aimed) -> Geometry:
        """R constant, incidence swept."""
        return _one_object(np.full(len(aimed.point), self.range_m), self._swept(aimed.point, self.incidence_deg))


class Wall(_Plane):
    """A flat wall that stands upright, through X = `x_m` on the X axis, turned by `turn_deg` about Z.

    Its normal is n = -(cos t, sin t, 0): R = x cos t/(-n·d), incidence = arccos(-n·d). Turned to positive angles, what
    lies to the left is nearer.
    """

    shape: Literal["wall"]
    material: _Number
    x_m: _RangeM
    turn_deg: Annotated[float, Field(gt=-90.0, lt=90.0)]

    def geometry(self, aimed: Aimed) -> Geometry:
        """R and incidence on the turned plane."""
        away_m = self.x_m * elementary.cos(np.deg2rad(self.turn_deg))
        return _one_object(self._way_m(aimed, away_m), _angle_deg(self._cosine(aimed.direction)))

    def _cosine(self, vectors: FloatArray) -> FloatArray:
        turn = np.deg2rad(self.turn_deg)
        return np.asarray(vectors[:, 0] * elementary.cos(turn) + vectors[:, 1] * elementary.sin(turn))


class Ground(_Plane):
    """A level ground, `height_m` below the sensor: R = h/sin(-φ), incidence = 90° + φ."""

    shape: Literal["ground"]
    material: _Number
    height_m: _RangeM

    def fault(self, beams: Beams) -> str:
        """A layer that looks above the horizon."""
        layer = np.arange(self.layers[0], self.layers[1] + 1)
        above = layer[beams.directions(layer, np.full(len(layer), self.points[0]))[:, 2] >= 0.0]
        if not len(above):
            return super().fault(beams)
        return f"layer {above[-1]} looks above the horizon; use layers that look below it"

    def geometry(self, aimed: Aimed) -> Geometry:
        """R and incidence on the plane Z = -h."""
        return _one_object(self._way_m(aimed, self.height_m), _angle_deg(self._cosine(aimed.direction)))

    def _cosine(self, vectors: FloatArray) -> FloatArray:
        return -vectors[:, 2]


class _TwoParts(Shape):
    """Something perpendicular to each beam at `range_m`, and beside it something at `behind_m`, or nothing.

    The front is the shape's first object, what is behind the second. `behind_material` is the front's if left out.
    """

    material: _Number
    range_m: _RangeM
    behind_m: _RangeM | None = None
    behind_material: _Number | None = None

    @property
    def objects(self) -> int:
        """The front and what is behind."""
        return 2

    def geometry(self, aimed: Aimed) -> Geometry:
        """R of either part, incidence 0."""
        front = self.front(aimed.layer, aimed.point)
        behind = self.material if self.behind_material is None else self.behind_material
        range_m = np.where(front, self.range_m, self.behind_m or 0.0)
        material = np.where(front, self.material, behind).astype(np.int32)
        return Geometry(range_m, np.zeros(len(front)), np.where(front, 0, 1).astype(np.int32), material)

    @abc.abstractmethod
    def front(self, layer: IntArray, point: IntArray) -> npt.NDArray[np.bool_]:
        """Which of those beams meet the front."""


class Target(_TwoParts):
    """A rectangle of beams, `target_layers` x `target_points`, in front of a background or of nothing."""

    shape: Literal["target"]
    target_layers: Span
    target_points: Span

    @model_validator(mode="after")
    def _inside(self) -> Target:
        for name in ("layers", "points"):
            (first, last), (low, high) = getattr(self, f"target_{name}"), getattr(self, name)
            if first < low or last > high:
                raise ValueError(f"target_{name} = [{first}, {last}] is not within {name} = [{low}, {high}]")
        return self

    def front(self, layer: IntArray, point: IntArray) -> npt.NDArray[np.bool_]:
        """The beams of the rectangle."""
        (low, high), (left, right) = self.target_layers, self.target_points
        return (layer >= low) & (layer <= high) & (point >= left) & (point <= right)


class Stripes(_TwoParts):
    """Stripes at two ranges in turn, each `width` points (or layers, where `across` says so) wide, the front first."""

    shape: Literal["stripes"]
    across: Literal["points", "layers"] = "points"
    width: _Count

    def front(self, layer: IntArray, point: IntArray) -> npt.NDArray[np.bool_]:
        """The beams of every other stripe, from the first on."""
        place, first = (point, self.points[0]) if self.across == "points" else (layer, self.layers[0])
        return np.asarray((place - first) // self.width % 2 == 0)


class Nothing(Shape):
    """Beams that meet nothing: background only."""

    shape: Literal["nothing"]

    def geometry(self, aimed: Aimed) -> Geometry:
        """Range 0 says that the beam meets nothing."""
        return _one_object(np.zeros(len(aimed.point)), np.zeros(len(aimed.point)))


BeamShape = Annotated[
    Surface | Panels | Incidence | Wall | Ground | Target | Stripes | Nothing, Field(discriminator="shape")
]
"""Every shape that a `[[beams]]` table may name."""


def lay_beams(shapes: Sequence[Shape], beams: Beams | None = None) -> tuple[IdealScan, IntArray]:
    """The ideal scan of all shapes, one after another, and for each of its rows the index of its shape, shape (n,).

    `beams`: the sensor's, those of SMART and SLIM where None; no shape has a `fault` with them. Objects without an ID
    of their own are numbered from 1 in the order of the file.
    """
    beams = reference_beams() if beams is None else beams
    tables = []
    next_object = 1
    for shape in shapes:
        aimed = shape.aimed(beams)
        seen = shape.geometry(aimed)
        n = len(aimed.layer)
        first = next_object if shape.object is None else shape.object
        next_object = max(next_object, first + shape.objects)
        material = np.full(n, shape.material, dtype=np.int32) if seen.material_id is None else seen.material_id
        objects = first + seen.object_index
        tables.append((aimed.layer, aimed.point, seen.range_m, material, seen.incidence_deg, objects))
    layer, point, range_m, material, incidence, objects = (
        np.concatenate(column) for column in zip(*tables, strict=True)
    )
    extra = places(beams, layer, point, range_m)
    ideal = IdealScan(layer, point, range_m, material, incidence, object_id=objects, extra=extra, beams=beams)
    return ideal, np.repeat(np.arange(len(shapes), dtype=np.int32), [len(table[0]) for table in tables])


def _one_object(range_m: FloatArray, incidence_deg: FloatArray) -> Geometry:
    return Geometry(range_m, incidence_deg, np.zeros(len(range_m), dtype=np.int32))


def _angle_deg(cosine: FloatArray) -> FloatArray:
    return np.asarray(np.rad2deg(elementary.arccos(np.minimum(cosine, 1.0))))
