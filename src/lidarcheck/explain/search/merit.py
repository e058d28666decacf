"""What a candidate's fit in a round is worth: whether it holds, and how it compares with others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from lidarcheck.effects.search import Probe, search_spec
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.nuisances import is_usual_error

__all__ = ["CHANCE", "PRICE", "FittedCandidate", "accepted", "best_of_each_name"]

PRICE, _PRICE_PART = 6.0, 0.003
"""What a free number costs of a merit: so much, and this part of it."""
_UNSEEN, _HARMLESS = 0.08, 0.02
"""An effect that moves the select frames by less than this part of its gain cannot show there; it may make them worse
by that part."""
_PART = 0.05
"""Select frames that come nearer by this part of the gain bear it out."""
_FEW_EDGES, _HARMLESS_THERE = 0.3, 0.1
"""The same of footprints where edges may be anywhere: a frame has few."""
_TO_THE_BETTER = 0.5
"""The true effect brings select frames as much nearer as it moves them, a wrong one as much farther away."""
_AS_FAR, _TWICE = 0.1, 2.0
"""What is lost at random holds on a select frame that is as far, to this part, as another measurement would be, if it
explains so many times what is needed."""
_ALL_CLOSED, _FOUR_TIMES = 0.5, 4.0
"""Select frames that are near their floor with an effect, to this part of what chance leaves, say nothing against it;
where it does not turn the view, it holds then if it explains so many times what is needed."""
_LISTED = 0.1
"""A number of a list that was read off the data, and shrunk by its noise, counts as this part of a free one."""
CHANCE = 250.0
"""What a fit leaves above the floor where nothing is missing: the summaries' means are of finitely many seeds."""


@dataclass(frozen=True)
class FittedCandidate:
    """A candidate that was fitted in a round: the fit with it, what it gained there and on the select frames.

    `select_change`: how far it moves what is shown of the select frames, as a distance. `along_edges`: by how much it
    brings these nearer and how far it moves them where edges may be anywhere between two beams, of footprints.
    `own`: how far another measurement of the select frames would be if the fit were the truth, of what is lost at
    random. `select_floor`: how far these are where nothing is missing. `end`: the fit that leads no further, nuisances
    included, where it is known.
    """

    name: str
    round: int
    fit: Fit
    gain: float
    needed: float
    select_before: float
    select_after: float
    select_change: float = float("inf")
    along_edges: tuple[float, float] | None = None
    own: float | None = None
    select_floor: float = float("-inf")
    end: Fit | None = None

    @property
    def probe(self) -> Probe:
        """The start that it was fitted from."""
        return next(probe for probe in self.fit.probes if probe.name == self.name)

    @property
    def merit(self) -> float:
        """What it explains on the frames of the fit and on those of the selection, less a little for each number that
        was free: of two that explain the same the simpler one is the better name."""
        own = self.probe
        both = self.gain + self.select_before - self.select_after
        listed = sum(len(own.settings.get(name, ())) for name in search_spec(self.name).read_lists)
        numbers = len(own.free) + _LISTED * listed
        return both - numbers * (PRICE + _PRICE_PART * abs(both))

    @property
    def passes(self) -> bool:
        """Whether it explains more than chance, more than 5 %, holds on frames that it was not fitted to, and is more
        than a usual error."""
        own = next(e for e in self.fit.effects() if e.name == self.name)
        return self.gain > self.needed and self.holds and not is_usual_error(own, self.fit.nuisance)

    @property
    def holds(self) -> bool:
        """Whether the select frames bear out what it explains on those of the fit."""
        borne_out = _holds(self.gain, self.select_before - self.select_after, self.select_change)
        if not borne_out and self.along_edges is not None:
            better, change = self.along_edges
            few = change < _FEW_EDGES * self.gain and better > -_HARMLESS_THERE * self.gain
            borne_out = few or _holds(self.gain, better, change)
        if not borne_out and self.own is not None:
            # Half as many packets may be lost in one frame as in others, which brings it no nearer.
            borne_out = abs(self.select_after - self.own) < _AS_FAR * self.own and self.gain > _TWICE * self.needed
        if not borne_out and not search_spec(self.name).at_edges:
            near = self.select_after < self.select_floor + _ALL_CLOSED * CHANCE
            borne_out = near and self.gain > _FOUR_TIMES * self.needed
        return borne_out


def _holds(gain: float, better: float, change: float) -> bool:
    """Whether select frames that come so much nearer, and move so far, bear out a gain on the frames of the fit."""
    # Frames without a sign cannot show a ghost: where nothing was to be seen, it must only do no harm.
    unseen = change < _UNSEEN * gain and better > -_HARMLESS * gain
    # They may show it weakly: then most of what it changes there must be to the better.
    return better > _PART * gain or better > _TO_THE_BETTER * change or unseen


def accepted(name: str, trials: Sequence[FittedCandidate]) -> FittedCandidate | None:
    """The trial with which an effect was accepted: its last one that passes, or else that explains enough."""
    own = [t for t in trials if t.name == name and t.gain > t.needed]
    return max(own, key=lambda t: (t.passes, t.round, t.merit), default=None)


def best_of_each_name(
    trials: Iterable[FittedCandidate], by: Callable[[FittedCandidate], float] = lambda t: t.merit
) -> list[FittedCandidate]:
    """The best trial of each name, by its merit or what else is said, the best first."""
    best: dict[str, FittedCandidate] = {}
    for trial in sorted(trials, key=by, reverse=True):
        best.setdefault(trial.name, trial)
    return [*best.values()]
