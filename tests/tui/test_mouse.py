"""The mouse presses keys of what is under it: a row, a cell, a tab, an entry of the last line, a part of the second."""

import pytest
from textual import events

from lidarcheck.tui.chooser import Chooser
from lidarcheck.tui.palette import Menu
from lidarcheck.tui.widgets.dialogs import Ask
from tui_kit import app_on, drive, make_project, on_blooming, says, sees, text_of, until

RIGHT = 3


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "project")


def place(app, text, row=None):
    """(column, row) of where a text begins on the screen; with `row` in that row."""
    lines = text_of(app).split("\n")
    y = row if row is not None else next(number for number, one in enumerate(lines) if text in one)
    return lines[y].index(text), y


def wheel(app, at, down):
    kind = events.MouseScrollDown if down else events.MouseScrollUp
    x, y = at
    app.post_message(kind(None, x, y, 0, 1 if down else -1, 0, False, False, False, screen_x=x, screen_y=y))


def test_what_can_be_clicked(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("f2")
        await pilot.click(offset=place(app, "F5 Bloom"))
        await until(pilot, lambda: app.view is view)
        # A row, and its cells.
        await pilot.click(offset=place(app, "-33"))
        await until(pilot, lambda: view.at == 4 and view.editor.on_x)
        await pilot.click(offset=(place(app, "-80")[0] + 7, place(app, "-80")[1]))
        await until(pilot, lambda: view.at == 2 and not view.editor.on_x)
        await pilot.click(offset=place(app, "-80"), times=2)
        await says(app, pilot, view.editor.TYPED)
        # The wheel goes as the arrows do; on the second line to the next distance.
        wheel(app, place(app, "-80"), True)
        await until(pilot, lambda: view.at == 5)
        wheel(app, place(app, "-80"), False)
        await until(pilot, lambda: view.at == 2)
        before = view.selection.current.name
        wheel(app, (2, 1), True)
        await until(pilot, lambda: view.selection.current.name != before)
        wheel(app, (2, 1), False)
        await until(pilot, lambda: view.selection.current.name == before)
        # Another pane, and what is at the left button's place of the menu.
        await pilot.click(offset=place(app, "[u]"))
        assert app.focused.id == "curve"
        await pilot.click(offset=place(app, "-20"), button=RIGHT)
        await until(pilot, lambda: isinstance(app.asking, Menu))
        await sees(app, pilot, "smooth the marked rows")
        assert view.at == 5
        assert app.focused.id == "table"
        await pilot.click(offset=place(app, "add "))
        await until(pilot, lambda: view.unsaved() == 1 and app.asking is None)
        # Beside the box it is left, and what lies there is not pressed.
        await pilot.press("m")
        await pilot.click(offset=place(app, "F2 Overview"))
        await until(pilot, lambda: app.asking is None)
        await pilot.pause()
        assert app.view is view
        # The last line.
        await pilot.click(offset=place(app, "u Undo", 23))
        await until(pilot, lambda: view.unsaved() == 0)
        await pilot.click(offset=place(app, "? Help", 23))
        await until(pilot, lambda: isinstance(app.asking, Ask))
        wheel(app, place(app, "Help: "), True)
        await until(pilot, lambda: app.asking.top == 1)
        await pilot.press("ctrl+g")
        # The second line: its parts open the chooser of their kind.
        for text, typed in (("a_lut.ini", "%"), ("69 m", "@")):
            await pilot.click(offset=place(app, text, 1))
            await until(pilot, lambda: isinstance(app.asking, Chooser))
            assert app.asking.typed.text == typed
            await pilot.press("escape")
        # A drag is no click.
        row = view.at
        await pilot.mouse_down(offset=place(app, "-80"))
        await pilot.mouse_up(offset=place(app, "-50"))
        await pilot.pause()
        assert view.at == row

    drive(app_on(project), do)


def test_letters_of_a_list_that_folds_are_found(project):
    async def do(app, pilot):
        await sees(app, pilot, "scenarios,")
        for number in range(30):
            app.say(f"line {number} " + "of many words " * 8)
        await pilot.press("L")
        await sees(app, pilot, "line 29")
        log = app.bars.log
        await until(pilot, lambda: log.size.height > 2)
        assert log.line_at(log.region.y) is None
        assert "line 29" in log.lines[log.line_at(log.region.bottom - 1)][0][0]
        wheel(app, (3, log.region.y + 2), False)
        await until(pilot, lambda: "line 29" not in text_of(app).split("\n")[log.region.bottom - 1])

    drive(app_on(project), do)
