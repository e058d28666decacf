"""The terminal interface driven by keys, headless: asserted are the state of the model and the text on screen."""

import asyncio
import signal

import pytest
from textual import events

from lidarcheck.formats.lut import load_lut
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.state import load_state
from lidarcheck.tui import bars
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.host import STOPS
from lidarcheck.tui.palette import Palette
from lidarcheck.tui.widgets import dialogs
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.themes import THEMES
from tui_kit import LUT, app_on, as_stored, drive, fake_check, make_project, says, sees, text_of, until


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "project")


def blooming(app):
    return next(view for view in app.views() if view.NAME == "blooming")


async def on_blooming(app, pilot):
    await pilot.press("f5")
    view = blooming(app)
    await until(pilot, lambda: app.view is view and view.file is not None)
    return view


def scaled(view, row):
    return view.file.current.tables[view.axis].rows()[row].scaled


def test_a_scenario_is_run_and_kept(project):
    async def do(app, pilot):
        await sees(app, pilot, "files with a fault")
        await sees(app, pilot, "bad_lut.ini")
        view = app.view
        names = [entry.path.stem for entry in view.entries()[:3]]
        assert names == ["background_SMART", "broken", "weak_targets_SLIM"]
        await pilot.press("r")
        await until(pilot, lambda: view.runs.last and not view.running)
        assert view.runs.last["background_SMART"].verdict == "fell out"
        await sees(app, pilot, "REGRESSED")
        await pilot.press("f")
        assert {entry.path.stem for entry in view.entries()} == {"background_SMART", "broken", "bad_lut", "empty"}
        await pilot.press("f", "end", "r")
        await says(app, pilot, "no scenario under the cursor")
        assert app.state.selected["overview"] == "measured/empty.txt"
        await pilot.press("R")
        await says(app, pilot, "scenarios")

    drive(app_on(project), do)

    async def again(app, pilot):
        await sees(app, pilot, "fell out")
        (project / "goldens/background_SMART.toml").write_text("other")
        await pilot.press("R")
        await until(pilot, lambda: "fell out?" in text_of(app))

    drive(app_on(project), again)


def test_all_are_run_and_a_run_is_stopped(project):
    async def do(app, pilot):
        view = app.view
        await pilot.press("a")
        await until(pilot, lambda: view.running)
        await pilot.press("a")
        await says(app, pilot, "a run is going on")
        await until(pilot, lambda: not view.running)
        assert set(view.runs.last) == {"background_SMART", "broken", "weak_targets_SLIM"}
        view.runs.last.clear()
        await pilot.press("a")
        await until(pilot, lambda: view.running)
        await pilot.press("x")
        await until(pilot, lambda: not view.running)
        await says(app, pilot, "the run was stopped")
        assert len(view.runs.last) < 3

    def slow(paths, progress):
        return fake_check(paths, progress, 0.15)

    drive(LidarcheckApp(project, check=slow), do)


def test_a_cell_is_edited_seen_and_saved(project):
    lut = project / "a_lut.ini"

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("down", "down", *"512")
        await sees(app, pilot, "512_")
        await pilot.press("backspace", "3", "enter")
        assert scaled(view, 2) == 513
        await sees(app, pilot, "513")
        await sees(app, pilot, "~")
        assert lut.read_bytes() == LUT.encode()
        await pilot.press("S")
        await until(pilot, lambda: isinstance(app.screen, Ask))
        await sees(app, pilot, "513")
        await pilot.press("escape")
        assert lut.read_bytes() == LUT.encode()
        await pilot.press("S", "enter")
        await pilot.pause()
        await says(app, pilot, "saved, 1 row")
        assert load_lut(lut).tables["vertical"].rows()[2].scaled == 513
        assert lut.read_bytes().endswith(b"; the end\r\nPostPro.Other = 7")
        await pilot.press("S")
        await says(app, pilot, "nothing is edited")

    drive(app_on(project), do)


def test_every_edit_by_its_key(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        first = scaled(view, 0)
        await pilot.press("plus", "right", "equals_sign")
        assert scaled(view, 0) == first + 3
        await pilot.press("minus", "left", "right_square_bracket")
        assert scaled(view, 0) == first + 21
        await pilot.press("left_square_bracket", "u")
        assert scaled(view, 0) == first + 21
        await says(app, pilot, "taken back: nudge -20")
        await pilot.press("r")
        assert scaled(view, 0) == first + 1
        await pilot.press("space", "shift+down", "shift+down")
        assert view.marked == {0, 1, 2}
        await pilot.press(*"700", "enter")
        assert [scaled(view, row) for row in range(4)] == [700, 700, 700, first]
        await pilot.press("escape", "home", "down", "down", "s")
        assert view.marked == set()
        assert first < scaled(view, 2) < 700
        await pilot.press("a")
        assert len(view.marked) == 26
        await pilot.press("a", *"0.02", "enter")
        assert view.file.current.tables["vertical"].y[2] == 0.02
        await pilot.press(*"2e", "minus", "4", "enter")
        assert view.file.current.tables["vertical"].y[2] == 2e-4
        await pilot.press(*"1001", "enter")
        await says(app, pilot, "scaled Y = 1001 is out of range; use a whole number from 0 to 1000")
        await pilot.press("enter")
        await says(app, pilot, "type a value first")
        await pilot.press("d")
        await sees(app, pilot, "Not saved: 3 rows")
        await pilot.press("escape", *("u",) * 20)
        await says(app, pilot, "nothing to take back")
        assert not view.file.dirty
        await pilot.press("d", "s", "R")
        await says(app, pilot, "read again")

    drive(app_on(project), do)


def test_tables_files_datasets_models(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("t")
        await says(app, pilot, "one table")
        await pilot.press("o")
        assert view.file.path.name == "both_lut.ini"
        await pilot.press("t")
        assert view.axis == "horizontal"
        await until(pilot, lambda: "no measured profile" in text_of(app))
        await pilot.press("n")
        await says(app, pilot, "no measurement")
        await pilot.press("t", "plus", "o")
        await says(app, pilot, "save the edits first")
        await pilot.press("u")
        selection = view.selection
        assert selection.model.stem in ("SLIM", "sign_SLIM")
        await pilot.press("n")
        assert selection.datasets[selection.dataset].name == "measured/sign_157m.csv"
        await pilot.press("p", "v")
        assert selection.dataset == 0
        assert selection.feature == 1
        await pilot.press("k")
        await says(app, pilot, "target: material")
        await pilot.press("m")
        await says(app, pilot, "model: models/")

    drive(app_on(project), do)


def test_the_expected_profile_follows_an_edit(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await until(pilot, lambda: view.plots.expected is not None)
        before, count = view.plots.expected.value.copy(), view.plots.worker.computed
        await pilot.press("a", "right_square_bracket", "right_square_bracket", "right_square_bracket")
        await until(pilot, lambda: view.plots.worker.computed > count and view.plots.expected is not None)
        beside = ~view.plots.expected.on_target
        assert (view.plots.expected.value[beside, 1] >= before[beside, 1]).all()
        assert view.plots.expected.value[beside, 1].mean() > 1.05 * before[beside, 1].mean()
        await sees(app, pilot, "expected")

    drive(app_on(project), do)


def test_a_file_changed_on_disk_asks(project):
    lut = project / "a_lut.ini"

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("plus")
        lut.write_bytes(LUT.replace("our", "my").encode())
        await pilot.press("S")
        await sees(app, pilot, "has changed on the disk")
        await pilot.press("k", "S", "enter")
        await pilot.pause()
        assert b"our sign" in lut.read_bytes()
        await pilot.press("plus")
        lut.write_bytes(LUT.replace("our", "his").encode())
        view._look_at_disk()
        await pilot.pause()
        await pilot.press("r")
        assert not view.file.dirty
        assert b"his" in view.file.current.content

    drive(app_on(project), do)


def test_a_crash_is_offered_at_the_next_start(project):
    session = EditedLut(project / "both_lut.ini", project)
    session.set("vertical", [1], "500")
    session._journal.close()
    session._lock.drop()

    async def do(app, pilot):
        await until(pilot, lambda: isinstance(app.screen, Ask))
        await sees(app, pilot, "both_lut.ini: an earlier session ended with 1 row not saved")
        await pilot.press("escape", "plus")
        await until(pilot, lambda: isinstance(app.screen, Ask))
        await pilot.press("b")
        view = blooming(app)
        assert scaled(view, 1) == 500
        await pilot.press("u")
        assert not view.file.dirty

    drive(app_on(project), do)


def test_another_instance_is_noticed(project):
    session = EditedLut(project / "a_lut.ini", project)

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("plus")
        await says(app, pilot, "is being edited by process")
        session.close()
        await pilot.press("R", "plus")
        assert view.file.dirty
        await pilot.press("u")

    drive(app_on(project), do)


def test_what_is_everywhere(project, monkeypatch):
    copied = []
    monkeypatch.setattr(LidarcheckApp, "copy_to_clipboard", lambda _app, text: copied.append(text))

    async def do(app, pilot):
        await pilot.press("f1")
        await sees(app, pilot, "Every scenario with the verdict")
        await sees(app, pilot, "as: lidarcheck check")
        await pilot.press("escape", "tab", "f1")
        await sees(app, pilot, "The KPIs of the scenario")
        await pilot.press("escape", "shift+tab", "c")
        assert "background_SMART" in copied[0]
        await pilot.press("w")
        await until(pilot, lambda: isinstance(app.screen, AskText))
        await pilot.press("enter")
        await pilot.pause()
        assert "background_SMART" in (project / "scenarios.txt").read_text()
        await pilot.press("w", "enter")
        await pilot.pause()
        await says(app, pilot, "is there already; give another name")
        await pilot.press("L")
        await sees(app, pilot, "bad_lut.ini:2")
        await pilot.press("g", "B")
        assert app.view is blooming(app)
        await pilot.press("g", "u")
        assert app.focused.id == "curve"
        await pilot.press("g", "l")
        assert app.focused.id == "log"
        await pilot.press("L", "f2", "ctrl+p")
        await until(pilot, lambda: isinstance(app.screen, Palette))
        await pilot.press(*"thm")
        await pilot.press("enter")
        assert isinstance(app.screen, type(app.screen))
        await pilot.press("ctrl+p", *"next", "space", *"theme", "enter")
        await pilot.pause()
        assert app.theme == "light"
        for theme in ("high-contrast", "plain", "dark"):
            await pilot.press("T")
            assert app.theme == theme
        await pilot.press("ctrl+c")
        await says(app, pilot, "q leaves")

    drive(app_on(project), do)


def test_the_next_start_is_as_the_last_one_was(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("o", "down", "down", "T", "L")
        assert view.at == 2

    drive(app_on(project), do)
    assert load_state(project).screen == "blooming"

    async def again(app, pilot):
        view = blooming(app)
        await until(pilot, lambda: app.view is view)
        assert (view.file.path.name, view.at, app.theme) == ("both_lut.ini", 2, "light")
        assert app.bars.log.size.height

    drive(app_on(project), again)


def test_leaving_with_edits_keeps_them(project):
    async def do(app, pilot):
        await on_blooming(app, pilot)
        await pilot.press("plus", "q")
        await sees(app, pilot, "1 row not saved")
        await pilot.press("escape", "q", "q")
        await pilot.pause()
        assert not app.is_running or app._exit

    drive(app_on(project), do)
    assert (project / "a_lut.ini").read_bytes() == LUT.encode()
    session = EditedLut(project / "a_lut.ini", project)
    assert session.found
    session.forget()
    session.close()


@pytest.mark.parametrize("screen", ["overview", "blooming"])
def test_any_size_down_to_one_by_one(project, screen):
    async def do(app, pilot):
        await until(pilot, lambda: screen == app.view.NAME)
        for size in ((1, 1), (5, 3), (40, 10), (200, 60), (3, 40), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.press("down", "f1", "escape", "ctrl+p", "escape")
            await pilot.pause(0.2)
        await sees(app, pilot, "F1 Help")

    drive(app_on(project, screen=screen), do)


def test_keys_in_one_go_with_a_screens_key_act_on_that_screen(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        overview = next(one for one in app.views() if one.NAME == "overview")
        before = scaled(view, 0)
        # As a terminal hands over what was typed ahead: no key waits for the one before.
        for key, character in (("f2", None), ("f", "f"), ("f5", None), ("plus", "+")):
            app.post_message(events.Key(key, character))
        await until(pilot, lambda: view.file.current.tables[view.axis].rows()[0].scaled == before + 1)
        assert overview.fallen_only
        assert app.view is view

    drive(app_on(project), do)


def test_a_question_that_comes_by_itself_takes_no_key_that_was_typed_before(project, monkeypatch):
    lut = project / "a_lut.ini"
    monkeypatch.setattr(dialogs, "UNASKED_S", 3600.0)

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("plus")
        lut.write_bytes(LUT.replace("our", "his").encode())
        view._look_at_disk()
        await sees(app, pilot, "has changed on the disk")
        await pilot.press("r", "o", "escape")
        assert isinstance(app.screen, Ask)
        assert view.file.dirty
        assert b"his" in lut.read_bytes()
        app.screen._ignores_keys_s = 0.0
        await pilot.press("r")
        await until(pilot, lambda: not view.file.dirty)

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
        assert "x stops it" not in text_of(app)
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
        await pilot.press("L", "end")
        names = [entry.name for entry in app.view.entries()]
        assert app.view.at == len(names) - 1
        await sees(app, pilot, "was it written completely?")
        await pilot.press("f9", "f1")
        # The end of the longest help there is.
        await sees(app, pilot, "diff, then write")

    drive(app_on(project), do, size=(70, 24))


def test_an_empty_project_says_so(tmp_path):
    async def session():
        app = LidarcheckApp(tmp_path)
        async with app.run_test(size=(80, 24)) as pilot:
            await until(pilot, lambda: app.reads)
            await sees(app, pilot, "no scenario here")
            await pilot.press("r", "a", "f5", "plus", "5", "enter", "u", "s", "d", "n", "m", "t", "o", "ctrl+s", "R")
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
        if screen == "overview":
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
