"""How well a classifier tells measured from simulated rows: `classifier_gap`, 2 AUC - 1, and what chance makes of it.

A classifier two-sample test (D. Lopez-Paz and M. Oquab, ICLR 2017). It shares nothing with any distance, so that what
these are blind to it may see. The trees are scikit-learn's, whose versions differ: the figure is no golden.
"""

from __future__ import annotations

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray

__all__ = [
    "EXCHANGES",
    "FEWEST_BLOCKS",
    "FOLDS",
    "classifier_gap",
    "exchange_floor",
    "folds_of",
    "gap_of_scores",
    "scores_of",
]

FOLDS = 5
"""Each row is judged by a classifier that has learnt from the other four fifths."""
BLOCK = 16
"""Where frames are too few for folds of their own, blocks of so many layers and points are dealt to them."""
FEWEST_BLOCKS = 10
"""Of fewer blocks, and fewer frames than folds, chance makes too much: there is no figure."""
EXCHANGES = 400
"""Exchanges of the two labels, whose scatter is known to a thirtieth."""
OF_EXCHANGES = 3.3
"""The floor in standard deviations of exchanges: 2.33 (1 %, one-sided) times sqrt 2, as folds train on each other."""
_ITERATIONS = 60
"""Trees of the boosting: beyond these the figure of what differs grows no more, and chance's share does."""


def classifier_gap(rows: FloatArray, measured: BoolArray, fold: IndexArray) -> float:
    """2 AUC - 1 of trees that are asked which rows are measured: 0 where they cannot tell, below it by chance.

    `rows` (n, features), NaN where a row has no such feature; `measured` (n,); `fold` (n,) from `folds_of`.
    """
    return gap_of_scores(scores_of(rows, measured, fold), measured)


def folds_of(
    frame: IndexArray,
    layer: IndexArray,
    point: IndexArray,
    *,
    repeated: bool = False,
    seed: int = 0,
    piece: IndexArray | None = None,
) -> IndexArray | None:
    """The fold of each beam, 0 ... 4, shape (n,): by frame, with fewer than five frames by blocks of 16 x 16 beams.

    `layer`, `point`: counted along the fired lattice. `piece`: where there is none, which of 40 equal pieces of its
    frame a beam lies in (`lattice.piece_of`), in place of blocks. `repeated`: frames show the same rays, of which each
    is in one fold in all of them. Whole units are dealt at random. None with too few of them for a figure.
    """
    by_frame = not repeated and len(np.unique(frame)) >= FOLDS
    rows, columns = (layer // BLOCK, point // BLOCK) if piece is None else (np.zeros_like(piece), piece)
    blocks = np.stack([frame * (not repeated), rows, columns])
    units, which = np.unique(blocks[:1] if by_frame else blocks, axis=1, return_inverse=True)
    count = units.shape[1]
    if not by_frame and count < FEWEST_BLOCKS:
        return None
    dealt = np.random.default_rng(seed).permutation(count) % FOLDS
    return np.asarray(dealt[which.ravel()])


def scores_of(rows: FloatArray, measured: BoolArray, fold: IndexArray) -> FloatArray:
    """How sure trees that have not learnt from a row's fold are that it is measured, shape (n,). On one thread."""
    from sklearn.ensemble import HistGradientBoostingClassifier
    from threadpoolctl import threadpool_limits

    scores = np.full(len(rows), 0.5)
    with threadpool_limits(1):  # sums come out the same on any number of cores, and others work beside
        for k in np.unique(fold):
            known, asked = fold != k, fold == k
            if not 0 < np.count_nonzero(measured[known]) < np.count_nonzero(known):
                continue
            trees = HistGradientBoostingClassifier(max_iter=_ITERATIONS, early_stopping=False, random_state=0)
            trees.fit(rows[known], measured[known])
            scores[asked] = trees.predict_proba(rows[asked])[:, 1]
    return scores


def gap_of_scores(scores: FloatArray, measured: BoolArray) -> float:
    """2 AUC - 1 of some scores, ties counted half; NaN where one sample has no rows."""
    n = int(np.count_nonzero(measured))
    others = len(scores) - n
    if n == 0 or others == 0:
        return float("nan")
    return float(2.0 * (_ranks(scores)[measured].sum() - 0.5 * n * (n + 1.0)) / (n * others) - 1.0)


def exchange_floor(scores: FloatArray, measured: BoolArray, beam: IndexArray, *, seed: int = 0) -> float:
    """What chance makes of the figure where there is no model to run: 3.3 standard deviations of 400 exchanges of the
    two labels within beams, the scores as they are. `beam` (n,): of each row, from 0."""
    rank, rng = _ranks(scores), np.random.default_rng(seed)
    beams = int(beam.max(initial=-1)) + 1
    own, other = (_of_each_beam(rank, beam, rows, beams) for rows in (measured, ~measured))
    draws = []
    for _ in range(EXCHANGES):
        swapped = rng.integers(0, 2, beams).astype(bool)
        n, total = np.where(swapped, other, own).sum(axis=1)
        others = len(scores) - n
        draws.append(2.0 * (total - 0.5 * n * (n + 1.0)) / (n * others) - 1.0 if n and others else 0.0)
    return float(OF_EXCHANGES * np.std(draws, ddof=1))


def _of_each_beam(rank: FloatArray, beam: IndexArray, rows: BoolArray, beams: int) -> FloatArray:
    """How many of some rows each beam has, and the sum of their ranks, shape (2, beams)."""
    mine = beam[rows]
    return np.stack([np.bincount(mine, minlength=beams), np.bincount(mine, rank[rows], beams)])


def _ranks(scores: FloatArray) -> FloatArray:
    """From 1, ties with their mean, shape (n,)."""
    _, which, count = np.unique(scores, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return np.asarray((last - 0.5 * (count - 1.0))[which])
