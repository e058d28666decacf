"""The last judgement beam by beam: whether the named effects close the gap."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.search import search_spec
from lidarcheck.explain.search.related import are_related
from lidarcheck.inference.observed.observations import FEATURES
from lidarcheck.inference.wasserstein import PARTS

__all__ = ["Open", "carries_over"]


_LEAST_CLOSED, _LEAST_CLOSED_EDGES, _LEAST_CLOSED_RELATED, _SURE = 0.4, 0.25, 0.85, 3.0
"""Effects that close less of the gap are not what it is made of, if it is more than chance by so many of its standard
deviations; less of it closes where all that shows is at edges, each of which is where the scan does not say. Effects
that change the same features in the same way must close more: together they come near to many a third one."""
_MAY_STAY = {
    "range": (0.36, 0.05), "area": (0.36, 0.08), "peak": (0.36, 0.08), "width": (0.36, 0.08), "detected": (0.36, 0.25),
    "other echoes": (0.45, 0.35),
}  # fmt: skip
"""What may stay open of each part of the gap: so large a part of it, or so much on the mean of both kinds of frames
where that is more, which is what errors of pose and reflectances make: 0.01 degrees alone lost 0.2 of detection in a
scene of panels. A threshold that varies from shot to shot left 0.07 of PEAK, and one that varies from beam to beam 0.32
of the widths; a rain, whose drops close before a road count as its echoes, 0.33 of the ranges. A wrong name often
closes one part and leaves another as it was, or wider."""
_MOST = 0.4
"""Of no feature of the echoes more than so many of its standard deviations, however far it was off, but for what shows
at edges: of 163 gaps that right names closed, one left more, beside which a second effect was missing; one left 0.35 of
the ranges, and none more than 0.24 of anything else. A rain with a gain per layer in the place of fog left 0.55 of the
ranges."""
_SHARE_AT_EDGES = 0.45
"""As large a part where all that shows is at edges: of a true divergence 0.36 of the widths stayed."""
_FOLLOWING = 0.04, 0.03
"""The same of ranges where what stays of them follows a quantity of the beams."""

_BY_CHANCE, _CLOSED_BESIDES = 2.0, 0.4
"""So many standard deviations of its noise more, where so much of the part closes, or where it is no larger than that
noise: effects that strike at random strike elsewhere in every frame."""
_SCATTER, _SCATTER_LEAST = 3.0, 0.1
"""Of effects that strike at random, one measurement is as far from the model without them as two of the model with them
are from each other, more or less: no more than so many times as far, and so much."""


@dataclass(frozen=True)
class Open:
    """What is open of each of `PARTS` of the gap with one model and with a later one, shape (n_parts,), and draws of
    the noise on these, shape (n_draws, n_parts): an effect that strikes at random has some of its own. `images`: of
    other echoes only what `only_images_stay` speaks of stays open; `following`: of ranges, what `ranges_follow` does;
    `edges`: what stays is at edges that split echoes; `settled`: the summaries have closed, as `Closure.settled` says.
    """

    before: FloatArray
    after: FloatArray
    noise: FloatArray
    noise_after: FloatArray
    images: bool = False
    following: bool = False
    edges: bool = False
    settled: bool = False

    def mean_of(self, parts: Sequence[str]) -> tuple[float, float, float]:
        """The means over some parts, and their standard deviation by chance."""
        of = [PARTS.index(part) for part in parts]
        chance = max(noise[:, of].mean(axis=1).std(ddof=1) for noise in (self.noise, self.noise_after))
        return float(self.before[of].mean()), float(self.after[of].mean()), float(chance)


def carries_over(open_: Open, names: Sequence[str] = ()) -> bool:
    """Whether a good part of the gap closes, and of each of its parts; `names`: the effects that close it.

    Where there is no gap beyond chance, this cannot be asked. What a beam meets that looks past an edge is nowhere in
    the ideal scan: of effects that are of nothing else, and of a footprint beside whatever else, the other echoes are
    left out, as are images of such things.
    """
    if _scatters_too_much(open_):
        return False
    at_edges = _only_at_edges(names)
    if at_edges and open_.edges:
        return True
    if open_.settled:
        # Forms leave what they leave; only of ranges, where each form is one or hardly bends, is what stays a sign.
        asked = PARTS if open_.following else [*_of_one_form(names)]
        return all(_may_stay(part, open_, names) for part in asked if part == "range")
    unplaced = at_edges or open_.images or any(search_spec(name).splits_echoes for name in names)
    parts = [part for part in PARTS if part != "other echoes" or not unplaced]
    whole, left, chance = open_.mean_of(parts)
    if whole <= _SURE * chance:
        return True
    related = any(are_related(one, other) for one, other in itertools.combinations(names, 2))
    least = _LEAST_CLOSED_EDGES if at_edges else _LEAST_CLOSED_RELATED if related else _LEAST_CLOSED
    # Chance takes from what closes as often as it adds to it: one standard deviation is forgiven.
    return left <= (1.0 - least) * whole + chance and all(_may_stay(part, open_, names) for part in parts)


def _scatters_too_much(open_: Open) -> bool:
    """Whether the later model's own scatter of some part is far more than the measurement has ever shown of it."""
    more = open_.noise_after.mean(axis=0) - open_.noise.mean(axis=0)
    return bool(np.any(more > _SCATTER * open_.before + _SCATTER_LEAST))


def _only_at_edges(names: Sequence[str]) -> bool:
    return bool(names) and all(search_spec(name).at_edges for name in names)


def _may_stay(part: str, open_: Open, names: Sequence[str]) -> bool:
    """Whether what is left of one part of the gap is no more than forms and usual errors leave."""
    share, least = _of_one_form(names).get(part, _MAY_STAY[part])
    if part == "range" and open_.following:
        share, least = _FOLLOWING
    most = _MOST if part in FEATURES else np.inf
    if _only_at_edges(names):
        share, most = max(share, _SHARE_AT_EDGES), np.inf
    whole, left, chance = open_.mean_of([part])
    most = min(max(share * whole, least), most)
    closes = whole <= chance or left <= (1.0 - _CLOSED_BESIDES) * whole
    return left <= most or (closes and left <= most + _BY_CHANCE * chance)


def _of_one_form(names: Sequence[str]) -> Mapping[str, tuple[float, float]]:
    """What may stay open of the parts that all of the effects are of, where each has one form only: hardly anything.

    Of true errors of range up to 2 % stayed, or 0.14, where reflectances and pose were off and not fitted. Of true
    walks, whose curve can bend, 1 % stayed, of a scale that was taken for one 11 %.
    """
    forms = [search_spec(name).may_stay for name in names]
    if not forms or any(form.keys() != forms[0].keys() for form in forms):
        return {}
    return {part: max(form[part] for form in forms) for part in forms[0]}
