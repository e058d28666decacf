"""The shapes that a scene file can name: the keys of each, and the triangles that they stand for.

Each shape is one class: its keys as they stand in an `[[objects]]` table, and `facets`, which gives its surface in the
shape's own frame. A new shape is a class here and its name in `ObjectTable`.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from lidarcheck.config.schema import Config, PathText
from lidarcheck.scenes import Facets
from lidarcheck.scenes.facets import box, cylinder, ellipsoid, floor, joined, wall
from lidarcheck.scenes.meshes import load_mesh
from lidarcheck.scenes.vehicles import BUILDERS, Paint, person, tree

__all__ = ["ObjectTable", "Position", "ShapeTable", "Velocity", "entries"]


def entries(count: int, words: str) -> Callable[[object], object]:
    """A check that a list has that many entries, which pydantic would say less plainly."""

    def check(value: object) -> object:
        if isinstance(value, list | tuple) and len(value) != count:
            raise ValueError(f"{len(value)} {'entry' if len(value) == 1 else 'entries'}; write {words}")
        return value

    return check


def _number(low: float | None = None, high: float = 2000.0, *, above: float | None = None, unit: str = "m") -> Any:
    return Field(ge=low, gt=above, le=high, json_schema_extra={"unit": unit})


_Coordinate = Annotated[float, _number(-2000.0)]
_Speed = Annotated[float, _number(-150.0, 150.0, unit="m/s")]
_Angle = Annotated[float, _number(-360.0, 360.0, unit="deg")]
_Length = Annotated[float, _number(above=0.0)]
_Material = Annotated[int, Field(ge=0, le=2**31 - 1)]
_Sides = Annotated[int, Field(ge=3, le=720)]
_Size2 = Annotated[tuple[_Length, _Length], BeforeValidator(entries(2, "[length, width]"))]
_Size3 = Annotated[tuple[_Length, _Length, _Length], BeforeValidator(entries(3, "[length, width, height]"))]
Position = Annotated[tuple[_Coordinate, _Coordinate, _Coordinate], BeforeValidator(entries(3, "[x, y, z]"))]
Velocity = Annotated[tuple[_Speed, _Speed, _Speed], BeforeValidator(entries(3, "[vx, vy, vz]"))]


class ShapeTable(Config, abc.ABC):
    """What every `[[objects]]` table has: where it stands, how it is turned, its motion, its copies."""

    name: Annotated[str, Field(min_length=1, max_length=80)] | None = None
    position_m: Position
    yaw_deg: _Angle = 0.0
    pitch_deg: _Angle = 0.0
    roll_deg: _Angle = 0.0
    velocity_m_s: Velocity = (0.0, 0.0, 0.0)
    object: Annotated[int, Field(ge=0, le=1_000_000_000)] | None = None
    copies: Annotated[int, Field(ge=1, le=1000)] = 1
    step_m: Position = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _copies_apart(self) -> ShapeTable:
        if self.copies > 1 and not any(self.step_m):
            raise ValueError(
                f"{self.copies} copies would stand in one place; add step_m = [x, y, z] from one to the next"
            )
        if self.copies == 1 and any(self.step_m):
            raise ValueError("step_m stands without copies; add copies = 2 or more, or remove it")
        return self

    @abc.abstractmethod
    def facets(self, directory: Path) -> Facets:
        """The surface about the shape's own origin; files are looked for from `directory`."""


class Plane(ShapeTable):
    """A level rectangle about its centre: `size_m` along X and Y."""

    shape: Literal["plane"]
    size_m: _Size2
    material: _Material

    def facets(self, directory: Path) -> Facets:
        """Two triangles."""
        return floor(*self.size_m, self.material)


class Box(ShapeTable):
    """A box that stands on its position: `size_m` along X, Y and Z."""

    shape: Literal["box"]
    size_m: _Size3
    material: _Material

    def facets(self, directory: Path) -> Facets:
        """Twelve triangles."""
        length, width, height = (float(size) for size in self.size_m)
        return box((-length / 2.0, -width / 2.0, 0.0), (length / 2.0, width / 2.0, height), self.material)


class PanelShape(ShapeTable):
    """An upright rectangle about its centre, which faces the sensor at yaw 0."""

    shape: Literal["panel"]
    width_m: _Length
    height_m: _Length
    material: _Material

    def facets(self, directory: Path) -> Facets:
        """Two triangles."""
        return wall(self.width_m, self.height_m, self.material)


class SignShape(ShapeTable):
    """A traffic sign about the centre of its face; its back, 2 cm behind; and a post, unless `post_m` is left out."""

    shape: Literal["sign"]
    width_m: _Length
    height_m: _Length
    material: _Material
    back_material: _Material = 13
    post_m: _Length | None = None
    post_diameter_m: _Length = 0.076
    post_material: _Material = 13

    def facets(self, directory: Path) -> Facets:
        """The post reaches from the sign's upper edge `post_m` down below its lower one."""
        face = wall(self.width_m, self.height_m, self.material)
        back = wall(self.width_m, self.height_m, self.back_material, centre_m=(0.02, 0.0, 0.0))
        if self.post_m is None:
            return joined(face, back)
        post = cylinder(self.post_diameter_m, self.height_m + self.post_m, self.post_material, sides=12)
        behind = [0.03 + self.post_diameter_m / 2.0, 0.0, -self.height_m / 2.0 - self.post_m]
        return joined(face, back, post._replace(triangles_m=post.triangles_m + behind))


class Pole(ShapeTable):
    """A cylinder that stands on its position, or a cone's stump with `top_diameter_m`."""

    shape: Literal["pole"]
    diameter_m: _Length
    height_m: _Length
    material: _Material
    top_diameter_m: Annotated[float, _number(0.0)] | None = None
    sides: _Sides = 32

    def facets(self, directory: Path) -> Facets:
        """`sides` facets and two caps."""
        top = -1.0 if self.top_diameter_m is None else self.top_diameter_m
        return cylinder(self.diameter_m, self.height_m, self.material, sides=self.sides, top_diameter_m=top)


class Ellipsoid(ShapeTable):
    """An ellipsoid about its centre: `size_m` are its diameters along X, Y and Z."""

    shape: Literal["ellipsoid"]
    size_m: _Size3
    material: _Material
    sides: _Sides = 24

    def facets(self, directory: Path) -> Facets:
        """`sides` meridians, half as many belts."""
        return ellipsoid(self.size_m, self.material, sides=self.sides)


class Mesh(ShapeTable):
    """A mesh file about its own origin."""

    shape: Literal["mesh"]
    file: PathText
    material: _Material
    scale: Annotated[float, Field(gt=0.0, le=1e6)] = 1.0
    up: Literal["z", "y"] | None = None

    def facets(self, directory: Path) -> Facets:
        """The file's triangles."""
        return load_mesh(directory / self.file, self.material, scale=self.scale, up=self.up)


class Vehicle(ShapeTable):
    """A car, van or truck that stands on its position about its middle and drives towards +X at yaw 0."""

    shape: Literal["car", "van", "truck"]
    material: _Material
    glass: _Material = 15
    plate: _Material = 18
    lamp: _Material = 19
    tyre: _Material = 14
    interior: _Material = 16
    marking: _Material = 20

    def facets(self, directory: Path) -> Facets:
        """Body, panes, plates, lamps, wheels; `marking` is the contour of a truck's box."""
        parts = (self.glass, self.plate, self.lamp, self.tyre, self.interior, self.marking)
        return BUILDERS[self.shape](Paint(self.material, *parts))


class Person(ShapeTable):
    """Somebody 1.75 m tall who stands on the position."""

    shape: Literal["person"]
    skin: _Material = 22
    clothing: _Material = 23

    def facets(self, directory: Path) -> Facets:
        """Legs, arms, body, head."""
        return person(self.skin, self.clothing)


class Tree(ShapeTable):
    """A tree that stands on its position."""

    shape: Literal["tree"]
    height_m: _Length
    crown_m: _Length
    bark: _Material = 10
    foliage: _Material = 9

    def facets(self, directory: Path) -> Facets:
        """A trunk and a crown of three balls."""
        return tree(self.height_m, self.crown_m, self.bark, self.foliage)


ObjectTable = Annotated[
    Plane | Box | PanelShape | SignShape | Pole | Ellipsoid | Mesh | Vehicle | Person | Tree,
    Field(discriminator="shape"),
]
"""Every shape that an `[[objects]]` table may name."""
