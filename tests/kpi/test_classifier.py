"""A classifier's figure, against closed forms; its folds, and what chance makes of it."""

import numpy as np
import pytest

from lidarcheck.kpi.classifier import classifier_gap, exchange_floor, folds_of, gap_of_scores


def beams(frames: int, layers: int, points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame, layer and point of every beam of a lattice."""
    return tuple(a.ravel() for a in np.meshgrid(*map(np.arange, (frames, layers, points)), indexing="ij"))


def two_samples(shift: float, seed: int, n: int = 1024) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of two samples that are a shift apart in one of their three features; which are measured, folds."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(2 * n, 3))
    measured = np.arange(2 * n) < n
    rows[measured, 1] += shift
    return rows, measured, np.tile(np.arange(n) // 64 % 5, 2)


def test_the_figure_of_scores_is_two_auc_less_one_with_ties_counted_half() -> None:
    from sklearn.metrics import roc_auc_score

    rng = np.random.default_rng(3)
    measured = rng.random(500) < 0.3
    scores = np.round(rng.random(500) + 0.2 * measured, 1)
    assert gap_of_scores(scores, measured) == pytest.approx(2.0 * roc_auc_score(measured, scores) - 1.0)
    assert gap_of_scores(np.array([1.0, 2.0]), np.array([False, True])) == 1.0
    assert gap_of_scores(np.array([1.0, 2.0]), np.array([True, False])) == -1.0
    assert np.isnan(gap_of_scores(np.ones(3), np.ones(3, bool)))


def test_a_shift_is_told_by_what_the_best_rule_would_and_no_shift_by_nothing() -> None:
    from scipy.stats import norm

    rows, measured, fold = two_samples(1.0, 5)
    best = 2.0 * norm.cdf(1.0 / np.sqrt(2.0)) - 1.0
    assert best - 0.08 < classifier_gap(rows, measured, fold) < best + 0.04
    alike = [classifier_gap(*two_samples(0.0, seed)) for seed in range(6)]
    assert np.abs(alike).max() < 0.1
    assert min(alike) < 0.0


def test_rows_without_a_feature_are_rows_like_others() -> None:
    rows, measured, fold = two_samples(0.0, 7)
    rows[: len(rows) // 8, :] = np.nan
    assert classifier_gap(rows, measured, fold) > 0.15


def test_folds_are_frames_where_there_are_five_and_blocks_where_there_are_fewer() -> None:
    frame, layer, point = beams(7, 8, 8)
    fold = folds_of(frame, layer, point)
    assert all(len(set(fold[frame == k])) == 1 for k in range(7))
    assert set(fold) == set(range(5))
    frame, layer, point = beams(2, 40, 50)
    fold = folds_of(frame, layer, point)
    block = (frame * 3 + layer // 16) * 4 + point // 16
    assert all(len(set(fold[block == b])) == 1 for b in np.unique(block))
    assert np.bincount(fold[np.unique(block, return_index=True)[1]]).tolist() == [5, 5, 5, 5, 4]
    assert (folds_of(frame, layer, point) == fold).all()


def test_of_repeats_a_ray_is_in_one_fold_in_all_frames() -> None:
    frame, layer, point = beams(6, 64, 64)
    fold = folds_of(frame, layer, point, repeated=True).reshape(6, -1)
    assert (fold == fold[0]).all()
    assert set(fold[0]) == set(range(5))


def test_too_few_frames_and_blocks_have_no_folds() -> None:
    assert folds_of(*beams(4, 16, 32)) is None
    assert folds_of(*beams(4, 16, 48)) is not None
    assert folds_of(*beams(5, 2, 2)) is not None


def test_exchanges_within_beams_make_what_chance_does_and_no_more() -> None:
    """Scores without any meaning have the variance of a rank sum; of beams that keep together, of their number."""
    rng = np.random.default_rng(11)
    n = 2000
    scores, measured, beam = rng.random(2 * n), np.arange(2 * n) < n, np.tile(np.arange(n), 2)
    expected = 2.0 * np.sqrt((2 * n + 1) / (12.0 * n * n))
    assert exchange_floor(scores, measured, beam) == pytest.approx(3.3 * expected, rel=0.12)
    together = np.repeat(np.arange(n // 8), 8)
    same = np.repeat(rng.random(2 * n // 8), 8)
    assert exchange_floor(same, measured, np.tile(together, 2)) == pytest.approx(
        3.3 * np.sqrt(8.0) * expected, rel=0.15
    )
    alike = np.tile(rng.random(n), 2)  # both samples of a beam have the same score: an exchange changes nothing
    assert exchange_floor(alike, measured, beam) == pytest.approx(0.0, abs=1e-12)
