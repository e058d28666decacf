"""Names that neither the summaries nor the gap beam by beam need.

Around the explained model an effect may gain much beside others that are not yet where they fit best without it; once
these have been fitted again, it closes next to nothing. And where the gap is small, usual errors of pose, gain and
reflectances may be all of it: a view that shakes at random explains a little of what these leave, and no more beam by
beam than they do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lidarcheck.effects import with_role
from lidarcheck.explain.decision.closure import closure
from lidarcheck.explain.decision.model_check import Open, carries_over
from lidarcheck.explain.search.refine import Judged, judged
from lidarcheck.explain.search.related import are_related, is_special_case
from lidarcheck.explain.search.search import DOUBTFUL, without
from lidarcheck.explain.search.second_look import SURE, closes_what_others_left, worth_by_beams
from lidarcheck.explain.search.selection import Search, SearchData, start_fit
from lidarcheck.explain.search.substitution import is_within_another
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.wasserstein import Scale, excesses
from lidarcheck.model.spec import Model
from lidarcheck.workers.threads import done_by

__all__ = ["without_any", "without_needless"]

_OF_ALL = 0.15
"""What strikes at random beside an effect that is a special case of it must close this part of the whole gap."""
_MANY, _OF_ALL_BESIDE_MANY = 3, 0.08
"""Where there are so many names, each must close that part of it if the others leave no more of any feature than their
forms may: what two forms leave is soon explained by a third effect."""


def without_needless(bench: SearchData, seen: Scale, search: Search, seed: int) -> Search:
    """The search without names that explain less than is worth a name, and close less of the gap on the frames seen
    than the second look asks of one more; not where the others then need nuisances that are no usual errors."""
    case, found = bench.simulator.model, search
    if len(found.fit.probes) < 2:
        return found
    [(whole, _)] = excesses(seen, [case])
    while len(found.fit.probes) > 1:
        own = found.own or judged(seen, case, found.fit, seed)
        found = replace(found, own=own)
        many = len(found.fit.probes) >= _MANY
        fewer = [
            (now, _least(bench, found.fit, at, now), is_within_another(found.fit, at))
            for at, now in enumerate(_fewer(bench, found.fit))
        ]
        asked = [one for one in fewer if many or one[1] is not None]
        judgements = done_by(bench.pool, judged, [(seen.shared, case, now, seed) for now, _, _ in asked])
        enough = [
            (now, its)
            for (now, least, within), its in zip(asked, judgements, strict=True)
            if (
                least is not None
                and _closes(own, its, whole, least, found.beside, within=within)
                and not (least == 0.0 and _is_all_of_a_part(seen, case, own, its))
            )
            or (many and _closes(own, its, whole, _OF_ALL_BESIDE_MANY, found.beside) and _closes_all(seen, case, its))
        ]
        if not enough:
            break
        now, its = min(enough, key=lambda one: one[1].left)
        found = replace(found, fit=now, own=its)
    return found


def without_any(bench: SearchData, seen: Scale, search: Search, seed: int) -> Search:
    """The search without a name where usual errors alone explain the case, come as near beam by beam and leave no part
    of the gap open; asked only where the gap is small enough to be theirs."""
    if not search.fit.probes or bench.start > DOUBTFUL * bench.simulator.floor_distance:
        return search
    off, names = start_fit(bench.simulator, nuisances=True), search.fit.names()
    if not _may_be(off.nuisance, names) or not closure(bench, off).holds:
        return search
    case = bench.simulator.model
    own = search.own or judged(seen, case, search.fit, seed)
    alone = judged(seen, case, off, seed)
    if _may_be(alone.last.nuisance, names) and not _nearer(seen, case, own, alone) and _closes_all(seen, case, alone):
        return Search(off, off, search.trials, alone)
    return replace(search, own=own)


def _is_all_of_a_part(seen: Scale, case: Model, own: Judged, fewer: Judged) -> bool:
    """Whether what fewer effects lack closes a part of the gap that these leave nearly as it was."""
    whole, _ = seen.excess_by_part(case)
    before, after = (seen.excess_by_part(one.last.model(case), one.last.nuisance) for one in (fewer, own))
    return closes_what_others_left(whole, before, after)


def _nearer(seen: Scale, case: Model, own: Judged, alone: Judged) -> bool:
    """Whether a fit comes nearer beam by beam than another, and some part of the gap by more than chance: of two that
    are equally near, the noise of the rarest echoes alone makes either one the nearer."""
    if own.left >= alone.left:
        return False
    (open_, noise), (left, noise_left) = (
        seen.excess_by_part(one.last.model(case), one.last.nuisance) for one in (alone, own)
    )
    chance = np.maximum(noise.std(axis=0, ddof=1), noise_left.std(axis=0, ddof=1))
    return bool((open_ - left > SURE * chance).any())


def _may_be(off: Nuisance, names: Sequence[str]) -> bool:
    """Whether errors may be all that is wrong in the place of some names: usual ones, or reflectances that are all off
    to one side where no name says much the same."""
    gain = with_role("gain").name
    alike = any(name == gain or are_related(name, gain) for name in names)
    return off.usual or (off.conceivable and not alike)


def _closes_all(seen: Scale, case: Model, its: Judged) -> bool:
    """Whether no part of the gap stays open, with effects or with usual errors alone: there may be one that they leave
    as it was."""
    before, noise = seen.excess_by_part(case)
    after, noise_after = seen.excess_by_part(its.last.model(case), its.last.nuisance)
    return carries_over(Open(before, after, noise, noise_after), its.last.names())


def _fewer(bench: SearchData, now: Fit) -> Iterator[Fit]:
    """The fits without one of the effects."""
    return done_by(bench.pool, without, [(bench.simulator.shared, now, at) for at in range(len(now.probes))])


def _explains(bench: SearchData, now: Fit, fewer: Fit) -> bool:
    """Whether fewer effects explain the summaries nearly as well."""
    return fewer.distance - now.distance < bench.worth_beside(fewer.distance)


def _least(bench: SearchData, now: Fit, at: int, fewer: Fit) -> float | None:
    """The part of the whole gap that one of the effects must close besides what the second look asks of one more; None
    where the summaries need it."""
    if _follows_another(now, at):
        return _OF_ALL
    return 0.0 if _explains(bench, now, fewer) else None


def _follows_another(now: Fit, at: int) -> bool:
    """Whether an effect strikes at random beside one that it can do the most of, and makes up for how that one's fit
    lacks what lies behind edges."""
    probe = now.probes[at]
    return probe.strikes_anew and any(is_special_case(other, probe) for other in now.names())


def _closes(
    own: Judged, fewer: Judged, whole: float, least: float, beside: Judged | None, *, within: bool = False
) -> bool:
    """Whether they close the gap nearly as well, but for the part `least` of it, with nuisances that are no less usual,
    unless the one that is left out is `within` another.

    What the second look found `beside` the others has closed enough of what they left there; it is asked about again
    only if they leave less now.
    """
    if own.last.nuisance.usual and not fewer.last.nuisance.usual and not within:
        return False
    known = beside is not None and set(beside.last.names()) == set(fewer.last.names()) and fewer.left >= beside.left
    worth = 0.0 if known else worth_by_beams(fewer.left, whole, fewer.chance)
    return fewer.left - own.left < max(least * whole, worth)
