"""Blooming with a sensor that is no SPAD array: works, or says why not."""

import numpy as np

from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.model import load_model, simulate
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import shipped
from tui_kit import app_on, drive, says, sees, text_of, until

MATERIALS = """
[materials.1]
name = "wall"
reflectance = 0.5
[materials.2]
name = "sign"
reflectance = 0.8
kind = "retro"
retro_gain = 900.0
"""
LUT = "PostPro.LUT_bloomingH_X = -20, -6, 0, 6, 20\nPostPro.LUT_bloomingH_Y = 0.0001, 0.01, 1, 0.01, 0.0001\n"
EFFECT = '\n[[effects]]\nname = "blooming_horizontal"\nlut = "h_lut.ini"\n'


def bench(root):
    """An XT32 before a sign and a wall far behind it, and a wall alone."""
    sensor = shipped("XT32")
    layer, point = (np.ravel(a).astype(np.int32) for a in np.mgrid[8:24, 440:561])
    sign = (np.abs(point - 500) <= 2) & (np.abs(layer - 15) <= 1)
    (root / "h_lut.ini").write_text(LUT)
    (root / "model.toml").write_text(f'variant = "XT32"\n{MATERIALS}{EFFECT}')
    model = load_model(root / "model.toml")
    for name, target in (("sign_25m", sign), ("wall_60m", np.zeros_like(sign))):
        where, what = np.where(target, 25.0, 60.0), np.where(target, 2, 1)
        ideal = IdealScan(layer, point, where, what, np.zeros(len(layer)), beams=sensor.beams)
        save_ideal(ideal, root / f"ideal_{name}.parquet")
        save_scan(simulate(ideal, model, seed=1), root / f"{name}.parquet", sensor)
    return root


def test_a_sensor_without_spads_shows_its_own_features(tmp_path):
    async def do(app, pilot):
        await until(pilot, lambda: app.view.NAME == "blooming")
        assert app.choice.features == ("INTENSITY", "range")
        plots = app.view.plots
        await until(pilot, lambda: plots.expected is not None, lambda: text_of(app))
        await sees(app, pilot, "25.0 m, 1/2 mean INTENSITY")
        before = plots.expected.features["INTENSITY"]
        await pilot.press("9", "0", "0", "enter")
        await until(pilot, lambda: plots.expected is not None, lambda: text_of(app))
        assert not np.array_equal(plots.expected.features["INTENSITY"], before)
        await pilot.press("f")
        await sees(app, pilot, "1/2 range [m]")
        await pilot.press("f", "n")
        await sees(app, pilot, "no beam of the ideal scan meets a retro-reflector")
        await pilot.press("F")
        await says(app, pilot, "has the detector linear; blooming is fitted to the PEAK, AREA")

    drive(app_on(bench(tmp_path), screen="blooming"), do, size=(140, 40))


def test_a_command_does_not_read_a_table_without_its_edits(tmp_path):
    async def do(app, pilot):
        await until(pilot, lambda: app.view.NAME == "blooming" and app.view.file is not None)
        await pilot.press("9", "0", "0", "enter")
        await app.run_action("form('simulate')")
        await sees(app, pilot, "lidarcheck simulate")
        await pilot.press("end", "enter")
        await says(app, pilot, "h_lut.ini has edits that are not saved")
        assert not app.commands.runs.running

    drive(app_on(bench(tmp_path), screen="blooming"), do, size=(140, 40))
