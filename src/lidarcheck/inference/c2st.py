"""A second opinion on a gap: how well a classifier tells measured from simulated echoes on frames it has not seen.

A classifier two-sample test (D. Lopez-Paz and M. Oquab, ICLR 2017). It shares nothing with the summaries, the fits or
the gap's own distance, so that what these are blind to it may see. What it is shown of an echo is what perception
software could use, and what the ideal scan says of its beam.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.cases.frame import Frame
from lidarcheck.inference.observed.beam_table import BeamTable, beams_of, key_of
from lidarcheck.model.chain import simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan

__all__ = ["COLUMNS", "classifier_auc"]


COLUMNS = (
    "range_m", "range_off_m", "area", "peak", "width_ns", "echo_number", "echoes", "layer", "point", "distance_m",
    "material_id", "incidence_deg",
)  # fmt: skip
"""What the classifier is shown of each echo, and of each beam without one, whose echo's columns are NaN."""
_RANGE_STEP_M = 1e-3
"""Ranges are rounded to this: how many digits a file has is no artefact of a sensor."""
_TREES = 150
"""Half more than the library's default."""


def classifier_auc(frames: Sequence[Frame], unseen: Collection[int], model: Model, seed: int = 0) -> float:
    """How well gradient-boosted trees tell the measured echoes of frames from a model's: the area under the ROC curve.

    0.5 where they guess, 1 where they are always right. They learn from the frames whose `number` is not in `unseen`
    and are asked about those. The same seed gives the same figure. `ValueError` when one of both is empty.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.metrics import roc_auc_score
    from threadpoolctl import threadpool_limits

    known, asked = ([f for f in frames if (f.number in unseen) == there] for there in (False, True))
    if not known or not asked:
        raise ValueError("a classifier needs frames to learn from and others to be asked about")
    trees = HistGradientBoostingClassifier(max_iter=_TREES, early_stopping=False, random_state=0)
    with threadpool_limits(1):  # a case's worker has one core; and sums come out the same on any number
        trees.fit(*_labelled(known, model, seed))
        rows, measured = _labelled(asked, model, seed)
        return float(roc_auc_score(measured, trees.predict_proba(rows)[:, 1]))


def _labelled(frames: Sequence[Frame], model: Model, seed: int) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Rows of the measured echoes and of a model's, and which are measured."""
    rows, measured = [], []
    for frame in frames:
        beams = beams_of([frame.ideal], model)
        shown = simulate(frame.ideal, model, seed=seed, frame=frame.number, threads=1)
        for scan, is_measured in ((frame.measured, True), (shown, False)):
            rows.append(_rows(beams, scan))
            measured.append(np.full(len(rows[-1]), is_measured))
    return np.concatenate(rows), np.concatenate(measured)


def _rows(beams: BeamTable, scan: Scan) -> FloatArray:
    """What a scan shows of the beams in `COLUMNS`, a row for each echo and for each beam without one, shape (n, 12)."""
    beam = np.searchsorted(beams.key, key_of(np.zeros(len(scan), np.int64), scan.layer, scan.point))
    echoes = np.bincount(beam, minlength=len(beams))
    lost = np.flatnonzero(echoes == 0)
    every = np.concatenate([beam, lost])
    range_m = np.round(scan.range_m / _RANGE_STEP_M) * _RANGE_STEP_M
    off = np.round((range_m - beams.distance_m[beam]) / _RANGE_STEP_M) * _RANGE_STEP_M
    of_echo = np.column_stack([range_m, off, scan.area, scan.peak, scan.width_ns, scan.echo_number])
    of_beam = (echoes, beams.layer, beams.point, beams.distance_m, beams.material_id, beams.incidence_deg)
    nothing = np.full((len(lost), of_echo.shape[1]), np.nan)
    return np.column_stack([np.concatenate([of_echo, nothing]), *(column[every] for column in of_beam)])
