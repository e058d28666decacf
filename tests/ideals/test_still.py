"""Frames that stand still are told from frames that move, whatever their noise, and whoever walks through them."""

import numpy as np
import pytest

from lidarcheck.formats.assign.cloud import Cloud
from lidarcheck.ideals.still import Search, likeness, view_of
from recording_kit import frame


def cloud(seed, **how):
    layer, _, xyz, _ = frame(seed, **how)
    return Cloud(xyz, ring=layer)


@pytest.mark.parametrize("noise_m", [0.0005, 0.01, 0.05])
def test_noise_is_no_motion_and_motion_no_noise(noise_m):
    first = view_of(cloud(1, noise_m=noise_m))
    assert likeness(first, view_of(cloud(2, noise_m=noise_m))).still
    moved = view_of(cloud(3, noise_m=noise_m, place_m=(3.0 * noise_m + 0.02, 0.02, 0.0)))
    assert not likeness(first, moved).still


def test_columns_that_do_not_repeat_stand_still_too():
    """A turn of 179.7 columns: every frame's rays lie between those of the other."""
    layer, _, xyz, _ = frame(5, noise_m=0.004)
    turn = np.deg2rad(0.6)
    c, s = np.cos(turn), np.sin(turn)
    _, _, other, _ = frame(6, noise_m=0.0)
    level = np.hypot(other[:, 0], other[:, 1])
    azimuth = np.arctan2(other[:, 1], other[:, 0]) + turn
    u = np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, other[:, 2]], axis=1)
    u /= np.linalg.norm(u, axis=1)[:, None]
    ways = np.array([9.0, 7.0, 3.0]) / np.maximum(np.abs(u), 1e-9)
    noise = 0.004 * np.random.default_rng(7).standard_normal(len(u))
    between = u * (ways.min(axis=1) + noise)[:, None]
    first, second = view_of(Cloud(xyz, ring=layer)), view_of(Cloud(between, ring=layer))
    assert likeness(first, second).still
    turned = xyz @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    assert not likeness(first, view_of(Cloud(turned, ring=layer))).still


def test_a_person_who_walks_through_is_no_motion_of_the_sensor():
    layer, point, xyz, _ = frame(8)
    before = (point > 40) & (point < 50) & (layer < 12)
    walked = np.where(before[:, None], xyz * 0.4, xyz)
    found = likeness(view_of(cloud(9)), view_of(Cloud(walked, ring=layer)))
    assert found.still
    assert 0.02 < found.changed < 0.08


def search(clouds):
    found = Search()
    for one in clouds:
        found.look(one)
    return found


def test_the_longest_run_is_found():
    drive = [(0.3 * k, 0.0, 0.0) for k in range(4)]
    rest = [(1.2, 0.0, 0.0)] * 6
    on = [(1.2 + 0.3 * k, 0.0, 0.0) for k in range(1, 4)]
    found = search([cloud(k, place_m=place) for k, place in enumerate([*drive, *rest, *on])])
    assert (found.best.first, found.best.last) == (4, 9)
    assert found.seen == 13
    assert not found.two_sensors


def test_what_creeps_does_not_stand_still():
    """From frame to frame less than the noise, over the run much more."""
    found = search([cloud(k, noise_m=0.02, place_m=(0.01 * k, 0.004 * k, 0.0)) for k in range(12)])
    assert found.best is None or len(found.best) < 8


def test_two_sensors_that_take_turns_are_noticed():
    found = search([cloud(k, place_m=(0.0, 0.0, 0.0) if k % 2 else (2.0, 1.0, 0.0)) for k in range(8)])
    assert found.best is None
    assert found.two_sensors


def test_without_rings_bands_of_elevation_do():
    xyz = [frame(k)[2] for k in (1, 2)]
    assert likeness(*(view_of(Cloud(one)) for one in xyz)).still
