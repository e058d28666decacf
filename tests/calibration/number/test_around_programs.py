"""The number of somebody else's program with blooming around it."""

import pytest

import number_kit
from lidarcheck.calibration.number.entry import expected, sample
from lidarcheck.calibration.number.number import judged
from lidarcheck.reading import reading
from number_kit import asked, changed, project
from own_models_kit import FUNCTION, own_model

pytestmark = pytest.mark.usefixtures("trusting")
BLOOM = '\n[materials.2]\nname = "sign"\nreflectance = 0.8\nkind = "retro"\nretro_gain = 1000\n'
BLOOM += '\n[[effects]]\nname = "blooming_vertical"\nlut = "table.ini"\n'


def test_a_program_behind_a_table_has_both_numbers(tmp_path, monkeypatch):
    folder = own_model(FUNCTION, tmp_path)
    sensor = folder / "sensor.toml"
    sensor.write_text(sensor.read_text().replace('direction = "right"', 'direction = "right", common_receiver = true'))
    text = (folder / "model.toml").read_text() + BLOOM
    monkeypatch.setattr(number_kit, "MODEL", text.replace("{", "{{").replace("}", "}}"))
    project(folder, layers=(0, 32), points=(560, 600), own=((14, 18), (574, 584)), at_m=(30.0,))
    first, gap = sample(asked(folder)), sample(asked(folder, "gap"))
    assert list(first.parts) == ["detected", "INTENSITY"]
    assert list(gap.parts) == ["range", "INTENSITY", "detected", "other echoes"]
    assert gap.value < 3.0 * gap.floor + 0.01
    assert expected(asked(folder)) is None
    with reading({str((folder / "table.ini").resolve()): changed(7, 3.0).encode()}):
        assert judged(first, sample(asked(folder))).word == "worse"
