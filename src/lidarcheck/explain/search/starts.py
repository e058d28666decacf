"""Where the search begins: each effect of the catalogue is asked for its starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from lidarcheck.effects.search import Probe, SearchSpec, search_spec, search_specs
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.inference.simulator import Simulator
from lidarcheck.sensor import Linear, PhotonHistogram, Sensor

__all__ = ["fixed_probes", "located_probes"]


_REFERENCE_BACKGROUND = 0.0003
"""Background of the reference sensor [avalanches per armed SPAD and ns], for which the starts are written."""


def fixed_probes(names: Sequence[str], sensor: Sensor | None = None) -> list[Probe]:
    """The starts that need no look at the data: the plain ones of each name, then those of other kinds; in the units
    of the sensor, or of the reference."""
    found = []
    for name in names:
        spec = search_spec(name)
        found += [Probe(name, _of(sensor, spec, start), spec.free, spec.fixed) for start in spec.fixed_starts]
    for spec in (spec for spec in search_specs().values() if spec.name in names):
        found += [
            Probe(spec.name, _of(sensor, spec, one.settings), one.free, spec.fixed, one.kind, one.ways)
            for one in spec.variants
        ]
    return found


def _of(sensor: Sensor | None, spec: SearchSpec, start: Mapping[str, Any]) -> Mapping[str, Any]:
    """A start in the units of the sensor's detector."""
    if isinstance(sensor, Linear):
        own = sensor.noise**2  # a linear detector's background is the variance of its amplitude
    elif isinstance(sensor, PhotonHistogram):
        own = sensor.background_per_ns
    else:
        return start
    times = own / _REFERENCE_BACKGROUND or 1.0
    return {name: value * times if name in spec.of_background else value for name, value in start.items()}


def located_probes(simulator: Simulator, names: Iterable[str]) -> list[Probe]:
    """The starts that need one: which layers, which patch, which material or object, which frequency."""
    evidence, wanted = SimulatorEvidence(simulator), set(names)
    specs = [spec for spec in search_specs().values() if spec.name in wanted]
    found = [probe for spec in specs if spec.starts for probe in spec.starts(evidence)]
    return found + [probe for spec in specs if spec.starts_of_each for probe in spec.starts_of_each(evidence)]
