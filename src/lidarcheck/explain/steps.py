"""The steps of the gap workflow, each a method that says what it did; `workflow` says in which order they are taken."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from lidarcheck.cases.origin import CAST, Origin
from lidarcheck.cases.split import Split, Unseen, exchanged, split_frames
from lidarcheck.effects.finding import catalogue, find
from lidarcheck.effects.search import search_spec
from lidarcheck.explain.decision.against_no_gap import against_no_gap
from lidarcheck.explain.decision.answer import (
    Answer,
    answer_with_names,
    answer_with_terms,
    closes,
    objection,
)
from lidarcheck.explain.decision.beam_closure import closure_by_beam
from lidarcheck.explain.decision.closure import Closure, closure, not_testable, shows_in_select_alone
from lidarcheck.explain.decision.equivalence import Polished, Rival, contest, rivals
from lidarcheck.explain.decision.findings import is_doubtful
from lidarcheck.explain.decision.idle import idle_names, without_idle
from lidarcheck.explain.decision.last_word import Verified, verified
from lidarcheck.explain.decision.late_forms import late_words
from lidarcheck.explain.decision.needless import without_any, without_needless
from lidarcheck.explain.empirical.description import Description, describe
from lidarcheck.explain.progress import ignore_progress, ignore_step, report_fit
from lidarcheck.explain.report.explanation import ProgressCallback, SearchStep, Standout, StepCallback
from lidarcheck.explain.report.wording import classifier_words, closed_words, standouts
from lidarcheck.explain.search.alternatives import other_ways, try_alternatives, with_fewer_related
from lidarcheck.explain.search.screening import Screened, chance_level, screen, weaker_starts
from lidarcheck.explain.search.search import backward, find_effects
from lidarcheck.explain.search.second_look import second_look
from lidarcheck.explain.search.selection import Search, SearchData
from lidarcheck.explain.search.starts import fixed_probes, located_probes
from lidarcheck.explain.search.trial import select_distance
from lidarcheck.inference.classifier import Chance, Classifier, classifier_gaps
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model.spec import Model
from lidarcheck.workers import WorkerPool

if TYPE_CHECKING:
    from lidarcheck.cases.case import Case
    from lidarcheck.workers.checkpoint import Checkpoint

__all__ = ["Workflow"]

_HEARD_PLACES = 5  # so many of what stands out are reported while the work goes on; the report has all


@dataclass(frozen=True)
class Workflow:
    """One run: the model, the seed, what is not to be named, who is told, what was found; its methods are the steps."""

    model: Model
    seed: int
    exclude: tuple[str, ...]
    pool: WorkerPool
    on_progress: ProgressCallback
    on_step: StepCallback = ignore_step
    checkpoint: Checkpoint | None = None
    calibrates: bool = True
    origin: Origin = CAST
    steps: list[SearchStep] = field(default_factory=list)
    described: list[Description] = field(default_factory=list)
    chances: list[Chance] = field(default_factory=list)

    def did(self, name: str, words: str) -> None:
        """A step of the report has been done."""
        self.steps.append(SearchStep(name, words))
        self.on_step(self.steps[-1])

    def searched(self) -> list[str]:
        """The effects that are searched for: those known to the search that mean something for the sensor, and that the
        ideal scans have not taken up, or not wholly."""
        return [name for name in self._known() if not self._why_not(name) or name in self._taken_up()]

    def _taken_up(self) -> list[str]:
        """The effects of which such ideal scans leave a part to be seen: fitted, and not named."""
        able = (name for name in self._known() if not find(name).why_not(self.model.sensor))
        return [name for name in able if self.origin.leaves_a_part(search_spec(name))]

    def _why_not(self, name: str) -> str:
        """Why an effect cannot show in any frames of the sensor beside such ideal scans; empty where it can."""
        return find(name).why_not(self.model.sensor) or self.origin.why_unseen(search_spec(name))

    def _known(self) -> list[str]:
        """The effects that the search knows where to begin with, and that may be named."""
        return [name for name in catalogue() if search_spec(name).is_searched and name not in self.exclude]

    def split(self, case: Case) -> Split:
        """Which frames serve for what."""
        found = split_frames(case.frames)
        self.did("split", found.words())
        return found

    def measure_residuals_and_floor(self, split: Split) -> SearchData:
        """Residuals of every beam, their summaries, and how far these vary where nothing is missing."""
        later = self.pool.submit(Simulator, split.select, self.model, 2 * self.seed + 2)
        simulator = Simulator(split.fit, self.model, 2 * self.seed + 1)
        self.on_progress("residuals and floor", 1, 2)
        select = later()
        self.on_progress("residuals and floor", 2, 2)
        start = simulator.distance(np.zeros((1, len(simulator.measured))))
        self.did("residuals", f"{len(simulator.beams)} beams in {len(simulator.summaries)} summaries")
        floor = simulator.floor_distance
        self.did("noise floor", f"distance {start:.0f} before any fit, {floor:.0f} where nothing is missing")
        return SearchData(simulator, select, 0.0, start, self.pool)

    def exchange_frames(self, split: Split, bench: SearchData) -> tuple[Split, SearchData]:
        """The select frames fit in the place of others where they alone show what is to be found."""
        if split.declared or not shows_in_select_alone(bench):
            return split, bench
        other = exchanged(split)
        self.did("exchange", f"the select frames alone show a gap; now {other.words()}")
        return other, self.measure_residuals_and_floor(other)

    def find_where(self, bench: SearchData) -> tuple[Standout, ...]:
        """The summaries beyond what the largest of all reaches by chance in 19 of 20 draws."""
        simulator = bench.simulator
        level = float(np.quantile(np.abs(simulator.check).max(axis=1), 0.95))
        found = standouts(simulator.summaries.names, simulator.measured_plain, level, simulator.beams.view)
        self.did("where", f"{len(found)} summaries stand out")
        for one in found[:_HEARD_PLACES]:
            self.on_step(SearchStep("stands out", one.words))
        return found

    def screen_candidates(self, bench: SearchData) -> tuple[list[Screened], SearchData]:
        """What every effect would change, and how large a gain chance makes of all of them."""
        names = self.searched()
        taken_up = self._taken_up()
        probes = fixed_probes(names, self.model.sensor, taken_up=taken_up)
        probes += located_probes(bench.simulator, [name for name in names if name not in taken_up])
        on_progress = functools.partial(self.on_progress, "candidates")
        screened = screen(bench.simulator, probes, on_progress, self.pool, self.checkpoint)
        weaker = weaker_starts(bench.simulator, screened)
        screened += screen(bench.simulator, weaker, None, self.pool, self.checkpoint, "weaker")
        return screened, dataclasses.replace(bench, level=chance_level(bench.simulator, screened))

    def fit_and_select(self, bench: SearchData, screened: Sequence[Screened]) -> Search:
        """Nuisances first, then one effect after another; at last those are left out again that are not needed."""
        on_progress = functools.partial(report_fit, self.on_progress)
        found = try_alternatives(bench, find_effects(bench, screened, on_progress), screened, on_progress)
        self.on_progress("fit", 1, 1)
        now, level = found.fit, bench.level
        self.did("candidates", f"{len(found.trials)} fitted; chance gains up to {level:.1f} times its mean")
        self.did("fit", f"{', '.join(now.names()) or 'nothing'} accepted; distance {now.distance:.0f}")
        self.did("nuisances", f"within their usual errors: {'; '.join(now.nuisance.words()) or 'none'}")
        self.did("select", f"distance {select_distance(bench.select, now):.0f} on the select frames")
        return found

    def look_again(self, bench: SearchData, seen: Scale, search: Search, screened: Sequence[Screened]) -> Search:
        """For effects that hide beside those that were accepted."""
        on_progress = functools.partial(self.on_progress, "second look")
        found = second_look(bench, seen, search, screened, 2 * self.seed + 4, on_progress)
        self.on_progress("second look", 1, 1)
        if found.fit is not search.fit:
            self.did("second look", f"{', '.join(found.fit.names())}; distance {found.fit.distance:.0f}")
        return found

    def leave_out_needless(self, bench: SearchData, seen: Scale, search: Search) -> Search:
        """Without names that gain much by the summaries and close next to nothing beam by beam."""
        found = without_needless(bench, seen, search, 2 * self.seed + 4)
        for name in (name for name in search.fit.names() if name not in found.fit.names()):
            self.did("needless", f"{name}: beam by beam, the others close the gap as well")
        alone = without_any(bench, seen, found, 2 * self.seed + 4)
        if len(alone.fit.probes) < len(found.fit.probes):
            self.did("needless", f"{', '.join(found.fit.names())}: beam by beam, usual errors alone come as near")
        return alone

    def judge(self, bench: SearchData, seen: Scale, search: Search) -> tuple[Search, Answer]:
        """Whether what was found closes the gap, what could stand in its place, and what is said of it."""
        search, closed = self.close(bench, seen, search)
        accepted = search.fit
        others = self.find_rivals(bench, search, closed)
        last = self.polish(seen, search, closed, others)
        if last is not None and (fewer := self.leave_out_idle(bench, search, last)) is not None:
            return self.judge(bench, seen, fewer)
        simpler = self.leave_out_again(bench, seen, search) if search.fit is not accepted else None
        return simpler or (search, self.decide(bench, seen, search, closed, last))

    def leave_out_idle(self, bench: SearchData, search: Search, last: Polished) -> Search | None:
        """The search without effects of no strength, and such as do not pay on the select frames; None where there is
        none."""
        idle = idle_names(bench, search.fit, last)
        for at, why in idle.items():
            self.did("idle", f"{search.fit.names()[at]}: {why}")
        if not idle:
            return None
        names = (*search.idle, *(search.fit.names()[at] for at in idle))
        return Search(search.first, without_idle(bench, search.fit, idle), search.trials, idle=names)

    def leave_out_again(self, bench: SearchData, seen: Scale, search: Search) -> tuple[Search, Answer] | None:
        """The same without names that a rival in its new place has made needless; None where it needs them all."""
        fewer = backward(bench, search.fit, ignore_progress)
        if len(fewer.probes) == len(search.fit.probes):
            return None
        found, answer = self.judge(bench, seen, Search(search.first, fewer, search.trials))
        if answer.verdict != "explained":
            self.did("kept", f"{', '.join(search.fit.names())}: with fewer, too much is open")
            return None
        self.did("left out again", f"{', '.join(found.fit.names())}: beside the rival no more is needed")
        return found, answer

    def close(self, bench: SearchData, seen: Scale, search: Search) -> tuple[Search, Closure]:
        """Whether little is left open, by the summaries of the select frames or beam by beam."""
        closed = closure(bench, search.fit, search.trials)
        if closed.holds:
            return search, closed
        found, closed = closure_by_beam(bench, seen, search, closed, 2 * self.seed + 4)
        if closed.holds:
            part = f"{100.0 * closed.share:.0f} % of the gap"
            self.did("appeal", f"{', '.join(found.fit.names())}: beam by beam, {part} closes on the frames seen")
        return found, closed

    def find_rivals(self, bench: SearchData, search: Search, closed: Closure) -> list[Rival]:
        """The effects that explain the data nearly as well in the place of an accepted one."""
        if not closed.holds or not search.fit.probes:
            return []
        return rivals(
            bench, search.fit, search.trials, lambda _s, i, n: self.on_progress("equivalence and testability", i, n + 1)
        )

    def polish(self, seen: Scale, search: Search, closed: Closure, others: Sequence[Rival]) -> Polished | None:
        """The accepted effects once more on all frames but those of the verification, or rivals that come nearer there;
        None where no effect is accepted."""
        if not closed.holds or not search.fit.probes:
            return None
        found = contest(seen, self.model, search.fit, others, 2 * self.seed + 4, known=search.own, pool=self.pool)
        if found.fit is not search.fit:
            now, before = (", ".join(one.names()) for one in (found.fit, search.fit))
            self.did("rivals", f"{now} in the place of {before}" if now != before else f"{now} of another kind")
            search.fit = found.fit
        return found

    def take_another_way(
        self, bench: SearchData, seen: Scale, screened: Sequence[Screened], search: Search, answer: Answer
    ) -> tuple[Search, Answer]:
        """Other names in the place of such as do not close the gap beam by beam, if there are any that do."""
        if closes(answer):
            return search, answer
        on_progress = functools.partial(report_fit, self.on_progress)
        for way in itertools.chain(with_fewer_related(bench, search), other_ways(bench, search, screened, on_progress)):
            named, instead = (", ".join(one.fit.names()) for one in (search, way))
            self.did("another way", f"{instead}, since with {named}, {objection(answer)}")
            found, other = self.judge(bench, seen, way)
            if other.verdict == "explained" and closes(other):
                return found, other
            self.did("kept", f"{named}: the other way does no better")
        return search, answer

    def list_untestable(self, bench: SearchData, screened: Sequence[Screened]) -> Mapping[str, str]:
        """Which effects the sensor could not have, or these scenes could not show."""
        found = {name: why for name in self._known() if (why := self._why_not(name))}
        asked = [name for name in self.searched() if name not in found]
        found |= not_testable(bench.simulator, screened, asked, bench.level)
        self.on_progress("equivalence and testability", 1, 1)
        return found

    def decide(self, bench: SearchData, seen: Scale, search: Search, closed: Closure, last: Polished | None) -> Answer:
        """No gap, explained by name, or unknown."""
        if not closed.holds:
            answer = self._unknown(bench, seen, search, 1.0 - closed.share)
        elif last is None:
            answer = Answer("no_gap", (), (("", self.model),), "")
        else:
            answer = answer_with_names(bench, seen, search, closed, last)
            for step, words in late_words(answer.findings):
                self.did(step, words)
            if is_doubtful(answer.findings[0]):
                first = answer.findings[0]
                self.did("withdrawn", f"{first.name}: its lead is too small, {100.0 * first.confidence:.0f} % sure")
                answer = self._unknown(bench, seen, search, 1.0 - first.confidence)
        self.did("unknown", answer.words or "nothing is left that needs a description")
        for one in answer.findings:
            self.on_step(SearchStep("found", f"{one.name}, confidence {100.0 * one.confidence:.0f} %"))
        return answer

    def _unknown(self, bench: SearchData, seen: Scale, search: Search, left: float) -> Answer:
        if not self.described:  # whichever names were withheld, terms begin with the case's own model
            self.described.append(describe(bench, seen, 2 * self.seed + 5, self.on_progress))
        self.on_progress("unknown", 1, 1)
        return answer_with_terms(bench, search, left, self.described[0])

    def withhold(self, bench: SearchData, seen: Scale, search: Search, answer: Answer) -> Answer:
        """Names that do not close the gap on the frames seen are not given: what is missing is unknown."""
        if closes(answer):
            return answer
        names = ", ".join(finding.name for finding in answer.findings)
        self.did("withdrawn", f"{names}: with these, {objection(answer)}")
        found = self._unknown(bench, seen, search, 1.0 - (answer.closed or 0.0))
        self.did("unknown", found.words)
        return found

    def withhold_taken_up(self, bench: SearchData, seen: Scale, search: Search, answer: Answer) -> Answer:
        """A name of which the ideal scans leave only a part to be seen is not given: what they took up nobody knows."""
        names = [finding.name for finding in answer.findings if finding.name in self._taken_up()]
        if not names:
            return answer
        words = f"what is left looks like {' and '.join(names)}, which such ideal scans cannot show"
        self.did("withdrawn", words)
        found = self._unknown(bench, seen, search, answer.closed or 0.0)
        first = dataclasses.replace(found.findings[0], where=f"{words}; {found.findings[0].where}")
        return dataclasses.replace(found, findings=(first,))

    def doubt_no_gap(self, bench: SearchData, seen: Scale, search: Search, answer: Answer) -> Answer:
        """`unknown` in the place of `no_gap` where loss or other echoes are beyond chance on the select frames, or a
        classifier still tells there."""
        if answer.verdict != "no_gap":
            return answer
        asked = Classifier.of(bench.select.frames, self.model, bench.select.seed)
        self.chances.extend(filter(None, [asked.chance(self.model, self.pool)]))
        words = against_no_gap(bench.select, asked, search.fit.nuisance, next(iter(self.chances), None))
        if not words:
            return answer
        self.did("doubt", f"no gap is not said: {words}")
        found = self._unknown(bench, seen, search, 1.0)
        first = dataclasses.replace(found.findings[0], where=f"{words}; {found.findings[0].where}")
        return dataclasses.replace(found, findings=(first,))

    def verify(self, unseen: Unseen, answer: Answer) -> Verified:
        """The gap before, after each effect, and its floor, on frames that nothing above has seen: the one look at
        them, which may change the word of the verdict, and nothing else."""
        scale = Scale.of(unseen.look(), self.model, 2 * self.seed + 3)

        def on_progress(names: Sequence[str], i: int, n: int, gap: float) -> None:
            self.on_progress("verification", i, n)
            self.on_step(SearchStep("gap", f"{gap:.3f} {f'with {names[i - 1]}' if i > 1 else 'before'}"))

        found = verified(scale, answer, self.calibrates, on_progress, self.pool)
        self.did("verification", f"gap {found.gap.before.value:.3f} before, {found.gap.after.value:.3f} after")
        asked = Classifier.of(scale.frames, self.model, scale.seed)
        figure = classifier_gaps(asked, self.model, found.model, next(iter(self.chances), None), self.pool)
        self.did("classifier", classifier_words(figure))
        found = dataclasses.replace(found, gap=dataclasses.replace(found.gap, classifier=figure))
        if found.verdict != answer.verdict:
            self.did("last word", f"{found.verdict}: {closed_words(answer.closed, found.gap)}")
        return found
