"""A classifier that is shown measured and simulated echoes: what it can tell apart, and what it must not."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import at_ranges, frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.inference.c2st import COLUMNS, _rows, classifier_auc
from lidarcheck.inference.observed.beam_table import beams_of, key_of

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 8)}


def test_the_sensor_itself_is_not_told_from_its_model() -> None:
    assert classifier_auc(frames(model(), 4, **FINE), {1, 3}, model(), 9) == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    "effect",
    [
        make("range_offset", {"offset_m": 0.1}),
        make("signal_gain", {"gain": 0.7}),
        make("dropout", {"share": 0.2}),
        make("dark_counts", {"rate_per_ns": 2e-3}),
    ],
    ids=lambda effect: effect.name,
)
def test_a_missing_effect_is_seen_until_the_model_has_it(effect: Effect) -> None:
    measured = frames(model(effect), 4, **FINE)
    before, after = (classifier_auc(measured, {1, 3}, one, 9) for one in (model(), model(effect)))
    assert before > 0.55
    assert after == pytest.approx(0.5, abs=0.03)


def test_digits_of_a_file_are_no_artefact_and_centimetres_are() -> None:
    """Ranges that come from X, Y and Z of six decimals are not those of a model by less than a micrometre."""
    measured = frames(model(), 4, **FINE)
    beams, scan = beams_of([measured[0].ideal], model()), measured[0].measured
    off = np.random.default_rng(1).uniform(-5e-7, 5e-7, len(scan))
    np.testing.assert_array_equal(_rows(beams, at_ranges(scan, scan.range_m + off)), _rows(beams, scan))
    coarse = [dataclasses.replace(f, measured=at_ranges(f.measured, np.round(f.measured.range_m, 1))) for f in measured]
    assert classifier_auc(coarse, {1, 3}, model(), 9) > 0.56


def test_it_is_asked_only_about_frames_that_it_has_not_learnt_from() -> None:
    """Echoes of the frames that it learns from lie farther; it cannot know better of the others, which do not."""
    offset = make("range_offset", {"offset_m": 0.3})
    far, plain = frames(model(offset), 4, **FINE), frames(model(), 4, **FINE)
    mixed = tuple(far[k] if k in (0, 2) else plain[k] for k in range(4))
    assert classifier_auc(mixed, {1, 3}, model(), 9) == pytest.approx(0.5, abs=0.05)
    assert classifier_auc(far, {1, 3}, model(), 9) > 0.9


def test_the_same_seed_gives_the_same_figure() -> None:
    measured = frames(model(), 3, **FINE)
    one, again, other = (classifier_auc(measured, {2}, model(), seed) for seed in (4, 4, 5))
    assert one == again != other


def test_a_row_for_each_echo_and_each_beam_without_one() -> None:
    [frame] = frames(model(make("range_offset", {"offset_m": 0.1})), 1, **FINE)
    beams, scan = beams_of([frame.ideal], model()), frame.measured
    rows = dict(zip(COLUMNS, _rows(beams, scan).T, strict=True))
    lost = np.isnan(rows["range_m"])
    assert (~lost).sum() == len(scan)
    assert lost.sum() == len(beams) - len({*zip(scan.layer, scan.point, strict=True)})
    assert (rows["echoes"] == 0).tolist() == lost.tolist()
    np.testing.assert_allclose(rows["range_m"][~lost], scan.range_m, atol=5e-4)
    np.testing.assert_array_equal(rows["layer"][~lost], scan.layer)
    np.testing.assert_array_equal(rows["area"][~lost], scan.area)
    of_beam = np.searchsorted(beams.key, key_of(np.zeros(len(scan), np.int64), scan.layer, scan.point))
    np.testing.assert_allclose(rows["range_off_m"][~lost], scan.range_m - beams.distance_m[of_beam], atol=1e-3)


def test_frames_to_learn_from_and_to_be_asked_about() -> None:
    measured = frames(model(), 2, **FINE)
    for unseen in ((), (0, 1)):
        with pytest.raises(ValueError, match="frames to learn from and others to be asked about"):
            classifier_auc(measured, unseen, model())
