"""The terminal interface on a project whose files and words are a stranger's: nothing drives it, nothing runs."""

import json

import pytest

from lidarcheck.tui.actions import SCREENS
from lidarcheck.tui.app import LidarcheckApp
from stranger_kit import ran, stranger
from tui_kit import app_on, drive, text_of, until

HOSTILE = "[bold]x[$bad] \x1b]0;pwned\x07\n::error::[red \u202e"


@pytest.fixture
def project(tmp_path):
    root = stranger(tmp_path)
    for folder in ("goldens", "measured", "case"):
        (root / folder).mkdir()
    return root


def hostile(root):
    """Files of every kind with names and words that would drive a terminal."""
    (root / "scenarios" / f"{HOSTILE}.toml").write_text(f"{json.dumps(HOSTILE)} = 1\n")
    (root / "goldens" / f"{HOSTILE}.toml").write_text(f"format = {json.dumps(HOSTILE)}\n")
    (root / f"{HOSTILE}_lut.ini").write_text(
        f"PostPro.LUT_blooming_X = 1, {HOSTILE!r}\nPostPro.LUT_blooming_Y = 1, x\n"
    )
    (root / "models" / f"{HOSTILE}.toml").write_text(f"variant = {json.dumps(HOSTILE)}\n")
    (root / "measured" / f"{HOSTILE}.csv").write_text(f'"{HOSTILE}",b\n1,2\n')
    (root / "case" / "case.toml").write_text(f"model = {json.dumps(HOSTILE)}\n")


def test_every_screen_shows_hostile_names_and_nothing_else(project):
    hostile(project)

    async def do(app, pilot):
        for place in SCREENS.values():
            await pilot.press(place.key)
            await until(pilot, lambda title=place.title: app.view.NAME in SCREENS and title)
            await pilot.pause()
            shown = text_of(app)
            assert shown.replace("\n", "").isprintable(), ascii(shown)
        await pilot.press("L")
        await pilot.pause()
        log = text_of(app)
        assert log.replace("\n", "").isprintable()
        assert "\\x1b" in log

    drive(app_on(project), do)


def test_a_scenario_that_is_started_there_runs_no_program(project):
    async def do(app, pilot):
        await pilot.press("f2")
        await until(pilot, lambda: "wall" in text_of(app))
        while not app.view.on_scenarios:
            await pilot.press("tab")
        await pilot.press("R")
        await until(pilot, lambda: "you do not trust" in text_of(app) + app.bars.status[0])

    drive(LidarcheckApp(project), do)
    assert ran(project) == []
