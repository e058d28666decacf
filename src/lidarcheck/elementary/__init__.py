"""Elementary functions that give the same bits on every machine: sums, products, quotients and square roots only.

The mathematics libraries of C and of numpy choose their code by the processor, and their last digit with it: exp and
log differ in one value of twenty. Whatever ends up in a scan's or a golden's bytes is worked out with these instead;
`tool.ruff.lint.flake8-tidy-imports` in pyproject.toml refuses the others in the rooms concerned. Arguments are numbers
or arrays, results float64, right to about one unit in the last place (`tests/test_elementary.py` holds each against
more digits). Compiled kernels have `model/lane_math.py`.

The methods are the textbook's (Muller, Elementary Functions): an argument is brought near zero with a constant in two
or three parts, whose first are short enough that their products are exact, and a Taylor series does the rest.
"""

from lidarcheck.elementary.angles import arccos, arcsin, arctan, arctan2, cos, hypot, rounded_cos_sin, sin, tan
from lidarcheck.elementary.exponentials import exp, exp2, expm1, lgamma, log, log1p, log2, log10, logaddexp, power
from lidarcheck.elementary.lines import interp
from lidarcheck.elementary.sums import gauss_legendre, product

__all__ = [
    "arccos",
    "arcsin",
    "arctan",
    "arctan2",
    "cos",
    "exp",
    "exp2",
    "expm1",
    "gauss_legendre",
    "hypot",
    "interp",
    "lgamma",
    "log",
    "log1p",
    "log2",
    "log10",
    "logaddexp",
    "power",
    "product",
    "rounded_cos_sin",
    "sin",
    "tan",
]
