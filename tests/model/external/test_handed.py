"""What a program is handed, row by row; no program runs here."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.effects import make
from lidarcheck.errors import UsageError
from lidarcheck.model import load_model
from lidarcheck.model.external.handed import handed
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import run_and_light
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Program
from waveform_kit import EVERYTHING, model_text, wall_scan

K = 6000.0
RHO = {1: 0.1, 2: 0.6, 9: 0.3}


def model(tmp_path: Path, *effects, reads=EVERYTHING, more: str = "scatter_material = 9") -> Model:
    """The kit's model, which says what it reads, with effects around it."""
    file = tmp_path / "model.toml"
    file.write_text(model_text(f"reads = {list(reads)}\n{more}\n".replace("'", '"')))
    made = load_model(file)
    for effect in effects:
        made = made.with_(effect)
    return made


def shown(ideal: IdealScan, around: Model, seed: int = 1) -> tuple[IdealScan, tuple[str, ...]]:
    run, light = run_and_light(ideal, around, seed, 0, None)
    return handed(light, run)


def test_nothing_around_it_hands_over_the_ideal_scan_as_it_is(tmp_path):
    ideal = wall_scan()
    table, columns = shown(ideal, model(tmp_path))
    assert columns == ()
    assert table.share is None
    for name in ("layer", "point", "distance_m", "material_id", "incidence_deg"):
        assert np.array_equal(getattr(table, name), getattr(ideal, name))


def test_equal_rows_of_a_beam_say_their_share_each(tmp_path):
    ideal = wall_scan(points=4)
    both = ideal.take(np.repeat(np.arange(len(ideal)), 2))
    both = replace(both, distance_m=both.distance_m + np.tile([0.0, 3.0], len(ideal)))
    table, columns = shown(both, model(tmp_path))
    assert columns == ("Share",)
    assert np.array_equal(table.share, np.full(len(both), 0.5))
    assert np.array_equal(table.distance_m, both.distance_m)


def test_what_dims_light_is_a_share_of_one_row(tmp_path):
    table, columns = shown(wall_scan(), model(tmp_path, make("signal_gain", {"gain": 0.37})))
    assert columns == ("Share",)
    assert np.allclose(table.share, 0.37, rtol=1e-12)


def test_a_known_shift_is_in_the_distance_and_keeps_the_light(tmp_path):
    ideal = wall_scan()
    table, columns = shown(
        ideal, model(tmp_path, make("range_offset", {"offset_m": 0.5}), make("range_scale", {"fraction": 0.01}))
    )
    far = (ideal.distance_m + 0.5) * 1.01
    assert columns == ("Share",)
    assert np.allclose(table.distance_m, far, rtol=1e-12)
    assert np.allclose(table.share, (far / ideal.distance_m) ** 2, rtol=1e-12)


def test_an_added_pulse_is_a_row_with_the_light_that_it_has(tmp_path):
    ideal = wall_scan(20.0, points=5)
    strength = 0.01
    ghost = make(
        "retro_ghost", {"strength": strength, "exponent": 0.0, "extra_m": 0.0, "retro_only": 0, "min_signal": 0.0}
    )
    table, columns = shown(ideal, model(tmp_path, ghost))
    assert columns == ("Share",)
    assert len(table) == 2 * len(ideal)
    first, second = table.take(np.arange(0, len(table), 2)), table.take(np.arange(1, len(table), 2))
    assert np.array_equal(first.share, np.ones(len(ideal)))
    assert np.array_equal(second.distance_m, 2.0 * ideal.distance_m)
    assert not second.incidence_deg.any()
    assert set(second.material_id.tolist()) == {2}, "the whitest Lambertian material"
    signal = strength * K * RHO[2] / ideal.distance_m**2
    assert np.allclose(second.share * K * RHO[2] / second.distance_m**2, signal, rtol=1e-9)


def test_fog_is_rows_of_the_air_with_its_light(tmp_path):
    ideal = wall_scan(60.0, layers=1, points=3)
    around = model(tmp_path, make("fog", {"mor_m": 40.0}))
    run, light = run_and_light(ideal, around, 1, 0, None)
    table, columns = handed(light, run)
    air = table.take(table.material_id == 9)
    assert columns == ("Share",)
    assert not air.incidence_deg.any()
    of_beam = air.take(air.point == ideal.point[0])
    assert np.all(np.diff(of_beam.distance_m) > 0.0)
    assert np.diff(of_beam.distance_m).max() < 0.75, "rows are nearer to each other than a pulse is long"
    signal = of_beam.share * K * RHO[9] / of_beam.distance_m**2
    haze = light.haze
    near = int(of_beam.distance_m.max() / haze.step_m)
    assert signal.sum() == pytest.approx(haze.density_per_m[:near].sum() * haze.step_m, rel=0.02)
    surface = table.take(table.material_id == 2)
    assert np.allclose(surface.share, np.exp(-2.0 * np.log(20.0) / 40.0 * surface.distance_m), rtol=1e-9)


def test_rain_takes_the_air_and_light_of_no_surface_another(tmp_path):
    rain = make("rain", {"rate_mm_h": 80.0, "drop_density": 0.5})
    table, _ = shown(wall_scan(), model(tmp_path, rain))
    assert np.count_nonzero(table.material_id == 9) > 10
    foreign = make("interference", {"share": 0.5})
    table, _ = shown(wall_scan(), model(tmp_path, foreign, more=""))
    assert set(table.material_id.tolist()) == {2}
    assert len(table) > len(wall_scan())


def test_background_is_a_factor_on_the_programs_own(tmp_path):
    table, columns = shown(wall_scan(), model(tmp_path, make("dark_counts", {"rate_per_ns": 3.0})))
    assert columns == ("Background",)
    assert np.array_equal(table.extra["Background"], np.full(len(table), 4.0))
    sun = make("ambient_light", {"rate_per_ns": 2.0})
    table, _ = shown(wall_scan(), model(tmp_path, sun))
    assert np.allclose(table.extra["Background"], 1.0 + 2.0 * RHO[2])


def test_a_program_that_reads_only_parts_gets_no_further_rows(tmp_path):
    ideal = wall_scan(points=6)
    both = ideal.take(np.repeat(np.arange(len(ideal)), 2))
    both = replace(
        both, distance_m=both.distance_m + np.tile([0.0, 3.0], len(ideal)), share=np.tile([0.3, 0.1], len(ideal))
    )
    table, columns = shown(both, model(tmp_path, reads=("Parts",)))
    assert columns == ("Share",)
    assert np.allclose(table.share, np.tile([0.75, 0.25], len(ideal)))
    with pytest.raises(UsageError, match="the program does not read Share"):
        shown(both, model(tmp_path, make("signal_gain", {}), reads=("Parts",)))


def test_a_reflectance_is_handed_as_it_is_or_as_a_share(tmp_path):
    ideal = replace(wall_scan(), extra={"Reflectance": np.linspace(0.1, 0.9, len(wall_scan()))})
    table, columns = shown(ideal, model(tmp_path))
    assert columns == ("Reflectance",)
    assert np.array_equal(table.extra["Reflectance"], ideal.extra["Reflectance"])
    table, columns = shown(ideal, model(tmp_path, reads=("Share",)))
    assert columns == ("Share",)
    assert np.allclose(table.share, ideal.extra["Reflectance"] / RHO[2], rtol=1e-12)
    with pytest.raises(UsageError, match="the program reads neither that nor Share"):
        shown(ideal, model(tmp_path, make("ambient_light", {}), reads=("Background",)))


def test_a_time_is_sent_where_it_is_read(tmp_path):
    ideal = replace(wall_scan(), time_s=np.linspace(0.0, 0.03, len(wall_scan())))
    assert shown(ideal, model(tmp_path))[1] == ("Time",)
    table, columns = shown(ideal, model(tmp_path, reads=("Share",)))
    assert (table.time_s, columns) == (None, ())


def test_fitted_materials_reach_the_program_and_are_written_as_an_effect(tmp_path):
    from lidarcheck.model.files.write import write_model

    around = model(tmp_path)
    materials = {**around.materials, 2: replace(around.materials[2], reflectance=0.3)}
    fitted = replace(around, materials=materials)
    table, _ = shown(wall_scan(), fitted)
    assert np.allclose(table.share, 0.5)
    write_model(tmp_path / "model.toml", fitted, tmp_path / "fitted.toml")
    again = load_model(tmp_path / "fitted.toml")
    assert again.materials == around.materials
    assert [(e.name, e.settings()) for e in again.effects] == [
        ("material_reflectance", {"factor": 0.5, "material_id": 2})
    ]
    assert np.allclose(shown(wall_scan(), again)[0].share, 0.5)


def test_the_sensor_of_a_program_is_the_named_one_without_its_detector(tmp_path):
    sensor = model(tmp_path).sensor
    assert isinstance(sensor, Program)
    assert (sensor.detector, sensor.variant, sensor.strength) == ("external", "SMART", "AREA")
    assert sensor.window_m == sensor.separation_m
