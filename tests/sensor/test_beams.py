"""The three kinds of beams, held against formulas that are written out here."""

import math

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.sensor import sensor_of, shipped
from lidarcheck.sensor.beam_table import TableBeams
from lidarcheck.sensor.sweep import Sweep

BASE = {"name": "x", "detector": "linear", "frame_rate_hz": 10, "linear": {"signal_at_1m": 1e5}}


def beams_of(kind, sweep=None, **keys):
    return sensor_of({**BASE, "beams": {"kind": kind, **keys}, "sweep": sweep or {}}).beams


GRID = beams_of(
    "grid", layers=8, points=30, elevation_deg={"first": 7.0, "step": -2.0}, azimuth_deg={"first": -29.0, "step": 2.0}
)
RING = beams_of(
    "grid", layers=2, points=36, elevation_deg={"first": -5.0, "step": 10.0}, azimuth_deg={"first": 5.0, "step": -10.0}
)
HEAD = {
    "elevation_deg": [12.0, -9.0, 3.0],
    "azimuth_offset_deg": [1.5, -2.0, 0.25],
    "origin_m": [0.03, 0.02, 0.0],
    "side_m": [-0.01, 0.02, 0.005],
    "height_m": 0.04,
    "range_offset_m": [0.1, 0.0, -0.05],
    "fire_time_us": [0.0, 30.0, 60.0],
    "column_shift": [3, 0, -2],
}
LEFT = beams_of("channels", **HEAD, columns=720)
RIGHT = beams_of("channels", {"direction": "right"}, **HEAD, columns=720, azimuth_deg={"first": 90, "last": -270})
SECTOR = beams_of(
    "channels", {"duration_s": 0.02}, elevation_deg=[-1.0, 1.0], columns=60, azimuth_deg={"first": -30, "last": 30}
)
STILL = beams_of("channels", {"fire_time_in_azimuth": False}, **HEAD, columns=720)
LOOSE = beams_of("channels", {"direction": "right"}, **HEAD, azimuth_step_deg=0.47, columns_repeat=False)
COLUMNS = {
    "Layer": np.array([0, 0, 0, 1, 1]),
    "Point": np.array([0, 1, 2, 0, 1]),
    "elevation_deg": np.array([1.0, 1.1, 1.0, -4.0, -4.0]),
    "azimuth_deg": np.array([-20.0, 0.0, 15.0, -10.0, 170.0]),
    "time_s": np.array([0.0, 0.01, 0.02, 0.05, 0.06]),
    "origin_x_m": np.array([0.1, 0.0, 0.0, 0.2, 0.0]),
}
TABLE = TableBeams.of_columns(Sweep("table"), COLUMNS)
SOME = {"grid": GRID, "ring": RING, "left": LEFT, "right": RIGHT, "sector": SECTOR, "still": STILL, "loose": LOOSE,
        "table": TABLE}  # fmt: skip


def by_hand(beams, layer, point, range_m, *, first, step, column_s, turns=True):
    """Section "Turning heads" of docs/sensors.md, for one beam, by scalars."""

    def of(name):
        value = HEAD[name]
        return value[layer] if isinstance(value, list) else value

    turned = step / column_s * of("fire_time_us") * 1e-6 if turns else 0.0
    psi = math.radians(first + point * step + turned)
    theta, phi = psi + math.radians(of("azimuth_offset_deg")), math.radians(of("elevation_deg"))
    ahead, side = of("origin_m"), of("side_m")
    o = (ahead * math.cos(psi) - side * math.sin(psi), ahead * math.sin(psi) + side * math.cos(psi), of("height_m"))
    u = (math.cos(phi) * math.cos(theta), math.cos(phi) * math.sin(theta), math.sin(phi))
    way = range_m - of("range_offset_m")
    return [a + b * way for a, b in zip(o, u, strict=True)]


@pytest.mark.parametrize(
    ("beams", "facts"),
    [
        (LEFT, {"first": 0.0, "step": 0.5, "column_s": 0.1 / 720}),
        (RIGHT, {"first": 90.0, "step": -0.5, "column_s": 0.1 / 720}),
        (STILL, {"first": 0.0, "step": 0.5, "column_s": 0.1 / 720, "turns": False}),
        (LOOSE, {"first": 0.0, "step": -0.47, "column_s": 0.1 * 0.47 / 360}),
        (LOOSE.with_phase(-123.4), {"first": -123.4, "step": -0.47, "column_s": 0.1 * 0.47 / 360}),
    ],
    ids=["left", "right", "still", "loose", "phase"],
)
def test_a_turning_heads_echoes_lie_where_the_formula_puts_them(beams, facts):
    for layer in range(3):
        for point in (0, 1, 333, 719):
            for range_m in (0.9, 50.0):
                expected = by_hand(beams, layer, point, range_m, **facts)
                found = beams.positions_m([layer], [point], [range_m])[0]
                assert np.abs(found - expected).max() < 1e-12
            time_s = point * facts["column_s"] + 1e-6 * HEAD["fire_time_us"][layer]
            assert beams.fire_time_s([layer], [point])[0] == pytest.approx(time_s, abs=1e-15)


def test_a_grids_beams_go_in_even_steps_from_one_origin():
    layer, point = GRID.every()
    assert len(layer) == GRID.size == 240
    elevation, azimuth = np.deg2rad(7.0 - 2.0 * layer), np.deg2rad(-29.0 + 2.0 * point)
    expected = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
    )
    assert np.abs(GRID.directions(layer, point) - expected).max() < 1e-15
    assert GRID.origins_m(layer, point) is None
    assert GRID.central
    assert np.array_equal(GRID.fire_time_s(layer, point), point * (0.1 / 29))
    steps = {"elevation_deg": {"first": 7.0, "step": -2.0}, "azimuth_deg": {"first": -29.0, "step": 2.0}}
    by_layers = beams_of("grid", {"order": "layers", "duration_s": 0.07}, layers=8, points=30, **steps)
    assert np.array_equal(by_layers.fire_time_s(layer, point), layer * (0.07 / 7))
    for kind, keys in (("grid", {"layers": 8, "points": 30, **steps}), ("channels", {**HEAD, "columns": 9})):
        flash = beams_of(kind, {"order": "flash"}, **keys)
        assert not flash.fire_time_s(*flash.every()).any()


@pytest.mark.parametrize("name", SOME)
def test_ranges_are_the_inverse_of_positions(name):
    beams = SOME[name]
    layer, point = beams.every()
    range_m = np.linspace(0.7, 140.0, len(layer))
    xyz = beams.positions_m(layer, point, range_m)
    assert np.abs(beams.ranges_m(layer, point, xyz) - range_m).max() < 1e-12
    assert np.abs(np.linalg.norm(beams.directions(layer, point), axis=1) - 1.0).max() < 1e-15


@pytest.mark.parametrize("name", SOME)
def test_what_a_beam_meets_is_nearest_to_that_beam(name):
    beams = SOME[name]
    layer, point = beams.every()
    # Not nearer than the origins' offsets turn into angles above half a step.
    for range_m in (8.0, 120.0):
        found = beams.nearest(beams.positions_m(layer, point, np.full(len(layer), range_m)))
        if name == "table":
            # Its nearest beam is searched by direction from 0.
            assert np.array_equal(np.stack(found), np.stack([layer, point]))
            continue
        assert np.array_equal(found[0], layer)
        # A turn that is no whole number of columns comes to its beginning again.
        over = np.mod(found[1] - point + 383, 766) - 383 if name == "loose" else found[1] - point
        assert (over == 0).mean() > 0.995
        assert np.abs(over).max() <= 1


def test_a_turn_goes_on_where_it_began():
    last = RING.directions([0, 1], [35, 35])
    first = RING.directions([0, 1], [0, 0])
    between = last + 0.6 * (first - last)
    assert np.array_equal(RING.nearest(between)[1], [0, 0])
    assert np.array_equal(RING.nearest(last + 0.4 * (first - last))[1], [35, 35])
    ahead = LEFT.directions([2, 2], [0, 0])
    back = LEFT.directions([2, 2], [719, 719])
    assert np.array_equal(LEFT.nearest(50.0 * (ahead + back + 0.1 * ahead))[1], [0, 0])
    assert np.array_equal(LEFT.nearest(50.0 * (ahead + back + 0.1 * back))[1], [719, 719])


def test_what_lies_outside_of_the_field_of_view_has_no_beam():
    up = np.array([[0.0, 0.1, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    for beams in (GRID, SECTOR):
        layer, point = beams.nearest(up)
        assert layer.tolist() == point.tolist() == [-1, -1, -1]
    assert TABLE.nearest(np.array([[0.0, 0.0, 1.0]]))[0].tolist() == [-1]
    inside = GRID.nearest(GRID.directions([0], [0]) * 9.0)
    assert [int(n[0]) for n in inside] == [0, 0]


def test_the_neighbouring_beam_is_so_far():
    up, aside = GRID.spacing_deg([0, 3], [0, 9])
    assert up.tolist() == aside.tolist() == [2.0, 2.0]
    up, aside = LEFT.spacing_deg([0, 1, 2], 0)
    assert up.tolist() == [9.0, 12.0, 9.0]
    assert aside.tolist() == [0.5, 0.5, 0.5]
    one = beams_of("channels", elevation_deg=[3.0], columns=90)
    assert [float(angle[0]) for angle in one.spacing_deg([0], [5])] == [4.0, 4.0]
    # A table: the angle to the nearest other beam, whichever it is.
    up, aside = TABLE.spacing_deg([0, 1], [1, 1])
    cosine = math.sin(math.radians(1.1)) * math.sin(math.radians(-4.0)) + math.cos(math.radians(1.1)) * math.cos(
        math.radians(-4.0)
    ) * math.cos(math.radians(10.0))
    assert up[0] == aside[0] == pytest.approx(math.degrees(math.acos(cosine)), abs=1e-9)


def test_an_image_shows_side_by_side_what_looks_side_by_side():
    assert LEFT.image_column([0, 1, 2, 0], [0, 0, 0, 718]).tolist() == [3, 0, 718, 1]
    assert GRID.image_column([0, 5], [7, 7]).tolist() == [7, 7]


def test_numbers_count_beams_in_order():
    assert GRID.index([0, 0, 7], [0, 29, 29]).tolist() == [0, 29, 239]
    assert GRID.has([0, 7, 8, -1, 0], [0, 29, 0, 0, 30]).tolist() == [True, True, False, False, False]
    layer, point = TABLE.every()
    assert list(zip(layer.tolist(), point.tolist(), strict=True)) == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)]
    assert TABLE.has([0, 1, 1], [2, 1, 2]).tolist() == [True, True, False]
    assert (TABLE.layers, TABLE.points, TABLE.size) == (2, 3, 6)


def test_a_table_says_all_of_each_beam():
    layer, point = TABLE.every()
    up, aside = np.deg2rad(COLUMNS["elevation_deg"]), np.deg2rad(COLUMNS["azimuth_deg"])
    u = np.stack([np.cos(up) * np.cos(aside), np.cos(up) * np.sin(aside), np.sin(up)], axis=1)
    o = np.stack([COLUMNS["origin_x_m"], np.zeros(5), np.zeros(5)], axis=1)
    assert np.abs(TABLE.positions_m(layer, point, np.full(5, 30.0)) - (o + 30.0 * u)).max() < 1e-12
    assert np.array_equal(TABLE.fire_time_s(layer, point), COLUMNS["time_s"])
    assert TABLE.lattice
    assert not TableBeams.of_columns(Sweep("table"), COLUMNS, from_scan=True).lattice


def test_columns_that_do_not_repeat_fill_a_turn_and_no_more():
    columns = 360.0 / 0.47
    assert LOOSE.columns == pytest.approx(columns)
    assert LOOSE.points == math.ceil(columns) == 766
    assert not LOOSE.repeats
    assert LEFT.with_phase(3.0) is LEFT
    assert LEFT.of_frame(5) == (LEFT, 720)
    fired = 0
    for frame in range(12):
        beams, count = LOOSE.of_frame(frame)
        # In a frame are the firings whose time lies within its tenth of a second.
        time_s = (fired + np.arange(count + 1)) * LOOSE.column_s
        assert 0.1 * frame - 1e-9 <= time_s[0] < time_s[count - 1] < 0.1 * (frame + 1) <= time_s[count] + 1e-9
        azimuth = math.remainder(-0.47 * fired, 360.0)
        assert math.remainder(beams.first_azimuth_deg - azimuth, 360.0) == pytest.approx(0.0, abs=1e-6)
        fired += count
    assert fired == math.ceil(12 * columns)


def test_a_phase_is_found_again_from_what_is_met():
    turned = LOOSE.with_phase(77.25)
    layer, point = turned.every()
    xyz = turned.positions_m(layer, point, np.full(len(layer), 12.0))
    assert LOOSE.phase_of(layer, point, xyz) == pytest.approx(77.25, abs=1e-9)
    assert LEFT.phase_of(layer[:3], point[:3], xyz[:3]) == 0.0


def test_beams_are_equal_when_all_their_numbers_are():
    same = beams_of("channels", **HEAD, columns=720)
    assert same == LEFT
    assert hash(same) == hash(LEFT)
    for name, value in (("side_m", [-0.01, 0.02, 0.006]), ("fire_time_us", [0.0, 30.0, 61.0]), ("column_shift", 0)):
        assert beams_of("channels", **{**HEAD, name: value}, columns=720) != LEFT
    assert STILL != LEFT
    assert LOOSE.with_phase(1.0) != LOOSE
    assert GRID not in (RING, LEFT)
    other = {**COLUMNS, "time_s": COLUMNS["time_s"] + 0.001}
    assert TableBeams.of_columns(Sweep("table"), COLUMNS) == TABLE
    assert TableBeams.of_columns(Sweep("table"), other) != TABLE
    assert shipped("SMART").beams == shipped("SLIM").beams


def test_only_what_turns_has_an_azimuth_to_begin_with():
    with pytest.raises(NotImplementedError):
        _ = GRID.first_azimuth_deg
    with pytest.raises(UsageError, match="number lines from 0"):
        TableBeams.of_columns(Sweep("table"), {**COLUMNS, "Layer": np.array([0, 0, 0, 2, 2])})
