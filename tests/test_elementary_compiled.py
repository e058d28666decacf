"""Compiled elementary functions against those of numpy's arrays: the same bits, over all there is."""

import numba  # noqa: F401 - what is loaded already may be used
import numpy as np
import pytest

from lidarcheck import elementary
from lidarcheck.arrays import FloatArray
from lidarcheck.elementary import blocks

RNG = np.random.default_rng(6)
N = 60_000
EDGES = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, 1e-320, 2.2250738585072014e-308, 1.0, -1.0, 0.5, 1e300,
                  -745.2, -746.0, -746.5, 709.78, 710.0, 711.0, np.pi, -np.pi / 2, 3 * np.pi / 4])  # fmt: skip
ARGUMENTS = {
    "exp": np.concatenate([EDGES, RNG.normal(size=N), RNG.uniform(-750.0, 712.0, N), -(10.0 ** RNG.uniform(-9, 3, N))]),
    "log": np.concatenate([EDGES, RNG.uniform(0.5, 2.0, N), 10.0 ** RNG.uniform(-323, 308, N), RNG.normal(size=N)]),
    "sin": np.concatenate([EDGES[EDGES != 1e300], RNG.uniform(-1e6, 1e6, N), RNG.normal(size=N)]),
    "cos": np.concatenate([EDGES[EDGES != 1e300], RNG.uniform(-1e6, 1e6, N), RNG.normal(size=N)]),
}


def bits(numbers: FloatArray) -> list[int]:
    """All bits, but of what is no number, which has no one sign."""
    return np.where(np.isnan(numbers), -1, numbers.view(np.int64)).tolist()


@pytest.mark.parametrize("name", ARGUMENTS)
def test_the_same_bits_compiled(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    function, x = getattr(elementary, name), ARGUMENTS[name]
    assert blocks.compiled_for(len(x)) is not None
    compiled = function(x)
    matrix = function(x[: len(x) // 3 * 3].reshape(-1, 3))
    monkeypatch.setattr(blocks, "_LARGE", len(x) + 1)
    assert blocks.compiled_for(len(x)) is None
    assert bits(compiled) == bits(function(x))
    assert bits(matrix.ravel()) == bits(compiled[: matrix.size])


def test_the_same_bits_of_angles(monkeypatch: pytest.MonkeyPatch) -> None:
    finite = EDGES[np.isfinite(EDGES) | np.isnan(EDGES)]
    size = 10.0 ** RNG.uniform(-320, 300, N)
    y = np.concatenate([np.repeat(finite, len(finite)), RNG.normal(size=N), size * RNG.choice([-1.0, 1.0], N)])
    x = np.concatenate([np.tile(finite, len(finite)), RNG.normal(size=N), size * RNG.normal(size=N)])
    compiled, apart = elementary.arctan2(y, x), elementary.arctan2(np.stack([y, x], axis=1)[:, 0], x)
    monkeypatch.setattr(blocks, "_LARGE", len(x) + 1)
    assert bits(compiled) == bits(elementary.arctan2(y, x)) == bits(apart)


@pytest.mark.parametrize("even", [False, True])
def test_lines_between_rows_as_numpy_draws_them(even: bool) -> None:
    steps = np.ones(9000) if even else np.where(RNG.random(9000) < 0.3, 0.0, 10.0 ** RNG.uniform(-9, 1, 9000))
    at, value = np.cumsum(steps), RNG.normal(size=9000)
    x = np.concatenate([RNG.uniform(at[0] - 1.0, at[-1] + 1.0, N), at, [np.inf, -np.inf, np.nan]])
    assert bits(elementary.interp(x, at, value)) == bits(np.interp(x, at, value))
    flat = np.zeros(9000)
    assert bits(elementary.interp(x, flat, value)) == bits(np.interp(x, flat, value))
