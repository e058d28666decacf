"""Where the search begins: each effect of the catalogue is asked for its starts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from lidarcheck.effects.search import Probe, SearchSpec, search_spec, search_specs
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.inference.simulator import Simulator
from lidarcheck.sensor import Linear, PhotonHistogram, Program, Sensor, SpadArray, shipped

__all__ = ["fixed_probes", "located_probes"]


_REFERENCE = "SMART"
"""The sensor for which the starts are written."""


def fixed_probes(
    names: Sequence[str], sensor: Sensor | None = None, *, taken_up: Collection[str] = frozenset()
) -> list[Probe]:
    """The starts that need no look at the data: the plain ones of each name, then those of other kinds; in the units
    of the sensor, or of the reference. `taken_up`: the names of which the ideal scans leave a part to be seen only."""
    found = []
    for name in (name for name in names if name not in taken_up):
        spec = search_spec(name)
        found += [Probe(name, _of(sensor, spec, start), spec.free, spec.fixed) for start in spec.fixed_starts]
    for spec in (spec for spec in search_specs().values() if spec.name in names):
        found += [
            Probe(spec.name, _of(sensor, spec, one.settings), one.free, spec.fixed, one.kind, one.ways)
            for one in (spec.beside_repeats if spec.name in taken_up else spec.variants)
        ]
    return found


def _of(sensor: Sensor | None, spec: SearchSpec, start: Mapping[str, Any]) -> Mapping[str, Any]:
    """A start in the units of the sensor's detector: as many times its own number as of the reference's."""
    if not isinstance(sensor, Linear | PhotonHistogram | Program):
        return start
    mine, reference = _scales(sensor), _scales(shipped(_REFERENCE))
    named = (spec.of_background, spec.of_signal, spec.of_threshold)
    times = {name: own / its or 1.0 for names, own, its in zip(named, mine, reference, strict=True) for name in names}
    return {name: value * times.get(name, 1.0) for name, value in start.items()}


def _scales(sensor: Sensor) -> tuple[float, float, float]:
    """The background, the S that is just seen, and the threshold, each in the unit of an effect's parameters."""
    seen = sensor.signal_of(sensor.threshold_counts)
    if isinstance(sensor, Linear):  # its background is the variance of its amplitude
        return sensor.noise**2, seen, sensor.threshold
    if isinstance(sensor, PhotonHistogram):
        return sensor.background_per_ns, seen, sensor.threshold_sigma
    if isinstance(sensor, Program):  # its background is its own, its threshold that of the sensor it stands for
        return sensor.background_per_ns, seen, _scales(sensor.nominal)[2]
    spads = SpadArray.narrow(sensor)
    return spads.background_per_ns, seen, float(spads.threshold)


def located_probes(simulator: Simulator, names: Iterable[str]) -> list[Probe]:
    """The starts that need one: which layers, which patch, which material or object, which frequency."""
    evidence, wanted = SimulatorEvidence(simulator), set(names)
    specs = [spec for spec in search_specs().values() if spec.name in wanted]
    found = [probe for spec in specs if spec.starts for probe in spec.starts(evidence)]
    return found + [probe for spec in specs if spec.starts_of_each for probe in spec.starts_of_each(evidence)]
