"""What is the same on every screen: undo, redo and save of all open files, each named; one pane on all of it."""

from lidarcheck.formats.lut import load_lut
from tui_kit import LUT, app_on, drive, make_project, misses, on_blooming, says, scaled, sees, text_of, until


def test_edits_of_two_files_are_taken_back_made_again_and_saved_from_other_screens(tmp_path):
    project = make_project(tmp_path / "project")
    lut, toml = project / "a_lut.ini", project / "models/SLIM.toml"
    before = toml.read_bytes()
    after = before + b"# looked at\n"

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        first = scaled(view, 0)
        await pilot.press("f3", "u")
        await says(app, pilot, "nothing to take back")
        await pilot.press("f5", *"512", "enter")
        app.commands.models.open(toml).take(after, "add a remark")
        # The last edit of all comes first, whatever screen and file is seen.
        await pilot.press("f2", "u")
        await says(app, pilot, "taken back: add a remark, in SLIM.toml")
        await pilot.press("f9", "u")
        await says(app, pilot, ", in a_lut.ini")
        assert scaled(view, 0) == first
        assert not app.session.unsaved()
        await pilot.press("S")
        await says(app, pilot, "nothing is edited")
        await pilot.press("f5", "U", "f4", "U")
        await says(app, pilot, "made again: add a remark, in SLIM.toml")
        await pilot.press("d")
        await sees(app, pilot, "Not saved: 2 files")
        await sees(app, pilot, "a_lut.ini: 1 row")
        await sees(app, pilot, "+# looked at")
        await pilot.press("escape", "f6", "S")
        await sees(app, pilot, "Save 2 files?")
        # Somebody else has changed one of them meanwhile: neither is written.
        lut.write_bytes(LUT.replace("our", "his").encode())
        await pilot.press("enter")
        await sees(app, pilot, "a_lut.ini has changed on the disk")
        assert toml.read_bytes() == before
        await pilot.press("k")
        await misses(app, pilot, "has changed on the disk")
        await pilot.press("S", "enter")
        await says(app, pilot, "a_lut.ini: saved, 1 row; SLIM.toml: saved, 1 line")
        assert toml.read_bytes() == after
        assert load_lut(lut).tables["vertical"].rows()[0].scaled == 512

    drive(app_on(project), do)


def test_a_pane_has_the_whole_screen_and_gives_it_back(tmp_path):
    project = make_project(tmp_path / "project")

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        for screen, others in (
            ("f5", ("[u] Curve", "[p] ")),
            ("f2", ("[c] Scenarios", "[h] Edits")),
            ("f3", ("[f] ",)),
        ):
            await pilot.press(screen)
            await sees(app, pilot, others[0])
            before, first = text_of(app), app.focused
            rooms = {pane.id: pane.region for pane in app.view.panes()}
            await pilot.press("z")
            await misses(app, pilot, others[0])
            text = text_of(app)
            assert not any(other in text for other in others)
            # The fixed lines stay, and the pane has all between them.
            assert [text.splitlines()[row] for row in (0, -1)] == [before.splitlines()[row] for row in (0, -1)]
            await until(pilot, lambda first=first: first.size == (80, 20))
            # Another pane that is gone to has the whole screen then.
            await pilot.press("tab")
            await sees(app, pilot, f">[{app.focused.label}]")
            await until(pilot, lambda: app.focused.size == (80, 20))
            await pilot.press("shift+tab", "z")
            await until(
                pilot,
                lambda rooms=rooms: {pane.id: pane.region for pane in app.view.panes()} == rooms,
                lambda: text_of(app),
            )
            await sees(app, pilot, others[-1])
        assert view.zoomed is None

    drive(app_on(project), do)
