"""Where measured and simulated disagree by more than chance, the tightest description first.

For each unit and feature there are three values: measured M, and simulated twice, A and B, with the same model and
other random numbers. Where nothing is wrong the three are exchangeable, so that of c = M - (A + B)/2 the three values
themselves tell the variance, 2.25 var(M, A, B), and

    z = sum c / sqrt(sum 2.25 var(M, A, B))     over the units of a group

is about normal, whatever the distribution of the values (a permutation test: E. J. G. Pitman, Suppl. J. R. Stat. Soc.
4, 1937). z of A against B, in which nothing can be wrong, must scatter by 1 over the groups of one kind; where it
scatters by more, because an effect moves many beams together, all z of the kind are divided by that. A group stands out
where |z| passes the bound that chance passes in one frame of a hundred, over all groups and features together
(Bonferroni).

z cannot pass sqrt(2 n), so that it tells that something is wrong and not how wrong. The order is by

    strength = |sum c| / sqrt(max(sum (c - mean c)^2, 1.5 sum (A - B)^2/2))

which is large where all units of a group disagree alike, and small for a group that only contains some that do. The
largest is listed, its units are taken out, and the rest is judged again: a sector that disagrees because of one sign in
it is not named beside the sign. Where strengths are about equal an object is named rather than a sector. The whole
frame is named where three quarters of its sectors disagree like it; it cannot be taken out, and another group is then
listed where it disagrees more than the frame does.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IndexArray
from lidarcheck.calibration.scenes.groups import UnitGroups
from lidarcheck.calibration.scenes.units import Values, features_in

__all__ = ["FALSE_ALARMS", "MOST_LISTED", "DisagreeingGroup", "Ranking", "rank"]

FALSE_ALARMS = 0.01
"""In how many frames without any disagreement one may be listed."""
MOST_LISTED = 20
ABOUT_EQUAL = 0.75
"""Of groups that are at least so strong as the strongest, the first in the order of the kinds is named."""
FEWEST_UNITS = 12
"""z cannot pass the bound with fewer."""
COMPRESSED_FROM = 5.0
FEW_GROUPS = 100
SHRINKAGE = 20.0
"""A group's own scatter counts for its units, the mean scatter of all for so many more."""


@dataclass(frozen=True)
class DisagreeingGroup:
    """A group that disagrees, by the feature in which it does most.

    `kind`, `group`: which; `units`: a mask of those that were still there, shape (n,); `strength` and `z`: see the
    module; `features`: all in which the group stands out, the first one first.
    """

    kind: str
    group: int
    name: str
    feature: str
    strength: float
    z: float
    features: tuple[str, ...]
    units: BoolArray = field(repr=False)


@dataclass(frozen=True)
class Ranking:
    """The findings, how many more groups stand out, and the bound that chance passes once in `FALSE_ALARMS` frames.

    `inflation`: by kind and feature, 1 or more. `strength`: by kind, of all groups and before any is taken out, the
    largest disagreement over the features; shape (n_groups,), 0 where a group does not stand out.
    """

    findings: tuple[DisagreeingGroup, ...]
    more: int
    bound_z: float
    tests: int
    inflation: dict[str, float]
    strength: dict[str, FloatArray]


@dataclass(frozen=True)
class _Sums:
    """Sums over the units of each group, for one feature; shape (n_groups,) each."""

    count: FloatArray
    change: FloatArray
    felt: FloatArray
    square: FloatArray
    variance: FloatArray
    scatter: FloatArray

    def without(self, other: _Sums) -> _Sums:
        """The sums once those of some units are taken out."""
        return _Sums(*(getattr(self, f.name) - getattr(other, f.name) for f in fields(self)))


@dataclass(frozen=True)
class _Terms:
    """A feature's terms for the units that have it, (n_feature,): rows, c, c with the largest compressed, its variance,
    the model's own scatter, A - B."""

    name: str
    counts: bool
    rows: IndexArray
    change: FloatArray
    felt: FloatArray
    variance: FloatArray
    scatter: FloatArray
    twice: FloatArray

    def sums(self, kind: UnitGroups, some: slice | BoolArray = slice(None)) -> _Sums:
        index, most = kind.index[self.rows[some]], len(kind.names)
        inside = index >= 0
        index = index if inside.all() else index[inside]

        def total(column: FloatArray) -> FloatArray:
            part = column[some]
            part = part if len(part) == len(index) else part[inside]
            return np.asarray(np.bincount(index, weights=part, minlength=most), dtype=np.float64)

        count = np.bincount(index, minlength=most).astype(np.float64)
        columns = (self.change, self.felt, self.felt**2, self.variance, self.scatter)
        return _Sums(count, *(total(column) for column in columns))


def rank(measured: Values, simulated: Values, again: Values | None, kinds: list[UnitGroups]) -> Ranking:
    """The disagreements of measured against simulated values, largest first.

    `again`: the simulation with other random numbers. Without it every difference of a unit counts as its own scatter.
    """
    terms = [
        _terms(feature.name, feature.counts, measured, simulated, again) for feature in features_in(measured, simulated)
    ]
    sums = {(kind.name, term.name): term.sums(kind) for kind in kinds for term in terms}
    inflation = {} if again is None else _inflation(terms, kinds)
    tests = sum(int(np.count_nonzero(s.count >= FEWEST_UNITS)) for s in sums.values())
    bound = _bound(tests)
    search = _Search(terms, kinds, sums, inflation, bound)
    strength = {kind.name: search.strength(kind) for kind in kinds}
    findings: list[DisagreeingGroup] = []
    while len(findings) < MOST_LISTED and (found := search.next()) is not None:
        findings.append(found)
        search = search.after(found)
    more = search.standing_out() if len(findings) == MOST_LISTED else 0
    return Ranking(tuple(findings), more, bound, tests, {f"{k} {f}": v for (k, f), v in inflation.items()}, strength)


def _terms(name: str, counts: bool, measured: Values, simulated: Values, again: Values | None) -> _Terms:
    m, a = measured.of[name], simulated.of[name]
    b = a if again is None else again.of[name]
    known = np.isfinite(m) & np.isfinite(a) & np.isfinite(b)
    if name == "echo":
        # Beams that never see their surface say nothing, and would dilute a layer that has lost all that it can see.
        known &= (m > 0.0) | (a > 0.0) | (b > 0.0)
    rows = np.flatnonzero(known)
    m, a, b = m[rows], a[rows], b[rows]
    if again is None:
        change = m - a
        # Without a second run a difference is judged by its own size.
        none = np.zeros(len(rows))
        return _Terms(name, counts, rows, change, _compressed(change, change, counts), change**2, none, none)
    change = m - 0.5 * (a + b)
    mean = (m + a + b) / 3.0
    variance = 0.75 * ((m - mean) ** 2 + (a - mean) ** 2 + (b - mean) ** 2)
    felt = _compressed(change, a - b, counts)
    return _Terms(name, counts, rows, change, felt, variance, 0.5 * (a - b) ** 2, a - b)


def _compressed(change: FloatArray, usual: FloatArray, counts: bool) -> FloatArray:
    """c, beyond some usual scatters logarithmic: at edges a few beams see another surface, and would hide the rest."""
    if counts or not len(change):
        return change
    scatter = COMPRESSED_FROM * (float(np.median(np.abs(usual))) or float(np.sqrt(np.mean(usual**2))))
    return np.asarray(scatter * np.arcsinh(change / scatter)) if scatter > 0.0 else change


def _inflation(terms: list[_Terms], kinds: list[UnitGroups]) -> dict[tuple[str, str], float]:
    """By how much z of the model against itself scatters more than 1, for each kind and feature; 1 or more."""
    found = {}
    for term in terms:
        for kind in kinds:
            index = kind.index[term.rows]
            inside = index >= 0
            sums, squares = (
                np.bincount(index[inside], weights=column[inside], minlength=len(kind.names))
                for column in (term.twice, term.twice**2)
            )
            some = squares > 0.0
            z_square = sums[some] ** 2 / squares[some]
            # Of few groups the scatter says little: as many more are taken to scatter by 1.
            found[kind.name, term.name] = float(np.sqrt(max((z_square.sum() + 10.0) / (some.sum() + 10.0), 1.0)))
    for term in terms:
        most = max(found[kind.name, term.name] for kind in kinds)
        for kind in kinds:
            # A few groups cannot tell by themselves: what moves columns together moves the objects in them, too.
            if len(kind.names) < FEW_GROUPS:
                found[kind.name, term.name] = most
    return found


def _bound(tests: int) -> float:
    from scipy.special import ndtri

    return float(-ndtri(FALSE_ALARMS / 2.0 / max(tests, 1)))


@dataclass(frozen=True)
class _Search:
    """What is left to be found: the sums of the units that no finding has taken out."""

    terms: list[_Terms]
    kinds: list[UnitGroups]
    sums: dict[tuple[str, str], _Sums]
    inflation: dict[tuple[str, str], float]
    bound: float
    left: BoolArray | None = None
    whole: bool = False

    def next(self) -> DisagreeingGroup | None:
        """The largest disagreement that is left, or None."""
        best: list[tuple[float, int, str, int]] = []
        for kind in self.kinds:
            for term in self.terms:
                strength = self._judged(kind, term)[1]
                if len(strength) and strength.max() > 0.0:
                    best.append((float(strength.max()), int(np.argmax(strength)), kind.name, self._order(kind)))
        if not best:
            return None
        enough = ABOUT_EQUAL * max(best)[0]
        _, group, name, _ = min((b for b in best if b[0] >= enough), key=lambda b: (b[3], -b[0]))
        return self._finding(next(kind for kind in self.kinds if kind.name == name), group)

    def _order(self, kind: UnitGroups) -> int:
        return [k.name for k in self.kinds].index(kind.name)

    def _finding(self, kind: UnitGroups, group: int) -> DisagreeingGroup:
        judged = {term.name: tuple(float(x[group]) for x in self._judged(kind, term)) for term in self.terms}
        names = sorted((name for name, (_, s) in judged.items() if s > 0.0), key=lambda name: -judged[name][1])
        z, strength = judged[names[0]]
        units = kind.index == group
        units = units if self.left is None else units & self.left
        return DisagreeingGroup(kind.name, group, kind.names[group], names[0], strength, z, tuple(names), units)

    def after(self, found: DisagreeingGroup) -> _Search:
        """What is left behind a finding."""
        if found.kind == "frame":
            return replace(self, whole=True)
        sums = {}
        for term in self.terms:
            some = found.units[term.rows]
            for kind in self.kinds:
                sums[kind.name, term.name] = self.sums[kind.name, term.name].without(term.sums(kind, some))
        left = ~found.units if self.left is None else self.left & ~found.units
        return replace(self, sums=sums, left=left)

    def standing_out(self) -> int:
        """How many groups still stand out."""
        return sum(int(np.count_nonzero(self.strength(kind))) for kind in self.kinds if kind.name != "frame")

    def strength(self, kind: UnitGroups) -> FloatArray:
        """The largest disagreement of each group over the features, shape (n_groups,)."""
        return np.asarray(np.max([self._judged(kind, term)[1] for term in self.terms], axis=0))

    def _judged(self, kind: UnitGroups, term: _Terms) -> tuple[FloatArray, FloatArray]:
        """z and strength of each group; the strength is 0 where the group does not stand out."""
        s = self.sums[kind.name, term.name]
        z, strength = self._score(s, kind, term)
        outstanding = (np.abs(z) > self.bound) & (s.count >= FEWEST_UNITS)
        if kind.name == "frame":
            return z, np.where(outstanding & (not self.whole) & self._is_broad(term), strength, 0.0)
        if self.whole:
            frame = self.sums["frame", term.name]
            n = s.count / max(float(frame.count[0]), 1.0)
            beyond = replace(s, change=s.change - n * frame.change[0], felt=s.felt - n * frame.felt[0])
            beyond_z, beyond_strength = self._score(beyond, kind, term)
            outstanding &= (np.abs(beyond_z) > self.bound) & (np.sign(beyond_z) == np.sign(z))
            strength = np.minimum(strength, beyond_strength)
        return z, np.where(outstanding, strength, 0.0)

    def _is_broad(self, term: _Terms) -> bool:
        """Whether three quarters of the sectors disagree like the frame: by half as much or more."""
        frame, sectors = self.sums["frame", term.name], self.sums["sector", term.name]
        some = sectors.count >= FEWEST_UNITS
        if not some.any():
            return False
        mean = float(frame.change[0] / max(frame.count[0], 1.0))
        share = sectors.change[some] / sectors.count[some] / mean if mean else np.zeros(1)
        return bool(np.mean(share >= 0.5) >= 0.75)

    def _score(self, s: _Sums, kind: UnitGroups, term: _Terms) -> tuple[FloatArray, FloatArray]:
        """z and strength of each group, shape (n_groups,)."""
        inflation = self.inflation.get((kind.name, term.name), 1.0)
        z = np.where(s.variance > 1e-12, s.change / np.sqrt(np.maximum(s.variance, 1e-12)), 0.0) / inflation
        spread = s.square - s.felt**2 / np.maximum(s.count, 1.0)
        usual = SHRINKAGE * float(term.scatter.mean()) if len(term.scatter) else 0.0
        least = max(usual, 1.0 if term.counts else 1e-12)
        return z, np.abs(s.felt) / np.sqrt(np.maximum(spread, 1.5 * s.scatter) + 1.5 * least)
