"""Estimated ideal scans: marked edges are left out of everything; what was estimated together is off alike."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import frames, model, street
from lidarcheck.cases.origin import Origin
from lidarcheck.inference.classifier import Classifier
from lidarcheck.inference.covariance import shuffled
from lidarcheck.inference.observed.beam_table import beams_of
from lidarcheck.inference.observed.observations import observations_of
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale


def marked(frame, rows):
    ideal = frame.ideal
    return dataclasses.replace(
        frame, ideal=dataclasses.replace(ideal, extra={**ideal.extra, "Edge": rows(ideal).astype(float)})
    )


def some(ideal):
    return (ideal.layer == 260) | (ideal.point == 416)


@pytest.fixture(scope="module")
def measured():
    return frames(model(), 2, sign=True)


def test_marked_edges_are_in_no_table_and_their_neighbours_know_what_they_meet(measured) -> None:
    whole = beams_of([f.ideal for f in measured], model())
    fewer = beams_of([marked(f, some).ideal for f in measured], model())
    left_out = (whole.layer == 260) | (whole.point == 416)
    assert 0 < left_out.sum() < len(whole)
    for column in dataclasses.fields(fewer):
        one, other = (getattr(table, column.name) for table in (whole, fewer))
        if isinstance(one, np.ndarray) and len(one) == len(whole):
            assert np.array_equal(one[~left_out], other), column.name
    assert np.array_equal(fewer.key[fewer.hit_beam], whole.key[whole.hit_beam][~left_out[whole.hit_beam]])


def test_their_echoes_are_neither_theirs_nor_of_no_surface(measured) -> None:
    edges = [marked(f, some) for f in measured]
    beams, whole = (beams_of([f.ideal for f in one], model()) for one in (edges, measured))
    shown = observations_of(beams, [f.measured for f in edges])
    every = observations_of(whole, [f.measured for f in measured])
    kept = np.isin(whole.key, beams.key)
    assert np.array_equal(shown.detected, every.detected[kept])
    assert np.array_equal(shown.feature, every.feature[kept])
    assert np.array_equal(beams.key[shown.extra_beam], whole.key[every.extra_beam][kept[every.extra_beam]])


def test_what_happens_at_marked_edges_moves_no_distance_and_no_classifier(measured) -> None:
    """Echoes of these beams are thrown away in one measurement, and not in the other."""
    lost = [marked(dataclasses.replace(f, measured=f.measured.take(~some(f.measured))), some) for f in measured]
    kept = [marked(f, some) for f in measured]
    one, other = (Simulator(list(f), model(), 3) for f in (lost, kept))
    assert np.array_equal(one.measured, other.measured)
    scales = [Scale.of(f, model(), 4) for f in (lost, kept)]
    parts = [scale.distance(scale.measured, scale.simulated(model(), 0, 2)) for scale in scales]
    assert np.array_equal(*parts)
    asked = [Classifier.of(f, model(), 5) for f in (lost, kept)]
    rows = [c.rows([f.measured for f in fs], 0.01, [0, 0]) for c, fs in zip(asked, (lost, kept), strict=True)]
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(*rows, strict=True))


def with_errors(frame):
    ideal = frame.ideal
    return dataclasses.replace(
        frame, ideal=dataclasses.replace(ideal, extra={"DistanceError": np.full(len(ideal), 0.02)})
    )


def test_beams_that_were_estimated_together_are_mixed_together() -> None:
    one = with_errors(frames(model(), 1)[0])
    beams = beams_of([one.ideal, one.ideal, street(1)], model())
    n = len(one.ideal)
    assert np.array_equal(beams.estimate[:n], beams.estimate[n : 2 * n])
    assert len(np.unique(beams.estimate)) == 2 * n
    runs = [
        observations_of(beams, [one.measured] * 2 + [street_scan]) for street_scan in [frames(model(), 2)[1].measured]
    ]
    # Simulations that can be told apart: the k-th shows the range residual k everywhere.
    drawn = [dataclasses.replace(runs[0], feature=np.full_like(runs[0].feature, k)) for k in range(7)]
    mixed = next(shuffled(beams, drawn, [1])).feature[:, 0]
    assert np.array_equal(mixed[:n], mixed[n : 2 * n])
    assert not np.array_equal(mixed[:n], mixed[2 * n :])


@pytest.mark.parametrize("repeats", [2, 4, 9])
def test_few_repeats_leave_out_means_and_two_leave_out_rates(measured, repeats: int) -> None:
    origin = Origin("repeats", repeats=repeats)
    simulator = Simulator([dataclasses.replace(f, origin=origin) for f in measured], model(), 3)
    every = Simulator(measured, model(), 3)
    names = simulator.summaries.names
    assert len(simulator.measured) == len(names)
    kept = [every.summaries.names.index(name) for name in names]
    assert np.array_equal(simulator.measured_plain, every.measured_plain[kept])
    found = {(name.feature, name.covariate) for name in names}
    means = {("range", "all"), ("area", "material"), ("range along azimuth", "frame")}
    rates = {("detected", "all"), ("echoes behind", "all"), ("other echoes", "from column to column")}
    spreads = {("range scatter along layers", "all"), ("range along elevation", "from column to column")}
    assert spreads <= found
    assert means <= found if repeats >= 5 else not means & found
    assert rates <= found if repeats > 2 else not rates & found
    assert (len(names) == len(every.summaries.names)) == (repeats == 9)
    assert np.isfinite(simulator.distance(np.zeros((1, len(names)))))


def test_folds_are_by_blocks_and_log_s_stands_for_the_material(measured) -> None:
    """That of the beams beside a ray: its own estimate would tell how far off it is."""
    dense = frames(model(), 6, layers=range(230, 280), points=range(400, 480))
    plain = Classifier.of(dense, model(), 5)
    repeated = Classifier.of([dataclasses.replace(f, origin=Origin("repeats", repeats=9)) for f in dense], model(), 5)
    assert len(np.unique(plain.fold[plain.beams.frame == 0])) == 1
    by_ray = repeated.fold.reshape(6, -1)
    assert (by_ray == by_ray[0]).all()
    assert len(np.unique(by_ray[0])) == 5
    own = np.log1p(repeated.beams.signal)
    assert np.median(np.abs(repeated.known[:, 1] - own)) < 0.02
    assert not np.array_equal(repeated.known[:, 1], own)
    assert np.array_equal(plain.known[:, 1], plain.beams.material_id)
