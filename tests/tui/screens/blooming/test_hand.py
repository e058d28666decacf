"""The hand in the plots of Blooming: from the curve to its row, a point that is dragged, the beams of a profile."""

from textual.events import MouseDown, MouseMove, MouseUp

from tui_kit import LUT, app_on, drive, make_project, on_blooming, says, scaled, until

ROW = 3


def test_the_curve_leads_to_its_row_and_a_dragged_point_is_one_edit(tmp_path):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        curve = view.curve_pane()
        await until(pilot, lambda: curve.drawn is not None)
        curve.focus()
        row = view.file.current.tables["vertical"].rows()[ROW]
        curve.look.cursor = row.x
        await pilot.press("enter")
        await says(app, pilot, f"row {ROW + 1}: X = {row.x:g}")
        assert view.table.at == ROW
        # Over another row than the one under the cursor.
        x, y = curve.drawn.axes
        row = view.file.current.tables["vertical"].rows()[ROW + 1]
        column, line = x.cell(row.x), y.cells - 1 - y.cell(row.y)
        place = [curve.drawn.left + column, 1 + line]
        for event, up in ((MouseDown, 0), (MouseMove, 1), (MouseMove, 2)):
            await pilot._post_mouse_events([event], curve, (place[0], place[1] - up), button=1)
        await says(app, pilot, f"row {ROW + 2} X {row.x:g}: {row.scaled} to ")
        assert not view.file.dirty
        await until(pilot, lambda: any(trace.name == "wanted" for trace in curve.chart.traces))
        await pilot._post_mouse_events([MouseUp], curve, (place[0], place[1] - 2), button=1)
        await until(pilot, lambda: view.file.dirty)
        assert scaled(view, ROW + 1) > row.scaled
        assert [change.row for change in view.file.diff()] == [ROW + 1]
        assert not any(trace.name == "wanted" for trace in curve.chart.traces)
        await pilot.press("u")
        await until(pilot, lambda: view.file.current.content == LUT.encode())
        # A point of the profile says which beams it stands for.
        profile = view.tile_panes()[0]
        await until(pilot, lambda: profile.chart is not None)
        profile.focus()
        await pilot.press("right", "enter")
        await says(app, pilot, "echoes")

    drive(app_on(make_project(tmp_path / "bench")), do)
