"""Rows of a table by keys: added, taken out, moved along X; refused with the neighbours; brought back after a crash."""

import pytest

from lidarcheck.formats.lut import load_lut
from lidarcheck.tui.widgets.dialogs import Ask
from tui_kit import LUT, app_on, drive, make_project, on_blooming, says, sees, status, text_of, until

ROW = 3


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "project")


def xs(view):
    return view.file.current.tables["vertical"].x.tolist()


def test_rows_are_added_moved_and_taken_out_by_keys(project):
    lut = project / "a_lut.ini"

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        x = xs(view)
        await pilot.press("home", *["down"] * ROW, "i")
        assert len(xs(view)) == len(x) + 1
        assert view.at == ROW + 1  # on the new row
        await sees(app, pilot, "~")
        await pilot.press("left", "minus", *"40", "enter")
        assert xs(view)[ROW + 1] == -40.0
        await sees(app, pilot, "-40_")
        await pilot.press("right", *"512", "enter")
        assert view.file.current.tables["vertical"].rows()[ROW + 1].scaled == 512
        # A bad X names both neighbours, and changes nothing.
        await pilot.press("left", "minus", *"80", "enter")
        await says(app, pilot, "X = -80 does not lie between its neighbours, -50 before it and -33 after it")
        assert "from -50 to -33" in status(app)
        assert xs(view)[ROW + 1] == -40.0
        await pilot.press("plus")
        await says(app, pilot, "X is typed")
        await pilot.press("d")
        await sees(app, pilot, "Not saved: 1 row")
        await pilot.press("escape", "S")
        await until(pilot, lambda: isinstance(app.asking, Ask))
        await pilot.press("enter")
        await says(app, pilot, "saved, 1 row")
        y = load_lut(lut).text("vertical", ROW + 1)
        cells = ", ".join(["0.0001000"] * (ROW + 1))
        assert lut.read_bytes() == (
            LUT.replace("-50, -33", "-50, -40, -33").replace(f"= {cells},", f"= {cells}, {y},", 1).encode()
        )
        await pilot.press("D")
        assert xs(view) == x
        await pilot.press("S", "enter")
        await until(pilot, lambda: lut.read_bytes() == LUT.encode(), lambda: status(app))
        await pilot.press("home", "space", "down", "space", "D")
        assert xs(view) == x[2:]
        await pilot.press("u")
        assert xs(view) == x

    drive(app_on(project), do)


def test_rows_of_settings_are_distances(project):
    async def do(app, pilot):
        await on_blooming(app, pilot)
        await pilot.press("E", "i")
        await says(app, pilot, "A adds a distance")
        await pilot.press("D")
        await says(app, pilot, "X takes out a distance")

    drive(app_on(project), do)


def test_what_is_kept_is_shown_as_a_difference_and_saved(project):
    lut = project / "a_lut.ini"

    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        shown = view.file.content
        lut.write_bytes(load_lut(lut).with_scaled("vertical", 5, 700).content)
        await sees(app, pilot, "has changed on the disk")
        await pilot.press("k")
        await says(app, pilot, "kept as it is shown; ^S shows how the file differs")
        await until(pilot, lambda: view.file.dirty)
        await pilot.press("S")
        await sees(app, pilot, "Save 1 row to a_lut.ini?")
        await sees(app, pilot, "700")
        await pilot.press("enter")
        await until(pilot, lambda: lut.read_bytes() == shown, lambda: text_of(app))

    drive(app_on(project), do)
