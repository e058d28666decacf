"""The verdict of a comparison: which KPIs stand out from what chance gives, which cannot be judged, and why."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lidarcheck.formats.plain import plain
from lidarcheck.kpi.chance.exchange import EXCHANGES, Judgement, judge, signs_of
from lidarcheck.kpi.chance.family import drawn_of
from lidarcheck.kpi.chance.rows import Tallies
from lidarcheck.kpi.chance.tallies import BLOCK_COLUMNS
from lidarcheck.kpi.compare import Compared
from lidarcheck.kpi.percentiles import LEVELS

__all__ = ["ChanceTest", "Verdict"]

FEWEST_FRAMES = 10
"""From so many frames on a unit is a frame: 2^10 exchanges, and what varies from frame to frame is in them."""
_LINE = 80
"""Columns that the closing line has."""
_OF_FEATURES = ("dvm_bias", "dvm_scatter", "wasserstein", "ks", "energy", "js", *(f"percentile_{n}" for n in LEVELS))
STANDS_OUT, AS_CHANCE, NOT_JUDGED = "stands out", "as chance", "not judged"


@dataclass(frozen=True)
class Verdict:
    """What chance gives for each KPI of a comparison, and which stand out.

    `kpis`: by (kpi, of) as a comparison's rows have them; `limit`: the score that the family's level asks, NaN where
    nothing is judged; `units`: their number, `unit_words` what they are; `frames`: how many were compared.
    """

    kpis: dict[tuple[str, str], Judgement]
    limit: float
    units: int
    unit_words: str
    frames: int

    @property
    def standing_out(self) -> list[Judgement]:
        """What no chance explains, the strongest first."""
        return sorted((one for one in self.kpis.values() if one.stands_out), key=lambda one: -one.score)

    @property
    def judged(self) -> int:
        """Number of KPIs that are judged."""
        return sum(not one.not_judged for one in self.kpis.values())

    def word(self, kpi: str, of: str) -> str:
        """The verdict on one KPI; empty for one that the test does not know."""
        found = self.kpis.get((kpi, of))
        if found is None:
            return ""
        return NOT_JUDGED if found.not_judged else STANDS_OUT if found.stands_out else AS_CHANCE

    def reasons(self) -> dict[str, list[str]]:
        """Why KPIs are not judged: the reason, and the KPIs that it holds for, in order."""
        found: dict[str, list[str]] = {}
        for one in self.kpis.values():
            if one.not_judged:
                found.setdefault(one.not_judged, []).append(f"{one.kpi} {one.of}".strip())
        return found

    @property
    def closing(self) -> str:
        """The verdict in one line."""
        tail = "" if not 1 < self.frames < FEWEST_FRAMES else "; chance between frames is not in it"
        if not self.judged:
            words = (
                self.unit_words
                if self.units != 1
                else self.unit_words.replace("blocks", "block").replace("pieces", "piece").replace("frames", "frame")
            )
            return f"No KPI could be judged: echoes lie in {self.units} {words}{tail}."
        out = self.standing_out
        if not out:
            return f"None of {self.judged} KPIs stands out from chance{tail}."
        subjects = list(dict.fromkeys(_subject(one) for one in out))
        number = f"{len(out)} of {self.judged} KPIs stand out from chance"
        lines = [
            f"{number}: {', '.join(subjects[:named])}{' and more' if named < len(subjects) else ''}{tail}."
            for named in range(len(subjects), 0, -1)
        ]
        return next((line for line in lines if len(line) <= _LINE), f"{number}{tail}.")

    def to_dict(self) -> dict[str, Any]:
        """For JSON: null where a number is not defined."""
        return {
            "closing": self.closing,
            "stands_out": [{"kpi": one.kpi, "of": one.of} for one in self.standing_out],
            "judged": self.judged,
            "limit": plain(self.limit),
            "unit": self.unit_words,
            "units": self.units,
            "frames": self.frames,
            "exchanges": EXCHANGES,
            "kpis": [plain(one) for one in self.kpis.values()],
        }


def _subject(one: Judgement) -> str:
    """What a KPI that stands out is about: its feature, else itself."""
    return one.of if one.kpi in _OF_FEATURES else one.kpi


@dataclass
class ChanceTest:
    """Takes the frames of a comparison one after another, and keeps of each what its units hold."""

    _tallies: Tallies = field(default_factory=Tallies)

    def add(self, found: Compared) -> None:
        """Take in a frame; hand this to `compare` as `look`."""
        self._tallies.add(found)
        if len(self._tallies.units) >= FEWEST_FRAMES:
            self._tallies.merge()

    def verdict(self) -> Verdict:
        """What chance gives, over all frames taken in."""
        frames = len(self._tallies.units)
        by_frame = frames >= FEWEST_FRAMES
        seen = self._tallies.echoes().sum(axis=0) > 0.0
        # A unit without an echo on either side is none: exchanging it would only be an exchange twice.
        own = signs_of(int(seen.sum()))
        signs = np.ones((len(own), len(seen)))
        signs[:, seen] = own
        part, of = ("blocks", f"{BLOCK_COLUMNS} columns") if self._tallies.lattice else ("pieces", "the sweep")
        kpis, limit = judge(list(drawn_of(self._tallies, signs, by_frame=by_frame)), "frames" if by_frame else part)
        words = "frames" if by_frame else f"{part} of {of}"
        return Verdict({(one.kpi, one.of): one for one in kpis}, limit, int(seen.sum()), words, frames)
