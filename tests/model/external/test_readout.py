"""Readout effects on a program's echoes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.effects import make
from lidarcheck.effects.finding import catalogue
from lidarcheck.effects.shared.ranges import at_range
from lidarcheck.errors import UsageError
from lidarcheck.model import load_model
from lidarcheck.model.external.readout import on_lattice, read_out_program
from lidarcheck.model.stages import of_stage, run_of
from lidarcheck.scan import Scan
from waveform_kit import model_text, wall_scan

STEP_M = 0.01


def run_with(tmp_path: Path, *effects, more: str = ""):
    (tmp_path / "model.toml").write_text(more + model_text('reads = ["Share"]\n'))
    model = load_model(tmp_path / "model.toml")
    for effect in effects:
        model = model.with_(effect)
    ideal = wall_scan(layers=40, points=200)
    return run_of(ideal, model, 5, 0, None, None), of_stage("readout", model.effects)


def echoes(run, *, rounded: bool = True) -> Scan:
    """An echo a beam, of ranges that scatter by little more than a step."""
    ideal = run.ideal
    range_m = ideal.distance_m + 0.0108 * np.random.default_rng(3).standard_normal(len(ideal))
    range_m = np.rint(range_m / STEP_M) * STEP_M if rounded else range_m
    return Scan.from_beams(
        ideal.layer, ideal.point, range_m, area=np.full(len(ideal), 1000.0), peak=np.full(len(ideal), 50.0)
    )


def test_a_shift_by_part_of_a_step_is_dithered(tmp_path):
    """Y = X + q with probability s / q: the mean moves by s, the variance grows by s (q - s)."""
    shift = STEP_M / 3.0
    run, effects = run_with(tmp_path, make("walk_error", {"per_decade_m": 0.0, "shifts_m": (shift, shift)}))
    before = echoes(run)
    after = read_out_program(before, run, effects)
    moved = after.range_m - before.range_m
    assert on_lattice(after, STEP_M)
    assert np.allclose(np.unique(np.round(moved, 6)), [0.0, STEP_M])
    assert moved.mean() == pytest.approx(shift, abs=4.0 * STEP_M * np.sqrt(2.0 / 9.0 / len(before)))
    assert moved.var() == pytest.approx(2.0 / 9.0 * STEP_M**2, rel=0.05)


def test_an_echo_that_is_moved_behind_the_sensor_is_none(tmp_path):
    run, effects = run_with(tmp_path, make("walk_error", {"per_decade_m": 0.0, "shifts_m": (-9.0,)}))
    far = echoes(run)
    near = far.point < np.median(far.point)
    before = at_range(far, np.where(near, 5.0, 20.0))
    after = read_out_program(before, run, effects)
    assert len(after) == np.sum(~near) > 0
    assert np.allclose(after.range_m, 11.0)


def test_ranges_on_no_lattice_are_not_rounded(tmp_path):
    shift = STEP_M / 3.0
    run, effects = run_with(tmp_path, make("walk_error", {"per_decade_m": 0.0, "shifts_m": (shift, shift)}))
    before = echoes(run, rounded=False)
    after = read_out_program(before, run, effects)
    assert np.allclose(after.range_m - before.range_m, shift, atol=1e-9)


@pytest.mark.parametrize("name", ["dropout", "range_offset", "range_scale"])
def test_what_moves_no_single_echo_touches_no_range(tmp_path, name):
    run, effects = run_with(tmp_path, make(name, {}))
    before = echoes(run)
    after = read_out_program(before, run, effects)
    kept = np.isin(before.layer * 1000 + before.point, after.layer * 1000 + after.point)
    assert np.array_equal(before.x_m[kept], after.x_m)
    assert (len(after) < len(before)) == (name == "dropout")


def test_coordinates_of_a_coarse_step_are_on_the_lattice_that_they_can_tell(tmp_path):
    run, _ = run_with(tmp_path)
    scan = echoes(run)
    rounded = {name: np.round(getattr(scan, name), 3) for name in ("x_m", "y_m", "z_m")}
    assert on_lattice(replace(scan, **rounded), STEP_M)
    assert not on_lattice(replace(scan, **{k: np.round(v, 2) for k, v in rounded.items()}), STEP_M)


def test_added_echoes_compete_for_the_returns_by_strength(tmp_path):
    extra = make(
        "empirical_extra",
        {
            "covariate": "range_m", "knots": (0.0, 100.0), "values": (3.0, 3.0), "range_from": "sensor",
            "range_knots": (1.0, 9.0), "range_density": (1.0,), "peak_quantiles": (20.0,), "area_quantiles": (2000.0,),
            "width_quantiles": (5.0,),
        },
    )  # fmt: skip
    run, effects = run_with(tmp_path, extra)
    after = read_out_program(echoes(run), run, effects)
    assert len(after) == 3 * len(run.ideal)
    assert set(after.area.tolist()) == {2000.0}, "the weakest of four falls out, and that is the surface's"
    assert after.echo_number.max() == 3


def test_a_walk_goes_by_the_feature_that_is_named(tmp_path):
    walk = make("walk_error", {"per_decade_m": 0.5, "reference_area": 50.0})
    run, effects = run_with(tmp_path, walk)
    area = read_out_program(echoes(run), run, effects).range_m.mean()
    peak_file = model_text('reads = ["Share"]\n', '[sensor]\nstrength = "PEAK"\n')
    (tmp_path / "peak.toml").write_text(peak_file)
    model = load_model(tmp_path / "peak.toml").with_(walk)
    by_peak = run_of(run.ideal, model, 5, 0, None, None)
    peak = read_out_program(echoes(run), by_peak, effects).range_m.mean()
    assert area - peak == pytest.approx(0.5 * np.log10(1000.0 / 50.0), abs=1e-3)


def test_without_a_strength_a_walk_is_refused_with_the_reason(tmp_path):
    run, _ = run_with(tmp_path)
    silent = replace(run.model.sensor, tells=("WIDTH",))
    with pytest.raises(UsageError, match="the program reports no feature that says how strong an echo is"):
        run_of(run.ideal, replace(run.model, sensor=silent).with_(make("walk_error", {})), 5, 0, None, None)
    assert catalogue()["dropout"].why_not(silent) == ""
