"""Rows of a table by keys: added, taken out, moved along X; refused with the neighbours; brought back after a crash."""

import subprocess
import sys

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
        await says(app, pilot, "X = -80 is not between its neighbours, -50 and -33")
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


EDITS = """import os, signal, sys
from pathlib import Path
from lidarcheck.session.edited_lut import EditedLut
file = EditedLut(Path(sys.argv[1]) / "a_lut.ini", Path(sys.argv[1]))
file.insert("vertical", 3)
file.remove("vertical", [0])
file.set_x("vertical", 1, "-90")
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_rows_of_a_killed_process_are_offered_with_their_undo(project):
    lut = project / "a_lut.ini"
    killed = subprocess.run([sys.executable, "-c", EDITS, str(project)], check=False, capture_output=True)
    assert (killed.returncode, killed.stderr) == (-9, b"")
    x = load_lut(lut).tables["vertical"].x.tolist()
    new = -((x[3] * x[4]) ** 0.5)

    async def do(app, pilot):
        await sees(app, pilot, "a_lut.ini: an earlier session ended with 3 rows not saved")
        view = await on_blooming(app, pilot)
        await pilot.press("b")
        await says(app, pilot, "3 rows brought back")
        assert xs(view) == pytest.approx([x[1], -90.0, x[3], new, *x[4:]], rel=1e-5)
        await pilot.press("u")
        assert xs(view) == pytest.approx([*x[1:4], new, *x[4:]], rel=1e-5)
        await pilot.press("u", "u")
        assert view.file.content == LUT.encode()
        assert not view.file.dirty

    drive(app_on(project), do)
    assert lut.read_bytes() == LUT.encode()


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
