"""The check on beams of any sensor's file: what is right passes, what is wrong is named with the line that mends it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lidarcheck.beams import Geometry
from lidarcheck.formats.geometry import words
from lidarcheck.formats.geometry.placement import rotation
from lidarcheck.formats.geometry.sensor_lattice import lattice_of
from lidarcheck.formats.geometry.unit import UnitFound
from lidarcheck.formats.geometry.verdict import Refusal, geometry_of
from sensor_beams import HDL32, OUSTER, VLP16, Channels, Shot, shoot

FIRED = replace(OUSTER, fire_us=np.linspace(0.0, 90.0, 32), first=90.0, origin=0.03, side=0.01)


def judged(beams: Channels, shot: Shot, position: np.ndarray | None = None, **given: Any) -> Geometry | Refusal:
    lattice = lattice_of(beams.beams(), **given)
    where = shot.position if position is None else position
    return geometry_of(where, shot.layer.astype(np.int32), shot.point.astype(np.int32), 1e-6, UnitFound(), lattice)


def refused(beams: Channels, shot: Shot, position: np.ndarray | None = None, **given: Any) -> str:
    found = judged(beams, shot, position, **given)
    assert isinstance(found, Refusal)
    return f"{found.what}; {found.fix}"


@pytest.mark.parametrize("beams", [VLP16, OUSTER, HDL32, FIRED])
def test_right_scans_pass(beams: Channels) -> None:
    shot = shoot(beams, every=5, keep=0.6)
    found = judged(beams, shot)
    assert isinstance(found, Geometry)
    assert (found.verdict, found.outside) == ("ok", 0)


def test_columns_that_do_not_repeat_pass_at_any_phase_and_wander() -> None:
    shot = shoot(HDL32.with_phase(211.0), every=4, keep=0.8)
    wander = np.deg2rad(np.random.default_rng(2).normal(0.0, 0.06, HDL32.points))[shot.point]
    x, y, z = shot.position.T
    bent = np.stack([x * np.cos(wander) - y * np.sin(wander), x * np.sin(wander) + y * np.cos(wander), z], axis=-1)
    found = judged(HDL32, shot, bent)
    assert isinstance(found, Geometry)
    assert (found.verdict, found.yaw_checked) == ("ok", False)
    assert words(found).endswith(
        "lie where their beams point, yaw not checked (columns do not repeat); unit not checked"
    )


def mirrored(p: np.ndarray) -> np.ndarray:
    return p * [1.0, -1.0, 1.0]


@pytest.mark.parametrize("beams", [FIRED, HDL32])
def test_a_mirrored_cloud_is_named_with_handedness(beams: Channels) -> None:
    shot = shoot(beams, every=5)
    text = refused(beams, shot, mirrored(shot.position))
    assert text.startswith("Y is mirrored: 100.0 % fit with Y negated")
    assert text.endswith('set handedness = "left" in the sensor\'s file')
    text = refused(beams, shot, mirrored(shot.position), handedness="left")
    assert text.endswith('set handedness = "right" in the sensor\'s file')


@pytest.mark.parametrize(
    ("declared", "said", "line"),
    [
        (lambda b: replace(b, first=0.0), "the axes are in another order", "set azimuth_deg.first = 90 (last with it)"),
        (lambda b: replace(b, first=73.5), "turned by 16.5 deg about Z", "set azimuth_deg.first = 90 (last with it)"),
        (lambda b: replace(b, step=-b.step), "the head turns the other way", 'set direction = "right" in [sweep]'),
        (lambda b: replace(b, fire_turns=False), "which the file denies", "set fire_time_in_azimuth = true in [sweep]"),
        (lambda b: replace(b, elevation=b.elevation + 1.3), "elevations are -1.3 deg off", "add -1.3 deg to every"),
        (lambda b: replace(b, elevation=b.elevation * 1.1), "0.9091 times", "multiply every elevation_deg by 0.9091"),
        (
            lambda b: replace(b, elevation=b.elevation[::-1]),
            "elevation_deg runs from the other end",
            "turn elevation_deg",
        ),
        (lambda b: replace(b, step=-0.36, points=1000), "columns are 0.351562 deg apart", "set columns = 1024"),
        (lambda b: replace(b, origin=0.5, side=0.3), "beams start elsewhere: -0.4700 m", "to origin_m (-0.4700)"),
    ],
)
def test_what_the_file_says_wrongly_is_named_with_its_key(
    declared: Callable[[Channels], Channels], said: str, line: str
) -> None:
    # Elevations that are not symmetric: a list that is turned around is no shift.
    beams = replace(FIRED, elevation=np.linspace(22.0, -12.0, 32) + 0.001 * np.arange(32) ** 2)
    text = refused(declared(beams), shoot(beams, every=3, keep=0.5))
    assert said in text[:200]
    assert line in text


def test_the_other_sense_and_another_first_column_are_found_together() -> None:
    shot = shoot(FIRED, every=3)
    text = refused(replace(FIRED, first=17.0, step=-FIRED.step), shot)
    assert "the head turns the other way and the points are turned by 73" in text
    assert 'direction = "right"' in text
    assert "azimuth_deg.first = 90" in text


def test_another_unit_s_calibration_alone_and_with_another_first_column() -> None:
    rng = np.random.default_rng(5)
    other = replace(
        FIRED, elevation=FIRED.elevation + rng.uniform(-0.9, 0.9, 32), offset=FIRED.offset + rng.uniform(-0.7, 0.7, 32)
    )
    shot = shoot(FIRED, every=3)
    text = refused(other, shot)
    assert "as with another unit's calibration: up to 0.8" in text
    assert "take the angles of this very unit" in text
    text = refused(replace(other, first=230.0), shot)
    assert "turned by" in text
    assert "another unit's calibration" in text


def test_channels_in_another_order_are_told_from_another_calibration() -> None:
    shot = shoot(VLP16, every=5)
    mixed = replace(shot, layer=np.random.default_rng(1).permutation(16)[shot.layer])
    text = refused(VLP16, mixed)
    assert "layers are in another order" in text
    assert "ring" in text


def test_rings_from_the_other_end_of_a_list_that_is_not_sorted() -> None:
    order = np.random.default_rng(1).permutation(16)
    beams = replace(VLP16, elevation=VLP16.elevation[order] + 0.7, fire_us=0.0)
    rank = np.argsort(np.argsort(beams.elevation))
    channel = np.argsort(beams.elevation)
    shot = shoot(beams, every=5)
    text = refused(beams, replace(shot, layer=channel[15 - rank[shot.layer]]))
    assert text.startswith("rings count from the other end")


def test_a_cloud_in_the_vehicle_s_frame_is_named_by_its_pose() -> None:
    shot = shoot(FIRED, every=3)
    moved = (shot.position - [0.4, -0.2, 1.5]) @ rotation(1.0, -3.0, 40.0)
    text = refused(FIRED, shot, moved)
    assert "the cloud stands in another frame" in text
    assert '--pose "0.4,-0.2,1.5,1,-3,40"' in text


def test_a_deskewed_cloud_is_named() -> None:
    shot = shoot(FIRED, every=3)
    share = shot.point / (FIRED.points - 1)
    moved = shot.position + np.array([1.6, 0.3, 0.0]) * share[:, None]
    text = refused(FIRED, shot, moved)
    assert "the cloud is deskewed" in text
    assert text.endswith("set deskewed = true in the sensor's file")


def test_a_mixture_is_no_change_of_the_file() -> None:
    shot = shoot(FIRED, every=3)
    rng = np.random.default_rng(0)
    half = rng.random(len(shot.layer)) < 0.3
    mixed = replace(shot, point=np.where(half, rng.integers(0, 1024, len(half)), shot.point))
    assert "no change makes them fit" in refused(FIRED, mixed)


def test_a_small_turn_is_a_warning() -> None:
    shot = shoot(FIRED, every=3)
    found = judged(FIRED, shot, shot.position @ rotation(0.0, 0.0, 0.08).T)
    assert isinstance(found, Geometry)
    assert found.verdict == "warning"
    assert "yaw 0.08 deg" in found.note
