"""Scenes: streets, laboratories and traffic signs, every frame another arrangement."""

import math

import numpy as np

from .rays import Rectangle, Scene, facing

LAYERS, POINT_RANGE = range(210, 306), range(430, 526)
SENSOR_HEIGHT_M = 1.6
ASPHALT, PANEL_10, PANEL_50, PANEL_80, CAR, CONCRETE, SIGN, VEGETATION, GLASS = range(1, 10)
TABLE: dict[int, tuple[str, float, float]] = {  # name, reflectance, retro gain (0: Lambertian)
    ASPHALT: ("asphalt", 0.12, 0.0),
    PANEL_10: ("panel_10", 0.1, 0.0),
    PANEL_50: ("panel_50", 0.5, 0.0),
    PANEL_80: ("panel_80", 0.8, 0.0),
    CAR: ("car_paint", 0.35, 0.0),
    CONCRETE: ("concrete", 0.3, 0.0),
    SIGN: ("sign", 0.6, 900.0),
    VEGETATION: ("vegetation", 0.25, 0.0),
    GLASS: ("glass", 0.05, 0.0),
}
KINDS = ("street", "lab", "sign")


FIRST_CAR = 101
"""Cars are numbered from here on: a number is one object in all frames, whatever else is in view."""


class Builder:
    """Collects rectangles, an object number for each thing."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.rectangles: list[Rectangle] = []
        self.things, self.cars = 0, 0

    def draw(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def plate(
        self, range_m: float, at: tuple[float, float], size_m: tuple[float, float], material: int, turn_deg: float = 0.0
    ) -> None:
        """An upright plate at (azimuth, elevation) [deg]."""
        self.things += 1
        centre, along, up = facing(range_m, at[0], at[1], turn_deg)
        self.rectangles.append(Rectangle(centre, along, up, (size_m[0] / 2, size_m[1] / 2), material, self.things))

    def ground(self, material: int) -> None:
        self.things += 1
        half = (250.0, 250.0)
        self.rectangles.append(
            Rectangle((200.0, 0.0, -SENSOR_HEIGHT_M), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), half, material, self.things)
        )

    def box(
        self,
        near_m: float,
        azimuth_deg: float,
        size_m: tuple[float, float, float],
        material: int,
        turn_deg: float,
        number: int | None = None,
    ) -> None:
        """A box of (length, width, height) that stands on the ground, its near end at a range; one object."""
        self.things += 1
        number = number or self.things
        length, width, height = size_m
        a, t = math.radians(azimuth_deg), math.radians(azimuth_deg + turn_deg)
        ahead, left = np.array([math.cos(t), math.sin(t), 0.0]), np.array([-math.sin(t), math.cos(t), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        near = np.array([near_m * math.cos(a), near_m * math.sin(a), height / 2 - SENSOR_HEIGHT_M])
        middle = near + ahead * length / 2
        for centre, u, v, half in (
            (near, left, up, (width / 2, height / 2)),
            (middle + left * width / 2, ahead, up, (length / 2, height / 2)),
            (middle - left * width / 2, ahead, up, (length / 2, height / 2)),
            (middle + up * height / 2, ahead, left, (length / 2, width / 2)),
        ):
            c, along, across = (tuple(float(x) for x in vector) for vector in (centre, u, v))
            self.rectangles.append(Rectangle(c, along, across, half, material, number))  # type: ignore[arg-type]

    def wall(self, range_m: float, material: int, span_deg: tuple[float, float], top_deg: float) -> None:
        """An upright wall across part of the view, from the ground to an elevation."""
        at = (span_deg[0] + span_deg[1]) / 2
        width = 2 * range_m * math.tan(math.radians((span_deg[1] - span_deg[0]) / 2))
        top_m = range_m * math.tan(math.radians(top_deg))
        middle_m = (top_m - SENSOR_HEIGHT_M) / 2
        self.plate(
            math.hypot(range_m, middle_m),
            (at, math.degrees(math.atan2(middle_m, range_m))),
            (width, top_m + SENSOR_HEIGHT_M),
            material,
        )

    def facade(self, side: int, offset_m: float, span_m: tuple[float, float], material: int, height_m: float) -> None:
        """A wall along the road at a distance to the side (1: left)."""
        self.things += 1
        centre = ((span_m[0] + span_m[1]) / 2, side * offset_m, height_m / 2 - SENSOR_HEIGHT_M)
        half = ((span_m[1] - span_m[0]) / 2, height_m / 2)
        self.rectangles.append(Rectangle(centre, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), half, material, self.things))


def _background(b: Builder) -> None:
    """What closes the view: a wall of concrete, vegetation, both, or partly the sky."""
    choice = b.rng.integers(4)
    split = b.draw(-3.0, 3.0)
    if choice == 0:
        b.wall(b.draw(100, 145), CONCRETE, (-7.0, 7.0), 3.0)
    elif choice == 1:
        b.wall(b.draw(110, 150), VEGETATION, (-7.0, 7.0), 3.0)
    elif choice == 2:
        b.wall(b.draw(90, 130), CONCRETE, (split, 7.0), b.draw(1.0, 3.0))
        b.wall(b.draw(120, 150), VEGETATION, (-7.0, split), 3.0)
    else:
        b.wall(b.draw(80, 140), CONCRETE, (-5.0, 4.0), b.draw(0.8, 1.9))


def _car(b: Builder, near_m: float, azimuth_deg: float) -> None:
    size = (b.draw(3.8, 4.8), b.draw(1.6, 1.9), b.draw(1.4, 1.9))
    b.box(near_m, azimuth_deg, size, CAR, b.draw(-25, 25) - azimuth_deg, FIRST_CAR + b.cars)
    b.cars += 1


def street(b: Builder) -> None:
    """Road, facade to a side, cars, poles, a panel, a sign."""
    b.ground(ASPHALT)
    _background(b)
    side = 1 if b.rng.random() < 0.5 else -1
    b.facade(side, b.draw(4.5, 8.0), (b.draw(45, 60), b.draw(85, 120)), CONCRETE, b.draw(5, 9))
    first, second = sorted(b.rng.uniform(16, 75, 2))
    _car(b, float(first), b.draw(-5, 5))
    _car(b, float(second), b.draw(-5, 5))
    for _ in range(int(b.rng.integers(1, 4))):
        b.box(b.draw(9, 60), b.draw(-5.5, 5.5), (0.25, 0.25, 6.0), CONCRETE, 0.0)
    if b.rng.random() < 0.7:
        b.plate(
            b.draw(9, 60), (b.draw(-4, 4), b.draw(-1, 0.5)), (b.draw(1, 2), b.draw(1, 1.8)), PANEL_80, b.draw(-40, 40)
        )
    if b.rng.random() < 0.6:
        sign_m = b.draw(25, 70)
        b.plate(sign_m, (b.draw(-4, 4), b.draw(0.6, 1.5)), (0.8, 0.8), SIGN, b.draw(-8, 8))


def lab(b: Builder) -> None:
    """Panels of 10, 50 and 80 % at many ranges and angles before a wall, open at its edges."""
    b.ground(CONCRETE)
    edge = b.draw(4.5, 7.0)
    b.wall(b.draw(70, 130), CONCRETE, (-edge, b.draw(4.5, 7.0)), b.draw(1.6, 3.0))
    places = b.rng.permutation(np.linspace(-5.2, 4.8, 6))
    ranges = np.sort(np.exp(b.rng.uniform(np.log(8), np.log(110), 6)))
    kinds = b.rng.permutation([PANEL_10, PANEL_50, PANEL_80, PANEL_10, PANEL_50, PANEL_80])
    for range_m, at, kind in zip(ranges, places, kinds, strict=True):
        turn = b.draw(-65, 65) if b.rng.random() < 0.6 else 0.0
        width = float(range_m) * math.radians(b.draw(1.2, 2.0)) / math.cos(math.radians(turn))
        height = float(range_m) * math.radians(b.draw(1.0, 2.6))
        b.plate(float(range_m), (float(at), b.draw(-1.0, 1.0)), (width, height), int(kind), turn)


def sign(b: Builder) -> None:
    """Retro-reflecting signs: one whose double range lies free before the background, and a far one."""
    b.ground(ASPHALT)
    b.wall(150.0, VEGETATION if b.rng.random() < 0.6 else CONCRETE, (-7.0, 7.0 if b.rng.random() < 0.7 else 3.5), 3.0)
    left = b.draw(-4.5, 1.0)
    b.plate(b.draw(22, 62), (left, b.draw(-0.3, 0.9)), (b.draw(0.5, 0.9), b.draw(0.5, 0.9)), SIGN, b.draw(-6, 6))
    b.plate(
        b.draw(85, 135),
        (left + b.draw(1.5, 3.5), b.draw(-0.3, 0.6)),
        (b.draw(0.9, 1.6), b.draw(0.9, 1.6)),
        SIGN,
        b.draw(-6, 6),
    )
    _car(b, b.draw(15, 75), b.draw(-5.0, 5.0))
    if b.rng.random() < 0.5:
        b.box(b.draw(15, 60), b.draw(-5.5, 5.5), (0.25, 0.25, 6.0), CONCRETE, 0.0)


def glass_front(b: Builder) -> None:
    """A facade of glass along the road and, beyond the view, the houses that it also shows."""
    side = 1 if b.rng.random() < 0.5 else -1
    offset = b.draw(2.2, 4.0)
    b.facade(side, offset, (b.draw(20, 30), b.draw(60, 80)), GLASS, b.draw(4, 6))
    b.facade(-side, b.draw(10, 16), (20.0, 150.0), CONCRETE, 8.0)


BUILDERS = {"street": street, "lab": lab, "sign": sign}


def arrange(kind: str, seed: list[int], glass: bool) -> Scene:
    """One arrangement of a kind of scene."""
    b = Builder(np.random.default_rng(seed))
    BUILDERS[kind](b)
    if glass:
        glass_front(b)
    return Scene(tuple(b.rectangles), kind)
