"""The screen Goldens: proposals that a check has left are reviewed, refused, accepted with a reason, or dropped."""

import subprocess
import threading

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.harness import check as check_module
from lidarcheck.harness.goldens.file import load_golden, load_proposal
from lidarcheck.harness.kpis.spec import SeedMeasurement
from lidarcheck.harness.review import review as review_module
from lidarcheck.harness.review.accept import ALL, accept
from lidarcheck.harness.review.review import review
from lidarcheck.session.own_files import content_hash
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.themes import THEMES
from scenario_texts import surface
from tui_kit import ROOT, app_on, as_stored, drive, says, sees, text_of, until

KPIS = """description = "a surface"
model = "../models/SMART.toml"

"""
KPIS += surface((240, 241), (0, 9), (50, 51))
KPIS += """[[kpis]]
name = "area_mean"
kpi = "area_mean"
tolerance = 1.0

[[kpis]]
name = "peak_mean"
kpi = "peak_mean"
tolerance = 1.0
high = {high}
"""


class Bench:
    """A project whose scenarios cost nothing to run; `shift` moves AREA, `lift` PEAK."""

    def __init__(self, root):
        self.root, self.shift, self.lift, self.seeds = root, 0.0, 0.0, 0
        (root / "scenarios").mkdir(parents=True)
        (root / "models").mkdir()
        (root / "models/SMART.toml").write_bytes((ROOT / "scenarios/models/SMART.toml").read_bytes())
        for name in ("one", "two"):
            self.write(name)

    def write(self, name, high=120.0):
        (self.root / f"scenarios/{name}.toml").write_text(KPIS.format(high=high))

    def measure(self, scenario, model, seed, **_):
        self.seeds += 1
        values = np.random.default_rng([seed, len(scenario.name)]).normal(100.0, 0.3, 2)
        found = {"area_mean": float(values[0]) + self.shift, "peak_mean": float(values[1]) + self.lift}
        return SeedMeasurement(found, {}, {}, content_hash(repr(found).encode())[:16])

    def golden(self, name):
        return self.root / f"goldens/{name}.toml"

    def proposal(self, name):
        return self.root / f".lidarcheck/proposals/{name}.toml"

    def review(self, paths, progress=None):
        return review(paths, progress=progress, measure=self.measure)

    def check(self, shift=0.0, lift=0.0):
        """What a run on Overview leaves."""
        self.shift, self.lift = shift, lift
        check_module.check([self.root], measure=self.measure)


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.setattr(review_module, "uncommitted", lambda scenario: ("", ""))
    made = Bench(tmp_path / "bench")
    accept(made.review([made.root]), [ALL])
    return made


async def on_goldens(app, pilot, bench):
    """The screen, once it has looked for proposals; its reviews are the bench's."""
    view = next(view for view in app.views() if view.NAME == "goldens")
    view.review = bench.review
    looks = view.looks
    await pilot.press("f9")
    await until(pilot, lambda: app.view is view and view.looks > looks)
    return view


async def asked(app, pilot, kind):
    await until(pilot, lambda: isinstance(app.asking, kind), lambda: text_of(app))


def names(view):
    return [one.name for one in view.waiting]


def test_without_a_proposal_it_says_how_to_make_one(bench):
    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        await sees(app, pilot, "nothing waits for review")
        await sees(app, pilot, "A run on Overview")
        await pilot.press("r")
        await says(app, pilot, "nothing waits for review; R reviews every scenario")
        await pilot.press("a")
        await pilot.press("A", "D", "space", "x")
        await says(app, pilot, "nothing runs")
        await pilot.press("R")
        await says(app, pilot, "nothing to accept: all is as the goldens say")
        await until(pilot, lambda: not view.running)
        assert names(view) == []

    drive(app_on(bench.root), do)


def test_a_proposal_is_reviewed_and_accepted(bench):
    bench.check(shift=0.6)
    before = bench.golden("one").read_bytes()

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        assert names(view) == ["one", "two"]
        await sees(app, pilot, "of 64 seeds")
        await sees(app, pilot, "area_mean")
        assert view.waiting[0].found is None
        await pilot.press("r")
        await until(pilot, lambda: view.waiting[0].found is not None and not view.running)
        await says(app, pilot, "reviewed: what speaks against accepting stands below")
        assert load_proposal(bench.proposal("one")).complete
        await sees(app, pilot, "changed")
        await sees(app, pilot, "nothing speaks against it: a accepts")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await sees(app, pilot, "Write goldens/one.toml?")
        await sees(app, pilot, "one, area_mean: 99.973 -> 100.57, changed")
        await pilot.press("pagedown")
        await sees(app, pilot, "+mean = 100.")
        await pilot.press("escape")
        await says(app, pilot, "not accepted: nothing was written")
        assert bench.golden("one").read_bytes() == before
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await pilot.press("enter")
        await says(app, pilot, "accepted: goldens/one.toml")
        await until(pilot, lambda: names(view) == ["two"])
        assert not bench.proposal("one").exists()
        assert load_golden(bench.golden("one")).kpis["area_mean"].reference.mean == pytest.approx(100.6, abs=0.2)

    drive(app_on(bench.root), do)


def test_what_is_written_is_what_was_shown(bench):
    bench.check(shift=0.6)
    shown = {}

    async def do(app, pilot):
        await on_goldens(app, pilot, bench)
        await pilot.press("a")
        await asked(app, pilot, Ask)
        shown["text"] = app.asking.text
        await pilot.press("enter")
        await says(app, pilot, "accepted: goldens")

    old = bench.golden("one").read_text()
    drive(app_on(bench.root), do)
    new = bench.golden("one").read_text()
    for sign, text, other in (("+", new, old), ("-", old, new)):
        moved = [row for row in text.splitlines() if row not in other.splitlines()]
        assert moved
        assert all(f"{sign}{row}" in shown["text"] for row in moved)


def test_a_regression_is_asked_about_and_the_golden_carries_the_reason(bench):
    bench.check(shift=5.0)
    before = bench.golden("one").read_bytes()

    async def do(app, pilot):
        await on_goldens(app, pilot, bench)
        await sees(app, pilot, "REGRESSED")
        await pilot.press("a")
        await asked(app, pilot, AskText)
        await sees(app, pilot, "one, area_mean: regressed")
        await pilot.press("enter")
        await says(app, pilot, "not accepted: it needs a reason")
        assert bench.golden("one").read_bytes() == before
        await pilot.press("a")
        await asked(app, pilot, AskText)
        await pilot.press(*"laser", "enter")
        await asked(app, pilot, Ask)
        await sees(app, pilot, "Write goldens/one.toml?")
        await pilot.press("enter")
        await says(app, pilot, "accepted: goldens")

    drive(app_on(bench.root), do)
    kpis = load_golden(bench.golden("one")).kpis
    assert (kpis["area_mean"].reason, kpis["peak_mean"].reason) == ("laser", "")


def test_a_tree_that_is_not_clean_needs_a_reason(bench, monkeypatch):
    bench.check(shift=0.6)
    monkeypatch.setattr(review_module, "uncommitted", lambda scenario: ("kernel.py", ""))

    async def do(app, pilot):
        await on_goldens(app, pilot, bench)
        await pilot.press("r")
        await sees(app, pilot, "needs a reason: uncommitted changes in kernel.py")
        await pilot.press("a")
        await asked(app, pilot, AskText)
        await sees(app, pilot, "one: uncommitted changes in kernel.py")
        await pilot.press("escape")
        await says(app, pilot, "it needs a reason")

    drive(app_on(bench.root), do)


def test_kpi_by_kpi(bench):
    bench.check(shift=5.0, lift=0.6)

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        assert view.kpis() == ["area_mean", "peak_mean"], "what fell out stands first"
        await pilot.press("tab", "down", "space")
        assert view.marked == {"peak_mean"}
        await sees(app, pilot, "*peak_mean")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await pilot.press("enter")
        await says(app, pilot, "accepted: goldens")
        await until(pilot, lambda: view.kpis() == ["area_mean"])
        assert view.marked == set()

    drive(app_on(bench.root), do)
    golden = load_golden(bench.golden("one"))
    assert golden.provenance.kept == ("area_mean",)
    assert golden.kpis["area_mean"].reference.mean == pytest.approx(100.0, abs=0.2)
    assert golden.kpis["peak_mean"].reference.mean == pytest.approx(100.6, abs=0.2)


def test_beyond_a_limit_nothing_is_accepted(bench):
    bench.check(lift=30.0)

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        await pilot.press("r")
        await until(pilot, lambda: view.waiting[0].found is not None and not view.running)
        await sees(app, pilot, "CANNOT be accepted")
        await sees(app, pilot, "above its limit 120")
        await pilot.press("a")
        await says(app, pilot, "not accepted: one, peak_mean: 130")
        await says(app, pilot, "change the scenario or the model")
        assert not isinstance(app.asking, Ask | AskText)

    drive(app_on(bench.root), do)


def test_all_at_once(bench):
    bench.check(shift=5.0)

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        await pilot.press("A")
        await asked(app, pilot, AskText)
        await sees(app, pilot, "two, area_mean: regressed")
        await pilot.press(*"why", "enter")
        await asked(app, pilot, Ask)
        await sees(app, pilot, "Write goldens/one.toml, goldens/two.toml?")
        await pilot.press("enter")
        await says(app, pilot, "accepted: goldens/one.toml, goldens/two.toml")
        await until(pilot, lambda: not view.waiting)

    drive(app_on(bench.root), do)


def test_a_golden_that_changed_while_one_was_asked_is_not_overwritten(bench):
    bench.check(shift=0.6)

    async def do(app, pilot):
        await on_goldens(app, pilot, bench)
        await pilot.press("a")
        await asked(app, pilot, Ask)
        accept(bench.review([bench.root / "scenarios/one.toml"]), [ALL])
        other = bench.golden("one").read_bytes()
        await pilot.press("enter")
        await says(app, pilot, "the golden of one has changed since it was reviewed")
        assert bench.golden("one").read_bytes() == other

    drive(app_on(bench.root), do)


def test_a_proposal_is_dropped(bench):
    bench.check(shift=5.0)
    before = bench.golden("one").read_bytes()

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        await pilot.press("D")
        await sees(app, pilot, "Drop the proposal for one?")
        await pilot.press("escape")
        assert bench.proposal("one").exists()
        await pilot.press("D")
        await asked(app, pilot, Ask)
        await pilot.press("enter")
        await says(app, pilot, "one: proposal dropped")
        await until(pilot, lambda: names(view) == ["two"])

    drive(app_on(bench.root), do)
    assert not bench.proposal("one").exists()
    assert bench.golden("one").read_bytes() == before


def test_a_review_is_stopped(bench):
    bench.check(shift=0.6)
    going, goes_on = threading.Event(), threading.Event()

    def slow(paths, progress=None):
        def told(*what):
            going.set()
            assert goes_on.wait(60.0)
            progress(*what)

        return bench.review(paths, progress=told)

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        view.review = slow
        await pilot.press("R")
        await until(pilot, going.is_set)
        await pilot.press("r")
        await says(app, pilot, "a review is going on")
        await pilot.press("x")
        await says(app, pilot, "stopping after the seeds that run now")
        goes_on.set()
        await until(pilot, lambda: not view.running)
        await says(app, pilot, "the review was stopped")
        assert view.waiting[0].found is None

    drive(app_on(bench.root), do)


def test_faults_are_said_in_one_line(bench):
    bench.check(shift=0.6)
    bench.golden("one").write_text("format = 7\n")
    bench.proposal("two").write_text("not toml [")
    (bench.root / "scenarios/three.toml").write_text("kpis = []\n")

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        assert names(view) == ["one", "three", "two"]
        await sees(app, pilot, "goldens/one.toml: golden format 7 is not 1")
        await pilot.press("end")
        await sees(app, pilot, "not valid TOML")
        await pilot.press("up", "r")
        await until(pilot, lambda: not view.running and view.waiting[1].fault)
        assert "scenarios/three.toml" in status_of(app)
        await pilot.press("home", "r")
        await until(pilot, lambda: view.waiting[0].found is not None)
        await sees(app, pilot, "needs a reason: the golden could not be read")
        await pilot.press("A")
        await says(app, pilot, "scenarios/three.toml")

    drive(app_on(bench.root), do)


def status_of(app):
    return app.bars.status[0]


def test_a_fault_within_a_review_does_not_end_the_app(bench):
    bench.check(shift=0.6)

    def broken(paths, progress=None):
        raise ZeroDivisionError("oh")

    def at_fault(paths, progress=None):
        raise InputError("no such table", file=bench.root / "lut.ini", fix="make it")

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        view.review = broken
        await pilot.press("r")
        await says(app, pilot, "internal error in the review, ZeroDivisionError: oh")
        view.review = at_fault
        await until(pilot, lambda: not view.running)
        await pilot.press("r")
        await says(app, pilot, "lut.ini: no such table; make it")
        await sees(app, pilot, "FAULT, see below")

    drive(app_on(bench.root), do)


def test_a_scenario_without_a_golden_gets_one(bench):
    bench.write("new")

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        assert names(view) == ["new"]
        await sees(app, pilot, "not run, no golden")
        await pilot.press("D")
        await says(app, pilot, "there is no proposal under the cursor")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await pilot.press("enter")
        await says(app, pilot, "accepted: goldens/new.toml")
        await until(pilot, lambda: not view.waiting)

    drive(app_on(bench.root), do)
    assert load_golden(bench.golden("new")).complete


def test_in_a_repository_what_is_not_committed_shows(bench, monkeypatch):
    from lidarcheck.harness.goldens.git_state import uncommitted

    for command in (["init", "-q"], ["add", "."], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "x"]):
        subprocess.run(["git", "-C", str(bench.root), *command], check=True)
    monkeypatch.setattr(review_module, "uncommitted", uncommitted)
    bench.check(shift=0.6)
    with (bench.root / "models/SMART.toml").open("a") as stream:
        stream.write("# edited\n")

    async def do(app, pilot):
        await on_goldens(app, pilot, bench)
        await pilot.press("a")
        await asked(app, pilot, AskText)
        await sees(app, pilot, "uncommitted changes in")
        await sees(app, pilot, "SMART.toml")

    drive(app_on(bench.root), do)


def test_any_size_down_to_one_by_one(bench):
    bench.check(shift=5.0)

    async def do(app, pilot):
        await on_goldens(app, pilot, bench)
        for size in ((1, 1), (5, 3), (40, 10), (200, 60), (3, 40), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.press("down", "tab", "up", "f1", "escape")
        await sees(app, pilot, "? Help")
        await sees(app, pilot, "REGRESSED")

    drive(app_on(bench.root), do)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_snapshots(bench, size):
    bench.check(shift=5.0, lift=0.6)

    async def do(app, pilot):
        view = await on_goldens(app, pilot, bench)
        await pilot.press("r")
        await until(pilot, lambda: view.waiting[0].found is not None and not view.running)
        await pilot.press("tab", "down", "space")
        await as_stored(app, pilot, f"goldens_{size[0]}x{size[1]}")

    drive(app_on(bench.root, theme=THEMES[0]), do, size)
