"""A LUT table edited by keys on the screen Blooming: edits, saving, other files, changes on the disk, crashes."""

import pytest

from lidarcheck.formats.lut import load_lut
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.tui.widgets import dialogs
from lidarcheck.tui.widgets.dialogs import Ask
from tui_kit import LUT, app_on, blooming, done, drive, make_project, on_blooming, says, scaled, sees, text_of, until


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "project")


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
        await until(pilot, lambda: isinstance(app.asking, Ask))
        await sees(app, pilot, "513")
        await pilot.press("escape")
        assert lut.read_bytes() == LUT.encode()
        await pilot.press("S", "enter")
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
        await pilot.press("plus", "plus", "equals_sign")
        assert scaled(view, 0) == first + 3
        await pilot.press("minus", "minus", "right_square_bracket")
        assert scaled(view, 0) == first + 21
        await pilot.press("left_square_bracket", "u")
        assert scaled(view, 0) == first + 21
        await says(app, pilot, "taken back: nudge -20")
        await pilot.press("U")
        assert scaled(view, 0) == first + 1
        await pilot.press("space", "shift+down", "shift+down")
        assert view.marked == {0, 1, 2}
        await pilot.press(*"700", "enter")
        assert [scaled(view, row) for row in range(4)] == [700, 700, 700, first]
        await pilot.press("escape", "home", "down", "down", "s")
        assert view.marked == set()
        assert first < scaled(view, 2) < 700
        await pilot.press("asterisk")
        assert len(view.marked) == 26
        await pilot.press("asterisk", *"0.02", "enter")
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
        await pilot.press("d", "s", "ctrl+r")
        await says(app, pilot, "read again")

    drive(app_on(project), do)


def test_tables_files_datasets_models(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await done(app, "other table")
        await says(app, pilot, "one table")
        await done(app, "next file")
        assert view.file.path.name == "both_lut.ini"
        await done(app, "other table")
        assert view.axis == "horizontal"
        await until(pilot, lambda: "no measured profile" in text_of(app))
        await pilot.press("n")
        await says(app, pilot, "no measurement")
        await done(app, "other table")
        await pilot.press("plus")
        await done(app, "next file")
        await says(app, pilot, "save the edits first")
        await pilot.press("u")
        selection = view.selection
        assert selection.model.stem in ("SLIM", "sign_SLIM")
        await pilot.press("n")
        assert selection.datasets[selection.dataset].name == "measured/sign_157m.csv"
        await pilot.press("p", "f")
        assert selection.dataset == 0
        assert selection.feature == "PEAK"
        await done(app, "next target")
        await says(app, pilot, "target: material")
        await done(app, "next model")
        await says(app, pilot, "model: models/")

    drive(app_on(project), do)


def test_the_expected_profile_follows_an_edit(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await until(pilot, lambda: view.plots.expected is not None)
        before, count = view.plots.expected.value.copy(), view.plots.worker.computed
        await pilot.press("asterisk", "right_square_bracket", "right_square_bracket", "right_square_bracket")
        await until(pilot, lambda: view.plots.worker.computed > count and view.plots.expected is not None)
        beside = ~view.plots.expected.on_target
        assert (view.plots.expected.value[beside, 1] >= before[beside, 1]).all()
        assert view.plots.expected.value[beside, 1].mean() > 1.05 * before[beside, 1].mean()
        await sees(app, pilot, "now")

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
        await until(pilot, lambda: b"our sign" in lut.read_bytes())
        await pilot.press("plus")
        lut.write_bytes(LUT.replace("our", "his").encode())
        view._look_at_disk()
        await pilot.pause()
        await pilot.press("r")
        await until(pilot, lambda: not view.file.dirty)
        assert b"his" in view.file.current.content

    drive(app_on(project), do)


def test_a_crash_is_offered_at_the_next_start(project):
    session = EditedLut(project / "both_lut.ini", project)
    session.set("vertical", [1], "500")
    session._journal.close()
    session._lock.drop()

    async def do(app, pilot):
        await until(pilot, lambda: isinstance(app.asking, Ask))
        await sees(app, pilot, "both_lut.ini: an earlier session ended with 1 row not saved")
        await pilot.press("escape", "plus")
        await until(pilot, lambda: isinstance(app.asking, Ask))
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
        await pilot.press("ctrl+r", "plus")
        assert view.file.dirty
        await pilot.press("u")

    drive(app_on(project), do)


def test_leaving_with_edits_keeps_them(project):
    async def do(app, pilot):
        await on_blooming(app, pilot)
        await pilot.press("plus", "q")
        await sees(app, pilot, "1 row not saved")
        await pilot.press("escape", "q", "q")
        await until(pilot, lambda: not app.is_running or app._exit)

    drive(app_on(project), do)
    assert (project / "a_lut.ini").read_bytes() == LUT.encode()
    session = EditedLut(project / "a_lut.ini", project)
    assert session.found
    session.forget()
    session.close()


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
        assert isinstance(app.asking, Ask)
        assert view.file.dirty
        assert b"his" in lut.read_bytes()
        app.asking.ignores_keys_s = 0.0
        await pilot.press("r")
        await until(pilot, lambda: not view.file.dirty)

    drive(app_on(project), do)
