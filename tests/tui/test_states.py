"""What is shown belongs to what is set, or says that it does not: on every screen, after whatever is done."""

import pytest

from lidarcheck.formats.lut import load_lut
from lidarcheck.permissions import Permissions, granted
from lidarcheck.session.session import CURRENT, OLD, SAVED, Session
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.jobs.profiles import Profiles
from lidarcheck.tui.screens.pages.screen import PageView
from states_kit import ROW, cheap, check, make_stateful
from tui_kit import drive, misses, on_blooming, scaled, sees, text_of, until

PAGES = {"histograms": "f3", "noise": "f4", "ghosts": "f6", "cloud": "f7"}
JOBS = {"noise": "hall_SLIM/frame", "ghosts": "signs_SLIM/1_25m.txt", "cloud": "car_20m_SLIM_real.txt"}
"""What is looked at where a screen lists more."""
ALL = {"overview": "f2", **PAGES, "blooming": "f5", "explain": "f8", "goldens": "f9"}


@pytest.fixture
def project(tmp_path):
    # The case is a project of its own, and names the table beside it.
    with granted(Permissions(roots=(tmp_path / "project",))):
        yield make_stateful(tmp_path / "project")


@pytest.fixture
def runs(monkeypatch):
    runs = {}
    cheap(monkeypatch, runs)
    return runs


def view_of(app, name):
    return next(view for view in app.views() if name == view.NAME)


async def go(app, pilot, name):
    await pilot.press(ALL[name])
    await until(pilot, lambda: name == app.view.NAME)
    if name == "cloud":
        app.view.show_maps(True)
    return app.view


def set_now(app):
    """The table's Y as it is shown; of a file without edits as the disk has it."""
    file = view_of(app, "blooming").file
    lut = file.current if file.dirty else load_lut(file.path)
    return lut.tables["vertical"].y[ROW]


def states(app):
    """What every screen says of what it shows, by the screen's name; only what was computed."""
    found = {}
    for name in PAGES:
        view = view_of(app, name)
        if view.job is not None and view.made is not None:
            found[name] = view.state
    overview, explain, goldens = (view_of(app, name) for name in ("overview", "explain", "goldens"))
    if overview.runs.last:
        found["overview"] = overview.states["one"]
    if explain.cases:
        found["explain"] = explain.state_of(explain.cases[0])
    if goldens.waiting and goldens.states:
        found["goldens"] = next(iter(goldens.states.values()))
    return found


def holds(app):
    """Nothing that is called current is of another table than the one that is set; words about states are true."""
    now = f"{set_now(app):.7f}"
    for name in PAGES:
        view = view_of(app, name)
        if view.job is not None and view.state == CURRENT:
            assert now in view.page.title, (name, view.page.title, now)
    overview = view_of(app, "overview")
    if overview.runs.last and overview.states["one"] == CURRENT and app.view is overview:
        assert f"{overview.runs.last['one'].kpis[0].now:.7f}" == now


async def settle(app, pilot, steps=6):
    """Look several times while things happen; drawn after its state has changed, a screen has the state's word."""
    for _ in range(steps):
        await pilot.pause(0.01)
        holds(app)
    if isinstance(app.view, PageView) and app.view.made is not None:
        await until(pilot, lambda: app.view.state.partition(",")[0] in text_of(app), lambda: text_of(app), seconds=5.0)


async def everything_computed(app, pilot):
    """Each screen has computed what it can from the table as it is."""
    await on_blooming(app, pilot)
    for name in PAGES:
        view = await go(app, pilot, name)
        view.at = next(i for i, job in enumerate(view.listed) if JOBS.get(name, job.name) == job.name)
        view.draw()
        assert not view.job.fault, view.job
        await pilot.press("r")
        await until(pilot, lambda view=view: view.state == CURRENT, lambda: text_of(app))
    view = await go(app, pilot, "overview")
    await pilot.press("tab", "R")
    await until(pilot, lambda: view.runs.last and not view.running and view.states.get("one") == CURRENT)
    for name in ("explain", "goldens"):
        await go(app, pilot, name)
        await until(pilot, lambda name=name: states(app).get(name) == CURRENT, lambda: text_of(app))
    assert set(states(app).values()) == {CURRENT}
    assert len(states(app)) == 7


async def edit(app, pilot, value="512"):
    view = await go(app, pilot, "blooming")
    await pilot.press("home", *["down"] * ROW, *value, "enter")
    await until(pilot, lambda: scaled(view, ROW) == int(value))


def test_after_an_edit_no_screen_shows_what_was_before_as_current(project, runs, monkeypatch):
    async def do(app, pilot):
        await everything_computed(app, pilot)
        before = dict(runs)
        monkeypatch.setattr(Session, "is_cheap", lambda _session, _derived: False)  # as if all were dear
        await edit(app, pilot)
        for name in ALL:
            await go(app, pilot, name)
            holds(app)
            await settle(app, pilot)
        found = states(app)
        assert {name: found[name] for name in PAGES} == dict.fromkeys(PAGES, f"{OLD}, of edit 0")
        assert found["overview"] == found["explain"] == found["goldens"] == SAVED
        assert runs == before
        # Undo brings the old key back, and what belongs to it, at once.
        await go(app, pilot, "blooming")
        await pilot.press("u")
        for name in ALL:
            await go(app, pilot, name)
            await settle(app, pilot, 2)
        await until(pilot, lambda: len(states(app)) == 7 and set(states(app).values()) == {CURRENT})
        assert runs == before

    drive(LidarcheckApp(project, check=check), do, (120, 36))


def test_histograms_follows_an_edit_by_itself_where_that_is_quick(project, runs):
    async def do(app, pilot):
        await everything_computed(app, pilot)
        await edit(app, pilot)
        view = view_of(app, "histograms")
        seen = {view.state.partition(" ")[0]}  # as it would be drawn if it were opened now
        await pilot.press("f3")
        for _ in range(2000):
            seen.add(view.state.partition(" ")[0])
            holds(app)
            if view.state == CURRENT:
                break
            await pilot.pause(0.005)
        assert view.state == CURRENT
        assert f"{set_now(app):.7f}" in view.page.title
        assert seen & {"OLD,", "computing"}
        assert runs["histograms"] == 2
        await sees(app, pilot, "current")

    drive(LidarcheckApp(project, check=check), do)


def test_verdicts_are_of_the_saved_model_until_it_is_saved_and_run_again(project, runs):
    async def do(app, pilot):
        await everything_computed(app, pilot)
        await edit(app, pilot)
        view = await go(app, pilot, "overview")
        await sees(app, pilot, SAVED)
        assert any(SAVED in line and "equivalent" not in line and " one " in line for line in text_of(app).splitlines())
        await sees(app, pilot, "without 1 edit")
        await go(app, pilot, "blooming")
        await pilot.press("S", "enter")
        await until(pilot, lambda: not view_of(app, "blooming").file.dirty)
        await go(app, pilot, "overview")
        await until(pilot, lambda: view.states["one"] == f"{OLD}, a_lut.ini changed", lambda: view.states["one"])
        await misses(app, pilot, SAVED)
        await pilot.press("tab", "home", "r")
        await until(pilot, lambda: view.states["one"] == CURRENT, lambda: view.states["one"])
        holds(app)
        await misses(app, pilot, SAVED)

    drive(LidarcheckApp(project, check=check), do)


@pytest.mark.parametrize("name", ["histograms", "overview", "explain", "goldens"])
def test_what_another_program_changes_makes_it_old_within_two_seconds(project, runs, name, monkeypatch):
    monkeypatch.setattr(Session, "is_cheap", lambda _session, _derived: False)

    async def do(app, pilot):
        await everything_computed(app, pilot)
        await go(app, pilot, name)
        path = project / "a_lut.ini"
        path.write_bytes(load_lut(path).with_scaled("vertical", ROW, 700).content)
        await until(pilot, lambda: states(app).get(name, "").startswith(OLD), lambda: str(states(app)), seconds=2.0)
        await until(pilot, lambda: OLD in text_of(app), lambda: text_of(app), seconds=2.0)
        holds(app)

    drive(LidarcheckApp(project, check=check), do, (120, 36))


def test_words_about_states_are_true_after_each_step(project, runs, monkeypatch):
    """Edit, undo, save, reading again, another file, another screen."""
    monkeypatch.setattr(Session, "is_cheap", lambda _session, _derived: False)

    async def do(app, pilot):
        await everything_computed(app, pilot)
        path = project / "a_lut.ini"
        at = ("home", *["down"] * ROW)
        steps = (
            (*at, *"512", "enter"),
            ("u",),
            ("U",),
            ("S", "enter"),
            ("u",),
            ("ctrl+r", "r"),
            ("plus",),
            ("d", "escape"),
        )
        for step in steps:
            view = await go(app, pilot, "blooming")
            await pilot.press(*step)
            await settle(app, pilot, 4)
            for name in ALL:
                await go(app, pilot, name)
                await settle(app, pilot, 2)
                if name == "overview":
                    words, dirty = f"without {app.session.unsaved()} edit", view.file.dirty
                    await (sees if dirty else misses)(app, pilot, words)
        path.write_bytes(load_lut(path).with_scaled("vertical", ROW, 650).content)
        await until(pilot, lambda: app.session.look() or True)
        for name in PAGES:
            await go(app, pilot, name)
            await settle(app, pilot, 2)

    drive(LidarcheckApp(project, check=check), do, (120, 36))


def test_the_expected_profile_that_is_called_current_is_that_of_the_table_shown(project, runs):
    async def do(app, pilot):
        app.state.selected["measurement"] = "measured/sign_69m.csv"
        view = await on_blooming(app, pilot)
        await until(pilot, lambda: view.plots.expected is not None, lambda: text_of(app))
        await sees(app, pilot, "current")
        await edit(app, pilot, "900")
        choice = view.selection.choice(view.selection.dataset)
        word, old = view.plots.expectation(choice)
        assert word != CURRENT or old is None
        await until(pilot, lambda: view.plots.expectation(choice)[0] == CURRENT)
        shown = view.plots.expected
        profiles = Profiles(Session())
        fresh = profiles.session.compute(profiles.expected(choice, view.file.current.tables["vertical"])).value
        assert (shown.value[~shown.on_target] == fresh.value[~fresh.on_target]).all()

    drive(LidarcheckApp(project, check=check), do)
