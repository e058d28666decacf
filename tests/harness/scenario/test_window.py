"""The window of KPIs that name none: half a pulse; and goldens of the version in which it was 0.5 m."""

import shutil
from pathlib import Path

import pytest

from lidarcheck.harness.check import check
from lidarcheck.harness.review.accept import accept
from lidarcheck.harness.review.review import review
from lidarcheck.harness.scenario.scenario import load_scenario
from scenario_texts import wall_scenario

KPI = '\n[[kpis]]\nkpi = "{kind}"\ntolerance = {tolerance}\n{more}'


def scenario(
    directory: Path,
    model: str,
    *,
    kind: str = "detection_probability",
    more: str = "",
    near: float = 20.0,
    tolerance: float = 0.002,
) -> Path:
    (directory / "models").mkdir(exist_ok=True)
    (directory / "models/model.toml").write_text(model)
    file = directory / "wall.toml"
    wall = wall_scenario((250, 254), (470, 489), near, "models/model.toml")
    file.write_text(wall + KPI.format(kind=kind, tolerance=tolerance, more=more))
    return file


MODEL = 'variant = "SMART"\n{sensor}[materials.1]\nname = "wall"\nreflectance = 0.8\n'


@pytest.mark.parametrize(("sensor", "window_m"), [("", 0.749481145), ("[sensor]\npulse_fwhm_ns = 10.0\n", 1.49896229)])
def test_it_is_half_the_way_of_light_in_a_pulse(tmp_path, sensor, window_m):
    asked = load_scenario(scenario(tmp_path, MODEL.format(sensor=sensor))).asked[0]
    assert asked.selection.window_m == pytest.approx(window_m, abs=1e-9)
    assert asked.spec.name == "detection_probability"


def test_one_that_is_named_stays_and_older_goldens_keep_hash_and_name(tmp_path):
    plain = load_scenario(scenario(tmp_path, MODEL.format(sensor="")))
    former = load_scenario(scenario(tmp_path, MODEL.format(sensor=""), more="window_m = 0.5\n"))
    assert former.asked[0].selection.window_m == 0.5
    assert (former.content_hash, former.asked[0].spec.name) == (plain.content_hash, plain.asked[0].spec.name)
    wide = load_scenario(scenario(tmp_path, MODEL.format(sensor=""), more="window_m = 1.0\n"))
    assert wide.asked[0].spec.name == "detection_probability.within_1m"
    assert wide.content_hash != plain.content_hash


def test_a_golden_of_the_former_window_is_named_with_the_command_that_moves_it(tmp_path, monkeypatch):
    """A bright wall at 8 m: pile-up moves its echoes by 0.55 m. The echoes are the golden's, what is counted is not."""
    directory = tmp_path / "scenarios"
    directory.mkdir()
    file = scenario(directory, MODEL.format(sensor=""), near=8.0, tolerance=0.1)
    with monkeypatch.context() as former:
        former.setattr("lidarcheck.harness.scenario.asked.surface_window_m", lambda _sensor, external=False: 0.5)
        accept(review([file]), ["all"], reason="first")
        assert check([file]).scenarios[0].notes == ()
    (found,) = check([file]).scenarios
    assert found.failed
    (note,) = found.notes
    assert "the echoes are the golden's bit for bit, but 1 of its 1 KPIs are computed otherwise" in note
    assert note.endswith("(detection_probability): run `lidarcheck review wall` and accept them")
    shutil.rmtree(tmp_path / ".lidarcheck", ignore_errors=True)
    accept(review([file]), ["all"], reason="An echo lies on a surface within half a pulse of it.")
    assert not check([file]).failed
