"""The screen Overview: scenarios are run, kept, shown and stopped."""

import pytest

from lidarcheck.tui.actions import SCREENS
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.screens.overview.measured import screen_of
from tui_kit import app_on, drive, fake_check, make_project, says, sees, text_of, until


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "project")


def test_a_scenario_is_run_and_kept(project):
    async def do(app, pilot):
        await sees(app, pilot, "files with a fault")
        await sees(app, pilot, "bad_lut.ini")
        view = app.view
        await pilot.press("tab")  # from the measurements to the scenarios
        names = [entry.path.stem for entry in view.entries()[:3]]
        assert names == ["background_SMART", "broken", "weak_targets_SLIM"]
        await pilot.press("r")
        await until(pilot, lambda: view.runs.last and not view.running)
        assert view.runs.last["background_SMART"].verdict == "fell out"
        await sees(app, pilot, "REGRESSED")
        await pilot.press("v")
        assert {entry.path.stem for entry in view.entries()} == {"background_SMART", "broken", "bad_lut", "empty"}
        await pilot.press("v", "end", "r")
        await says(app, pilot, "no scenario under the cursor")
        assert app.state.selected["overview"] == "measured/empty.txt"
        await pilot.press("ctrl+r")
        await says(app, pilot, "scenarios")

    drive(app_on(project), do)

    async def again(app, pilot):
        await pilot.press("tab", "home")
        await sees(app, pilot, "fell out")
        (project / "goldens/background_SMART.toml").write_text("other")
        await pilot.press("ctrl+r", "home")
        await until(pilot, lambda: "fell out OLD" in text_of(app), lambda: text_of(app))

    drive(app_on(project), again)


def test_all_are_run_and_a_run_is_stopped(project):
    async def do(app, pilot):
        view = app.view
        await pilot.press("tab", "R")
        await until(pilot, lambda: view.running)
        await pilot.press("R")
        await says(app, pilot, "a run is going on")
        await until(pilot, lambda: not view.running)
        assert set(view.runs.last) == {"background_SMART", "broken", "weak_targets_SLIM"}
        view.runs.last.clear()
        await pilot.press("R")
        await until(pilot, lambda: view.running)
        await pilot.press("x")
        await until(pilot, lambda: not view.running)
        await says(app, pilot, "the run was stopped")
        assert len(view.runs.last) < 3

    def slow(paths, progress):
        return fake_check(paths, progress, 0.15)

    drive(LidarcheckApp(project, check=slow), do)


def test_each_kind_of_measurement_has_a_screen():
    kinds = (
        "profile",
        "sign",
        "scan",
        "frames",
        "case",
        "bag",
        "car",
        "van",
        "truck",
        "data set",
        "a class of its own",
    )
    assert {screen_of(kind) for kind in kinds} <= set(SCREENS)
