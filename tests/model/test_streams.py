"""Random streams: the generator against numpy's, and what a draw depends on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarcheck.model import streams

WORD = st.integers(0, 2**64 - 1)
INDEX = st.integers(0, 2**31 - 1)


def numpy_draws(seed: int, purpose: str, frame: int, beam: int, draws: int) -> np.ndarray:
    """The same draws from numpy's own Philox, which counts up before it computes a block."""
    before = (beam << 64) + (frame << 128) - 1
    counter = np.array([before >> (64 * i) & (2**64 - 1) for i in range(4)], dtype=np.uint64)
    key = np.array([seed, streams.purpose_key(purpose)], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(counter=counter, key=key)).random(draws)


@settings(deadline=None)
@given(seed=WORD, frame=INDEX, layer=st.integers(0, 519), point=st.integers(1, 959), draws=st.integers(1, 50))
def test_draws_are_those_of_numpy_philox(seed: int, frame: int, layer: int, point: int, draws: int) -> None:
    ours = streams.uniforms(seed, "spads", frame, [layer], [point], draws)[0]
    assert np.array_equal(ours, numpy_draws(seed, "spads", frame, (layer << 32) + point, draws))


def test_a_draw_does_not_depend_on_order_or_company() -> None:
    layer, point = np.divmod(np.arange(500), 25)
    together = streams.uniforms(7, "dropout", 3, layer, point, 9)
    shuffled = np.random.default_rng(0).permutation(500)
    assert np.array_equal(streams.uniforms(7, "dropout", 3, layer[shuffled], point[shuffled], 9), together[shuffled])
    assert np.array_equal(streams.uniforms(7, "dropout", 3, layer[:1], point[:1], 5)[0], together[0, :5])


@pytest.mark.parametrize("changed", [{"seed": 8}, {"purpose": "fog"}, {"frame": 4}, {"point": [6]}, {"layer": [3]}])
def test_every_part_of_the_key_matters(changed: dict[str, object]) -> None:
    key = {"seed": 7, "purpose": "dropout", "frame": 3, "layer": [2], "point": [5], "draws": 8}
    assert not np.any(streams.uniforms(**key) == streams.uniforms(**{**key, **changed}))  # type: ignore[arg-type]


def test_draws_are_uniform_and_uncorrelated_between_beams() -> None:
    layer, point = np.divmod(np.arange(100_000), 960)
    draws = streams.uniforms(0, "spads", 0, layer, point, 2)
    assert abs(draws.mean() - 0.5) < 5 * np.sqrt(1 / 12 / draws.size)
    neighbours = np.corrcoef(draws[:-1, 0], draws[1:, 0])[0, 1]
    assert abs(neighbours) < 5 / np.sqrt(len(draws))
    assert abs(np.corrcoef(draws[:, 0], draws[:, 1])[0, 1]) < 5 / np.sqrt(len(draws))
