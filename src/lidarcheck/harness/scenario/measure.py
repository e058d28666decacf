"""Simulate one seed of a scenario and compute its KPIs."""

from __future__ import annotations

import functools
import hashlib

import numpy as np
import numpy.typing as npt

from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.kpis.selection import SelectedEchoes
from lidarcheck.harness.kpis.spec import SeedMeasurement
from lidarcheck.harness.scenario.scenario import Scenario
from lidarcheck.kpi.distances import wasserstein
from lidarcheck.kpi.pairing import pair_with_ideal
from lidarcheck.model import simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import Scan

__all__ = ["measure"]


def measure(scenario: Scenario, model: Model, seed: int, *, threads: int | None = None) -> SeedMeasurement:
    """One seed of a scenario with `model`, which may be another than the scenario's own.

    The same arguments give the same numbers. Raises what `lidarcheck.model.simulate` raises, and `UsageError` when an
    external model reports an echo on a beam that was not fired. `threads`: all cores when None.
    """
    digest = hashlib.sha256()
    parts = []
    shown = functools.partial(simulate, scenario.ideal, model, scene=scenario.scene, surfaces=scenario.surfaces)
    for frame in range(scenario.frames):
        scan = shown(seed=seed, frame=frame, threads=threads)
        _feed(digest, scan)
        pairing = pair_with_ideal(scenario.ideal, scan, model=model, rows=scenario.rows)
        parts.append(SelectedEchoes.of(scan, pairing, frame, model.sensor))
    return _measured(scenario, SelectedEchoes.joined(parts), digest.hexdigest())


def _measured(scenario: Scenario, echoes: SelectedEchoes, digest: str) -> SeedMeasurement:
    """All KPIs of one seed's echoes."""
    values: dict[str, float] = {}
    trials: dict[str, int] = {}
    samples: dict[str, npt.NDArray[np.float64]] = {}
    for asked in scenario.asked:
        kind, name = KINDS[asked.kind], asked.spec.name
        seen = asked.selection.seen(echoes, scenario.frames)
        if kind.value is not None:
            values[name] = kind.value(seen)
        if kind.trials is not None:
            trials[name] = kind.trials(seen)
        if kind.sample is not None and asked.measured is not None:
            values[name] = wasserstein(asked.measured, kind.sample(seen))
        elif kind.sample is not None and asked.spec.feature is not None:
            samples[asked.spec.feature] = kind.sample(seen)
    return SeedMeasurement(values, trials, samples, digest)


def _feed(digest: hashlib._Hash, scan: Scan) -> None:
    for column in (scan.layer, scan.point, scan.echo_number, scan.x_m, scan.y_m, scan.z_m):
        digest.update(column.tobytes())
    for column in (scan.width_ns, scan.area, scan.peak):
        digest.update(column.tobytes())
    for name in sorted(scan.features):
        digest.update(name.encode() + scan.features[name].tobytes())
    if scan.histograms is not None:
        digest.update(scan.histograms.counts.tobytes())
