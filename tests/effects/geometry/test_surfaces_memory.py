"""What `Surfaces` keeps for the next seed changes no echo, and is kept only where nothing random is in it."""

from collections import Counter

import numpy as np
import pytest

from analytic_scene import GROUND, WALL_AHEAD, Patch, PatchScene, box
from lidarcheck.effects import make
from lidarcheck.effects.beam_divergence import BeamDivergence
from lidarcheck.model import Model, simulate
from lidarcheck.model.stages import Surfaces
from lidarcheck.sensor import Material, Sensor

STREET = PatchScene(
    [
        Patch((0, 0, -1.8), **GROUND, material=1, number=1),
        Patch((60, 0, 0), **WALL_AHEAD, material=2, number=2),
        *box((18, -2, -1.8), (22, 0.1, 0.2), material=3, number=3),
    ]
)
IDEAL = STREET.ideal(np.arange(250, 270), np.arange(450, 490))
TABLE = {i: Material(f"m{i}", 0.1 * i + 0.1) for i in range(4)}
AIMS = {
    "beam_divergence": {},
    "boresight": {"yaw_deg": 0.05},
    "vibration": {"random_deg": 0.1},
    "motion": {"forward_m_s": 10.0},
}


def model(variant="SMART", materials=None, **effects):
    made = Model(Sensor.of(variant), TABLE if materials is None else materials)
    for name, settings in effects.items():
        made = made.with_(make(name, settings))
    return made


def bytes_of(scan):
    return b"".join(np.ascontiguousarray(getattr(scan, n)).tobytes() for n in ("layer", "point", "x_m", "area", "peak"))


@pytest.fixture
def casts(monkeypatch):
    """How often beams were spread."""
    count, aim = Counter(), BeamDivergence.aim

    def counted(self, ideal, around):
        count["casts"] += 1
        return aim(self, ideal, around)

    monkeypatch.setattr(BeamDivergence, "aim", counted)
    return count


@pytest.mark.parametrize("scene", [None, STREET])
@pytest.mark.parametrize("name", AIMS)
def test_the_same_echoes_with_what_is_kept_and_without(name, scene):
    kept = Surfaces(IDEAL)
    one = model(**{name: AIMS[name]}, **({} if name == "boresight" else {"boresight": {"pitch_deg": 0.03}}))
    for seed in (1, 2, 1):
        with_it = simulate(IDEAL, one, seed=seed, scene=scene, surfaces=kept)
        assert bytes_of(with_it) == bytes_of(simulate(IDEAL, one, seed=seed, scene=scene))


def test_what_draws_no_numbers_is_done_once_for_all_seeds(casts):
    kept = Surfaces(IDEAL)
    for seed in range(5):
        simulate(IDEAL, model(beam_divergence={}), seed=seed, surfaces=kept)
    assert casts["casts"] == 1


def test_what_draws_numbers_is_done_anew(casts):
    kept, shaken = Surfaces(IDEAL), model(vibration={"random_deg": 0.2}, beam_divergence={})
    shown = [bytes_of(simulate(IDEAL, shaken, seed=seed, surfaces=kept)) for seed in range(3)]
    assert len(set(shown)) == 3
    assert casts["casts"] == 3


def test_another_strength_scene_or_sensor_is_another_thing(casts):
    kept = Surfaces(IDEAL)
    asked = [
        (model(beam_divergence={"vertical_deg": 0.1}), None),
        (model(beam_divergence={"vertical_deg": 0.4}), None),
        (model(beam_divergence={"vertical_deg": 0.4}), STREET),
        (model("SLIM", beam_divergence={"vertical_deg": 0.4}), None),
    ]
    for one, scene in asked:
        with_it = simulate(IDEAL, one, surfaces=kept, scene=scene)
        assert bytes_of(with_it) == bytes_of(simulate(IDEAL, one, scene=scene))
    assert casts["casts"] == 2 * len(asked)


def test_other_reflectances_need_no_other_rays(casts):
    kept = Surfaces(IDEAL)
    darker = {i: Material(m.name, 0.5 * m.reflectance) for i, m in TABLE.items()}
    one, other = (simulate(IDEAL, model(materials=m, beam_divergence={}), surfaces=kept) for m in (TABLE, darker))
    assert casts["casts"] == 1
    assert np.log(other.area).mean() < np.log(one.area).mean()


def test_a_few_are_kept_the_last_used_ones(casts):
    kept = Surfaces(IDEAL)
    widths = [0.1, 0.15, 0.2, 0.25, 0.1, 0.3, 0.1]
    for width in widths:
        simulate(IDEAL, model(beam_divergence={"vertical_deg": width}), surfaces=kept)
    assert casts["casts"] == 5
    simulate(IDEAL, model(beam_divergence={"vertical_deg": 0.15}), surfaces=kept)
    assert casts["casts"] == 6
