"""Which echoes of a beam are kept, where there are more than it may report."""

import numpy as np
import pytest
from numba import typeof

from lidarcheck.model.exact.echoes import keep, new_echoes


@pytest.mark.parametrize("room", [1, 2, 3])
def test_the_largest_echoes_are_kept_in_order_of_time(room: int) -> None:
    """Of two as large the earlier, each with its own numbers; other beams' are left alone."""
    rng = np.random.default_rng(room)
    echoes = new_echoes(40, room)
    for beam in range(0, 40, 2):
        areas = rng.integers(1, 6, rng.integers(0, 8))
        for k, area in enumerate(areas):
            keep(echoes, beam, k + 0.5, k + 10, area, k + 100)
        left = sorted(sorted(range(len(areas)), key=lambda k: -areas[k])[:room])
        held = echoes.held[beam]
        assert echoes.area[beam, :held].tolist() == areas[left].tolist()
        assert echoes.centre[beam, :held].tolist() == [k + 0.5 for k in left]
        assert echoes.width[beam, :held].tolist() == [k + 10 for k in left]
        assert echoes.peak[beam, :held].tolist() == [k + 100 for k in left]
    assert not echoes.held[1::2].any()


@pytest.mark.parametrize("beams", [0, 1, 2])
def test_few_beams_need_no_kernels_of_their_own(beams: int) -> None:
    assert typeof(new_echoes(beams, 3)) == typeof(new_echoes(1000, 3))
