"""What a search must know of `dropout`: of single beams, or of blocks, whose size is read off the data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.search.base import LOG_STEP, FreeParameter, Probe, SearchSpec
from lidarcheck.effects.search.evidence import Evidence

_FREE = (FreeParameter("share", LOG_STEP, log=True),)

_SURE = 0.9
"""Beams that the model detects so often, which is with every seed that it was asked, tell of losses; not along edges,
where a pose that is a little off takes a whole line of them."""
_FEWEST = 20
_SIZES = (*range(1, 17), 20, 24, 32, 40, 48, 64)
"""Lengths of blocks that are tried, in layers and in point columns."""
_TOGETHER = 2.0
"""Fewer beams than this in a block on the mean, of those that are lost with it, are single beams."""
_LEAST_LIKELIER = 10.0
"""Blocks must be likelier than single beams by so much, in ln."""
_ROUNDS, _TURNS, _MOST = 8, 2, 1.0 - 1e-9
_CHANCE = 3.0
"""Shares of two sets of frames that differ by less than so many standard deviations may be one."""


def _starts(evidence: Evidence) -> list[Probe]:
    """Dropout in blocks, where beams of a block are lost together more often than others."""
    losses = _Losses.of(evidence)
    found = None if losses.lost.sum() < _FEWEST else _blocks(losses)
    if found is None:
        return []
    (layers, points), share = found
    fixed = {"block_points": points, "block_layers": layers}
    return [Probe("dropout", {"share": share}, _FREE, fixed, "blocks")]


def _as_struck(evidence: Evidence, probe: Probe, effect: Effect) -> Mapping[str, float]:
    """As large a share of blocks lost as the frames show, where chance may make the difference: of a hundred blocks of
    which each is lost with 5 %, a frame loses two, or nine."""
    size = _size(probe)
    if size == (1, 1) or not len((losses := _Losses.of(evidence)).lost):
        return {}
    share = float(effect.settings()["share"])
    there = _fitted(losses, losses.block(*size), share, _rates(losses, np.where(losses.lost, 0.5, 0.0))).share
    near = 0.0 < abs(there - share) < _CHANCE * share * _share_spread(evidence, probe, share)
    return {"share": there} if near else {}


def _chance_errors(evidence: Evidence, probe: Probe, effect: Effect) -> Mapping[str, float]:
    return {"share": _share_spread(evidence, probe, float(effect.settings()["share"]))}


def _share_spread(evidence: Evidence, probe: Probe, share: float) -> float:
    """By what part of itself a share of blocks that was fitted is off by chance: the frames have lost so many blocks,
    and so have the simulations, whose blocks are others. 0 for single beams."""
    layers, points = _size(probe)
    if (layers, points) == (1, 1):
        return 0.0
    beams, met = evidence.beams, evidence.beams.distance_m > 0.0
    block = np.stack([beams.frame[met], beams.layer[met] // layers, beams.point[met] // points])
    return float(np.sqrt(2.0 / max(share * np.unique(block, axis=1).shape[1], 1.0)))


def _size(probe: Probe) -> tuple[int, int]:
    """How many layers and point columns a probe's blocks have; 1 and 1 for single beams."""
    return int(probe.fixed.get("block_layers", 1)), int(probe.fixed.get("block_points", 1))


@dataclass(frozen=True)
class _Losses:
    """Beams that should be detected, each (n,): where they are, whether they are lost, and on which surface of which
    frame they lie: there, other causes lose about as many everywhere."""

    frame: IndexArray
    layer: IndexArray
    point: IndexArray
    lost: BoolArray
    surface: IndexArray

    @classmethod
    def of(cls, evidence: Evidence) -> _Losses:
        """Of some frames."""
        beams, expected = evidence.beams, evidence.expected
        sure = expected.known & (expected.probability > _SURE) & ~expected.at_edge
        place = np.stack([beams.frame[sure], beams.material_id[sure]])
        surface = np.unique(place, axis=1, return_inverse=True)[1].ravel().astype(np.int64)
        lost = ~evidence.measured.detected[sure]
        return cls(beams.frame[sure], beams.layer[sure], beams.point[sure], lost, surface)

    def block(self, layers: int, points: int) -> IndexArray:
        """Each beam's block, (n,): numbers from 0 on, of which some may be nobody's."""
        row, column = (at // size for at, size in ((self.layer, layers), (self.point, points)))
        rows, columns = (int(at.max()) + 1 for at in (row, column))
        return (self.frame * rows + row) * columns + column


@dataclass(frozen=True)
class _Fitted:
    """Losses in blocks of a size: the ln of their likelihood, the share of blocks that are lost, how often each beam is
    lost alone (n,), and how many beams a lost block has on the mean."""

    likelihood: float
    share: float
    alone: FloatArray
    together: float


def _blocks(losses: _Losses) -> tuple[tuple[int, int], float] | None:
    """The likeliest size of blocks, (layers, point columns), and the share that is lost; None for beams that are lost
    one by one.

    Beams are lost with their whole block, or alone by other causes, whose part is fitted for each surface. Given
    these, every size has its likelihood; given a size, they are fitted by expectation and maximisation.
    """
    single = _likelihood(losses, losses.block(1, 1), 0.0, _rates(losses, losses.lost.astype(np.float64)))[0].sum()
    share, alone = 0.5 * float(losses.lost.mean()), _rates(losses, np.where(losses.lost, 0.5, 0.0))
    pairs = [_fitted(losses, losses.block(*pair), share, alone).likelihood for pair in ((1, 2), (2, 1))]
    if max(pairs) < single + _LEAST_LIKELIER:
        return None
    for _ in range(_TURNS):
        sums = {one: _likelihood(losses, losses.block(*one), share, alone)[0].sum() for one in product(_SIZES, _SIZES)}
        size = max(sums, key=lambda one: (sums[one], -one[0] * one[1]))
        found = _fitted(losses, losses.block(*size), share, alone)
        share, alone = found.share, found.alone
    return (size, share) if found.together > _TOGETHER and found.likelihood > single + _LEAST_LIKELIER else None


def _fitted(losses: _Losses, block: IndexArray, share: float, alone: FloatArray) -> _Fitted:
    """The share of blocks and the losses of single beams that are likeliest, from a start."""
    beams = np.bincount(block)
    for _ in range(_ROUNDS):
        each, whole = _likelihood(losses, block, share, alone)
        kept = 1.0 - whole[block]
        share = float(whole.sum()) / int(np.count_nonzero(beams))
        alone = _rates(losses, np.where(losses.lost, kept, 0.0), kept)
    together = float((whole * beams).sum() / max(whole.sum(), 1e-9))
    return _Fitted(float(each.sum()), share, alone, together)


def _rates(losses: _Losses, lost: FloatArray, of: FloatArray | None = None) -> FloatArray:
    """How often each beam's surface loses a beam alone, (n,)."""
    weight = np.ones(len(lost)) if of is None else of
    n = int(losses.surface.max()) + 1
    rate = (np.bincount(losses.surface, lost, n) + 0.5) / (np.bincount(losses.surface, weight, n) + 1.0)
    return np.asarray(np.clip(rate, 1e-6, 1.0 - 1e-6)[losses.surface])


def _likelihood(losses: _Losses, block: IndexArray, share: float, alone: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The ln of each block's likelihood, and how likely it is that it was lost as a whole; both (n_blocks,), 0 where a
    number is nobody's."""
    each = np.bincount(block, np.where(losses.lost, np.log(alone), np.log1p(-alone)))
    beams, lost = np.bincount(block), np.bincount(block, losses.lost)
    kept, all_lost = each + np.log1p(-min(share, _MOST)), (lost == beams) & (beams > 0)
    both, whole = np.where(beams > 0, kept, 0.0), np.zeros(len(beams))
    if share > 0.0:
        both[all_lost] = np.logaddexp(kept[all_lost], np.log(share))
        whole[all_lost] = np.exp(np.log(share) - both[all_lost])
    return both, whole


SPEC = SearchSpec(
    "dropout",
    free=_FREE,
    fixed_starts=({"share": 0.01}, {"share": 0.06}),
    starts=_starts,
    order=5,
    amounts=("share",),
    at_random="loses echoes",
    form_errors={"share": 0.12},  # how often it strikes
    chance_errors=_chance_errors,
    as_struck=_as_struck,
    in_repeats=True,
    watched_by=("detection_probability", "echo_share"),
    shown_by=("detected", "map"),
)
