"""Lists of numbers of an effect, read off what a fit with it leaves over.

A fit moves the numbers of an effect, and a list of them, a gain for every layer, only as a whole. The list was read off
the case's own model, whose echoes are farther from the measured ones than those of the fit. A walk is fitted as a curve
of two or three numbers, and a fall-off with incidence by a power, which the sensor's own is not quite.
"""

from __future__ import annotations

from dataclasses import replace

from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.effects.search.parts import ListReader
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator

__all__ = ["read_again"]

_SEEDS, _MOST = 3, 3
_LEAST = 0.02
"""A list that comes nearer by a smaller part of the distance is not worth a further reading."""


def read_again(simulator: Simulator, now: Fit) -> Fit:
    """The fit with its lists read again, where that comes nearer once the other numbers have followed: the curve's own
    and those of other effects, which had made up for what the curve has not."""
    for place, probe in enumerate(now.probes):
        reader = search_spec(probe.name).list_reader
        if reader is None or not (reader.always or reader.parameter in probe.settings):
            continue
        for _ in range(_MOST):
            probes = (*now.probes[:place], _read(simulator, now, place, reader), *now.probes[place + 1 :])
            found = fit(simulator, probes, now.x, rounds=reader.rounds, nuisance=now.nuisance)
            if not found.distance < (1.0 - _LEAST) * now.distance:
                break
            now = found if found.jacobian is not None else replace(found, jacobian=now.jacobian)
    return now


def _read(simulator: Simulator, now: Fit, place: int, reader: ListReader) -> Probe:
    """The probe with its list read off what the fit leaves over."""
    model = now.model(simulator.model)
    shown = [simulator.observations(model, 400 + k, now.nuisance) for k in range(_SEEDS)]
    probe = now.probes[place]
    values = reader.read(SimulatorEvidence(simulator), shown, probe, now.x[place])
    return replace(probe, settings={**probe.settings, reader.parameter: values})
