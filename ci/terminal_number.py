"""How far the number after an edit can be trusted: null edits, fresh measurements of a known edit, random edits.

All is simulated, so that it is known which of two tables is the better one. Run by ci/terminal_number.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.calibration.number.frames import Frames
from lidarcheck.calibration.number.misfit import Misfit
from lidarcheck.calibration.number.number import LEAST, judged
from lidarcheck.calibration.number.prepared import OnFrames
from lidarcheck.calibration.number.request import SAMPLE_SEEDS, Request
from lidarcheck.calibration.number.seen import Seen
from lidarcheck.calibration.number.spread import Spread
from lidarcheck.cases.frame import Frame
from lidarcheck.cases.source import ideal_of
from lidarcheck.cli import main as lidarcheck
from lidarcheck.effects.base import Curve
from lidarcheck.effects.finding import make, with_role
from lidarcheck.formats.lut_scale import y_of_scaled
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.model import load_model, simulate
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces

ROOT = Path(__file__).resolve().parents[1]
X = (-160, -120, -80, -50, -33, -20, -10, -6, -3, 3, 6, 10, 20, 33, 50, 80, 100, 120, 140, 200)
STEPS = 4
"""Steps of a scaled Y by which an edit moves a row: 7 %."""
POOL, TRUE = 64, 24
"""Seeds of each model, of which each number takes a few; further ones, for the true difference of an edit."""
KNOWN_STEPS = 12
"""By how much a row is moved in the edit whose interval is looked at."""


@dataclass(frozen=True)
class Trial:
    """A scene, the sensor, the direction, further effects, and how far lines of a measurement are off together."""

    scene: str
    variant: str = "SLIM"
    axis: Any = "vertical"
    effects: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    together: float = 0.0


OTHERS: Mapping[str, Mapping[str, Any]] = {"rain": {}, "crosstalk": {}, "blooming_horizontal": {}}
TRIALS = {
    "sign 69 m": Trial("sign_vertical_69m"),
    "sign 156 m": Trial("sign_vertical_156m"),
    "sign 156 m, SMART": Trial("sign_vertical_156m", "SMART"),
    "sign 199 m": Trial("sign_vertical_199m"),
    "horizontal, 20 m": Trial("sign_horizontal_20m", axis="horizontal"),
    "three signs, 60 and 130 m": Trial("bridge_signs"),
    "156 m, rain, crosstalk, horizontal": Trial("sign_vertical_156m", effects=OTHERS),
    "69 m, lines correlated": Trial("sign_vertical_69m", together=0.5),
}


def table(scaled: Sequence[int]) -> Curve:
    """A blooming table of whole numbers 0 to 1000 at `X`."""
    return Curve(tuple(map(float, X)), tuple(y_of_scaled(s) for s in scaled), "")


class Bench:
    """A measured scene and the tables that are tried on it: a truth, and one that is wrong in each row."""

    def __init__(self, trial: Trial, scratch: Path, rng: np.random.Generator, measurements: int = 1) -> None:
        self.trial, self.rng = trial, rng
        file = scratch / f"{trial.scene}_{trial.variant}.parquet"
        if not file.exists():
            words = ["scene", trial.scene, "--sensor", trial.variant, "--out", str(file), "--quiet"]
            if lidarcheck(words) != 0:
                sys.exit(f"lidarcheck {' '.join(words)} failed")
        plain = load_model(ROOT / f"scenarios/models/scenes_{trial.variant}.toml")
        for name, values in trial.effects.items():
            plain = plain.with_(make(name, dict(values)))
        self.plain = plain
        self.truth = [560 - int(abs(x) / 1.7) for x in X]
        self.wrong = [s + int(rng.integers(-8, 9)) for s in self.truth]
        ideal = ideal_of(file, plain.sensor)
        measured = simulate(ideal, self.model(self.truth), seed=1)
        surfaces = Surfaces(ideal)
        data = Frames((Frame(0, ideal, measured, 0.0),), (surfaces,), "trial", trial.scene)
        self.request = Request("misfit", file, axis=trial.axis)
        self.on = OnFrames.of(data, self.model(self.truth), self.request)
        self.measured = self._measured(self.seen(self.truth, 5000, measurements))

    def model(self, scaled: Sequence[int]) -> Model:
        """The model with a table."""
        return self.plain.with_(make(with_role(f"{self.trial.axis} blooming").name, {"lut": table(scaled)}))

    def seen(self, scaled: Sequence[int], first: int, count: int) -> list[Seen]:
        """What a table shows with some seeds."""
        lights = self.on.lights(self.model(scaled), range(first, first + count))
        return [self.on.seen(lights.scans(k)) for k in range(count)]

    def _measured(self, seen: list[Seen]) -> list[Seen]:
        """Measurements; with what lines next to each other have in common, where the trial asks for it."""
        if not self.trial.together:
            return seen
        lines, found = int(self.on.beside.line.max()) + 1, []
        for one in seen:
            raw = self.rng.normal(size=lines + 2)
            common = self.trial.together * np.convolve(raw, np.ones(3) / np.sqrt(3.0), "valid")
            spread = self.on.misfit.spread[self.on.misfit.cell, 1:]
            found.append(replace(one, value=one.value + common[self.on.beside.line][:, None] * spread))
        return found

    @cached_property
    def misfits(self) -> list[Misfit]:
        """The measurements, ready to be compared."""
        return [Misfit(self.on.beside, self.on.slots, one, "trial") for one in self.measured]

    def misfit(self, k: int) -> Misfit:
        """The k-th of them, and again the first after the last."""
        return self.misfits[k % len(self.misfits)]

    def edits(self, number: int) -> Iterator[list[int]]:
        """The wrong table with one row moved, up or down."""
        for _ in range(number):
            edited = list(self.wrong)
            edited[int(self.rng.integers(len(X)))] += STEPS * int(self.rng.choice([-1, 1]))
            yield edited


def difference(bench: Bench, before: list[Seen], after: list[Seen]) -> float:
    """The true one, of numbers with as many seeds as are shown: their mean over all measurements and seeds."""
    found = []
    for one in bench.misfits:
        some = bench.rng.permutation(len(before))[:SAMPLE_SEEDS]
        values = [one.value(one.means([side[i] for i in some])) for side in (before, after)]
        found.append(values[1] - values[0])
    return float(np.mean(found))


def words(misfit: Misfit, before: Sequence[Seen], after: Sequence[Seen]) -> tuple[str, float, float]:
    """What is said of an edit, and its interval."""
    numbers = [misfit.number(seen, simulated=name, sample="") for name, seen in (("a", before), ("b", after))]
    step = judged(*numbers)
    return step.word, step.low, step.high


def tried(bench: Bench, nulls: int, frames: int, edits: int) -> str:
    """A row of the table."""
    rng, n = bench.rng, SAMPLE_SEEDS
    wrong = bench.seen(bench.wrong, 0, POOL)
    said = 0
    for k in range(nulls):
        some = rng.permutation(POOL)[: 2 * n]
        word, *_ = words(bench.misfit(k), [wrong[i] for i in some[:n]], [wrong[i] for i in some[n:]])
        said += word in ("better", "worse")
    known = list(bench.wrong)
    known[X.index(20)] += KNOWN_STEPS
    moved = bench.seen(known, 0, POOL)
    true, held = difference(bench, wrong, moved), 0
    for k in range(frames):
        some = rng.permutation(POOL)[:n]
        _, low, high = words(bench.misfit(k), [wrong[i] for i in some], [moved[i] for i in some])
        held += low <= true <= high
    right = bad = matter = told = 0
    for k, edited in enumerate(bench.edits(edits)):
        shown = bench.seen(edited, 0, n + TRUE)
        at = difference(bench, wrong[n : n + TRUE], shown[n:])
        word, *_ = words(bench.misfit(k), wrong[:n], shown[:n])
        truth = "same" if abs(at) < LEAST else "better" if at < 0.0 else "worse"
        right += word.startswith(truth)
        matter += truth != "same"
        told += truth != "same" and word == truth
        bad += word in ("better", "worse") and truth in ("better", "worse") and word != truth
    share = [f"{100.0 * a / max(b, 1):.0f} %" for a, b in ((said, nulls), (held, frames), (right, edits))]
    number = bench.misfit(0).number(wrong[:n], simulated="", sample="")
    return " | ".join([f"{len(bench.on.beside)}", number.blocks, f"{number.value:.2f}", f"{number.floor:.2f}",
                       share[0], f"{true:+.3f}", share[1], share[2], f"{told} of {matter}", str(bad)])  # fmt: skip


def tried_gap(scratch: Path, nulls: int) -> str:
    """The gap of a pulse that is 2 % too long, against its nulls: how often each is told."""
    bench = Bench(TRIALS["sign 156 m"], scratch, np.random.default_rng(5))
    start = bench.model(bench.truth)
    spread = Spread.of(bench.on.data, start, 0)
    longer = replace(start, sensor=replace(start.sensor, pulse_fwhm_ns=1.02 * start.sensor.pulse_fwhm_ns))
    seen: list[list[Observations]] = []
    for model in (start, longer):
        lights = spread.lights(model, range(3 * SAMPLE_SEEDS))
        seen.append([spread.seen(lights.scans(k)) for k in range(3 * SAMPLE_SEEDS)])
    said = told = 0
    for _ in range(nulls):
        some = bench.rng.permutation(3 * SAMPLE_SEEDS)
        one, other = some[:SAMPLE_SEEDS], some[SAMPLE_SEEDS : 2 * SAMPLE_SEEDS]
        picked = [[seen[0][i] for i in one], [seen[0][i] for i in other], [seen[1][i] for i in one]]
        a, b, c = (spread.number(s, [], simulated=str(k), sample="") for k, s in enumerate(picked))
        said += judged(a, b).is_said
        told += judged(a, c).word == "worse"
    return f"null edits said {100.0 * said / nulls:.0f} %, a pulse 2 % longer `worse` {100.0 * told / nulls:.0f} %"


def main() -> None:
    """Print a row for each trial."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trials", nargs="*", help=f"of {', '.join(TRIALS)}, gap; by default all")
    parser.add_argument("--nulls", type=int, default=200)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--edits", type=int, default=100)
    parser.add_argument("--scratch", type=Path, help="keeps the ideal scans for the next time")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as own:
        scratch = asked.scratch or Path(own)
        for name in asked.trials or [*TRIALS, "gap"]:
            start = time.process_time()
            if name == "gap":
                row = tried_gap(scratch, max(asked.nulls // 4, 1))
            else:
                bench = Bench(TRIALS[name], scratch, np.random.default_rng(1), max(asked.frames, 1))
                row = tried(bench, asked.nulls, asked.frames, asked.edits)
            print(f"| {name} | {row} | {time.process_time() - start:.0f} s |", flush=True)


if __name__ == "__main__":
    main()
