"""The beam of each row is found again, whatever of it the file says."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.formats.assign import Known, Rows, assign
from lidarcheck.formats.assign.nearest import nearest_channels
from lidarcheck.formats.geometry.head import Head
from sensor_beams import HDL32, OUSTER, VLP16, Channels, Shot, shoot

WANDER_DEG = 0.02
"""How far the columns of a real head wander about their place."""


def known(beams: Channels, **given: Any) -> Known:
    return Known(
        Head.of(beams.beams()),
        ring=beams.ring,
        column_shift=np.broadcast_to(beams.column_shift, (beams.layers,)),
        **given,
    )


def shares(found: Any, shot: Shot) -> tuple[float, float]:
    return float(np.mean(found.layer == shot.layer)), float(np.mean(found.point == shot.point))


@pytest.mark.parametrize("beams", [VLP16, OUSTER, replace(OUSTER, step=360.0 / 1024, fire_us=3.0 * np.arange(32) / 32)])
@pytest.mark.parametrize("ringed", [True, False])
def test_columns_that_repeat_are_found_by_azimuth(beams: Channels, ringed: bool) -> None:
    shot = shoot(beams, every=7, keep=0.7)
    rows = Rows(position=shot.position, ring=shot.layer if ringed else None)
    found = assign(rows, known(beams))
    assert shares(found, shot) == (1.0, 1.0)
    assert found.by == ("ring and azimuth" if ringed else "direction alone")
    assert (found.layers_told, found.points_told) == (ringed, False)


def test_columns_that_do_not_repeat_are_found_by_time_and_give_the_phase() -> None:
    beams = HDL32.with_phase(123.4)
    shot = shoot(beams, every=3, keep=0.5)
    found = assign(Rows(position=shot.position, ring=shot.layer, time_s=shot.time_s), known(HDL32))
    assert shares(found, shot) == (1.0, 1.0)
    assert (found.by, found.points_told) == ("ring and time", True)
    assert found.phase_deg == pytest.approx(123.4, abs=1e-3)


@pytest.mark.parametrize("phase", [0.0, 200.03, 359.9])
def test_columns_that_do_not_repeat_are_counted_from_the_first_row(phase: float) -> None:
    beams = HDL32.with_phase(phase)
    shot = shoot(beams, keep=0.9)
    found = assign(Rows(position=shot.position, ring=shot.layer), known(HDL32))
    assert shares(found, shot) == (1.0, 1.0)
    off = (found.phase_deg - phase + 180.0) % 360.0 - 180.0
    assert abs(off) < 1e-3


def test_rows_ring_by_ring_begin_at_the_earliest_column_of_any_ring() -> None:
    beams = HDL32.with_phase(77.0)
    shot = shoot(beams, keep=0.5, seed=3)
    order = np.lexsort((shot.point, shot.layer))
    found = assign(Rows(position=shot.position[order], ring=shot.layer[order]), known(HDL32))
    assert np.array_equal(found.point, shot.point[order])


def test_a_list_of_rings_and_rings_from_the_other_end() -> None:
    beams = replace(VLP16, ring=tuple(np.roll(np.arange(16), 5)))
    shot = shoot(beams, every=20)
    ring = np.array(beams.ring)[shot.layer]
    found = assign(Rows(position=shot.position, ring=ring), known(beams))
    assert np.array_equal(found.layer, shot.layer)
    found = assign(Rows(position=shot.position, ring=15 - shot.layer), known(VLP16))
    assert np.array_equal(found.layer, shot.layer)
    assert found.notes == ("the rings count from the other end: their order was reversed",)
    assert assign(Rows(position=shot.position, ring=shot.layer), known(VLP16)).notes == ()


def test_a_ring_that_the_sensor_does_not_have_is_refused_and_minus_one_is_none() -> None:
    shot = shoot(VLP16, every=50)
    with pytest.raises(UsageError, match=r"ring 16, the sensor's 16 channels have 0 to 15"):
        assign(Rows(position=shot.position, ring=shot.layer + 1), known(VLP16))
    found = assign(Rows(position=shot.position, ring=np.full(len(shot.layer), -1)), known(VLP16))
    assert found.by == "direction alone"
    assert np.array_equal(found.layer, shot.layer)


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("staggered", [True, False])
def test_an_organised_cloud_is_staggered_or_not(timed: bool, staggered: bool) -> None:
    shot = shoot(OUSTER, keep=0.6)
    shift = np.broadcast_to(OUSTER.column_shift, (OUSTER.layers,))[shot.layer]
    image = shot.point if staggered else (shot.point + shift) % OUSTER.points
    rows = Rows(
        position=shot.position,
        time_s=shot.time_s if timed else None,
        cell=shot.layer.astype(np.int64) * OUSTER.points + image,
        height=OUSTER.layers,
        width=OUSTER.points,
    )
    found = assign(rows, known(OUSTER))
    assert shares(found, shot) == (1.0, 1.0)
    assert bool(found.notes) == (not staggered)
    assert found.points_told


def test_a_column_number_goes_before_time_and_layer_and_point_before_all() -> None:
    shot = shoot(VLP16, every=30)
    rows = Rows(position=shot.position, ring=shot.layer, column=shot.point, time_s=shot.time_s * 0.0)
    assert assign(rows, known(VLP16)).by == "ring and column"
    found = assign(replace(rows, layer=shot.layer, point=shot.point + 3), known(VLP16))
    assert np.array_equal(found.point, shot.point + 3)
    assert found.by == "Layer and Point"


def test_of_two_rows_of_one_beam_the_nearer_to_the_column_stays() -> None:
    layer, point = np.array([3, 3, 3, 5]), np.array([10.0, 10.3, 10.0, 10.4])
    azimuth = np.deg2rad(point * VLP16.step + VLP16.angles_deg(layer, 0)[1])
    up = np.deg2rad(VLP16.elevation[layer])
    direction = np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)], axis=-1)
    position = direction * np.array([[5.0], [5.0], [9.0], [5.0]])
    # Without return kinds the second echo of the same shot stays, with them each kind has one row.
    assert assign(Rows(position=position, ring=layer), known(VLP16)).point.tolist() == [10, -1, 10, 10]
    kinds = np.array([1, 1, 2, 1])
    found = assign(Rows(position=position, ring=layer, kind=kinds), known(VLP16))
    assert found.point.tolist() == [10, -1, 10, 10]
    assert found.notes == ("1 row of beams that have another, nearer to their column",)


def test_a_near_point_is_given_to_its_channel_though_its_beam_starts_elsewhere() -> None:
    beams = replace(OUSTER, elevation=np.linspace(20, -20, 32) ** 3 / 400.0, origin=0.03, height=0.08)
    shot = shoot(beams, every=40)
    near = beams.positions_m(shot.layer, shot.point, np.full(len(shot.layer), 0.9) + beams.range_offset_m(shot.layer))
    assert np.mean(nearest_channels(Head.of(beams.beams()), near) == shot.layer) == 1.0
    above = np.array([[0.0, 1.0, 5.0]])
    assert nearest_channels(Head.of(beams.beams()), above).tolist() == [-1]


def test_a_deskewed_cloud_is_ranked_by_azimuth_and_keeps_one_row_a_beam() -> None:
    shot = shoot(VLP16, keep=0.8)
    turn = np.deg2rad(0.11 * shot.point / VLP16.points)
    x, y, z = shot.position.T
    bent = np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=-1)
    found = assign(Rows(position=bent, ring=shot.layer), known(VLP16, deskewed=True))
    beams = found.layer.astype(np.int64) * VLP16.points + found.point
    assert len(np.unique(beams[found.point >= 0])) == np.count_nonzero(found.point >= 0)
    assert np.mean(np.abs(found.point - shot.point) <= 1) > 0.99


def test_a_head_is_the_beams_that_it_was_read_off() -> None:
    for beams in (VLP16, OUSTER, HDL32, replace(OUSTER, fire_us=np.linspace(0.0, 60.0, 32))):
        head = Head.of(beams.beams())
        layer, point = np.array([0, 3, 7, 15]), np.array([0, 1, 500, 1000])
        assert np.allclose(head.directions(layer, point), beams.directions(layer, point), atol=1e-10)
        if head.origin_m is not None:
            assert np.allclose(head.origins_m(layer, point), beams.origins_m(layer, point), atol=1e-10)
        other = replace(beams, fire_turns=not beams.fire_turns)
        assert np.allclose(head.with_fire().directions(layer, point), other.directions(layer, point), atol=1e-10)
        back = Head.of(replace(beams, step=-beams.step).beams())
        assert np.allclose(head.reversed().directions(layer, point), back.directions(layer, point), atol=1e-10)
