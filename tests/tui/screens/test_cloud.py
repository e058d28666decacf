"""Cloud, driven by keys on a small bench: both sides as points, one zoom and cursor, merged and written."""

import numpy as np
import pytest

from bench_kit import make_bench
from lidarcheck.calibration.scenes.slices import slices_of
from lidarcheck.cli import main
from lidarcheck.formats.recognise import read_table
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.screens.cloud.density import SIDES, classes, counts, fitted
from lidarcheck.tui.screens.cloud.screen import Cloud
from lidarcheck.tui.widgets.lines import Lines
from tui_kit import drive, says, sees, until

CAR = "car_16m_SMART_real.pcd"


@pytest.fixture
def bench(tmp_path):
    root = make_bench(tmp_path / "bench")
    (root / "scenes/real_street.pcd").rename(root / "scenes/SMART_real_street.pcd")
    return root


def cloud(project, do, size=(80, 24)):
    async def on_it(app, pilot):
        await until(pilot, lambda: isinstance(app.view, Cloud) and app.view.listed)
        await do(app, pilot, app.view)

    drive(LidarcheckApp(project, screen="cloud"), on_it, size)


async def at_measurement(pilot, view, name):
    """Go on with n until a measurement is seen and its points are known."""
    for _ in view.listed:
        if view.job.name == name:
            break
        await pilot.press("n")
    assert view.job.name == name
    await until(pilot, lambda: view.clouds is not None and view.running is None, lambda: view.fault_of(view.cloud))


def shown(view, pane):
    return view.query_one(f"#{pane}", Lines).text


def test_both_sides_have_one_zoom_and_one_cursor_and_are_written_as_one_cloud(bench):
    async def do(app, pilot, view):
        # The points come by themselves.
        await at_measurement(pilot, view, CAR)
        sides = view.clouds.at.clouds
        await sees(app, pilot, f"Real {len(sides[0])}, from above")
        await sees(app, pilot, f"Simulated {len(sides[1])}, from above")
        assert view.clouds.simulated is not None
        first = shown(view, "real"), shown(view, "simulated")
        assert "x[m]" in first[0]
        assert [row[:6] for row in first[0].splitlines()] == [row[:6] for row in first[1].splitlines()]
        # What the readout says of a cell are the echoes that lie in it.
        await pilot.press("down", "down", "right")
        seen = view._seen(view.clouds, view.view_now, view.query_one("#real", Lines))[1]
        column, row = view.lens.cursor(view.measured, view.view_now, seen)
        left, _, _, top = seen.window.edges(seen.size)
        inside = [
            int(np.sum(
                (np.floor((xyz[:, 0] - left) / seen.window.column_m) == column)
                & (np.floor((top - xyz[:, 1]) / seen.window.column_m / 2) == row)
            ))
            for xyz in sides
        ]  # fmt: skip
        assert f"real {inside[0]}, simulated {inside[1]} echoes" in shown(view, "where")
        await pilot.press("enter")
        await says(app, pilot, "real: layer " if inside[0] else "real: none")
        # Zoom keeps the place under the cursor; 0 shows all again.
        at = view.lens.cursor_m(view.measured, view.view_now)
        await pilot.press("plus", "plus")
        zoomed = view._seen(view.clouds, view.view_now, view.query_one("#real", Lines))[1]
        assert zoomed.window.column_m == pytest.approx(seen.window.column_m / 4)
        assert zoomed.window.cell(at, zoomed.size) == (column, row)
        await pilot.press("0", *["up"] * 40)
        assert view._seen(view.clouds, view.view_now, view.query_one("#real", Lines))[1].window != seen.window
        await pilot.press("0")
        await pilot.press("b")
        await sees(app, pilot, f"Both {len(sides[0])}, from above")
        await sees(app, pilot, "# real  o simulated  % both")
        await pilot.press("b", "v", "v", "v")
        await sees(app, pilot, f"Both {len(sides[0])}, merged, from above, Y -3")
        await pilot.press("left_curly_bracket", "right_square_bracket")
        await says(app, pilot, "X 0.25 m, Y -3.25 m (suggested 0 and -3)")
        await sees(app, pilot, "w writes car_SMART_16m_merged.pcd")
        await pilot.press("w")
        await sees(app, pilot, "Write both vehicles")
        await pilot.press("enter")
        await says(app, pilot, "Simulated is 0 for the")
        await pilot.press("n")
        assert view.job.name != CAR

    cloud(bench, do)
    names = [str(bench / f"car_16m_SMART_{side}.pcd") for side in ("real", "sim")]
    ideal = str(bench / "ideal_car_16m.parquet")
    offset = ("--x", "0.25", "--y", "-3.25", "--ideal", ideal)
    assert main(["vehicles", "merge", *names, "--vehicle", "car", "--out", str(bench / "m.pcd"), *offset]) == 0
    by_key, by_command = (read_table(bench / name).columns for name in ("car_SMART_16m_merged.pcd", "m.pcd"))
    assert list(by_key) == list(by_command)
    for name, column in by_command.items():
        np.testing.assert_array_equal(by_key[name], column)


def test_frames_without_a_partner_a_vehicle_or_a_sound_file_say_why(bench):
    (bench / "lonely_real.pcd").write_bytes((bench / CAR).read_bytes())

    async def do(app, pilot, view):
        # A measurement without anything beside it is seen alone.
        await at_measurement(pilot, view, "lonely_real.pcd")
        await sees(app, pilot, ", frame from")
        await sees(app, pilot, "none: no ideal scan is")
        await pilot.press("w")
        await says(app, pilot, "there is nothing to merge with: no ideal scan is named like it")
        # A frame without a vehicle.
        await at_measurement(pilot, view, "scenes/SMART_real_street.pcd")
        await sees(app, pilot, "no vehicle is named by the file")
        # Two views below each other where there is room.
        await pilot.resize_terminal(120, 36)
        await sees(app, pilot, ", frame from behind")
        await pilot.press("w")
        await sees(app, pilot, "SMART_real_street_merged.pcd")
        await pilot.press("enter")
        await says(app, pilot, "Simulated is 0 for the")
        faults = [job.name for job in view.listed if "empty" in job.name]
        while view.job.name != faults[0]:
            await pilot.press("n")
        await sees(app, pilot, "the file is empty")
        await pilot.press("v", "v", "v")
        await sees(app, pilot, "cannot")
        assert app.focused is view.query_one("#jobs")
        for size in ((1, 1), (5, 3), (40, 10), (200, 60), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.press("v", "right", "plus", "b", "down", "n")

    cloud(bench, do)
    table = read_table(bench / "SMART_real_street_merged.pcd").columns
    real = read_table(bench / "scenes/SMART_real_street.pcd").columns
    assert np.count_nonzero(table["Simulated"] == 0) == len(real["X"])
    np.testing.assert_allclose(table["X"][: len(real["X"])], real["X"], rtol=1e-6)


def test_points_are_counted_in_the_cells_where_they_are():
    draw = np.random.default_rng(5)
    xyz = draw.normal(size=(4000, 3)) * (3.0, 1.0, 0.5) + (20.0, -2.0, 1.0)
    for side in SIDES.values():
        places = side.places(xyz)
        window = fitted(places, (30, 10))
        count = counts(places, window, (30, 10))
        assert count.sum() == 4000
        place = places[17]
        column, row = window.cell((place[0], place[1]), (30, 10))
        assert count[row, column] >= 1
        left, right, bottom, top = window.zoomed((place[0], place[1]), 8.0).edges((30, 10))
        inside = (places >= (left, bottom)).all(axis=1) & (places < (right, top)).all(axis=1)
        assert counts(places, window.zoomed((place[0], place[1]), 8.0), (30, 10)).sum() == pytest.approx(
            inside.sum(), abs=1
        )
    assert SIDES["behind"].places(np.array([[1.0, 2.0, 3.0]])).tolist() == [[-2.0, 3.0]]
    assert classes(np.array([0, 1, 3, 1])) == (2, 5)
    low, high = classes(np.arange(1000))
    assert 2 < low < high


def test_slices_name_where_echoes_are_lacking():
    draw = np.random.default_rng(6)
    real = draw.uniform(0.0, 1.0, size=(8000, 3))
    simulated = draw.uniform(0.0, 1.0, size=(8000, 3))
    assert max(one.off_sd for one in slices_of(real, simulated)) < 4.0
    lacking = simulated[(simulated[:, 2] < 0.5) | (simulated[:, 2] > 0.6)]
    first = slices_of(real, lacking)[0]
    assert first.axis == "Z"
    assert 0.4 < first.low_m < 0.6
    assert first.real > first.simulated
    assert first.words().startswith("Z 0.")
    assert slices_of(np.zeros((0, 3)), np.zeros((0, 3))) == []
