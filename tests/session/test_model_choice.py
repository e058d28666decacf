"""Which sensor a project's scans are of, by its models."""

from pathlib import Path

from lidarcheck.session.model_choice import (
    features_of_models,
    free_models,
    models_of_sensor,
    other_sensors,
    sensor_of_models,
)
from lidarcheck.session.project import read_project

MODEL = 'variant = "{}"\n[materials.1]\nname = "panel"\nreflectance = 0.5\n'


def project(root: Path, **variants: str):
    for name, variant in variants.items():
        (root / f"{name}.toml").write_text(MODEL.format(variant))
    return read_project(root)


def test_the_sensor_that_all_models_are_of(tmp_path):
    found = project(tmp_path, a="XT32", b="XT32")
    models = models_of_sensor(found, "", tmp_path)
    assert len(models) == 2
    assert sensor_of_models(models).name == "PandarXT-32"
    assert other_sensors(found) == ["PandarXT-32"]


def test_the_model_that_is_meant_decides_between_several(tmp_path):
    found = project(tmp_path, a="XT32", b="VLP-16")
    assert sensor_of_models(models_of_sensor(found, "", tmp_path)) is None
    assert sensor_of_models(models_of_sensor(found, "b.toml", tmp_path)).variant == "VLP-16"


def test_built_in_sensors_are_told_by_their_scans(tmp_path):
    found = project(tmp_path, a="SMART", b="SLIM")
    assert sensor_of_models(models_of_sensor(found, "a.toml", tmp_path)) is None
    assert other_sensors(found) == []


def test_the_features_to_look_at_are_those_of_the_sensors(tmp_path):
    found = project(tmp_path, a="SLIM", b="OS1-128", c="TMF8820").of("model")
    assert features_of_models(found[:1]) == ("AREA", "PEAK", "WIDTH", "range")
    assert features_of_models(found[1:2]) == ("REFLECTIVITY", "range")
    assert features_of_models(found[2:]) == ("CONFIDENCE", "range")
    assert features_of_models(found) == ("AREA", "PEAK", "WIDTH", "REFLECTIVITY", "CONFIDENCE", "range")
    assert features_of_models([]) == ()


def test_a_cases_own_model_is_meant_for_the_case_alone(tmp_path):
    (tmp_path / "case").mkdir()
    (tmp_path / "case/case.toml").write_text('model = "model.toml"\n[[frames]]\nideal = "i"\nmeasured = "m"\n')
    (tmp_path / "case/model.toml").write_text(MODEL.format("SLIM"))
    found = project(tmp_path, a="SLIM")
    assert [one.name for one in free_models(found, tmp_path)] == ["a.toml"]
    assert [one.name for one in free_models(found, tmp_path / "case")] == ["a.toml", "case/model.toml"]
