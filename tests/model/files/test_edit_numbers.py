"""Numbers of the sensor and the materials in a model file's text: those that change, and not a byte besides."""

import dataclasses
from importlib.resources import files

import pytest

from lidarcheck.effects import make
from lidarcheck.model import load_model
from lidarcheck.model.files.write import write_model

TEXT = """# the bench sensor
variant = "SMART"   # 3 x 9

[materials.1]   # the wall
name = "wall"
reflectance = 0.30  # measured in May
[sensor]
threshold = 9 # as built
pulse_fwhm_ns=5.0

[materials.2]
name = "sign"
reflectance = 0.5
kind = "retro"
retro_gain = 8e2
[[effects]]
name = "dropout"
share = 0.01
"""


def written(text, change, tmp_path):
    source, out = tmp_path / "model.toml", tmp_path / "new.toml"
    source.write_bytes(text.encode())
    model = change(load_model(source))
    result = write_model(source, model, out)
    assert dataclasses.replace(load_model(out), file=None) == dataclasses.replace(model, file=None)
    return out.read_bytes().decode(), result.rewritten


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_numbers_change_where_they_stand(newline, tmp_path):
    text = TEXT.replace("\n", newline)
    new, why = written(text, lambda m: m.with_sensor(threshold=11, pulse_fwhm_ns=5.25), tmp_path)
    assert why == ""
    assert new == text.replace("threshold = 9 #", "threshold = 11 #").replace("fwhm_ns=5.0", "fwhm_ns=5.25")


def test_materials_change_where_they_stand(tmp_path):
    def change(model):
        sign = dataclasses.replace(model.materials[2], retro_gain=900.0)
        wall = dataclasses.replace(model.materials[1], reflectance=0.33)
        return dataclasses.replace(model, materials={1: wall, 2: sign})

    new, why = written(TEXT, change, tmp_path)
    assert why == ""
    assert new == TEXT.replace("= 0.30 ", "= 0.33 ").replace("= 8e2", "= 900.0")


def test_a_number_that_was_not_there_goes_under_its_header(tmp_path):
    new, why = written(TEXT, lambda m: m.with_sensor(signal_at_1m=5000.0), tmp_path)
    assert why == ""
    assert new == TEXT.replace("[sensor]\n", "[sensor]\nsignal_at_1m = 5000.0\n")


@pytest.mark.parametrize(
    "text",
    ['variant = "SLIM"', 'variant = "SLIM"\n', '# top\nvariant = "SLIM" # a\n\n[materials.1]\nreflectance = 0.5\n'],
)
def test_a_sensor_table_is_made_where_there_is_none(text, tmp_path):
    new, why = written(text, lambda m: m.with_sensor(threshold=12), tmp_path)
    assert why == ""
    assert "\n\n[sensor]\nthreshold = 12\n" in new
    assert new.replace("\n[sensor]\nthreshold = 12\n", "", 1).strip() == text.strip()


def test_numbers_and_effects_change_together(tmp_path):
    def change(model):
        return model.with_sensor(threshold=10).with_(make("range_offset", {"offset_m": 0.5}))

    new, why = written(TEXT, change, tmp_path)
    assert why == ""
    assert new.startswith(TEXT.replace("threshold = 9", "threshold = 10"))
    assert new.endswith('name = "range_offset"\noffset_m = 0.5\n')


@pytest.mark.parametrize(
    "text", ['variant = "SMART"\nsensor.threshold = 9\n', 'variant = "SMART"\nsensor = {threshold = 9}\n']
)
def test_another_layout_is_written_anew_and_that_is_said(text, tmp_path):
    _, why = written(text, lambda m: m.with_sensor(pulse_fwhm_ns=6.0, threshold=10), tmp_path)
    assert "plain key" in why or "header" in why


def test_a_sensor_s_file_is_named_anew_where_the_model_is_written_elsewhere(tmp_path):
    (tmp_path / "case").mkdir()
    (tmp_path / "found").mkdir()
    (tmp_path / "case" / "sensor.toml").write_text(files("lidarcheck.sensors").joinpath("SLIM.toml").read_text())
    source, out = tmp_path / "case" / "model.toml", tmp_path / "found" / "model.toml"
    source.write_text('variant = "sensor.toml"  # on the bench\n\n[sensor]\nthreshold = 8  # as fitted\n')
    (tmp_path / "dataset.toml").touch()  # one project
    model = load_model(source).with_sensor(threshold=7)
    result = write_model(source, model, out)
    assert result.rewritten == ""
    assert out.read_text() == source.read_text().replace('"sensor.toml"', '"../case/sensor.toml"').replace("= 8", "= 7")
    assert load_model(out).sensor.threshold == 7
