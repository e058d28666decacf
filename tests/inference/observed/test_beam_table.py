"""What beams meet and what scans show of them, against slow loops written beam by beam."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest

from explain_core_kit import MATERIALS, PANEL, ROAD, SIGN, WALL, model
from lidarcheck.inference.observed.beam_table import BeamTable, beams_of
from lidarcheck.inference.observed.observations import Observations, observations_of
from lidarcheck.scan import IdealScan, Scan
from reference_grid import azimuth_deg, elevation_deg

BRIGHT = 30.0
UP, DOWN, LEFT, RIGHT = range(4)
Key = tuple[int, int, int]


def shuffled(table, rng):
    return table.take(rng.permutation(len(table)))


def random_scan(rng: np.random.Generator, layers: Sequence[int], points: Sequence[int], *, holes: bool) -> IdealScan:
    """Patches of surfaces, misses, beams with two or three rows, beams that were not fired; rows in any order."""
    table = []
    for a in layers:
        for b in points:
            if holes and rng.random() < 0.15:
                continue
            base = 12.0 if (a // 9 + b // 12) % 2 else 30.0
            rows = 1 if rng.random() < 0.8 else int(rng.integers(2, 4))
            for _ in range(rows):
                kind = rng.random()
                met = 0.0 if kind < 0.15 else base * (1.0 + 0.03 * rng.random()) if kind < 0.85 else rng.uniform(3, 60)
                material = int(rng.choice([WALL, PANEL, ROAD, SIGN], p=[0.4, 0.3, 0.2, 0.1]))
                table.append((a, b, met, material, rng.uniform(0.0, 85.0)))
    return shuffled(IdealScan(*(np.array(column) for column in zip(*table, strict=True))), rng)


def signal(distance: float, material: int, incidence: float) -> float:
    entry = MATERIALS[material]
    gain = entry.retro_gain if entry.kind == "retro" else np.cos(np.deg2rad(incidence))
    return model().sensor.signal_at_1m * entry.reflectance * gain / distance**2 if distance > 0.0 else 0.0


def nearest(ideals: Sequence[IdealScan]) -> dict[Key, tuple[float, int, float]]:
    """By (frame, layer, point) the nearest surface: distance (0: none), material, S."""
    met: dict[Key, tuple[float, int, float]] = {}
    for frame, ideal in enumerate(ideals):
        for i in range(len(ideal)):
            key = (frame, int(ideal.layer[i]), int(ideal.point[i]))
            distance = float(ideal.distance_m[i])
            old = met.get(key)
            if old is None or (distance > 0.0 and (old[0] == 0.0 or distance < old[0])):
                material = int(ideal.material_id[i])
                met[key] = (distance, material, signal(distance, material, float(ideal.incidence_deg[i])))
    return met


@pytest.fixture(params=["dense", "every third layer", "with holes"], scope="module")
def ideals(request):
    rng = np.random.default_rng(3)
    layers, points = {
        "dense": (range(250, 268), range(470, 490)),
        "every third layer": (range(220, 280, 3), range(300, 330, 2)),
        "with holes": (range(100, 118), range(900, 920)),
    }[request.param]
    return [random_scan(rng, layers, points, holes=request.param == "with holes") for _ in range(3)]


@pytest.fixture(scope="module")
def beams(ideals) -> BeamTable:
    return beams_of(ideals, model())


def keys(beams: BeamTable) -> list[Key]:
    columns = (beams.frame.tolist(), beams.layer.tolist(), beams.point.tolist())
    return list(zip(*columns, strict=True))


def test_each_beam_is_one_row_with_its_nearest_surface(ideals, beams) -> None:
    met = nearest(ideals)
    assert keys(beams) == sorted(met)
    assert (np.diff(beams.key) > 0).all()
    expected = [met[key] for key in sorted(met)]
    assert beams.distance_m.tolist() == [one[0] for one in expected]
    assert beams.material_id.tolist() == [one[1] if one[0] > 0.0 else -1 for one in expected]
    assert beams.signal == pytest.approx([one[2] for one in expected], rel=1e-9)
    assert beams.retro.tolist() == [one[0] > 0.0 and one[1] == SIGN for one in expected]


def test_every_surface_is_in_the_list_of_hits(ideals, beams) -> None:
    number = {key: i for i, key in enumerate(keys(beams))}
    hits = sorted(
        (number[frame, int(a), int(b)], float(d))
        for frame, ideal in enumerate(ideals)
        for a, b, d in zip(ideal.layer, ideal.point, ideal.distance_m, strict=True)
        if d > 0.0
    )
    assert list(zip(beams.hit_beam.tolist(), beams.hit_m.tolist(), strict=True)) == hits


def beside(key: Key, layers: list[int], points: list[int]) -> list[Key | None]:
    frame, a, b = key
    i, j = layers.index(a), points.index(b)
    up = (frame, layers[i + 1], b) if i + 1 < len(layers) else None
    down = (frame, layers[i - 1], b) if i > 0 else None
    left = (frame, a, points[j + 1]) if j + 1 < len(points) else None
    right = (frame, a, points[j - 1]) if j > 0 else None
    return [up, down, left, right]


def even(ideals) -> list[IdealScan]:
    """The same ranges, all of one material met at right angles: no creases."""
    return [dataclasses.replace(i, incidence_deg=np.zeros(len(i)), material_id=np.full(len(i), WALL)) for i in ideals]


def test_a_crease_lies_where_another_material_or_slope_begins_at_nearly_the_same_range() -> None:
    layer, point = (a.ravel() for a in np.meshgrid(range(230, 236), range(400, 406), indexing="ij"))
    angle = np.where(point >= 403, 40.0, 5.0)
    corner = IdealScan(layer, point, np.full(36, 20.0), np.full(36, WALL), angle)
    assert np.array_equal(beams_of([corner], model()).crease, (point == 402) | (point == 403))
    floor = IdealScan(layer, point, np.full(36, 20.0), np.where(layer < 232, ROAD, WALL), np.full(36, 5.0))
    assert np.array_equal(beams_of([floor], model()).crease, (layer == 231) | (layer == 232))
    edge = IdealScan(layer, point, np.where(point >= 403, 40.0, 20.0), np.full(36, WALL), angle)
    assert not beams_of([edge], model()).crease.any()


def test_neighbours_and_slopes_are_those_of_the_lattice(ideals) -> None:
    ideals = even(ideals)
    beams = beams_of(ideals, model())
    met = nearest(ideals)
    layers, points = sorted({k[1] for k in met}), sorted({k[2] for k in met})
    sloped = 0

    def step_m(key: Key | None) -> float:
        """The largest difference to a neighbour less than 15 % farther or nearer."""
        if key not in met:
            return 0.0
        there = [met[k][0] for k in beside(key, layers, points) if k in met and met[k][0] > 0.0]
        apart = [abs(r - met[key][0]) for r in there]
        return max([a for a in apart if a < 0.15 * met[key][0]], default=0.0)

    for i, key in enumerate(keys(beams)):
        around = beside(key, layers, points)
        ranges = [met[k][0] if k in met else -1.0 for k in around]
        assert beams.neighbour_m[i].tolist() == ranges
        assert beams.step_m[i] == step_m(key)
        assert beams.neighbour_step_m[i].tolist() == [step_m(k) for k in around]
        own = met[key][0]
        for axis, (plus, minus) in enumerate(((UP, DOWN), (LEFT, RIGHT))):
            one_surface = own > 0.0 and all(abs(ranges[s] - own) < 0.06 * own for s in (plus, minus))
            slope = 0.0
            if one_surface:
                angle = elevation_deg if axis == 0 else azimuth_deg
                ends = [float(angle(around[s][1 + axis])) for s in (plus, minus)]
                slope = (ranges[plus] - ranges[minus]) / (ends[0] - ends[1])
                sloped += 1
            assert beams.slope_m_per_deg[i, axis] == pytest.approx(slope, rel=1e-9)
    assert sloped > 100


def test_the_next_bright_beam_is_found_on_every_side(ideals, beams) -> None:
    met = nearest(ideals)
    found = 0
    steps = ((1, 0), (-1, 0), (0, 1), (0, -1))
    for i, (frame, a, b) in enumerate(keys(beams)):
        for side, (da, db) in enumerate(steps):
            offset, range_m = 0, 0.0
            for n in range(1, 70):
                there = met.get((frame, a + n * da, b + n * db))
                if there is not None and there[2] >= BRIGHT:
                    offset, range_m = n, there[0]
                    break
            assert (beams.bright[i, side], beams.bright_m[i, side]) == (offset, range_m)
            found += offset > 0
    assert found > 100


def echoes_near(ideals, beams, rng) -> list[Scan]:
    """Up to four echoes on a part of the beams: on a surface, a little off it, at a neighbour's, or anywhere."""
    number = {key: i for i, key in enumerate(keys(beams))}
    scans = []
    for frame, ideal in enumerate(ideals):
        table = []
        for a, b in sorted(set(zip(ideal.layer.tolist(), ideal.point.tolist(), strict=True))):
            i = number[frame, a, b]
            places = [x for x in (beams.distance_m[i], *beams.neighbour_m[i]) if x > 0.0]
            for _ in range(int(rng.integers(0, 5))):
                off = rng.choice([0.0, 0.3, -0.4, 1.5, 2.6]) + rng.normal(0.0, 0.05)
                near = rng.choice(places) + off if places else 10.0 + off
                range_m = near if rng.random() < 0.7 else rng.uniform(0.5, 80.0)
                if clear_of_limits(beams, i, range_m):
                    table.append((a, b, range_m, *rng.uniform(5.0, 900.0, 3)))
        layer, point, range_m, area, peak, width = (np.array(c) for c in zip(*table, strict=True))
        scan = Scan.from_beams(layer.astype(int), point.astype(int), range_m, area=area, peak=peak, width_ns=width)
        scans.append(shuffled(scan, rng))
    return scans


def clear_of_limits(beams: BeamTable, i: int, range_m: float) -> bool:
    """Not where "at a neighbour's range" is a matter of the last centimetre."""
    there = beams.neighbour_m[i] > 0.0
    off = np.abs(range_m - beams.neighbour_m[i][there])
    return bool(np.all(np.abs(off - (1.0 + 0.03 * range_m + beams.neighbour_step_m[i][there])) > 1e-6))


def check_pairing(beams: BeamTable, scans: Sequence[Scan], observations: Observations) -> None:
    number = {key: i for i, key in enumerate(keys(beams))}
    of_beam: dict[int, list[tuple[float, float, float, float]]] = {}
    for frame, scan in enumerate(scans):
        values = zip(scan.range_m, np.log(scan.area), np.log(scan.peak), scan.width_ns, strict=True)
        for a, b, echo in zip(scan.layer.tolist(), scan.point.tolist(), values, strict=True):
            of_beam.setdefault(number[frame, a, b], []).append(tuple(map(float, echo)))
    extras = []
    for i in range(len(beams)):
        surfaces = beams.hit_m[beams.hit_beam == i]
        off = [min((abs(e[0] - s), e[0] - s) for s in surfaces) if len(surfaces) else (np.inf, 0.0)
               for e in of_beam.get(i, [])]  # fmt: skip
        best = min(range(len(off)), key=lambda n: off[n][0]) if off else -1
        seen = best >= 0 and off[best][0] <= 2.0 + beams.step_m[i]
        assert observations.detected[i] == seen
        own = (off[best][1], *of_beam[i][best][1:]) if seen else (0.0, 0.0, 0.0, 0.0)
        assert observations.feature[i] == pytest.approx(own, abs=1e-9)
        others = sorted(e for n, e in enumerate(of_beam.get(i, [])) if not (seen and n == best))
        sides = []
        for echo in others:
            reach, here = 1.0 + 0.03 * echo[0] + beams.neighbour_step_m[i], beams.distance_m[i]
            beyond = list(zip(beams.neighbour_m[i], reach, strict=True))
            apart = [here == 0.0 or abs(here - there) > most for there, most in beyond]
            near = [there > 0.0 and abs(echo[0] - there) < most for there, most in beyond]
            matches = [side for side in range(4) if near[side] and apart[side]]
            sides.append(matches[0] if matches else -1)
            extras.append((i, *echo, sides[-1]))
        assert observations.strayed[i] == (not seen and any(side >= 0 for side in sides))
    columns = ("extra_beam", "extra_m", "extra_area", "extra_peak", "extra_width", "extra_side")
    found = np.column_stack([getattr(observations, name) for name in columns])
    assert found == pytest.approx(np.array(extras).reshape(-1, 6), abs=1e-9)


def test_echoes_are_paired_with_the_nearest_surface_within_2_m_and_a_step(ideals, beams) -> None:
    scans = echoes_near(ideals, beams, np.random.default_rng(8))
    observations = observations_of(beams, scans)
    check_pairing(beams, scans, observations)
    assert 100 < observations.detected.sum() < len(beams)
    assert set(observations.extra_side) == {-1, 0, 1, 2, 3}
    assert observations.strayed.sum() > 3


def test_the_order_of_rows_does_not_matter(ideals, beams) -> None:
    rng = np.random.default_rng(9)
    scans = echoes_near(ideals, beams, rng)
    again = beams_of([shuffled(ideal, rng) for ideal in ideals], model())
    one, two = observations_of(beams, scans), observations_of(again, [shuffled(scan, rng) for scan in scans])
    for mine, other in ((beams, again), (one, two)):
        for field in dataclasses.fields(mine):
            if field.name != "incidence_deg":
                assert np.array_equal(getattr(mine, field.name), getattr(other, field.name)), field.name


def test_scans_without_an_echo_show_nothing(beams, ideals) -> None:
    empty = Scan.from_beams(np.zeros(0, int), np.zeros(0, int), np.zeros(0))
    observations = observations_of(beams, [empty] * len(ideals))
    assert not observations.detected.any()
    assert not observations.strayed.any()
    assert not observations.feature.any()
    assert len(observations.extra_beam) == len(observations.extra_side) == 0


def test_without_surfaces_every_echo_is_extra() -> None:
    ideal = IdealScan([10, 10, 11], [5, 6, 5], np.zeros(3), np.ones(3), np.zeros(3))
    beams = beams_of([ideal], model())
    assert not beams.bright.any()
    assert not beams.slope_m_per_deg.any()
    assert len(beams.hit_m) == 0
    assert (beams.material_id == -1).all()
    scan = Scan.from_beams(np.array([11, 10]), np.array([5, 6]), np.array([4.0, 7.0]), area=np.array([9.0, 8.0]))
    observations = observations_of(beams, [scan])
    assert not observations.detected.any()
    assert observations.extra_beam.tolist() == [1, 2]
    assert observations.extra_m == pytest.approx([7.0, 4.0])
    assert (observations.extra_side == -1).all()


def test_one_beam_alone_has_no_neighbours() -> None:
    beams = beams_of([IdealScan([3], [4], [10.0], [WALL], [0.0])], model())
    assert beams.neighbour_m.tolist() == [[-1.0] * 4]
    observations = observations_of(beams, [Scan.from_beams(np.array([3, 3]), np.array([4, 4]), np.array([10.5, 8.5]))])
    assert observations.feature[0, 0] == pytest.approx(0.5)
    assert observations.extra_m == pytest.approx([8.5])
