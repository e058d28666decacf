"""More of the named effects' forms, once all is fitted: finer ones that the search had no time for, and what means over
frames do not show. Each is taken where it leaves less of the gap beam by beam.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.search import search_spec
from lidarcheck.effects.search.evidence import BeamTable, Observations
from lidarcheck.effects.search.parts import Refined
from lidarcheck.explain.decision.equivalence import Polished
from lidarcheck.explain.report.explanation import Finding
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.intervals import Interval
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Sensor
from lidarcheck.workers import WorkerPool

__all__ = ["ScaleReplays", "late_words", "with_finer_forms", "with_forms_of_beams"]

Look = Callable[[BeamTable, Observations], FloatArray]

_ROUNDS = 2
_SEED = 9700


def with_finer_forms(seen: Scale, case: Model, polish: Polished, pool: WorkerPool) -> Polished:
    """The last fit, each effect that has a finer form fitted anew in that where it leaves less of the gap."""
    for at, probe in enumerate(polish.last.probes):
        if search_spec(probe.name).finer is None:
            continue
        start = _finer(polish.last, at)
        more = fit(polish.simulator, start.probes, start.x, rounds=_ROUNDS, nuisance=start.nuisance)
        if not more.possible:
            continue
        both = [(seen.shared, one.model(case), one.nuisance) for one in (polish.last, more)]
        (coarse_left, _), (fine_left, _) = pool.map(Scale.excess, both)
        polish = replace(polish, last=more) if fine_left < coarse_left else polish
    return polish


def _finer(now: Fit, at: int) -> Fit:
    """The same fit with one effect in its finer form."""
    finer = search_spec(now.probes[at].name).finer
    probes, x = list(now.probes), list(now.x)
    if finer is not None:
        probes[at] = finer(probes[at], x[at])
        x[at] = probes[at].start()
    return replace(now, probes=tuple(probes), x=tuple(x), jacobian=None)


def with_forms_of_beams(
    seen: Scale, model: Model, findings: Sequence[Finding], off: Nuisance, pool: WorkerPool
) -> tuple[Finding, ...]:
    """The findings, each effect with what is read of its form off the beams, where that is beyond chance and the model
    comes nearer so. `off`: the small errors that were fitted besides."""
    found = list(findings)
    for at, finding in enumerate(findings):
        step = search_spec(finding.name).beam_by_beam
        if step is None or len(finding.effects) != 1:
            continue
        plain = model
        for effect in (effect for one in found for effect in one.effects):
            plain = plain.with_(effect)
        more = step.read(ScaleReplays(seen, plain, off, pool), finding.effects[0])
        if more is None:
            continue
        models = ((seen.shared, one, off) for one in (plain, plain.with_(more.effect)))
        (left, _), (there, _) = pool.map(Scale.excess, models)
        if there < left:
            found[at] = _refined(finding, more)
    return tuple(found)


def late_words(findings: Sequence[Finding]) -> list[tuple[str, str]]:
    """The names of the steps that read more of the findings' forms off the beams, and what they found, in words."""
    said = []
    for finding in findings:
        step = search_spec(finding.name).beam_by_beam
        if step is not None:
            said += [(step.name, words) for effect in finding.effects if (words := step.words(effect))]
    return said


def _refined(plain: Finding, more: Refined) -> Finding:
    """The finding with more of its form."""
    parameters = dict(plain.parameters)
    for name, factor in more.wider.items():
        if (known := parameters.get(name)) is not None:
            parameters[name] = replace(known, low=known.low / factor, high=known.high * factor)
    parameters |= {name: Interval(*values) for name, values in more.intervals.items()}
    return replace(plain, parameters=parameters, effects=(more.effect,))


@dataclass(frozen=True)
class ScaleReplays:
    """Frames beam by beam with a model, in which one effect can be replaced: `effects.search.evidence.Replays`."""

    seen: Scale
    model: Model
    off: Nuisance
    pool: WorkerPool

    @property
    def sensor(self) -> Sensor:
        """The model's sensor."""
        return self.model.sensor

    @property
    def beams(self) -> BeamTable:
        """What the beams meet."""
        return self.seen.beams

    @property
    def measured(self) -> Observations:
        """What was measured."""
        return self.seen.measured

    def looks(self, effects: Sequence[Effect], seeds: int, look: Look) -> list[list[FloatArray]]:
        """What `look`, a function of a module, says of simulations with each of the effects; a list a seed."""
        tasks = ((self.seen.shared, self.model.with_(effect), self.off, seeds, look) for effect in effects)
        return [*self.pool.map(_looked, tasks)]


def _looked(seen: Scale, model: Model, off: Nuisance, seeds: int, look: Look) -> list[FloatArray]:
    return [look(seen.beams, one) for one in seen.simulated(model, _SEED, seeds, off)]
