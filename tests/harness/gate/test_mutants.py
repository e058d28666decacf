"""The gate from end to end: the reference sensor stays green for fresh seeds, and mutants of it turn the gate red."""

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidarcheck.harness.check import check
from lidarcheck.harness.review import review as review_module
from lidarcheck.harness.review.accept import ALL, accept
from lidarcheck.harness.review.review import review
from lidarcheck.harness.scenario import measure as measure_module
from lidarcheck.scan import Scan
from places import ROOT

SCENARIO = "incidence_SMART"
Simulate = Callable[..., Scan]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One of the repository's scenarios with a golden of its own."""
    root = tmp_path_factory.mktemp("project")
    (root / "scenarios").mkdir()
    shutil.copytree(ROOT / "scenarios" / "models", root / "scenarios" / "models")
    shutil.copy(ROOT / "scenarios" / f"{SCENARIO}.toml", root / "scenarios")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(review_module, "uncommitted", lambda scenario: ("", ""))
        accept(review([root]), [ALL])
    return root


def stronger(simulate: Simulate, factor: float) -> Simulate:
    def mutant(ideal: Any, model: Any, **more: Any) -> Scan:
        return simulate(ideal, model.with_sensor(signal_at_1m=factor * model.sensor.signal_at_1m), **more)

    return mutant


def walking(simulate: Simulate, by_m: float) -> Simulate:
    def mutant(ideal: Any, model: Any, **more: Any) -> Scan:
        scan = simulate(ideal, model, **more)
        factor = 1.0 + by_m / np.sqrt(scan.x_m**2 + scan.y_m**2 + scan.z_m**2)
        return dataclasses.replace(scan, x_m=scan.x_m * factor, y_m=scan.y_m * factor, z_m=scan.z_m * factor)

    return mutant


def blind(simulate: Simulate, layer_index: int) -> Simulate:
    def mutant(ideal: Any, model: Any, **more: Any) -> Scan:
        scan = simulate(ideal, model, **more)
        seen = scan.layer != np.unique(ideal.layer)[layer_index]
        columns = {field.name: getattr(scan, field.name) for field in dataclasses.fields(scan)}
        kept = {name: column[seen] for name, column in columns.items() if isinstance(column, np.ndarray)}
        return dataclasses.replace(scan, **kept)

    return mutant


def test_unchanged_is_identical(project: Path) -> None:
    report = check([project])
    assert report.exit_code == 0
    assert all(scenario.identical for scenario in report.scenarios)


@pytest.mark.parametrize("seed", range(3))
def test_unchanged_holds_for_fresh_seeds(project: Path, seed: int) -> None:
    report = check([project], seed=seed)
    assert report.exit_code == 0
    assert all(scenario.seeds >= 24 for scenario in report.scenarios)


@pytest.mark.parametrize(("mutate", "by"), [(stronger, 1.03), (walking, 0.002), (blind, 3)])
def test_mutants_turn_the_gate_red(project: Path, monkeypatch: pytest.MonkeyPatch, mutate: Any, by: Any) -> None:
    monkeypatch.setattr(measure_module, "simulate", mutate(measure_module.simulate, by))
    assert check([project]).exit_code == 1


def test_a_given_model_file(project: Path, tmp_path: Path) -> None:
    same = project / "scenarios" / "models" / "SMART.toml"
    assert check([project], model=same).exit_code == 0
    stronger_file = tmp_path / "stronger.toml"
    stronger_file.write_text(same.read_text(encoding="utf-8") + "\n[sensor]\nsignal_at_1m = 6180.0\n", encoding="utf-8")
    assert check([project], model=stronger_file).exit_code == 1
