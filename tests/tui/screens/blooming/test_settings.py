"""Settings of distances in the terminal interface: the session, and the editor on the screen Blooming."""

import json
import shutil

import pytest

from blooming_kit import sign_frame, sign_model
from lidarcheck.cli import main
from lidarcheck.errors import LidarcheckError, UsageError
from lidarcheck.formats import save_scan
from lidarcheck.formats.settings import load_settings
from lidarcheck.model.files.model_file import save_model
from lidarcheck.session.edited_file import ChangedOnDisk
from lidarcheck.session.edited_settings import EditedSettings, left_behind, settings_path
from lidarcheck.session.project import read_project
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from tui_kit import LUT, app_on, done, drive, says, sees, text_of, until

NAME = "Blooming_Calibration_V_SLIM.json"
ODD = (
    '[ {"Distance": 69, "note": "ours",  "IndexVerMin": 700, "IndexVerMax": 900, "SegVerCenter": 272, "SegHor": 440} ]'
)


def session_on(root, name=NAME, axis="vertical"):
    return EditedSettings(root / name, root, axis)


def crash(session):
    session._journal.close()
    session._lock.drop()


def test_without_a_file_edits_begin_with_the_defaults_and_saving_makes_it(tmp_path):
    session = session_on(tmp_path)
    assert session.in_force.content is None
    assert not session.dirty
    assert session.set([4], "441")
    assert session.in_force.entries[0].across == 441
    assert [(c.distance_m, c.key, c.before, c.after) for c in session.diff()] == [(69.0, "SegHor", 440, 441)]
    assert session.edited().index(True) == 4
    assert not (tmp_path / NAME).exists()
    assert session.save() == 1
    assert load_settings(tmp_path / NAME).entries[0].across == 441
    assert session.undo() == "set 441"
    session.save()
    assert load_settings(tmp_path / NAME).entries[0].across == 440
    session.close()


def test_an_edit_is_that_of_the_command_line_and_undo_gives_the_bytes_back(tmp_path):
    for part in ("a", "b"):
        (tmp_path / part).mkdir()
        (tmp_path / part / NAME).write_text(ODD)
    session = session_on(tmp_path / "a")
    session.set([1], "777")
    session.nudge([4], 20)
    session.save()
    session.close()
    edits = ["--set", "69:IndexVerMin=777", "--set", "69:SegHor=460"]
    assert main(["bloom", "settings", str(tmp_path / "b" / NAME), *edits]) == 0
    assert (tmp_path / "a" / NAME).read_bytes() == (tmp_path / "b" / NAME).read_bytes()
    assert json.loads((tmp_path / "a" / NAME).read_text())[0]["note"] == "ours"
    session.undo()
    session.undo()
    assert session.content == ODD.encode()


def test_what_cannot_be_is_refused_with_its_limits(tmp_path):
    session = session_on(tmp_path)
    for row, value, words in (
        (1, "1560", "IndexVerMin = 1560 is out of range; use a whole number from 0 to 1559"),
        (4, "4.5", "SegHor = 4.5 is out of range; use a whole number from 0 to 959"),
        (0, "301", "Distance = 301 is out of range; use a number from 0 to 300 m"),
    ):
        with pytest.raises(UsageError, match=words.replace(".", r"\.")):
            session.set([row], value)
    with pytest.raises(LidarcheckError, match="IndexVerMin = 900 is above IndexVerMax = 873; swap them"):
        session.set([1], "900")
    with pytest.raises(LidarcheckError, match="the distance 69 m stands twice"):
        session.set([5], "69")
    assert not session.dirty
    session.close()


def test_distances_are_added_moved_and_taken_out(tmp_path):
    session = session_on(tmp_path)
    session.add("120.5")
    assert [entry.distance_m for entry in session.current.entries] == [69.0, 156.6, 199.0, 120.5]
    assert session.current.entries[3].index_min == 770
    assert {change.before for change in session.diff()} == {None}
    assert session.edited()[15:] == [True] * 5
    session.set([0, 4], "70")
    assert (session.current.entries[0].distance_m, session.current.entries[0].across) == (70.0, 70)
    session.undo()
    session.remove(120.5)
    assert not session.dirty
    with pytest.raises(UsageError, match=r"there is no setting for 12 m; there are: 69, 156\.6, 199"):
        session.remove(12.0)
    session.close()


def test_each_variant_and_direction_has_its_own_file(tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / NAME).write_text(ODD)
    project = read_project(tmp_path)
    paths = {settings_path(project, axis, v) for axis in ("vertical", "horizontal") for v in ("SMART", "SLIM")}
    assert len(paths) == 4
    assert tmp_path / "deep" / NAME in paths
    assert tmp_path / "Blooming_Calibration_H_SMART.json" in paths


def test_a_crash_brings_back_edits_of_a_file_that_was_never_there(tmp_path):
    session = session_on(tmp_path)
    session.set([4], "441")
    session.add("120")
    crash(session)
    assert left_behind(read_project(tmp_path)) == ("vertical", "SLIM")
    again = session_on(tmp_path)
    assert "6 values not saved" in again.found_in_words()
    again.bring_back()
    assert (again.undo(), again.undo()) == ("add 120 m", "set 441")
    assert again.in_force.content is None
    again.redo()
    again.save()
    assert load_settings(tmp_path / NAME).entries[0].across == 441
    again.close()


def test_a_file_that_somebody_makes_meanwhile_is_asked_about(tmp_path):
    session = session_on(tmp_path)
    session.set([4], "441")
    (tmp_path / NAME).write_text(ODD)
    with pytest.raises(ChangedOnDisk):
        session.save()
    session.reload()
    assert session.content == ODD.encode()
    session.close()


# On the screen


@pytest.fixture
def project(tmp_path):
    """A sign at 69 m without an ideal scan, at a column that the settings do not have."""
    root = tmp_path / "bench"
    root.mkdir()
    (root / "a_lut.ini").write_bytes(LUT.encode())
    save_model(sign_model("SLIM"), root / "sign_SLIM.toml")
    save_model(sign_model("SMART"), root / "sign_SMART.toml")
    save_scan(sign_frame(69.0, "SLIM", 9)[0], root / "real_69m.csv")
    (root / NAME).write_text(ODD)
    return root


def blooming(app):
    return next(view for view in app.views() if view.NAME == "blooming")


async def on_settings(app, pilot):
    await until(pilot, lambda: app.view.NAME == "blooming")
    await sees(app, pilot, "nothing saturates at 69 m")
    await pilot.press("E")
    await sees(app, pilot, "Settings vertical SLIM")
    return blooming(app)


def test_an_edit_moves_the_target_and_is_saved_after_its_diff(project):
    async def do(app, pilot):
        view = await on_settings(app, pilot)
        await pilot.press("down", "down", "down", "down", *"480", "enter")
        await until(pilot, lambda: view.plots.setting() is not None)
        await sees(app, pilot, "<- here")
        assert view.plots.shown().cells.setting.across == 480
        await until(pilot, lambda: view.plots.expected is not None)
        await pilot.press("u")
        await sees(app, pilot, "nothing saturates at 69 m")
        await pilot.press("U", "plus", "minus", *"999", "enter")
        await says(app, pilot, "SegHor = 999 is out of range; use a whole number from 0 to 959")
        await pilot.press("E")
        await sees(app, pilot, "a_lut.ini vertical ")
        assert not view.file.dirty
        await pilot.press("E", "ctrl+s")
        await sees(app, pilot, f"Save 1 value to {NAME}?")
        await sees(app, pilot, "440      480")
        await pilot.press("enter")
        await says(app, pilot, "saved, 1 value")
        assert json.loads((project / NAME).read_text())[0]["SegHor"] == 480
        assert not view.unsaved()

    drive(app_on(project, screen="blooming"), do)


def test_distances_are_added_by_the_name_of_what_is_shown(project):
    async def do(app, pilot):
        view = await on_settings(app, pilot)
        await pilot.press("D")
        await until(pilot, lambda: not view.settings.file.current.entries)
        await sees(app, pilot, "no setting fits")
        await sees(app, pilot, "no distance: i adds one")
        await pilot.press("i")
        await until(pilot, lambda: isinstance(app.asking, AskText))
        await pilot.press("enter")
        await until(pilot, lambda: view.settings.count() == 5)
        assert view.settings.file.current.entries[0].distance_m == 69.0
        await pilot.press("s", "E", "q")
        await sees(app, pilot, "not saved")

    drive(app_on(project, screen="blooming"), do)


def test_another_model_has_other_settings(project):
    async def do(app, pilot):
        view = await on_settings(app, pilot)
        await pilot.press("space", *"70", "enter")
        await done(app, "next model")
        await sees(app, pilot, "Settings vertical SMART")
        await sees(app, pilot, "no file: these are the defaults")
        assert view.settings.file.path.name == "Blooming_Calibration_V_SMART.json"
        assert view.unsaved() == 1
        await done(app, "next model")
        await sees(app, pilot, "Settings vertical SLIM *")

    drive(app_on(project, screen="blooming"), do)


def test_a_change_on_the_disk_is_asked_about(project):
    async def do(app, pilot):
        view = await on_settings(app, pilot)
        (project / NAME).write_text(ODD.replace("440", "480"))
        await until(pilot, lambda: isinstance(app.asking, Ask))
        await sees(app, pilot, f"{NAME} has changed on the disk")
        await pilot.press("r")
        await until(pilot, lambda: view.plots.setting() is not None)

    drive(app_on(project, screen="blooming"), do)


def test_settings_with_a_fault_are_said_where_they_would_be_used(project):
    (project / NAME).write_text(ODD.replace("700", "-7"))

    async def do(app, pilot):
        await until(pilot, lambda: app.view.NAME == "blooming")
        await until(pilot, lambda: text_of(app).count("is out of range") == 1)
        await pilot.press("E")
        await until(pilot, lambda: text_of(app).count("is out of range") == 2)
        await pilot.press("5", "enter", "plus", "u", "i", "escape", "D", "ctrl+r", "d", "E", "plus")
        assert blooming(app).file.dirty

    drive(app_on(project, screen="blooming"), do, (160, 50))


def test_edits_of_an_ended_session_are_offered(project):
    shutil.copy(project / NAME, project / "kept")
    session = session_on(project)
    session.set([4], "480")
    crash(session)

    async def do(app, pilot):
        await sees(app, pilot, "an earlier session ended with 1 value")
        await pilot.press("b")
        await until(pilot, lambda: app.view.NAME == "blooming" and app.view.plots.setting() is not None)
        assert (project / NAME).read_bytes() == (project / "kept").read_bytes()

    drive(app_on(project), do)
