"""Small scenes for any field of view: a street for turning heads, a bench for a chip of short range."""

import math

import numpy as np

from hidden.places import CAR, CONCRETE, PANEL_10, PANEL_50, PANEL_80, SIGN, TABLE, VEGETATION, Builder
from hidden.rays import Rectangle, Scene

MATERIALS = {m: TABLE[m] for m in (1, PANEL_10, PANEL_50, PANEL_80, CAR, CONCRETE, SIGN, VEGETATION)}
OFTEN = {"street": (1, CONCRETE, PANEL_50), "bench": (PANEL_50, PANEL_80, CONCRETE)}
"""Materials that every case of a kind of scene shows."""


def street(b: Builder, half_deg: float) -> None:
    """Ground, a wall that leaves some sky, a facade, boxes, panels at all angles, a sign whose double range is free."""
    b.ground(1)
    away = b.draw(60, 85)
    b.wall(away, CONCRETE if b.rng.random() < 0.6 else VEGETATION, (-2.0 * half_deg, b.draw(0.3, 2.0) * half_deg), 5.0)
    side = 1 if b.rng.random() < 0.5 else -1
    b.facade(side, b.draw(4.0, 8.0), (b.draw(20, 30), b.draw(40, 60)), CONCRETE, b.draw(5, 9))
    for _ in range(2):
        size = (b.draw(3.8, 4.8), b.draw(1.6, 1.9), b.draw(1.4, 1.9))
        b.box(b.draw(8, 40), b.draw(-0.8, 0.8) * half_deg, size, CAR, b.draw(-25, 25))
    for material in (PANEL_10, PANEL_50, PANEL_80, PANEL_50):
        range_m = math.exp(b.draw(math.log(6), math.log(45)))
        size = (range_m * math.radians(b.draw(2, 4)), range_m * math.radians(b.draw(4, 8)))
        b.plate(range_m, (b.draw(-0.9, 0.9) * half_deg, b.draw(-3, 3)), size, material, b.draw(-65, 65))
    sign_m = b.draw(14, 26)
    size = (sign_m * math.radians(2.0), sign_m * math.radians(4.0))
    b.plate(sign_m, (b.draw(-0.6, 0.6) * half_deg, b.draw(0.0, 2.5)), size, SIGN, b.draw(-8, 8))


def bench(b: Builder, half_deg: float) -> None:
    """A board before a back wall within two metres, and a box: a chip of a few zones."""
    b.plate(b.draw(0.8, 1.45), (0.0, 0.0), (6.0, 6.0), CONCRETE if b.rng.random() < 0.5 else PANEL_80, b.draw(-30, 30))
    for material in (PANEL_50, PANEL_80, PANEL_10):
        at = (b.draw(-0.8, 0.8) * half_deg, b.draw(-0.8, 0.8) * half_deg)
        b.plate(b.draw(0.25, 0.8), at, (b.draw(0.1, 0.3), b.draw(0.1, 0.3)), material, b.draw(-50, 50))


BUILDERS = {"street": street, "bench": bench}


def arrange(kind: str, seed: list[int], middle_deg: float, half_deg: float) -> Scene:
    """One arrangement of a kind of scene, about the azimuth at which a sector looks."""
    b = Builder(np.random.default_rng(seed))
    BUILDERS[kind](b, half_deg)
    c, s = math.cos(math.radians(middle_deg)), math.sin(math.radians(middle_deg))

    def turned(v: tuple[float, float, float]) -> tuple[float, float, float]:
        return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])

    parts = [
        Rectangle(turned(r.centre), turned(r.along), turned(r.across), r.half_m, r.material, r.object_id)
        for r in b.rectangles
    ]
    return Scene(tuple(parts), kind)
