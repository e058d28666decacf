"""Blooming tables that a model file names: found, saved, and refused with a reason."""

from pathlib import Path

import pytest

from lidarcheck.effects import make
from lidarcheck.effects.base import Curve
from lidarcheck.errors import ConfigError, LidarcheckError
from lidarcheck.model import load_model, save_model
from lidarcheck.model.stages import light_after_effects
from light_kit import added, cross, own, signal

MODEL = """\
variant = "SLIM"
[materials.2]
name = "sign"
reflectance = 0.8
kind = "retro"
retro_gain = 1000
[[effects]]
name = "blooming_vertical"
lut = "luts/v.ini"
strength = 2.0
"""
INI = "PostPro.LUT_blooming_X = -6, 0, 6, 6\nPostPro.LUT_blooming_Y = 0.01, 1, 0.02, 0.001\n"
FLAT = INI.replace("blooming_", "bloomingH_")


def saved(tmp_path: Path, ini: str | None) -> Path:
    (tmp_path / "luts").mkdir()
    if ini is not None:
        (tmp_path / "luts/v.ini").write_text(ini)
    (tmp_path / "m.toml").write_text(MODEL)
    return tmp_path / "m.toml"


def test_a_model_names_its_table_by_a_relative_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path, INI)
    monkeypatch.chdir("/")
    read = load_model(path)
    assert read.effects[0].lut == Curve((-6.0, 0.0, 6.0, 6.0), (0.01, 1.0, 0.02, 0.001), str(tmp_path / "luts/v.ini"))
    ideal = cross((260, 480, 30.0))
    new = added(light_after_effects(ideal, read)[0], own(ideal))
    assert {beam: p[0][1] / signal(30.0) for beam, p in new.items()} == pytest.approx(
        {(258, 480): 0.02, (259, 480): 1.01, (261, 480): 1.02, (262, 480): 0.002}
    )


def test_a_saved_model_finds_its_table_from_another_directory(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()  # one project
    read = load_model(saved(tmp_path, INI))
    (tmp_path / "deep/er").mkdir(parents=True)
    save_model(read, tmp_path / "deep/er/copy.toml")
    assert 'lut = "../../luts/v.ini"' in (tmp_path / "deep/er/copy.toml").read_text()
    again = load_model(tmp_path / "deep/er/copy.toml")
    assert (again.effects[0].lut.x, again.effects[0].lut.y) == (read.effects[0].lut.x, read.effects[0].lut.y)
    assert again.effects[0].settings() | {"lut": ""} == read.effects[0].settings() | {"lut": ""}


@pytest.mark.parametrize(
    ("ini", "message"),
    [
        (None, "luts/v.ini: there is no such file"),
        (FLAT, "luts/v.ini: the file has no vertical table; lut needs one: add it"),
        (INI.replace("0.02", "2"), "luts/v.ini:2: number 3 of PostPro.LUT_blooming_Y is 2, out of range"),
        (INI.replace("-6", "9"), "luts/v.ini:1: number 2 of PostPro.LUT_blooming_X is 0, below 9 before it"),
        ("", "luts/v.ini: the file is empty"),
    ],
)
def test_a_table_that_is_missing_or_wrong_is_refused(tmp_path: Path, ini: str | None, message: str) -> None:
    with pytest.raises(LidarcheckError) as caught:
        load_model(saved(tmp_path, ini))
    assert isinstance(caught.value, ConfigError)
    (line,) = caught.value.lines()
    assert message in line


def test_a_table_that_is_no_file_is_refused() -> None:
    with pytest.raises(LidarcheckError, match="blooming_vertical: lut = 3 is no file"):
        make("blooming_vertical", {"lut": 3})
