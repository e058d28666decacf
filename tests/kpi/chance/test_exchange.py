"""The exchanges against the plain KPIs of samples that are exchanged row by row, and what is made of them."""

import numpy as np
import pytest

from lidarcheck.kpi.chance.draws import (
    blooming_draws,
    difference_draws,
    means_apart,
    mixed,
    moments_draws,
    ratio_draws,
    scatters_apart,
)
from lidarcheck.kpi.chance.exchange import EXCHANGES, Drawn, judge, signs_of
from lidarcheck.kpi.chance.tallies import Histogram, block_of
from lidarcheck.kpi.compare import feature_gap
from lidarcheck.kpi.percentiles import LEVELS, percentile

UNITS = 6


def tallied(values, units):
    """A histogram of both sides; `values`, `units`: measured, simulated."""
    found = Histogram()
    found.add(0, UNITS, tuple(np.asarray(u) for u in units), tuple(np.asarray(v, dtype=float) for v in values))
    return found


@pytest.mark.parametrize("step", [1.0, 0.01, 0.0])
def test_every_exchange_has_the_kpis_of_the_exchanged_samples(step):
    """As many rows of either side in each unit, so that all weigh 1; lattices of two steps, and none."""
    g = np.random.default_rng(4)
    units = np.repeat(np.arange(UNITS), 60)
    values = [g.normal(50.0 + side, 3.0 + side, units.size) for side in (0.0, 1.0)]
    values = [np.round(v / step) * step for v in values] if step else values
    signs = signs_of(UNITS)
    value, counts = (held := tallied(values, (units, units))).filled([UNITS])
    drawn = mixed(value, counts, signs).distances(held.js_edges)
    for i in (0, 1, 13, 40):
        swap = signs[i][units] < 0
        gap = feature_gap(np.where(swap, values[1], values[0]), np.where(swap, values[0], values[1]))
        for kpi, draws in drawn.items():
            assert draws[i] == pytest.approx(getattr(gap, kpi), abs=1e-9), kpi


def test_medians_of_every_exchange():
    g = np.random.default_rng(5)
    units = np.repeat(np.arange(UNITS), 61)
    values = [g.integers(0, 40, units.size) + side for side in (0.0, 3.0)]
    signs = signs_of(UNITS)
    apart = mixed(*tallied(values, (units, units)).filled([UNITS]), signs).medians_apart()
    for i in range(0, 64, 7):
        swap = signs[i][units] < 0
        one, other = np.where(swap, values[1], values[0]), np.where(swap, values[0], values[1])
        assert apart[i] == np.quantile(one, 0.5, method="inverted_cdf") - np.quantile(other, 0.5, method="inverted_cdf")


@pytest.mark.parametrize("step", [1.0, 0.01, 0.0])
def test_percentiles_of_every_exchange(step):
    g = np.random.default_rng(6)
    units = np.repeat(np.arange(UNITS), 60)
    values = [g.normal(50.0 + side, 3.0, units.size) for side in (0.0, 1.0)]
    values = [np.round(v / step) * step for v in values] if step else values
    signs = signs_of(UNITS)
    drawn = mixed(*tallied(values, (units, units)).filled([UNITS]), signs).percentiles_apart([0.05, 0.5, 0.95])
    for i in range(0, 64, 7):
        swap = signs[i][units] < 0
        one, other = np.where(swap, values[1], values[0]), np.where(swap, values[0], values[1])
        for level, draws in zip(LEVELS, drawn, strict=True):
            assert draws[i] == pytest.approx(percentile(one, level) - percentile(other, level), abs=1e-9)
    assert [
        draws[0] for draws in mixed(np.array([7.0]), np.ones((2, 2, 1)), np.ones((1, 2))).percentiles_apart([0.5])
    ] == [0.0]


def test_means_and_scatters_of_every_exchange():
    g = np.random.default_rng(7)
    units = np.repeat(np.arange(UNITS), 50)
    values = [g.normal(side, 1.0 + side, units.size) for side in (0.0, 0.5)]
    powers = [[np.bincount(units, weights=v**power) for power in range(3)] for v in values]
    sums, signs = np.moveaxis(np.array(powers), 1, 2), signs_of(UNITS)
    means, scatters = means_apart(sums[..., :2], signs), scatters_apart(sums, signs)
    for i in range(0, 64, 7):
        swap = signs[i][units] < 0
        one, other = np.where(swap, values[1], values[0]), np.where(swap, values[0], values[1])
        assert means[i] == pytest.approx(one.mean() - other.mean())
        assert scatters[i] == pytest.approx(one.std() - other.std())
    # What is the same in all rows scatters by nothing, however far off it is.
    same = np.tile([50.0, 50 * 0.025, 50 * 0.025**2], (2, UNITS, 1))
    assert not scatters_apart(same, signs).any()


def test_a_unit_weighs_the_same_on_either_side():
    """Half of one unit's echoes are lost: what is left of them counts twice, and no feature has moved."""
    values = np.tile(np.arange(40.0), UNITS) + np.repeat(10.0 * np.arange(UNITS), 40)
    units = np.repeat(np.arange(UNITS), 40)
    kept = (units > 0) | (np.arange(units.size) % 2 == 0)
    value, counts = (held := tallied((values[kept], values), (units[kept], units))).filled([UNITS])
    drawn = mixed(value, counts, np.ones((1, UNITS))).distances(held.js_edges)
    assert abs(drawn["dvm_bias"][0]) < 0.1
    assert feature_gap(values[kept], values).dvm_bias > 2.0
    # Of a unit that one side lacks there is nothing to compare.
    alone = mixed(value, np.where(np.arange(UNITS)[:, None] == 0, 0.0, counts), np.ones((1, UNITS)))
    assert alone.pooled[-1] == pytest.approx(2.0)
    assert mixed(value, counts * np.array([1.0, 0.0])[:, None, None], np.ones((1, UNITS))) is None


def test_counts_shares_and_ratios_by_hand():
    signs = np.array([[1.0, 1.0], [-1.0, 1.0]])
    hits, trials = np.array([[3.0, 4.0], [1.0, 2.0]]), np.array([[10.0, 10.0], [10.0, 10.0]])
    np.testing.assert_allclose(difference_draws(hits, None, signs), [4.0, 0.0])
    np.testing.assert_allclose(difference_draws(hits, trials, signs), [4 / 20, 0.0])
    # One unit: the target's mean is 10 on both sides, the ghost's 2 and 1.
    ghost, target = np.array([[[4.0, 8.0]], [[4.0, 4.0]]]), np.array([[[2.0, 20.0]], [[4.0, 40.0]]])
    np.testing.assert_allclose(ratio_draws(ghost, target, np.array([[1.0], [-1.0]])), [0.1, -0.1])
    # Rows at x = ±2 and ±1 measured, ±1 and ±1 simulated: RMS 2 over 1, and 1 over 1.
    wide, narrow = [2.0, 0.0, 0.0, 0.0, 8.0], [2.0, 0.0, 0.0, 0.0, 2.0]
    sizes = moments_draws(np.array([[wide], [narrow]]), np.array([[narrow], [narrow]]), np.array([[1.0], [-1.0]]))
    np.testing.assert_allclose(sizes, [1.0, -1.0])


def test_blooming_by_hand():
    """Two offsets: twice the AREA at one, the same at the other; an offset of one side alone cannot enter."""
    measured, simulated = [[2.0, 40.0], [2.0, 30.0], [1.0, 5.0]], [[2.0, 20.0], [2.0, 30.0], [0.0, 0.0]]
    drawn = blooming_draws(np.array([[measured], [simulated]]), np.array([[1.0], [-1.0]]))
    np.testing.assert_allclose(drawn, np.log10(2.0) / np.sqrt(2.0))


def test_exchanges_are_all_or_as_many_as_asked():
    few, many = signs_of(8), signs_of(9)
    assert few.shape == (256, 8)
    assert len(np.unique(few, axis=0)) == 256
    assert many.shape == (EXCHANGES + 1, 9)
    assert (few[0] == 1.0).all()
    assert (many[0] == 1.0).all()
    np.testing.assert_array_equal(many, signs_of(9))
    assert abs(signs_of(60).mean()) < 0.01


def test_blocks_of_sixteen_columns():
    np.testing.assert_array_equal(block_of(np.array([-1, 0, 15, 16, 959], dtype=np.int32)), [0, 1, 1, 2, 60])


def drawn(values, units=20, kpi="ks", of="AREA"):
    return Drawn(kpi, of, np.asarray(values, dtype=float), units)


class TestJudge:
    def test_one_kpi_stands_out_where_at_most_five_percent_reach_it(self):
        below = np.arange(499.0)
        (found,), _ = judge([drawn([600.0, *below])], "blocks")
        assert found.stands_out
        assert found.chance == 474.0  # the 475th of 500
        (found,), _ = judge([drawn([473.5, *below])], "blocks")
        assert not found.stands_out

    def test_a_difference_counts_by_its_magnitude(self):
        (found,), _ = judge([drawn([-600.0, *np.arange(499.0)])], "blocks")
        assert found.stands_out

    def test_the_family_asks_for_more_than_its_own_level(self):
        """Among 30 independent KPIs the largest is often beyond the 95 % of each."""
        g = np.random.default_rng(1)
        alone, family = 0, 0
        for _ in range(100):
            judged, _ = judge([drawn(np.abs(g.normal(size=500)), of=str(k)) for k in range(30)], "blocks")
            alone += any(one.score > 0 and one.stands_out for one in judged)
            values = [abs(one.score) for one in judged]
            family += max(values) > 1.9
        assert alone <= 12
        assert family > 60

    @pytest.mark.parametrize(
        ("one", "why"),
        [
            (drawn(np.arange(500.0), units=2), "its rows lie in 2 blocks"),
            (drawn(np.arange(500.0), units=1), "its rows lie in 1 block"),
            (drawn(np.arange(500.0), units=0), "none of the blocks has enough rows"),
            (drawn(np.zeros(500)), "no exchange changes it"),
            (drawn(np.full(500, 0.3)), "no exchange changes it"),
            (drawn([np.nan]), "it is not defined here"),
            (drawn([1.0, np.nan]), "it is not defined in every exchange"),
            (Drawn("chamfer", "", np.full(1, np.nan), 0, "never judged"), "never judged"),
        ],
    )  # fmt: skip
    def test_what_is_not_judged_says_why(self, one, why):
        (found,), limit = judge([one], "blocks")
        assert found.not_judged == why
        assert not found.stands_out
        assert np.isnan(limit)
