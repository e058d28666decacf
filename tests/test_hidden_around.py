"""Hidden cases around models that are not ours: the package sees in them what the generator put there, and no more."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import hidden
from lidarcheck.cases.case import load_case
from lidarcheck.explain.benchmark.run import load_generator
from lidarcheck.model import simulate

pytestmark = pytest.mark.usefixtures("trusting")

around = load_generator(Path(hidden.__file__).parent / "around")
orders = sys.modules[f"{around.__name__}.orders"]


def case_of(model, tmp_path, kind="null", effects=()):
    """A case of three frames, by the package; skipped where the C program cannot be built."""
    if model == "own_model_c" and shutil.which("cc") is None:
        pytest.skip("there is no C compiler cc on this machine")
    around.write_case(orders.CaseOrder(0, kind, 5, effects, "medium", model, "street"), tmp_path, frames=3)
    return load_case(tmp_path)


def summary(scan):
    strength = np.log(np.maximum(scan.feature("INTENSITY"), 1.0))
    return np.array([len(scan), strength.mean(), scan.range_m.mean(), strength.std()])


@pytest.mark.parametrize("model", orders.MODELS)
def test_agrees_with_the_package_where_nothing_is_hidden(model, tmp_path):
    case = case_of(model, tmp_path)
    for frame in case.frames:
        simulated = [summary(simulate(frame.ideal, case.model, seed=seed)) for seed in range(6)]
        spread = np.std(simulated, axis=0, ddof=1) + 1e-6
        assert (np.abs(summary(frame.measured) - np.mean(simulated, axis=0)) < 8.0 * spread).all()


@pytest.mark.parametrize("model", orders.MODELS)
def test_an_effect_that_is_hidden_is_in_the_data(model, tmp_path):
    case = case_of(model, tmp_path, "single", ("range_scale",))
    fraction = []
    for frame in case.frames:
        simulated = simulate(frame.ideal, case.model, seed=1)
        both = [
            {
                (a, b): r
                for a, b, r, n in zip(s.layer.tolist(), s.point.tolist(), s.range_m, s.echo_number, strict=True)
                if n == 1
            }
            for s in (frame.measured, simulated)
        ]
        common = sorted(both[0].keys() & both[1].keys())
        near, far = (np.array([side[key] for key in common]) for side in both)
        fraction.append(np.median((near - far) / far))
    assert all(0.001 < abs(value) < 0.004 for value in fraction)
    assert len(set(np.sign(fraction))) == 1


def test_twenty_cases_are_of_both_models_and_hide_most_effects():
    plan = around.plan(20, 1)
    assert {(one.variant, one.kind) for one in plan} == {(m, k) for m in orders.MODELS for k in set(orders.KINDS)}
    hidden_names = [name for one in plan if one.kind == "single" for name in one.effects]
    assert len(hidden_names) == len(set(hidden_names)) == 14
    assert around.plan(7, 1) == plan[:7]
    assert {one.seed for one in around.plan(20, 2)}.isdisjoint({one.seed for one in plan})
