"""A scan of one variant with the other's model: refused alike by every command that takes both."""

from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli.core.entry import main
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.scan import IdealScan, Scan

LAYER, POINT = (
    a.ravel().astype(np.int32) for a in np.meshgrid(np.arange(240, 280), np.arange(400, 560), indexing="ij")
)
DISTANCE = np.where((abs(LAYER - 260) < 14) & (abs(POINT - 480) < 10), 25.0, 40.0)
SATURATES = {"SMART": 135, "SLIM": 236}
MODEL = (
    'variant = "{}"\n[materials.1]\nname = "wall"\nreflectance = 0.5\n'
    '[materials.2]\nname = "sign"\nreflectance = 0.5\nkind = "retro"\nretro_gain = 1000.0\n'
)
CASE = 'model = "model.toml"\n' + "".join(
    f'[[frames]]\nideal = "ideal.parquet"\nmeasured = "real{t}.parquet"\ntime = {t}.0\n' for t in range(3)
)
COMMANDS = {
    "compare": "compare real.parquet sim.parquet --ideal ideal.parquet --model model.toml",
    "panels": "panels real.parquet --ideal ideal.parquet --model model.toml --out found",
    "panels, simulated": "panels real.parquet --ideal ideal.parquet --simulated other.parquet --out found",
    "compare, no model": "compare real.parquet other.parquet",
    "ghosts": "ghosts find real.parquet --model model.toml --out found",
    "bloom": "bloom fit real.parquet --model model.toml --lut lut.ini --axis vertical --out found",
    "scenes": "scenes compare real.parquet --ideal ideal.parquet --model model.toml --out found",
    "vehicles": "vehicles compare real.parquet --vehicle car --ideal ideal.parquet --model model.toml --out found",
    "calibrate": "calibrate case --free signal_gain.gain --out found",
    "explain": "explain case --out found",
}


def scan_of(variant: str, seed: int = 3) -> Scan:
    """A wall and a sign at which the sensor saturates, as bright as that variant shows it."""
    g = np.random.default_rng(seed)
    top = SATURATES[variant]
    peak = np.where(DISTANCE < 30.0, top, g.integers(20, top - 20, len(LAYER)))
    range_m = np.where(DISTANCE < 30.0, DISTANCE - 0.3, DISTANCE)
    return Scan.from_beams(
        LAYER, POINT, range_m, echo_number=np.ones(len(LAYER), dtype=np.int32), width_ns=np.full(len(LAYER), 12.0),
        area=9.0 * peak, peak=peak.astype(np.float64),
    )  # fmt: skip


@pytest.mark.parametrize("measured", SATURATES)
@pytest.mark.parametrize("command", COMMANDS)
def test_the_other_variants_model_is_refused(command, measured, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    other = "SLIM" if measured == "SMART" else "SMART"
    ideal = IdealScan(LAYER, POINT, DISTANCE, np.where(DISTANCE < 30.0, 2, 1), np.zeros(len(LAYER)))
    Path("case").mkdir()
    for place in (Path(), Path("case")):
        save_ideal(ideal, place / "ideal.parquet")
        (place / "model.toml").write_text(MODEL.format(other))
    for t in range(3):
        save_scan(scan_of(measured, t), Path(f"case/real{t}.parquet"))
    save_scan(scan_of(measured), Path("real.parquet"))
    save_scan(scan_of(measured), Path("sim.parquet"))
    save_scan(scan_of(other), Path("other.parquet"))
    Path("case/case.toml").write_text(CASE)
    Path("lut.ini").write_text("PostPro.LUT_blooming_X = -9,-6,-3,0,3,6,9\nPostPro.LUT_blooming_Y = 0,0,0,1,0,0,0\n")
    assert main([*COMMANDS[command].split(), "-q"]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    assert "saturate" in error
    assert measured in error
    assert other in error or "real.parquet" in error
    assert not Path("found").exists()
