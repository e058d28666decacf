"""The gap workflow on cases in which an independent generator has hidden an effect: a fixed part of the benchmark.

The whole benchmark is `lidarcheck explain --benchmark N`; docs/explain.md has its figures.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from lidarcheck.cases.case import load_case
from lidarcheck.explain.report.explanation import Explanation
from lidarcheck.explain.workflow import explain
from lidarcheck.model.files.model_file import load_model

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import hidden

SEED = 4711
"""Not among the seeds that thresholds were chosen with, nor among those that the documentation reports."""


def order_of(kind: str, effects: tuple[str, ...] | None = None) -> hidden.CaseOrder:
    """The first SMART case of a kind (few SPADs, so that it is fast) that hides these effects, if any are given."""
    for order in hidden.plan(600, SEED, kind):
        if order.variant == "SMART" and order.strength != "weak" and effects in (None, order.effects):
            return order
    raise AssertionError(f"no case of kind {kind} with {effects}")


def answered(order: hidden.CaseOrder, directory: Path) -> tuple[Explanation, hidden.Truth]:
    """The answer to a case, and only then the truth."""
    sealed = hidden.write_case(order, directory)
    found = explain(load_case(directory), exclude=order.exclude)
    return found, sealed.open(found.to_dict())


@pytest.mark.long
def test_nothing_is_named_where_only_table_and_pose_are_a_little_off(tmp_path: Path) -> None:
    found, _ = answered(order_of("null_nuisance"), tmp_path / "case")
    assert found.verdict == "no_gap"
    assert found.findings == ()
    assert found.model == load_case(tmp_path / "case").model


@pytest.mark.long
@pytest.mark.parametrize("name", ["range_scale", "threshold", "fog"])
def test_a_hidden_effect_is_named_and_the_gap_shrinks(name: str, tmp_path: Path) -> None:
    found, truth = answered(order_of("single", (name,)), tmp_path / "case")
    assert found.verdict == "explained"
    assert [one.name for one in found.findings] == list(truth.effects)
    assert found.gap.after.value < found.gap.before.value
    assert found.gap.closed > 0.6
    figure = found.gap.classifier
    assert figure.before > figure.floor
    assert figure.after < 0.3 * figure.before + figure.floor
    assert [effect.name for effect in found.model.effects if effect.name != "boresight"] == [name]
    json.dumps(found.to_dict(), allow_nan=True)


@pytest.mark.long
def test_what_no_catalogue_has_is_called_unknown_and_described(tmp_path: Path) -> None:
    found, _ = answered(order_of("alien", ("range_ripple",)), tmp_path / "case")
    assert found.verdict == "unknown"
    assert [one.name for one in found.findings] == ["unknown"]
    assert "range" in found.findings[0].where
    from lidarcheck.explain.report.model_diff import write_model

    source = load_case(tmp_path / "case").model_file
    written = write_model(source, found.model, tmp_path / "model.toml")
    assert load_model(written.path).effects == found.model.effects
    assert any(effect.empirical for effect in found.model.effects)
