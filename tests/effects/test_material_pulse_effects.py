"""Material reflectance and pulse shape: the light that they change, and all that they leave alone."""

import numpy as np
import pytest

from lidarcheck.effects import make
from lidarcheck.model import Model, light_of, simulate
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import Material, Sensor
from light_kit import MATERIALS, alone, lit, model, own, scan_of


def test_material_reflectance_scales_what_comes_from_that_material_wherever_it_arrives() -> None:
    ideal = scan_of((10, 10, 20.0, 1), (10, 10, 30.0, 3), (10, 11, 40.0, 1), (10, 12, 0.0, 1), (10, 13, 50.0, 3))
    light = own(ideal).with_pulses([3, 3], [40.0, 60.0], [0.5, 0.25], [2, -1])
    changed = alone(make("material_reflectance", {"factor": 1.5, "material_id": 1}), light, ideal)
    rows = light.rows()
    expected = [
        s * (1.5 if r >= 0 and ideal.material_id[r] == 1 else 1.0)
        for s, r in zip(light.pulse_signal, rows, strict=True)
    ]
    assert changed.pulse_signal == pytest.approx(expected, rel=1e-12)
    assert np.count_nonzero(changed.pulse_signal != light.pulse_signal) == 3
    assert alone(make("material_reflectance", {"material_id": 9}), light, ideal) is light
    assert alone(make("material_reflectance", {"factor": 1.0}), light, ideal) is light


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_material_reflectance_is_another_table_entry(variant: str) -> None:
    ideal = scan_of(*((100 + i, 5, 20.0 + i, 1 + 2 * (i % 2)) for i in range(60)))
    brighter = Model(Sensor.of(variant), {**MATERIALS, 3: Material("road", 0.25)})
    effect = make("material_reflectance", {"factor": 2.5, "material_id": 3})
    changed = lit(ideal, effect, variant=variant)
    assert changed.pulse_signal == pytest.approx(light_of(ideal, brighter).pulse_signal, rel=1e-12)


def test_pulse_shape_sets_the_shape_and_nothing_else() -> None:
    ideal = scan_of((10, 10, 20.0, 1))
    light = own(ideal)
    shape = {"stretch": 0.5, "tail_share": 0.1, "tail_ns": 4.0}
    changed = alone(make("pulse_shape", shape), light, ideal)
    assert changed.shape == PulseShape(2.5, 0.1, 4.0)
    assert changed.pulse_signal is light.pulse_signal
    assert alone(make("pulse_shape", {"stretch": 1.0, "tail_share": 0.0}), light, ideal) is light
    again = alone(make("pulse_shape", {"stretch": 3.0, "tail_share": 0.0}), changed, ideal)
    assert again.shape == PulseShape(7.5, 0.1, 4.0)
    assert alone(make("pulse_shape", {"stretch": 1.0, "tail_share": 0.2, "tail_ns": 9.0}), again, ideal).shape == (
        PulseShape(7.5, 0.2, 9.0)
    )
    second = make("pulse_shape", {"stretch": 1.0, "tail_share": 0.2, "tail_ns": 0.5, "tail_delay_ns": 9.5})
    assert alone(second, again, ideal).shape == PulseShape(7.5, 0.2, 0.5, 9.5)
    assert alone(make("pulse_shape", {"tail_share": 0.0}), alone(second, light, ideal), ideal).shape == (
        PulseShape(3.5, 0.2, 0.5, 9.5)
    )


def test_a_longer_pulse_is_a_sensor_with_a_longer_pulse() -> None:
    ideal = scan_of(*((100 + i, 5, 20.0 + i, 1) for i in range(100)))
    stretched = simulate(ideal, model(make("pulse_shape", {"stretch": 2.0, "tail_share": 0.0})), seed=2)
    sensor = simulate(ideal, model().with_sensor(pulse_fwhm_ns=10.0), seed=2)
    assert np.array_equal(stretched.area, sensor.area)
    assert np.array_equal(stretched.width_ns, sensor.width_ns)
    assert stretched.width_ns.mean() > simulate(ideal, model(), seed=2).width_ns.mean() + 2.0
