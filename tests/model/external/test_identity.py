"""The built-in model, run as a program by its own command, with effects around it: what it gives with them inside."""

import sys
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.effects import make
from lidarcheck.effects.finding import catalogue
from lidarcheck.model import load_model, simulate
from lidarcheck.scan import IdealScan, Scan
from waveform_kit import MATERIALS

pytestmark = pytest.mark.usefixtures("trusting")

COMMAND = """
from lidarcheck.cli.core.entry import main
import sys
sys.exit(main(["simulate", sys.argv[1], "--model", "inner.toml", "--out", sys.argv[2], "--seed", sys.argv[3], "-q"]))
"""
SETTINGS = {
    "retro_ghost": {"strength": 0.02, "exponent": 0.0, "extra_m": 0.0},
    "blooming_vertical": {"bright_signal": 3.0, "strength": 0.05},
    "blooming_horizontal": {"bright_signal": 3.0, "strength": 0.05},
    "material_reflectance": {"material_id": 2},
    "blockage": {},
    "mirror_multipath": {"material_id": 1, "reflectivity": 0.5},
}
EXACT = {"signal_gain", "material_reflectance", "incidence_falloff", "retro_ghost", "interference"}
"""What changes light alone, of each beam by itself: the draws are the same, and so are the echoes."""


def scene() -> IdealScan:
    """Two walls, a sign, and a floor that rises to them."""
    layer, point = (a.ravel() for a in np.meshgrid(240 + np.arange(40), 460 + np.arange(40), indexing="ij"))
    wall_m = np.where(point < 480, 18.0, 31.0)
    floor = layer < 250
    sign = (np.abs(layer - 265) < 2) & (np.abs(point - 470) < 3)
    return IdealScan(
        layer=layer.astype(np.int32),
        point=point.astype(np.int32),
        distance_m=np.where(floor, 12.0 + 0.3 * (layer - 240), wall_m),
        material_id=np.where(sign, 3, np.where(floor, 1, 2)).astype(np.int32),
        incidence_deg=np.where(floor, 60.0, 5.0),
    )


@pytest.fixture
def pair(tmp_path: Path):
    """(the built-in model, the same as a program)."""
    (tmp_path / "inner.toml").write_text(f'variant = "SMART"\n{MATERIALS}')
    (tmp_path / "run.py").write_text(COMMAND)
    command = [sys.executable, "run.py", "{ideal}", "{scan}", "{seed}"]
    reads = 'reads = ["Share", "Reflectance", "Seed"]\nscatter_material = 9\n'
    table = f'variant = "SMART"\n[external]\ncommand = {command}\n{reads}'.replace("'", '"')
    (tmp_path / "around.toml").write_text(f"{table}\n{MATERIALS}")
    return load_model(tmp_path / "inner.toml"), load_model(tmp_path / "around.toml")


def same(one: Scan, other: Scan) -> float:
    """The part of the echoes of one scan that the other has to the last digit."""
    columns = [(s.layer, s.point, s.area, s.peak, np.round(s.range_m, 3)) for s in (one, other)]
    rows = [{*zip(*(column.tolist() for column in part), strict=True)} for part in columns]
    return len(rows[0] & rows[1]) / max(len(rows[0] | rows[1]), 1)


def numbers(scan: Scan) -> dict[str, float]:
    """What a user would look at."""
    first = scan.echo_number == 1
    return {
        "echoes": float(len(scan)),
        "detected": float(np.count_nonzero(first)),
        "area": float(scan.area[first].mean()),
        "range": float(scan.range_m[first].mean()),
    }


def check(pair, name: str) -> None:
    built_in, program = pair
    effect = make(name, SETTINGS.get(name, {}))
    ideal = scene()
    inside, around = (simulate(ideal, model.with_(effect), seed=4) for model in (built_in, program))
    if name in EXACT:
        assert same(inside, around) > 0.995, name
    one, other = numbers(inside), numbers(around)
    for key, value in one.items():
        assert other[key] == pytest.approx(value, rel=0.03), (name, key)


def test_nothing_around_it_gives_its_own_bytes(pair):
    built_in, program = pair
    assert same(simulate(scene(), built_in, seed=4), simulate(scene(), program, seed=4)) == 1.0


@pytest.mark.parametrize("name", ["signal_gain", "retro_ghost", "range_offset"])
def test_an_effect_around_it_is_the_effect_inside(pair, name):
    check(pair, name)


@pytest.mark.long
def test_every_effect_of_light_around_it_is_the_effect_inside(pair):
    """But those that need a background that a program reads; and of `fog` and `rain` what rows can say of air."""
    program = pair[1].sensor
    able = [name for name, kind in catalogue().items() if kind.stage in ("aim", "light") and not kind.why_not(program)]
    assert len(able) >= 12
    for name in able:
        check(pair, name)
