"""The ranking of a scene comparison against closed forms and against chance."""

import numpy as np
import pytest

from lidarcheck.calibration.scenes.groups import UnitGroups
from lidarcheck.calibration.scenes.rank import FEWEST_UNITS, rank
from lidarcheck.calibration.scenes.units import Values

N = 4000


def values(**of) -> Values:
    n = len(next(iter(of.values())))
    return Values({name: np.asarray(column, dtype=np.float64) for name, column in of.items()}, np.full(n, np.nan))


def kinds(parts: int = 40, n: int = N, seed: int = 0) -> list[UnitGroups]:
    """The whole, parts of equal size, and sectors across them."""
    index = np.arange(n) % parts
    sector = np.arange(n) * 20 // n
    return [
        UnitGroups("frame", np.zeros(n, dtype=np.int64), ("the whole frame",)),
        UnitGroups("object", index, tuple(f"object {i}" for i in range(parts))),
        UnitGroups("sector", sector, tuple(f"sector {i}" for i in range(20))),
    ]


def listed(ranking) -> list[str]:
    return [found.name for found in ranking.findings]


def test_z_of_lost_echoes_is_root_of_twice_their_number():
    groups = kinds()
    lost = groups[1].index == 7
    ones = np.ones(N)
    ranking = rank(values(echo=np.where(lost, 0.0, 1.0)), values(echo=ones), values(echo=ones), groups)
    assert listed(ranking) == ["object 7"]
    assert ranking.findings[0].z == pytest.approx(-np.sqrt(2 * lost.sum()))
    assert np.array_equal(ranking.findings[0].units, lost)


def test_z_of_a_shift_is_that_of_the_three_values():
    rng = np.random.default_rng(3)
    m, a, b = rng.normal(size=(3, N))
    groups = kinds()
    m = m + np.where(groups[1].index == 3, 4.0, 0.0)
    found = rank(values(range_residual=m), values(range_residual=a), values(range_residual=b), groups).findings[0]
    own = groups[1].index == 3
    change = (m - (a + b) / 2)[own]
    # All six orders of three values are equally likely by chance: the variance over them, counted out.
    orders = [(0, 1, 2), (1, 0, 2), (2, 0, 1)]
    three = np.stack([m, a, b])[:, own]
    permuted = np.stack([three[i] - (three[j] + three[k]) / 2 for i, j, k in orders])
    assert found.name == "object 3"
    assert found.z == pytest.approx(change.sum() / np.sqrt((permuted**2).mean(axis=0).sum()))


DRAWS = {
    "gauss": lambda rng: rng.normal(size=(3, N)),
    "heavy tails": lambda rng: rng.standard_cauchy(size=(3, N)),
    "nearly always one value": lambda rng: (rng.random((3, N)) < 0.002).astype(float),
    "of very different spread": lambda rng: rng.normal(size=(3, N)) * np.geomspace(1e-3, 1e3, N),
}


@pytest.mark.parametrize("draw", DRAWS)
def test_chance_is_not_listed(draw):
    groups = kinds()
    alarms = 0
    for seed in range(40):
        m, a, b = (values(range_residual=x) for x in DRAWS[draw](np.random.default_rng(seed)))
        alarms += bool(rank(m, a, b, groups).findings)
    assert alarms <= 2  # a hundredth is allowed


def test_what_moves_many_beams_together_is_not_taken_for_a_disagreement():
    groups = kinds()
    alarms = bare = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        together = rng.normal(size=(3, 40))[:, groups[1].index]
        m, a, b = (values(range_residual=x) for x in rng.normal(size=(3, N)) + together)
        alarms += bool(rank(m, a, b, groups).findings)
        bare += bool(rank(m, a, None, groups).findings)
    assert alarms <= 3
    assert bare > 15  # without the second simulation nothing says that beams move together


def test_a_part_of_the_frame_is_named_and_not_what_contains_it():
    rng = np.random.default_rng(1)
    m, a, b = rng.normal(size=(3, N))
    groups = kinds()
    m[groups[1].index == 5] -= 3.0
    assert listed(rank(values(peak=m), values(peak=a), values(peak=b), groups)) == ["object 5"]


def test_the_whole_frame_is_named_where_all_of_it_disagrees():
    rng = np.random.default_rng(1)
    m, a, b = rng.normal(size=(3, N))
    ranking = rank(values(peak=m - 0.5), values(peak=a), values(peak=b), kinds())
    assert listed(ranking) == ["the whole frame"]


def test_a_part_that_disagrees_more_than_the_frame_is_named_behind_it():
    rng = np.random.default_rng(2)
    m, a, b = rng.normal(size=(3, N))
    groups = kinds()
    m = m - 0.5 - np.where(groups[2].index == 4, 1.0, 0.0)
    assert set(listed(rank(values(peak=m), values(peak=a), values(peak=b), groups))[:2]) == {
        "the whole frame",
        "sector 4",
    }


def test_the_larger_of_two_comes_first():
    rng = np.random.default_rng(4)
    m, a, b = rng.normal(size=(3, N))
    groups = kinds()
    m[groups[1].index == 9] += 1.5
    m[groups[1].index == 2] += 5.0
    assert listed(rank(values(peak=m), values(peak=a), values(peak=b), groups)) == ["object 2", "object 9"]


def test_too_few_units_are_never_listed():
    n = N
    index = np.where(np.arange(n) < FEWEST_UNITS - 1, 0, 1)
    groups = [*kinds()[::2], UnitGroups("object", index, ("few", "many"))]
    ones = np.ones(n)
    ranking = rank(values(echo=np.where(index == 0, 0.0, 1.0)), values(echo=ones), values(echo=ones), groups)
    assert "few" not in listed(ranking)
