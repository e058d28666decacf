"""Halls with panels whose truth is known, on the independent simulator: layouts, stands, walls, frames of echoes."""

import math
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hidden.files import echoes_text, ideal_text, model_text, write
from hidden.places import CONCRETE, PANEL_10, PANEL_50, PANEL_80, TABLE, VEGETATION
from hidden.rays import Beams, Hits, Rectangle, Scene, cast, directions
from hidden.sensor import ALL_SHOTS, BACKGROUND_PER_NS, SIGNAL_AT_1M, THRESHOLD, Detectors, Echoes, Light, detect
from lidarcheck.scan import IdealScan, Scan

FLOOR_COVER = VEGETATION
REFLECTANCES = (PANEL_10, PANEL_50, PANEL_80)
BLOCK = Beams.block(range(180, 340), range(200, 760))
SMALL = Beams.block(range(230, 290), range(430, 530))


@dataclass(frozen=True)
class Spot:
    """Where a panel stands: range along the ground [m], azimuth [deg], height of its middle, size, turn and tilt."""

    range_m: float
    azimuth_deg: float
    up_m: float
    width_m: float
    height_m: float
    material: int
    turn_deg: float = 0.0
    tilt_deg: float = 0.0

    @property
    def half_deg(self) -> float:
        return math.degrees(math.atan(self.width_m / 2 / self.range_m))


@dataclass
class Hall:
    """A hall: its surfaces, and which of them are the panels."""

    spots: list[Spot]
    floor_m: float = -1.8
    roof_m: float = 4.0
    side_m: float = 20.0
    end_m: float = 95.0
    stands: bool = True
    dead_layers: tuple[int, ...] = ()
    pillars: list[tuple[float, float]] = field(default_factory=list)

    def scene(self) -> Scene:
        parts = [self._panel(spot, i + 1) for i, spot in enumerate(self.spots)]
        number = len(parts) + 1
        if self.stands:
            for spot in self.spots:
                parts.append(self._stand(spot, number))
                number += 1
        length, height = self.end_m + 5.0, self.roof_m - self.floor_m
        middle_z = (self.roof_m + self.floor_m) / 2
        x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        half = (length / 2, self.side_m)
        shell = [
            Rectangle((length / 2 - 5, 0.0, self.floor_m), x, y, half, FLOOR_COVER, number),
            Rectangle((length / 2 - 5, 0.0, self.roof_m), x, y, half, CONCRETE, number + 1),
            Rectangle((self.end_m, 0.0, middle_z), y, z, (self.side_m, height / 2), CONCRETE, number + 2),
            Rectangle((length / 2 - 5, self.side_m, middle_z), x, z, (length / 2, height / 2), CONCRETE, number + 3),
            Rectangle((length / 2 - 5, -self.side_m, middle_z), x, z, (length / 2, height / 2), CONCRETE, number + 4),
        ]
        number += 5
        for px, py in self.pillars:
            shell.append(Rectangle((px, py, middle_z), y, z, (0.3, height / 2), CONCRETE, number))
            number += 1
        return Scene(tuple(parts + shell), "hall")

    def _panel(self, spot: Spot, number: int) -> Rectangle:
        centre, along, across = _pose(spot)
        return Rectangle(centre, along, across, (spot.width_m / 2, spot.height_m / 2), spot.material, number)

    def _stand(self, spot: Spot, number: int) -> Rectangle:
        """A post from the panel's middle to the floor, 2 cm behind it."""
        centre, along, _ = _pose(spot)
        away = 1.0 + 0.02 / math.hypot(centre[0], centre[1])
        half_up = (centre[2] - self.floor_m) / 2
        foot = (centre[0] * away, centre[1] * away, self.floor_m + half_up)
        return Rectangle(foot, along, (0.0, 0.0, 1.0), (0.04, half_up), CONCRETE, number)


def _pose(spot: Spot) -> tuple[tuple[float, float, float], ...]:
    a, t, lean = (math.radians(v) for v in (spot.azimuth_deg, spot.azimuth_deg + spot.turn_deg, spot.tilt_deg))
    centre = (spot.range_m * math.cos(a), spot.range_m * math.sin(a), spot.up_m)
    along = (-math.sin(t), math.cos(t), 0.0)
    across = (math.sin(lean) * math.cos(t), math.sin(lean) * math.sin(t), math.cos(lean))
    return centre, along, across


def meets(hall: Hall, beams: Beams = BLOCK) -> Hits:
    """What the beams meet."""
    heading = directions(beams.azimuth_deg, beams.elevation_deg)
    return cast(hall.scene(), np.zeros((len(beams), 3)), heading, beams.time_s)


def around(hits: Hits, number: int, beams: Beams = BLOCK) -> NDArray[np.bool_]:
    """Beams on the first `number` surfaces, the panels, and around them: to follow only these is quick."""
    rows = len(np.unique(beams.layer))
    near = np.zeros((rows, len(beams) // rows), bool)
    for i in range(number):
        layer, point = np.nonzero((hits.rectangle == i).reshape(near.shape))
        near[max(layer.min() - 9, 0) : layer.max() + 10, max(point.min() - 5, 0) : point.max() + 6] = True
    return near.ravel()


def echoes(
    hits: Hits,
    variant: str,
    seed: int,
    beams: Beams = BLOCK,
    dead_layers: tuple[int, ...] = (),
    only: NDArray[np.bool_] | None = None,
) -> Echoes:
    """One frame of echoes, 1 cm steps; of the beams in the mask `only`, if given, whatever else the others meet."""
    met = np.flatnonzero((hits.range_m > 0) & (True if only is None else only))
    material, range_m = hits.material[met], hits.range_m[met]
    rho = np.array([TABLE[m][1] if m in TABLE else 0.0 for m in range(100)])[material]
    signal = SIGNAL_AT_1M * rho * np.cos(np.deg2rad(hits.incidence_deg[met])) / range_m**2
    signal[np.isin(beams.layer[met], dead_layers)] = 0.0
    n = len(beams)
    light = Light(
        met, range_m, signal, material, hits.incidence_deg[met], np.ones(len(met), bool),
        np.full(len(met), ALL_SHOTS, np.int64), np.full(n, BACKGROUND_PER_NS), hits.range_m.copy(),
    )  # fmt: skip
    out = detect(light, Detectors(np.full(n, float(THRESHOLD))), variant, seed)
    out.range_m = np.round(np.maximum(out.range_m, 0.0), 2)
    return out.kept(out.range_m > 0)


def scan_of(out: Echoes, beams: Beams = BLOCK) -> Scan:
    """The echoes as the package holds them."""
    start = np.append(True, np.diff(out.beam) != 0)[: len(out.beam)]
    row = np.arange(len(out.beam))
    number = row - np.maximum.accumulate(np.where(start, row, 0)) + 1
    layer, point = beams.layer[out.beam].astype(np.int32), beams.point[out.beam].astype(np.int32)
    return Scan.from_beams(
        layer,
        point,
        out.range_m,
        echo_number=number.astype(np.int32),
        width_ns=out.width_ns,
        area=out.area,
        peak=out.peak,
    )


def ideal_of(hits: Hits, beams: Beams = BLOCK, object_ids: bool = True) -> IdealScan:
    """What the beams meet as the package holds it."""
    objects = np.maximum(hits.object_id, 0).astype(np.int32) if object_ids else None
    return IdealScan(beams.layer, beams.point, hits.range_m, hits.material, hits.incidence_deg, objects)


def write_frames(directory: Path, hall: Hall, variant: str, seeds: range, beams: Beams = BLOCK) -> list[Path]:
    """ideal.txt, model.toml and a measured file for each seed, as text; the paths of the measured ones."""
    hits = meets(hall, beams)
    write(directory, "ideal.txt", ideal_text(beams, hits, True, None))
    write(directory, "model.toml", model_text(variant, TABLE, {}))
    return [
        write(directory, f"frame_{s:02d}.txt", echoes_text(beams, echoes(hits, variant, s, beams, hall.dead_layers)))
        for s in seeds
    ]


# --- random halls ----------------------------------------------------------------------------------------------------


def random_hall(seed: int, panels: int = 16) -> Hall:
    """16 panels at 5 ... 80 m: alone, side by side, one 0.5 m behind the other, partly hidden; turned and tilted."""
    rng = np.random.default_rng([seed, 77])
    for _ in range(200):
        hall = _try_hall(rng, panels)
        if hall is not None:
            return hall
    raise AssertionError("no hall could be laid out")


def _try_hall(rng: np.random.Generator, panels: int) -> Hall | None:
    floor, roof = -float(rng.uniform(1.3, 2.2)), float(rng.uniform(2.5, 7.0))
    side = float(rng.uniform(17.0, 28.0))
    ranges = np.sort(np.exp(rng.uniform(np.log(5.0), np.log(80.0), panels)))
    ranges[0], ranges[-1] = rng.uniform(5.0, 7.0), rng.uniform(76.0, 80.0)
    spots: list[Spot] = []
    taken: list[tuple[float, float]] = []
    order = list(ranges[::-1])  # the far ones first: they have the least room
    while order:
        group = _group(rng, order, floor)
        placed = _place(rng, group, taken, side)
        if placed is None:
            return None
        spots += placed
    pillars = [(float(rng.uniform(30, 90)), float(s * rng.uniform(0.8, 0.95) * side)) for s in (-1, 1)]
    dead = tuple(int(v) for v in rng.integers(200, 320, 2)) if rng.random() < 0.5 else ()
    return Hall(spots, floor, roof, side, float(rng.uniform(88, 110)), bool(rng.random() < 0.8), dead, pillars)


def _spot(rng: np.random.Generator, range_m: float, floor: float) -> Spot:
    size = 0.45 + 0.9 * (range_m / 80.0)
    width, height = (float(size * rng.uniform(1.0, 1.35)) for _ in range(2))
    highest = range_m * math.tan(math.radians(3.6)) - height / 2
    lowest = max(floor + 0.35 + height / 2, -highest)
    up = float(rng.uniform(lowest, max(min(highest, 1.0), lowest + 1e-3)))
    turn, tilt = rng.uniform(-20, 20, 2) * (rng.random(2) < 0.6)
    return Spot(range_m, 0.0, up, width, height, int(rng.choice(REFLECTANCES)), float(turn), float(tilt) / 2)


def _group(rng: np.random.Generator, order: list[float], floor: float) -> list[Spot]:
    """The next panel, or two that belong together, at azimuths beside 0."""
    first = _spot(rng, float(order.pop(0)), floor)
    kind = rng.choice(["alone", "alone", "beside", "step", "hidden"])
    if kind == "alone" or not order:
        return [first]
    if kind == "hidden":
        return _with_hidden(rng, first, float(order.pop(0)))
    order.pop(0)
    behind = 0.5 if kind == "step" else 0.0
    others = [m for m in REFLECTANCES if m != first.material]
    gap = 0.0 if kind == "step" or rng.random() < 0.5 else max(0.05, 2.0 * first.range_m * math.radians(0.125))
    material = int(rng.choice(others)) if gap == 0.0 and kind == "beside" else int(rng.choice(REFLECTANCES))
    flat = Spot(first.range_m, 0.0, first.up_m, first.width_m, first.height_m, first.material)
    range_m = first.range_m - behind
    beside = 2 * math.degrees(math.atan((first.width_m + gap) / 2 / first.range_m))
    return [flat, Spot(range_m, beside, first.up_m, first.width_m, first.height_m, material)]


def _with_hidden(rng: np.random.Generator, back: Spot, near_m: float) -> list[Spot]:
    """A panel and a nearer one that covers 20 to 40 % of its width."""
    if back.range_m - near_m < 1.0:
        near_m = back.range_m - 1.0
    front = Spot(
        near_m,
        0.0,
        back.up_m * near_m / back.range_m,
        back.width_m * near_m / back.range_m,
        back.height_m * near_m / back.range_m,
        int(rng.choice(REFLECTANCES)),
    )
    reach = back.half_deg + front.half_deg - float(rng.uniform(0.2, 0.4)) * 2 * back.half_deg
    return [
        Spot(back.range_m, 0.0, back.up_m, back.width_m, back.height_m, back.material),
        Spot(front.range_m, reach, front.up_m, front.width_m, front.height_m, front.material),
    ]


def _place(
    rng: np.random.Generator, group: list[Spot], taken: list[tuple[float, float]], side_m: float
) -> list[Spot] | None:
    """The group at a free azimuth within the hall."""
    low = min(s.azimuth_deg - s.half_deg for s in group) - 0.35
    high = max(s.azimuth_deg + s.half_deg for s in group) + 0.35
    farthest = max(s.range_m for s in group)
    widest = min(33.0, math.degrees(math.asin(min((side_m - 1.5) / farthest, 0.6))))
    for _ in range(60):
        at = float(rng.uniform(-widest - low, widest - high)) if widest - high > -widest - low else 0.0
        span = (at + low, at + high)
        if all(span[1] < a or span[0] > b for a, b in taken) and -widest <= span[0] and span[1] <= widest:
            taken.append(span)
            return [
                Spot(s.range_m, s.azimuth_deg + at, s.up_m, s.width_m, s.height_m, s.material, s.turn_deg, s.tilt_deg)
                for s in group
            ]
    return None


# --- truth against what was found -------------------------------------------------------------------------------------


def score(hall: Hall, hits: Hits, panels, beams: Beams = BLOCK) -> tuple[int, int, list[str]]:
    """How many true panels were found, how many found ones are none, and what went wrong.

    A true panel is found by exactly one panel nine tenths of whose beams lie on it and which has at least half of the
    beams that are left of it without two layers and a point at each border.
    """
    of = {(int(la), int(p)): int(r) for la, p, r in zip(beams.layer, beams.point, hits.rectangle, strict=True)}
    matches: dict[int, int] = {}
    wrong, said = 0, []
    for panel in panels:
        on = np.array([of.get((int(la), int(p)), -1) for la, p in zip(panel.layer, panel.point, strict=True)])
        names, counts = np.unique(on, return_counts=True)
        best = int(names[np.argmax(counts)])
        if 0 <= best < len(hall.spots) and counts.max() >= 0.9 * len(on):
            matches[best] = matches.get(best, 0) + (1 if len(on) >= 0.5 * _inner(hits, best, beams) else 100)
        else:
            wrong += 1
            said.append(f"no panel at {panel.range_m:.1f} m, {panel.azimuth_deg:.1f} deg, on {best}")
    found = sum(count == 1 for count in matches.values())
    for i, spot in enumerate(hall.spots):
        if matches.get(i) != 1:
            said.append(f"lost {i} ({matches.get(i, 0)}) at {spot.range_m:.1f} m, {spot.azimuth_deg:.1f} deg")
    return found, wrong, said


def _inner(hits: Hits, number: int, beams: Beams) -> int:
    """Beams of a panel that lie two layers and a point within its border."""
    on = (hits.rectangle == number).reshape(len(np.unique(beams.layer)), -1)
    inner = on.copy()
    for layer_shift in (-2, -1, 0, 1, 2):
        for point_shift in (-1, 0, 1):
            inner &= np.roll(on, (layer_shift, point_shift), (0, 1))
    return int(np.count_nonzero(inner))


def main(first: int, end: int, frames: int) -> None:
    """How many panels of random halls are found, from ideal scans and from measured points."""
    from lidarcheck.calibration.panels.find import find_panels
    from lidarcheck.calibration.panels.image import echoes_of, image_of_frames, image_of_ideal
    from lidarcheck.calibration.panels.settings import PanelSettings

    total = {"ideal": [0, 0], "measured": [0, 0]}
    for seed in range(first, end):
        hall, variant = random_hall(seed), ("SMART", "SLIM")[seed % 2]
        hits = meets(hall)
        runs = [echoes(hits, variant, 100 * seed + i, dead_layers=hall.dead_layers) for i in range(frames)]
        images = {
            "ideal": image_of_ideal(ideal_of(hits)),
            "measured": image_of_frames([echoes_of(scan_of(run)) for run in runs]),
        }
        for name, image in images.items():
            found, wrong, said = score(hall, hits, find_panels(image, PanelSettings()).panels)
            total[name] = [total[name][0] + found, total[name][1] + wrong]
            print(f"{seed} {variant} {name}: {found} of {len(hall.spots)}, {wrong} false", *said, sep="; ", flush=True)
    print(f"of {16 * (end - first)} panels, (found, false): {total}")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
