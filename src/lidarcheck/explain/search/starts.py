"""Where the search begins: each effect of the catalogue is asked for its starts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lidarcheck.effects.search import Probe, search_spec, search_specs
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.inference.simulator import Simulator

__all__ = ["fixed_probes", "located_probes"]


def fixed_probes(names: Sequence[str]) -> list[Probe]:
    """The starts that need no look at the data: the plain ones of each name, then those of other kinds."""
    found = []
    for name in names:
        spec = search_spec(name)
        found += [Probe(name, settings, spec.free, spec.fixed) for settings in spec.fixed_starts]
    for spec in (spec for spec in search_specs().values() if spec.name in names):
        found += [Probe(spec.name, one.settings, one.free, spec.fixed, one.kind, one.ways) for one in spec.variants]
    return found


def located_probes(simulator: Simulator, names: Iterable[str]) -> list[Probe]:
    """The starts that need one: which layers, which patch, which material or object, which frequency."""
    evidence, wanted = SimulatorEvidence(simulator), set(names)
    specs = [spec for spec in search_specs().values() if spec.name in wanted]
    found = [probe for spec in specs if spec.starts for probe in spec.starts(evidence)]
    return found + [probe for spec in specs if spec.starts_of_each for probe in spec.starts_of_each(evidence)]
