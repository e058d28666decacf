"""An effect must be what its name says: dirt is local, rain has drops; and small errors put right must help."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.effects.search import search_spec
from lidarcheck.explain import steps as workflow_steps
from lidarcheck.explain.decision.answer import Answer
from lidarcheck.explain.decision.model_check import Open
from lidarcheck.explain.progress import ignore_progress
from lidarcheck.explain.report.explanation import Finding
from lidarcheck.explain.search.evidence import SimulatorEvidence
from lidarcheck.explain.search.selection import Search
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.explain.search.trial import tried
from lidarcheck.explain.steps import Workflow
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import PARTS
from lidarcheck.workers import WorkerPool

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}
HAZE = make("fog", {"mor_m": 120.0, "backscatter": 0.0})
DRIZZLE = make("rain", {"rate_mm_h": 40.0})


@pytest.fixture(scope="module")
def plain() -> Simulator:
    return Simulator(frames(model(), 2, **FINE), model(), 3)


@pytest.mark.parametrize(
    ("first", "last", "whole"), [(0, 959, True), (320, 640, True), (320, 500, False), (450, 470, False)]
)
def test_a_band_over_all_points_is_no_dirt(plain: Simulator, first: int, last: int, whole: bool) -> None:
    place = {"first_layer": 240, "last_layer": 250, "first_point": first, "last_point": last}
    is_another = search_spec("blockage").is_another
    assert is_another is not None
    assert is_another(SimulatorEvidence(plain), make("blockage", place)) is whole
    assert search_spec("signal_gain").is_another is None


@pytest.mark.long
@pytest.mark.parametrize(("missing", "is_rain"), [(HAZE, False), (DRIZZLE, True)], ids=["haze", "rain"])
def test_there_is_no_rain_without_drops(missing: Effect, is_rain: bool) -> None:
    simulator = Simulator(frames(model(missing), 2, **FINE), model(), 3)
    nothing = np.zeros((1, len(simulator.measured)))
    now = Fit((), (), simulator.distance(nothing), nothing)
    found = [tried(simulator, simulator, now, nothing, 10.0, probe)[0] for probe in fixed_probes(["rain"])]
    assert any(fit.possible for fit in found) is is_rain
    fog = min(
        (tried(simulator, simulator, now, nothing, 10.0, probe)[0] for probe in fixed_probes(["fog"])), key=_distance
    )
    assert fog.possible


def _distance(fit: Fit) -> float:
    return fit.distance


def fit_of(*names: str) -> Fit:
    """A fit of such effects where they begin."""
    probes = tuple(next(one for one in fixed_probes([name]) if not one.variant) for name in names)
    return Fit(probes, tuple(one.start() for one in probes), 1.0, np.zeros((1, 3)))


@pytest.mark.parametrize(
    ("needed", "simpler", "left"),
    [
        (("signal_gain",), "explained", ["signal_gain"]),
        (("signal_gain",), "unknown", ["signal_gain", "fog"]),
        (("signal_gain", "fog"), "explained", ["signal_gain", "fog"]),
    ],
    ids=["one is needless", "without it all is unknown", "both are needed"],
)
def test_a_rival_may_make_another_name_needless(
    needed: tuple[str, ...], simpler: str, left: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Crosstalk and a pattern of layers were found where the gain is too high; with the gain no pattern is needed."""
    swapped = fit_of("signal_gain", "fog")

    def polished(self: Workflow, seen: object, search: Search, closed: object, others: object) -> None:
        if "crosstalk" in search.fit.names():
            search.fit = swapped

    def said(self: Workflow, bench: object, seen: object, search: Search, closed: object, last: object) -> Answer:
        names = search.fit.names()
        return Answer("explained" if len(names) == 2 else simpler, tuple(_named(one) for one in names), (), "")

    monkeypatch.setattr(Workflow, "close", lambda self, bench, seen, search: (search, None))
    monkeypatch.setattr(Workflow, "find_rivals", lambda self, bench, search, closed: [])
    monkeypatch.setattr(Workflow, "polish", polished)
    monkeypatch.setattr(Workflow, "decide", said)
    monkeypatch.setattr(workflow_steps, "backward", lambda bench, fit, on_progress: fit_of(*needed))
    run, first = Workflow(model(), 0, (), WorkerPool(), ignore_progress), fit_of("crosstalk", "fog")
    search, answer = run.judge(None, None, Search(first, first))  # type: ignore[arg-type]
    assert [one.name for one in answer.findings] == left == list(search.fit.names())
    said_of_it = ["left out again" if len(left) == 1 else "kept"] if len(needed) == 1 else []
    assert [step.name for step in run.steps] == said_of_it


def test_nothing_is_left_out_where_no_rival_came(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Workflow, "close", lambda self, bench, seen, search: (search, None))
    monkeypatch.setattr(Workflow, "find_rivals", lambda self, bench, search, closed: [])
    monkeypatch.setattr(Workflow, "polish", lambda self, seen, search, closed, others: None)
    monkeypatch.setattr(Workflow, "decide", lambda self, bench, seen, search, *_: Answer("explained", (), (), ""))
    monkeypatch.setattr(workflow_steps, "backward", lambda *_: pytest.fail("not asked"))
    run, first = Workflow(model(), 0, (), WorkerPool(), ignore_progress), fit_of("crosstalk", "fog")
    assert run.judge(None, None, Search(first, first))[1].verdict == "explained"  # type: ignore[arg-type]


def opened(left: float) -> Open:
    """A gap of one standard deviation in all parts, of which so much is left."""
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (6, 6))
    return Open(np.ones(len(PARTS)), np.full(len(PARTS), left), noise, noise)


@pytest.mark.parametrize(
    ("left", "others", "names", "said"),
    [
        (0.1, {}, ["fog"], []),
        (0.9, {"rain": ("explained", 0.1)}, ["rain"], ["another way"]),
        (0.9, {"rain": ("explained", 0.9)}, ["fog"], ["another way", "kept"]),
        (0.9, {"rain": ("unknown", 0.1)}, ["fog"], ["another way", "kept"]),
        (0.9, {"rain": ("explained", 0.9), "dropout": ("explained", 0.1)}, ["dropout"], ["another way", "kept"] * 2),
    ],
    ids=["closed", "another closes", "another does not", "another is unknown", "the second other closes"],
)
def test_where_much_stays_open_other_names_are_asked(
    left: float,
    others: dict[str, tuple[str, float]],
    names: list[str],
    said: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Rain was called fog by blunt summaries, with which all the drops stayed open."""

    def judged(self: Workflow, bench: object, seen: object, search: Search) -> tuple[Search, Answer]:
        [name] = search.fit.names()
        verdict, its = others[name]
        return search, Answer(verdict, (_named(name),), (), "", opened(its))

    monkeypatch.setattr(Workflow, "judge", judged)
    monkeypatch.setattr(workflow_steps, "with_fewer_related", lambda *_: iter(()))
    ways = [Search(fit_of(name), fit_of(name)) for name in others]
    monkeypatch.setattr(workflow_steps, "other_ways", lambda *_: iter(ways))
    run, first = Workflow(model(), 0, (), WorkerPool(), ignore_progress), fit_of("fog")
    answer = Answer("explained", (_named("fog"),), (), "", opened(left))
    search, answer = run.take_another_way(None, None, [], Search(first, first), answer)  # type: ignore[arg-type]
    assert [one.name for one in answer.findings] == names == list(search.fit.names())
    assert [step.name for step in run.steps] == said[: 3 if names == ["dropout"] else None]


def test_an_unknown_is_asked_for_no_other_way() -> None:
    run, first = Workflow(model(), 0, (), WorkerPool(), ignore_progress), fit_of("fog")
    search, answer = Search(first, first), Answer("unknown", (_named("unknown"),), (), "")
    assert run.take_another_way(None, None, [], search, answer) == (search, answer)  # type: ignore[arg-type]


def _named(name: str) -> Finding:
    return Finding(name, {}, 0.9, (), "", "", ())
