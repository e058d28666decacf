"""The descent that all fits use, on functions whose least point is known."""

from collections.abc import Iterator

import numpy as np
import pytest

from lidarcheck.inference.metric import Metric
from lidarcheck.inference.optimiser import (
    Point,
    broyden,
    damped_step,
    descend,
    identified_step,
    jacobian_at,
    normal_equations,
    without_flips,
)

SLOPES = np.array([[20.0, 3.0], [2.0, 30.0], [1.0, -8.0]])
TRUTH = np.array([1.5, -2.0])
METRIC = Metric(np.full(3, 2.0), np.array([[0.5], [0.0], [0.2]]))


class Bowl:
    """Least squares of a linear model; steps are `factor` of what they should be. Counts how often it is looked at."""

    def __init__(self, factor: float = 1.0, worth_doubling: float = float("inf"), lowest: float = -np.inf) -> None:
        self.factor, self.worth_doubling, self.lowest, self.looked = factor, worth_doubling, lowest, 0

    def at(self, x: np.ndarray, step: np.ndarray) -> Point:
        off = SLOPES @ (TRUTH - x)
        return Point(x, off, METRIC.square(off), step)

    def look(self, now: Point, step: np.ndarray) -> Point | None:
        self.looked += 1
        return None if (now.x + step)[1] < self.lowest else self.at(now.x + step, step)

    def steps(self, now: Point) -> Iterator[np.ndarray]:
        step = identified_step(*normal_equations(METRIC, SLOPES, now.shown))
        for part in (1.0, 0.25):
            yield part * self.factor * step

    def settled(self, before: Point, now: Point) -> bool:
        return now is before


def ends(bowl: Bowl, rounds: int) -> Point:
    return descend(bowl, bowl.at(np.zeros(2), np.zeros(2)), rounds)


def test_one_step_leads_to_the_end_of_a_linear_model() -> None:
    assert ends(Bowl(), 1).x == pytest.approx(TRUTH)


def test_steps_too_short_are_doubled_where_that_is_worth_it() -> None:
    assert ends(Bowl(0.25, 0.1), 1).x == pytest.approx(TRUTH)
    assert ends(Bowl(0.25), 1).x == pytest.approx(0.25 * TRUTH)


def test_steps_too_long_are_taken_shorter() -> None:
    assert ends(Bowl(4.0), 1).x == pytest.approx(TRUTH)


def test_where_no_sensor_is_none_goes() -> None:
    assert ends(Bowl(lowest=-1.0), 3).x == pytest.approx(TRUTH * (1.0 - 0.75**2))


def test_where_no_step_leads_nearer_it_ends() -> None:
    bowl = Bowl(-1.0)
    end = ends(bowl, 5)
    assert end.x.tolist() == [0.0, 0.0]
    assert bowl.looked == 2


def test_a_damped_step_is_shorter_and_limited() -> None:
    curvature, slope = normal_equations(METRIC, SLOPES, SLOPES @ TRUTH)
    lengths = [np.linalg.norm(damped_step(curvature, slope, damping)) for damping in (0.0, 0.1, 1.0, 10.0)]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] == pytest.approx(np.linalg.norm(TRUTH), rel=0.02)
    assert np.abs(damped_step(curvature, 1e6 * slope, 0.1)).max() == 7.0


def test_what_cannot_be_told_apart_stays_as_it_is() -> None:
    alike = np.array([[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    assert identified_step(alike, np.array([2.0, 2.0, 0.0])) == pytest.approx([0.25, 0.25, 0.0])
    assert identified_step(alike, np.array([1.0, -1.0, 5.0])) == pytest.approx([0.0, 0.0, 0.0])


def test_slopes_are_taken_as_wide_as_shows() -> None:
    tried: list[float] = []

    def shows(x: np.ndarray, seeds: int) -> np.ndarray | None:
        assert seeds == 1
        if x[1]:
            tried.append(float(x[1]))
        return None if x[1] == 1.0 else np.array([[10.0 * x[0], 0.2 * x[1], 0.4]])

    jacobian = jacobian_at(shows, np.zeros(2), np.zeros((2, 3)))
    assert jacobian[:, 0] == pytest.approx([10.0, 0.0, 0.0])
    assert jacobian[:, 1] == pytest.approx([0.0, 0.2, 0.0])
    assert tried == [1.0, -1.0, 4.0, 16.0]


def test_a_step_corrects_the_slopes_along_it_alone() -> None:
    step = np.array([2.0, 0.0])
    corrected = broyden(np.zeros((3, 2)), step, SLOPES @ step)
    assert corrected[:, 0] == pytest.approx(SLOPES[:, 0])
    assert not corrected[:, 1].any()


def test_flips_are_no_change() -> None:
    assert without_flips(np.array([0.6, -0.9, 2.0])).tolist() == [0.0, -0.9, 2.0]
    assert without_flips(np.array([0.6, 2.0]), np.array([1.0, 0.1])).tolist() == [0.6, 0.0]
