"""Distances side by side, four features at once, and that nothing is computed twice."""

import threading

import pytest

from lidarcheck.tui.jobs import profile_worker
from tui_kit import app_on, drive, make_project, misses, says, sees, text_of, until

WIDE, NARROW = (160, 50), (80, 24)


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "bench")


async def on_blooming(app, pilot):
    await until(pilot, lambda: app.view.NAME == "blooming" and app.view.plots.expected is not None)
    return app.view


async def rested(pilot, view):
    """Wait until what was asked for is drawn."""
    await until(pilot, lambda: view.plots.rests)


def heads(app):
    """The titles of the panes of profiles that are seen."""
    return [pane._title for pane in app.view.tile_panes()]


def test_distances_stand_side_by_side_on_a_wide_terminal(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await sees(app, pilot, "157.0 m, 2/2")
        await sees(app, pilot, "<69.0 m>")
        assert len(view.tile_panes()) == 2
        await pilot.press("n")
        await sees(app, pilot, "<157.0 m>, 2/2")
        await sees(app, pilot, " 69.0 m, 1/2")
        await pilot.press("f", "f")
        await until(pilot, lambda: text_of(app).count("WIDTH [ns]") == 2)
        await pilot.resize_terminal(*NARROW)
        await until(pilot, lambda: len(view.tile_panes()) == 1)
        await sees(app, pilot, " 157.0 m, 2/2")

    drive(app_on(project, screen="blooming"), do, WIDE)


def test_all_features_of_one_distance_by_one_key(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("b")
        for unit in ("AREA", "PEAK", "WIDTH [ns]", "range [m]"):
            await sees(app, pilot, unit)
        assert len(view.tile_panes()) == 4
        await misses(app, pilot, "a_lut.ini vertical")
        assert app.focused.id == "profile"
        await pilot.press("right_square_bracket")  # + zooms the plot that has the focus
        await says(app, pilot, "X = -160: scaled 449")
        await pilot.press("f")
        await says(app, pilot, "all features are shown")
        await pilot.press("n")
        await until(pilot, lambda: all("157.0 m" in head for head in heads(app)))
        await pilot.press("b")
        await sees(app, pilot, "a_lut.ini vertical *")
        assert app.focused.id == "table"
        await pilot.press("b", "E")
        await sees(app, pilot, "Settings vertical")
        await pilot.resize_terminal(*WIDE)
        await pilot.press("b")
        await until(pilot, lambda: len(view.tile_panes()) == 4)
        await sees(app, pilot, "Settings vertical")

    drive(app_on(project, screen="blooming"), do, NARROW)


def test_only_what_is_seen_is_computed_and_only_once(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await rested(pilot, view)
        assert view.plots.worker.computed == 1
        await pilot.press("n")
        await until(pilot, lambda: view.plots.expected is not None)
        assert view.plots.worker.computed == 2
        await pilot.press("p", "n", "p", "f", "b", "b")
        await rested(pilot, view)
        assert view.plots.worker.computed == 2
        await pilot.press("plus")
        await rested(pilot, view)
        assert view.plots.worker.computed == 3
        await pilot.press("u")
        await rested(pilot, view)
        assert view.plots.worker.computed == 3
        assert view.plots.expected is not None
        await pilot.press("U", "n")
        await until(pilot, lambda: view.plots.expected is not None)
        assert view.plots.worker.computed == 4

    drive(app_on(project, screen="blooming"), do, NARROW)


def test_the_curve_follows_at_once_and_several_cells_together(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        curve = view.query_one("#curve")
        before = curve.text
        await pilot.press("shift+down", "shift+down", *"900", "enter")
        assert [row.scaled for row in view.file.current.tables["vertical"].rows()[:3]] == [900] * 3
        assert [change.row for change in view.file.diff()] == [0, 1, 2]
        await until(pilot, lambda: curve.text != before and "saved" in text_of(app))
        await until(pilot, lambda: view.plots.expected is not None)

    drive(app_on(project, screen="blooming"), do, NARROW)


def test_the_first_time_on_a_machine_is_said_and_compiled_aside(project, monkeypatch):
    aside, measured = threading.Event(), []

    def compile_aside():
        measured.append("begun")
        aside.wait(60)

    monkeypatch.setattr(profile_worker, "first_time", lambda: len(measured) == 0)
    monkeypatch.setattr(profile_worker, "compile_aside", compile_aside)

    async def do(app, pilot):
        await says(app, pilot, "the sensor model is compiled first, once on this machine")
        await sees(app, pilot, "computing")
        await sees(app, pilot, "69.0 m, 1/2")
        await pilot.press("plus")
        assert app.view.file.dirty
        assert app.view.plots.expected is None
        aside.set()
        await until(pilot, lambda: app.view.plots.expected is not None)
        await says(app, pilot, "the sensor model is compiled")

    drive(app_on(project, screen="blooming"), do, NARROW)
