"""How far summaries are apart, given how they scatter: r' C^-1 r with a covariance that is kept factored."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray, IndexArray

__all__ = ["Metric"]


@dataclass(frozen=True)
class Metric:
    """The squared Mahalanobis distance with the covariance C = D + F F'.

    `diagonal` (n,): D, positive. `factors` (n, k): F, a column for each independent source of scatter: a draw of the
    noise, a usual error of a nuisance, a run of beams along an edge. C^-1 by the identity of Sherman, Morrison and
    Woodbury, so that a column more costs little and C itself is never formed.
    """

    diagonal: FloatArray
    factors: FloatArray

    @classmethod
    def shrunk(cls, covariance: FloatArray, least: FloatArray, shrinkage: float) -> Metric:
        """Of a covariance (n, n) that is known from few draws.

        Its correlations are shrunk towards none by `shrinkage`, 0 ... 1 (O. Ledoit and M. Wolf, J. Multivariate Anal.
        88, 2004); no variance is below `least` (n,).
        """
        variance = np.diag(covariance)
        spread = np.sqrt(np.maximum(variance, least))
        values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
        factors = spread[:, None] * vectors * np.sqrt((1.0 - shrinkage) * np.maximum(values, 0.0))
        return cls(spread**2 - (1.0 - shrinkage) * variance, factors)

    @functools.cached_property
    def spread(self) -> FloatArray:
        """The standard deviation of each summary, shape (n,)."""
        return np.asarray(np.sqrt(self.diagonal + (self.factors**2).sum(axis=1)))

    @functools.cached_property
    def _small(self) -> FloatArray:
        scaled = self.factors / self.diagonal[:, None]
        return np.asarray(np.linalg.inv(np.eye(self.factors.shape[1]) + self.factors.T @ scaled))

    def widened(self, factors: FloatArray) -> Metric:
        """With further sources of scatter, shape (n, m)."""
        return Metric(self.diagonal, np.concatenate([self.factors, factors], axis=1))

    def of_rows(self, rows: IndexArray) -> Metric:
        """Of some of the summaries alone, the others not looked at."""
        return Metric(self.diagonal[rows], self.factors[rows])

    def times(self, r: FloatArray) -> FloatArray:
        """C^-1 r for r of shape (n,) or (n, m)."""
        d = self.diagonal if r.ndim == 1 else self.diagonal[:, None]
        plain = r / d
        return np.asarray(plain - (self.factors @ (self._small @ (self.factors.T @ plain))) / d)

    def inner(self, one: FloatArray, other: FloatArray) -> float:
        """one' C^-1 other, both of shape (n,)."""
        return float(one @ self.times(other))

    def square(self, r: FloatArray) -> float:
        """r' C^-1 r for r of shape (n,)."""
        return self.inner(r, r)
