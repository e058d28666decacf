"""Each elementary function against more digits, over the range in use and at its edges; and that no other is used."""

import math
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck import elementary
from lidarcheck.arrays import FloatArray

RNG = np.random.default_rng(5)


def even(low: float, high: float, *more: float) -> FloatArray:
    return np.append(RNG.uniform(low, high, 400), more)


def decades(low: float, high: float) -> FloatArray:
    return np.asarray(10.0 ** RNG.uniform(low, high, 400))


CASES = {
    "exp": (mpmath.exp, [even(-700.0, 700.0, 0.0, -1e-300)], 1.0),
    "exp2": (lambda x: mpmath.mpf(2) ** x, [even(-60.0, 60.0)], 1.0),
    "expm1": (mpmath.expm1, [np.append(even(-40.0, 3.0), decades(-12.0, 1.0))], 1.5),
    "log": (mpmath.log, [np.append(decades(-300.0, 300.0), even(0.5, 2.0))], 1.0),
    "log1p": (mpmath.log1p, [np.append(even(-0.999, 5.0), -decades(-12.0, -0.1))], 1.5),
    "log2": (lambda x: mpmath.log(x, 2), [decades(-9.0, 9.0)], 2.0),
    "log10": (mpmath.log10, [decades(-9.0, 9.0)], 2.0),
    "sin": (mpmath.sin, [np.append(even(-7.0, 7.0), even(-1e5, 1e5))], 1.0),
    "cos": (mpmath.cos, [np.append(even(-7.0, 7.0), even(-1e5, 1e5))], 1.0),
    "tan": (mpmath.tan, [even(-7.0, 7.0)], 2.0),
    "arctan": (mpmath.atan, [np.append(even(-5.0, 5.0), decades(-9.0, 9.0))], 1.5),
    "arctan2": (mpmath.atan2, [even(-1.0, 1.0), even(-1.0, 1.0)], 1.5),
    "arcsin": (mpmath.asin, [even(-1.0, 1.0)], 2.0),
    "arccos": (mpmath.acos, [even(-1.0, 1.0)], 2.0),
    "power": (lambda x, y: x**y, [decades(-5.0, 5.0), even(-9.0, 8.0)[:400]], 5.0),
    "hypot": (mpmath.hypot, [even(-9.0, 9.0), even(-9.0, 9.0)], 1.5),
    "lgamma": (mpmath.loggamma, [np.array([0.3])], 16.0),
}
"""For each function: more digits of it, its arguments, and how many units in the last place it may be off."""


@pytest.mark.parametrize("name", CASES)
def test_against_more_digits(name: str) -> None:
    more_digits, arguments, most = CASES[name]
    found = np.atleast_1d(getattr(elementary, name)(*(a if len(a) > 1 else a[0] for a in arguments)))
    with mpmath.workprec(120):
        right = [more_digits(*(mpmath.mpf(float(x)) for x in row)) for row in zip(*arguments, strict=True)]
        off = [
            abs(mpmath.mpf(float(f)) - r) / float(np.spacing(abs(float(r)))) for f, r in zip(found, right, strict=True)
        ]
    assert max(off) <= most, arguments[0][int(np.argmax(off))]


@given(st.floats(0.1, 1e6))
@settings(max_examples=examples(60), deadline=None)
def test_log_of_the_gamma_function(x: float) -> None:
    assert elementary.lgamma(x) == pytest.approx(float(mpmath.loggamma(x)), rel=2e-14, abs=2e-14)


@pytest.mark.parametrize(
    ("function", "argument", "value"),
    [
        (elementary.exp, -np.inf, 0.0),
        (elementary.exp, np.inf, np.inf),
        (elementary.exp, 0.0, 1.0),
        (elementary.exp, -745.0, 5e-324),
        (elementary.exp2, -1074.0, 5e-324),
        (elementary.expm1, -np.inf, -1.0),
        (elementary.expm1, np.inf, np.inf),
        (elementary.expm1, 1e-18, 1e-18),
        (elementary.log, 0.0, -np.inf),
        (elementary.log, np.inf, np.inf),
        (elementary.log, 1.0, 0.0),
        (elementary.log1p, -1.0, -np.inf),
        (elementary.log1p, 1e-18, 1e-18),
        (elementary.log2, 2.0**-30, -30.0),
        (elementary.log10, 1000.0, 3.0),
        (elementary.log10, 1e-3, -3.0),
        (elementary.sin, math.pi, 1.2246467991473532e-16),
        (elementary.cos, math.pi / 2.0, 6.123233995736766e-17),
        (elementary.arccos, -1.0, math.pi),
        (elementary.arctan, np.inf, math.pi / 2.0),
    ],
)
def test_edges(function: Callable[[float], float], argument: float, value: float) -> None:
    assert function(argument) == value


@pytest.mark.parametrize("name", ["exp", "expm1", "log", "log1p", "log10", "exp2", "sin", "arccos"])
def test_what_is_no_number_stays_none(name: str) -> None:
    assert np.isnan(getattr(elementary, name)(np.nan))


def test_logarithms_below_zero_are_no_numbers() -> None:
    assert np.all(np.isnan(elementary.log(np.array([-1.0, -np.inf]))))
    assert np.all(np.isnan(elementary.arcsin(np.array([-1.1, 2.0]))))


@given(st.floats(0.0, 1e12), st.sampled_from([0.0, 1.0, 2.0]))
@settings(max_examples=examples(60), deadline=None)
def test_powers_that_need_no_rounding(x: float, y: float) -> None:
    assert elementary.power(x, y) == x**y


def test_quarters_of_the_plane() -> None:
    for y, x in [(0.0, 1.0), (-0.0, 1.0), (0.0, -1.0), (-0.0, -1.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (1.0, -1.0)]:
        found, right = elementary.arctan2(y, x), math.atan2(y, x)
        assert (found, math.copysign(1.0, found)) == (right, math.copysign(1.0, right))


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
@settings(max_examples=examples(60), deadline=None)
def test_sums_of_exponentials(x: float, y: float) -> None:
    assert elementary.logaddexp(x, y) == pytest.approx(float(np.logaddexp(x, y)), rel=1e-15, abs=3e-16)


@pytest.mark.parametrize("nodes", [2, 5, 8, 16])
def test_quadrature(nodes: int) -> None:
    """Exact for polynomials up to degree 2 n - 1."""
    place, weight = elementary.gauss_legendre(nodes)
    for degree in range(2 * nodes):
        right = 0.0 if degree % 2 else 2.0 / (degree + 1)
        assert float((weight * place**degree).sum()) == pytest.approx(right, abs=2e-15)


def test_products_of_matrices() -> None:
    a, b, v = RNG.normal(size=(4, 7, 3)), RNG.normal(size=(3, 5)), RNG.normal(size=3)
    np.testing.assert_allclose(elementary.product(a, b), a @ b, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(elementary.product(a, v), a @ v, rtol=1e-13, atol=1e-15)


def test_one_number_an_array_and_blocks_give_the_same() -> None:
    many = RNG.uniform(-3.0, 3.0, 20_000)
    for name in ("exp", "sin", "cos", "tan", "arctan", "expm1", "exp2"):
        function = getattr(elementary, name)
        whole = function(many.reshape(100, 200))
        assert whole.shape == (100, 200)
        assert np.array_equal(whole.ravel()[[0, 8191, 8192, -1]], [function(many[i]) for i in (0, 8191, 8192, -1)])


def test_tables_are_rounded_to_the_nearest_number() -> None:
    angles = even(-3.2, 3.2, 0.0, math.pi / 2.0)
    cosine, sine = elementary.rounded_cos_sin(angles)
    with mpmath.workprec(200):
        assert cosine.tolist() == [float(mpmath.cos(mpmath.mpf(float(a)))) for a in angles]
        assert sine.tolist() == [float(mpmath.sin(mpmath.mpf(float(a)))) for a in angles]
