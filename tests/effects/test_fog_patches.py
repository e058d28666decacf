"""Fog in patches: the density's statistics, and what it does to the light, against slow sums."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import ndtri

from effect_kit import Around, empty, lit, plain, wall
from lidarcheck import effects
from lidarcheck.effects.shared.air_patches import patches_of
from lidarcheck.model import Model, simulate
from lidarcheck.sensor import Material, Sensor

PATCHY = {"mor_m": 100.0, "patchiness": 0.5, "patch_m": 20.0, "patch_deg": 12.0}


def frames(count: int) -> list[Around]:
    """Surroundings that differ by their random numbers alone."""
    return [Around(wall(1), seed=seed) for seed in range(count)]


def density(around: Around, point: int, range_m: float) -> float:
    """The relative density in the half degree and the metre of a place, wave by wave."""
    uniform = around.uniforms([520], [0], 48)[0]
    middle_deg = (math.floor(point * 0.125 / 0.5) + 0.5) * 0.5
    field = 0.0
    for k in range(16):
        along, across = ndtri(uniform[k]), ndtri(uniform[16 + k])
        turn = along * (math.floor(range_m) + 0.5) / 20.0 + across * middle_deg / 12.0
        field += math.sqrt(2.0 / 16.0) * math.cos(turn + 2.0 * math.pi * uniform[32 + k])
    return math.exp(0.5 * field - 0.125)


def test_fog_without_patches_is_even_fog_bit_by_bit() -> None:
    around = Around(wall(960))
    one, other = (lit(effects.make("fog", {"mor_m": 100.0} | more), around) for more in ({}, {"patchiness": 0.0}))
    assert np.array_equal(one.pulse_signal, other.pulse_signal)
    assert one.haze is not None
    assert other.haze is not None
    assert np.array_equal(one.haze.row_share, other.haze.row_share)


def test_no_beams_are_no_trouble() -> None:
    assert len(lit(effects.make("fog", PATCHY), Around(empty()))) == 0


def test_the_density_is_log_normal_of_mean_one() -> None:
    # Sectors a patch apart; by the spread from frame to frame, 100 frames give either mean to 0.009 and the standard
    # deviation to 0.9 %.
    found = np.array([patches_of(one, 0.5, 20.0, 12.0).density[:-1:24] for one in frames(100)])
    log = np.log(found)
    assert found.mean() == pytest.approx(1.0, abs=0.03)
    assert log.mean() == pytest.approx(-0.125, abs=0.03)
    assert log.std() == pytest.approx(0.5, rel=0.03)


@pytest.mark.long
@pytest.mark.parametrize(("sectors", "cells"), [(24, 0), (0, 20), (24, 20)])
def test_patches_are_as_large_as_is_said(sectors: int, cells: int) -> None:
    log = np.log([patches_of(one, 0.5, 20.0, 12.0).density for one in frames(600)]) + 0.125
    here, there = log[:, : -1 - sectors, : -1 - cells], log[:, sectors:-1, cells:-1]
    found = (here * there).mean() / 0.25
    # 12 degrees are 24 sectors, 20 m are 20 cells: a size away in either direction it falls by sqrt(e).
    assert found == pytest.approx(math.exp(-0.5 * ((sectors / 24) ** 2 + (cells / 20) ** 2)), abs=0.05)


def test_every_pulse_passes_the_patches_on_its_way() -> None:
    distance = np.linspace(0.5, 250.0, 960)
    around = Around(wall(960, distance))
    ratio = lit(effects.make("fog", PATCHY), around).pulse_signal / plain(around).pulse_signal
    for point in range(0, 960, 97):
        whole = math.floor(distance[point])
        depth = sum(density(around, point, cell) for cell in range(whole))
        depth += (distance[point] - whole) * density(around, point, whole)
        assert ratio[point] == pytest.approx(0.05 ** (2 * depth / 100.0), rel=1e-9)


def test_the_air_is_as_bright_as_its_patches_close_by_are_dense() -> None:
    around = Around(wall(960))
    fog = PATCHY | {"overlap_start_m": 0.5, "overlap_full_m": 8.0}
    even, patchy = (lit(effects.make("fog", fog | more), around).haze for more in ({"patchiness": 0.0}, {}))
    assert even is not None
    assert patchy is not None
    at_m = (np.arange(len(even.density_per_m)) + 0.5) * even.step_m
    for point in range(0, 960, 97):
        dense = np.array([density(around, point, r) for r in at_m])
        depth = np.cumsum(dense) * even.step_m - 0.5 * dense * even.step_m
        sent = even.density_per_m * dense * 0.05 ** (2 * (depth - at_m) / 100.0)
        part = sent.sum() / even.density_per_m.sum()
        # In steps of 2 %, by which no two sectors differ for nothing.
        assert patchy.row_share[point] / even.row_share[point] == pytest.approx(part, rel=0.012)
    assert np.ptp(patchy.row_share) > 0.1
    assert np.array_equal(patchy.density_per_m, even.density_per_m)


def test_another_frame_has_other_patches_and_a_beam_the_same_beside_any_others() -> None:
    fog = effects.make("fog", PATCHY)
    ideal = wall(960)
    every, again, other = (lit(fog, Around(ideal, seed=seed)).pulse_signal for seed in (1, 1, 2))
    assert np.array_equal(every, again)
    assert not np.allclose(every, other, rtol=0.01)
    few = lit(fog, Around(ideal.take(np.arange(5, 960, 7)))).pulse_signal
    assert np.array_equal(few, every[5::7])


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_frames_of_a_scan_differ_by_more_than_in_even_fog(variant: str) -> None:
    ideal = dataclasses.replace(wall(1920, 80.0), layer=np.repeat([200, 300], 960))
    air = {"mor_m": 120.0, "backscatter": 0.046, "overlap_start_m": 1.0, "overlap_full_m": 6.0, "patch_deg": 300.0}

    def echoes_close_by(patchiness: float) -> np.ndarray:
        model = Model(Sensor.of(variant), {1: Material("wall", 0.5)}).with_(
            effects.make("fog", air | {"patchiness": patchiness})
        )
        scans = [simulate(ideal, model, seed=3, frame=k, threads=1) for k in range(12)]
        return np.array([scan.area[scan.range_m < 20.0].sum() for scan in scans])

    even, patchy = echoes_close_by(0.0), echoes_close_by(0.4)
    assert patchy.std() > 5.0 * even.std()
    assert patchy.mean() == pytest.approx(even.mean(), rel=0.4)
