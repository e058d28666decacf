"""Numbers of somebody else's program are parameters that a fit may turn."""

import pytest

from lidarcheck.calibration.parameters.parameters import free_parameters, known_names, value_of, with_fixed, with_values
from lidarcheck.errors import UsageError
from lidarcheck.explain.report.model_diff import model_diff
from lidarcheck.model import load_model
from lidarcheck.model.files.write import write_model
from waveform_kit import model_text

NUMBER = '[external.parameters."PostPro.Threshold"]\nvalue = 0.05\nlow = 0.01\nhigh = 0.5\nunit = "V"\n'
NAME = "external.PostPro.Threshold"


@pytest.fixture
def model(tmp_path):
    (tmp_path / "model.toml").write_text(model_text(f'reads = ["Share"]\n{NUMBER}'))
    return load_model(tmp_path / "model.toml")


def test_a_number_of_the_program_is_free_between_its_bounds(model):
    assert NAME in known_names(model)
    [free] = free_parameters(model, [NAME])
    assert (free.name, free.unit, free.low, free.high, free.start) == (NAME, "V", 0.01, 0.5, 0.05)
    turned = with_values(model, {NAME: 0.2})
    assert value_of(turned, NAME) == turned.sensor.settings["PostPro.Threshold"] == 0.2
    assert turned.external == model.external, "what is trusted stays while a fit goes on"
    with pytest.raises(UsageError, match=r"out of range; use a number from 0.01 to 0.5 V"):
        with_fixed(model, {NAME: 0.7})


def test_numbers_of_the_detector_are_none(model):
    assert "threshold" not in known_names(model)
    with pytest.raises(UsageError, match=r"there is no parameter 'threshold'"):
        free_parameters(model, ["threshold"])


def test_a_turned_number_is_written_where_it_stands(model, tmp_path):
    turned = with_values(model, {NAME: 0.2})
    assert write_model(tmp_path / "model.toml", turned, tmp_path / "out.toml").rewritten == ""
    expected = (tmp_path / "model.toml").read_text().replace("value = 0.05", "value = 0.2")
    assert (tmp_path / "out.toml").read_text() == expected
    diff = model_diff(model, turned)
    assert [line for line in diff if line[:1] in "+-"] == ["- value = 0.05", "+ value = 0.2"]
