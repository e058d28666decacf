"""The interface driven by keys, headless: what is the same on every screen; asserted are state and text on screen."""

import asyncio
import signal
import time

import pytest
from textual import events

from lidarcheck.session.state import load_state
from lidarcheck.tui import bars
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.host import STOPS
from lidarcheck.tui.palette import Palette
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.themes import THEMES
from tui_kit import (
    app_on,
    as_stored,
    blooming,
    done,
    drive,
    make_project,
    misses,
    on_blooming,
    says,
    scaled,
    sees,
    text_of,
    until,
)


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "project")


def test_of_two_dialogs_as_wide_each_is_seen(project):
    """One after the other, as fast as they come: what was drawn of the first is kept for none that is as wide."""

    async def do(app, pilot):
        for k in range(10):
            app.ask(Ask(f"long {k}", [(("one", "text"),), (("two", "text"),)], {"y": "takes it"}))
            await sees(app, pilot, f"long {k}")
            app.asking.dismiss(None)
            await pilot.pause(0)
            app.ask(AskText(f"short {k}"))
            await sees(app, pilot, f"short {k}")
            app.asking.dismiss(None)

    drive(app_on(project), do)


def test_what_is_everywhere(project, monkeypatch):
    copied = []
    monkeypatch.setattr(LidarcheckApp, "copy_to_clipboard", lambda _app, text: copied.append(text))

    async def do(app, pilot):
        await pilot.press("g", "c")
        await until(pilot, lambda: app.view.on_scenarios)
        await pilot.press("f1")
        await sees(app, pilot, "Every scenario with the verdict")
        await pilot.press("pagedown")
        await sees(app, pilot, "as: lidarcheck check")
        await pilot.press("escape", "tab", "f1")
        await sees(app, pilot, "The KPIs of the scenario")
        await pilot.press("escape", "shift+tab", "c")
        await until(pilot, lambda: copied)
        assert "background_SMART" in copied[0]
        await pilot.press("w")
        await until(pilot, lambda: isinstance(app.asking, AskText))
        await pilot.press("enter")
        file = project / "scenarios.txt"
        await until(pilot, lambda: file.exists() and "background_SMART" in file.read_text())
        await pilot.press("w")
        await until(pilot, lambda: isinstance(app.asking, AskText))
        await pilot.press("enter")
        await says(app, pilot, "is there already; give another name")
        await pilot.press("L")
        await sees(app, pilot, "broken.toml:1")
        await pilot.press("g", "B")
        await until(pilot, lambda: app.view is blooming(app))
        for key, part in (("u", "curve"), ("l", "log")):
            await pilot.press("g", key)
            await until(pilot, lambda part=part: app.focused is not None and app.focused.id == part)
        await pilot.press("L", "f2", "ctrl+p")
        await until(pilot, lambda: isinstance(app.asking, Palette))
        await pilot.press(*"thm")
        await pilot.press("enter")
        assert app.asking is None
        await pilot.press("ctrl+p", *"next", "space", *"theme", "enter")
        await until(pilot, lambda: app.theme == "light")
        for theme in ("high-contrast", "plain", "dark"):
            await pilot.press("T")
            await until(pilot, lambda theme=theme: app.theme == theme)
        await pilot.press("ctrl+c")
        await says(app, pilot, "q leaves")

    drive(app_on(project), do)


def test_the_next_start_is_as_the_last_one_was(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await done(app, "next file")
        await pilot.press("down", "down", "T", "L")
        assert view.at == 2

    drive(app_on(project), do)
    assert load_state(project).screen == "blooming"

    async def again(app, pilot):
        view = blooming(app)
        await until(pilot, lambda: app.view is view)
        assert (view.file.path.name, view.at, app.theme) == ("both_lut.ini", 2, "light")
        assert app.bars.log.size.height

    drive(app_on(project), again)


@pytest.mark.parametrize("screen", ["overview", "blooming"])
def test_any_size_down_to_one_by_one(project, screen):
    async def do(app, pilot):
        await until(pilot, lambda: screen == app.view.NAME)
        for size in ((1, 1), (5, 3), (40, 10), (200, 60), (3, 40), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.press("down", "f1", "escape", "ctrl+p", "escape")
            await pilot.pause()
        await sees(app, pilot, "? Help")

    drive(app_on(project, screen=screen), do)


def test_keys_in_one_go_with_a_screens_key_act_on_that_screen(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        overview = next(one for one in app.views() if one.NAME == "overview")
        before = scaled(view, 0)
        # As a terminal hands over what was typed ahead: no key waits for the one before.
        for key, character in (("f2", None), ("v", "v"), ("f5", None), ("plus", "+")):
            app.post_message(events.Key(key, character))
        await until(pilot, lambda: view.file.current.tables[view.axis].rows()[0].scaled == before + 1)
        assert overview.fallen_only
        assert app.view is view
        # And with the key of a pane on that pane.
        curve = view.curve_pane()
        await until(pilot, lambda: curve.drawn is not None)
        for key, character in (("tab", "\t"), ("plus", "+")):
            app.post_message(events.Key(key, character))
        await until(pilot, lambda: curve.look.zoomed)
        assert scaled(view, 0) == before + 1

    drive(app_on(project), do)


def test_what_is_said_is_seen_while_something_runs(project, monkeypatch):
    async def do(app, pilot):
        app.progress(f"run 1/2: one{STOPS}", "overview")
        await sees(app, pilot, "run 1/2: one   x stops it")
        await pilot.press("g", "escape")
        app.say("something else")
        await sees(app, pilot, "something else")
        app.progress(f"run 2/2: two{STOPS}", "overview")
        assert "something else" in text_of(app)
        monkeypatch.setattr(bars, "_READ_S", 0.0)
        app.progress(f"run 2/2: three{STOPS}", "overview")
        await sees(app, pilot, "run 2/2: three   x stops it")
        await pilot.press("f4")
        await sees(app, pilot, "F2 run 2/2: three")
        await misses(app, pilot, "x stops it")
        app.progress(f"reading{STOPS}", "noise")
        await sees(app, pilot, "reading   x stops it")
        app.progress("", "noise")
        await sees(app, pilot, "F2 run 2/2: three")
        app.progress("", "overview")
        await sees(app, pilot, "something else")

    drive(app_on(project), do)


def test_what_is_wider_than_the_screen_can_be_read(project):
    async def do(app, pilot):
        app.say("; ".join(f"part {number} of a long line" for number in range(8)) + "; and its end")
        await pilot.press("L")
        await sees(app, pilot, "and its end")
        await pilot.press("L", "g", "c")
        await until(pilot, lambda: app.view.on_scenarios)
        await pilot.press("end")
        names = [entry.name for entry in app.view.entries()]
        assert app.view.at == len(names) - 1
        await sees(app, pilot, "was it written completely?")
        await pilot.press("f9", "f1")
        await until(pilot, lambda: app.asking is not None)
        for _page in range(9):
            if "diff, then write" not in text_of(app):
                await pilot.press("pagedown")
        # The end of the longest help there is.
        await sees(app, pilot, "diff, then write")

    drive(app_on(project), do, size=(70, 24))


def test_an_empty_project_says_so(tmp_path):
    async def session():
        app = LidarcheckApp(tmp_path)
        async with app.run_test(size=(80, 24)) as pilot:
            await until(pilot, lambda: app.reads)
            await sees(app, pilot, "no scenario here")
            await pilot.press(
                "r", "R", "f5", "plus", "5", "enter", "u", "s", "d", "n", "U", "f", "b", "b", "ctrl+s", "ctrl+r"
            )
            await pilot.pause(0.3)
            await sees(app, pilot, "no LUT file in this project")

    asyncio.run(session())


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
@pytest.mark.parametrize("screen", ["overview", "blooming"])
def test_snapshots(tmp_path, screen, size):
    project = make_project(tmp_path / "bench")

    async def do(app, pilot):
        await until(pilot, lambda: screen == app.view.NAME)
        view = app.view
        app.numbers.began = time.mktime((2026, 1, 2, 9, 38, 0, 0, 0, -1))
        if screen == "overview":
            while not view.on_scenarios:
                await pilot.press("tab")
            await pilot.press("r")
            await until(pilot, lambda: view.runs.last and not view.running)
            await pilot.press("f1", "escape")
        else:
            await until(pilot, lambda: view.plots.expected is not None)
            await pilot.press("down", "down", "space", *"640", "enter")
            await until(pilot, lambda: view.plots.expected is not None)
        await as_stored(app, pilot, f"{screen}_{size[0]}x{size[1]}")

    drive(app_on(project, screen=screen, theme=THEMES[0]), do, size)


def test_signals_are_listened_to(project):
    async def do(app, pilot):
        assert signal.getsignal(signal.SIGHUP) is not signal.SIG_DFL

    drive(app_on(project), do)
