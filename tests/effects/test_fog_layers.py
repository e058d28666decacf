"""Fog that thins out with height: what it does to the light, against slow sums along each beam."""

import dataclasses
import math

import numpy as np
import pytest

from effect_kit import Around, lit, plain, wall
from lidarcheck import effects
from lidarcheck.effects.shared.air_patches import patches_of

LAYERED = {"mor_m": 100.0, "thinning_per_m": 0.3}
LAYERS = [0, 200, 259, 260, 300, 519]


def around(distance_m: float = 120.0) -> Around:
    """A wall before a few columns of some layers."""
    ideal = wall(12 * len(LAYERS), distance_m)
    return Around(
        dataclasses.replace(
            ideal,
            layer=np.repeat(np.array(LAYERS, dtype=ideal.layer.dtype), 12),
            point=np.tile(np.arange(12, dtype=ideal.point.dtype), len(LAYERS)),
        )
    )


def climb(layer: int) -> float:
    """Height that a beam gains per metre; the reference sensor's layers are 0.05 degrees apart."""
    return math.sin(math.radians((layer - 259.5) * 0.05))


@pytest.mark.parametrize("thinning_per_m", [0.3, -0.2])
def test_surfaces_lose_what_the_air_on_their_way_takes(thinning_per_m: float) -> None:
    there = around()
    fog = effects.make("fog", {"mor_m": 100.0, "thinning_per_m": thinning_per_m})
    ratio = (lit(fog, there).pulse_signal / plain(there).pulse_signal).reshape(len(LAYERS), 12)
    for layer, row in zip(LAYERS, ratio, strict=True):
        fall = thinning_per_m * climb(layer)
        depth_m = -math.expm1(-fall * 120.0) / fall
        # The sum over cells of a metre is off by a 24th of the square of what the density changes by in one.
        assert row == pytest.approx(np.full(12, 0.05 ** (2.0 * depth_m / 100.0)), rel=0.01)


def test_a_level_beam_sees_even_fog() -> None:
    there = around()
    even, layered = (lit(effects.make("fog", LAYERED | more), there) for more in ({"thinning_per_m": 0.0}, {}))
    level = np.flatnonzero(np.isin(there.ideal.layer, [259, 260]))
    assert layered.pulse_signal[level] == pytest.approx(even.pulse_signal[level], rel=0.07)
    assert layered.pulse_signal[:12].max() < 0.5 * even.pulse_signal[0]
    assert layered.pulse_signal[-12:].min() > 2.0 * even.pulse_signal[-1]


def test_the_air_is_brighter_below_than_above() -> None:
    there = around()
    fog = LAYERED | {"overlap_start_m": 3.0, "overlap_full_m": 15.0}
    even, layered = (lit(effects.make("fog", fog | more), there).haze for more in ({"thinning_per_m": 0.0}, {}))
    assert even is not None
    assert layered is not None
    at_m = (np.arange(len(even.density_per_m)) + 0.5) * even.step_m
    share = (layered.row_share / even.row_share).reshape(len(LAYERS), 12)
    for layer, row in zip(LAYERS, share, strict=True):
        fall = 0.3 * climb(layer)
        dense, depth_m = np.exp(-fall * at_m), -np.expm1(-fall * at_m) / fall
        sent = even.density_per_m * dense * 0.05 ** (2.0 * (depth_m - at_m) / 100.0)
        # In steps of 2 %.
        assert row == pytest.approx(np.full(12, sent.sum() / even.density_per_m.sum()), rel=0.013)
    assert np.all(np.diff(share[:, 0]) <= 0.0)
    assert share[0, 0] > 1.3 * share[-1, 0]


def test_no_thinning_is_even_fog_bit_by_bit() -> None:
    there = around()
    one, other = (lit(effects.make("fog", {"mor_m": 100.0} | more), there) for more in ({}, {"thinning_per_m": 0.0}))
    assert np.array_equal(one.pulse_signal, other.pulse_signal)
    assert one.haze is not None
    assert other.haze is not None
    assert np.array_equal(one.haze.row_share, other.haze.row_share)


def test_the_steepest_thinning_stays_finite() -> None:
    for thinning_per_m in (2.0, -1.0):
        fog = effects.make("fog", {"mor_m": 20.0, "thinning_per_m": thinning_per_m})
        found = lit(fog, around(290.0))
        assert np.isfinite(found.pulse_signal).all()
        assert found.haze is not None
        assert np.isfinite(found.haze.row_share).all()


def test_patches_in_layers_multiply() -> None:
    columns, layers = 60, np.arange(0, 520, 2)
    ideal = wall(columns * len(layers), 90.0)
    there = Around(
        dataclasses.replace(
            ideal,
            layer=np.repeat(layers, columns).astype(ideal.layer.dtype),
            point=np.tile(np.arange(columns) * 16, len(layers)).astype(ideal.point.dtype),
        )
    )
    assert len(there.ideal) > 8192  # more than one block of beams
    patches, cells = patches_of(there, 0.5, 20.0, 12.0), np.arange(90) + 0.5
    fog = {"mor_m": 100.0, "thinning_per_m": 0.3, "patchiness": 0.5, "patch_m": 20.0, "patch_deg": 12.0}
    ratio = (lit(effects.make("fog", fog), there).pulse_signal / plain(there).pulse_signal).reshape(-1, columns)
    for i, column in [(0, 0), (7, 59), (130, 31), (259, 20)]:
        dense = patches.density[patches.row[column * 16], :90] * np.exp(-0.3 * climb(layers[i]) * cells)
        assert ratio[i, column] == pytest.approx(0.05 ** (2.0 * dense.sum() / 100.0), rel=1e-9)
