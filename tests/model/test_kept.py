"""The light that is kept for the next seed, frame or model is the one that a new computation gives, bit by bit."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from beams_kit import head, in_room
from explain_core_kit import MATERIALS, PANEL, model, same, street
from lidarcheck.effects import make
from lidarcheck.effects.finding import catalogue
from lidarcheck.model import Model, simulate
from lidarcheck.model.stages import Surfaces, run_and_light
from lidarcheck.scan import Light
from lidarcheck.sensor import Material, Sensor

IDEAL = street(1, sign=True)
LIT = [name for name, effect in catalogue().items() if effect.stage == "light"]
OTHER = {**MATERIALS, PANEL: Material("panel", 0.55)}


def with_effects(*names: str) -> Model:
    return model(*(make(name, {}) for name in names))


def light(one: Model, surfaces: Surfaces | None, seed: int, frame: int = 0) -> Light:
    return run_and_light(IDEAL, one, seed, frame, None, surfaces)[1]


def same_light(one: Light, other: Light) -> bool:
    names = ["layer", "point", "background_per_ns", "first_pulse", "pulse_range_m", "pulse_signal"]
    equal = all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)
    equal &= np.array_equal(one.rows(), other.rows()) and one.shape == other.shape
    if one.haze is None or other.haze is None:
        return equal and one.haze is other.haze
    hazes = ["density_per_m", "first_row", "row_end_m", "row_share"]
    return equal and all(np.array_equal(getattr(one.haze, name), getattr(other.haze, name)) for name in hazes)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each effect worked on light."""
    count: Counter[str] = Counter()
    for name in LIT:
        kind = catalogue()[name]

        def counted(self, light, around, kind=kind, plain=kind.light):
            count[kind.name] += 1
            return plain(self, light, around)

        monkeypatch.setattr(kind, "light", counted)
    return count


@pytest.mark.parametrize("name", LIT)
def test_the_same_light_with_what_is_kept_and_without(name: str) -> None:
    kept = Surfaces(IDEAL)
    first, behind = make(name, {}), make("incidence_falloff", {})
    asked = [model(first), model(first, behind), model(behind, first), model(first)]
    for one in [*asked, *(replace(one, materials=OTHER) for one in asked)]:
        for seed, frame in ((1, 0), (2, 0), (1, 1)):
            assert same_light(light(one, kept, seed, frame), light(one, None, seed, frame))


def test_what_draws_no_numbers_is_done_once_for_all_seeds_and_frames(made: Counter[str]) -> None:
    kept, one = Surfaces(IDEAL), with_effects("incidence_falloff", "fog", "rain", "ambient_light")
    for seed in range(3):
        for frame in range(2):
            light(one, kept, seed, frame)
    # Rain draws, so that what stands behind it is done anew, too.
    assert made == {"incidence_falloff": 1, "fog": 1, "rain": 6, "ambient_light": 6}


def test_a_model_that_differs_takes_what_comes_before_the_difference(made: Counter[str]) -> None:
    kept = Surfaces(IDEAL)
    thin, thick = (make("ambient_light", {"rate_per_ns": rate}) for rate in (0.0002, 0.0005))
    before = with_effects("incidence_falloff", "fog")
    for one in (before.with_(thin), before.with_(thick), before.with_(thin), before):
        light(one, kept, 1)
    assert made == {"incidence_falloff": 1, "fog": 1, "ambient_light": 2}
    light(replace(before, materials=OTHER), kept, 1)
    assert made == {"incidence_falloff": 2, "fog": 2, "ambient_light": 2}
    light(before.with_sensor(signal_at_1m=5000.0), kept, 1)
    assert made["fog"] == 3


def test_behind_beams_that_a_seed_moves_nothing_is_kept(made: Counter[str]) -> None:
    kept, shaken = Surfaces(IDEAL), with_effects("vibration", "fog")
    assert not same_light(light(shaken, kept, 1), light(shaken, kept, 2))
    assert made == {"fog": 2}
    still = with_effects("boresight", "fog")
    assert light(still, kept, 1) is light(still, kept, 2)


@pytest.mark.parametrize("sensor", [Sensor.of("SLIM"), head()], ids=["SLIM", "linear"])
def test_echoes_are_the_same_on_any_sensor(sensor: Sensor) -> None:
    ideal = in_room(sensor.beams, *(IDEAL.layer % sensor.beams.layers, IDEAL.point % sensor.beams.points))
    _, first = np.unique(ideal.layer.astype(np.int64) << 32 | ideal.point, return_index=True)
    ideal = ideal.take(first)
    kept, one = Surfaces(ideal), Model(sensor, {1: Material("wall", 0.3)}, (make("fog", {}), make("rain", {})))
    for seed in (3, 4):
        assert same(
            simulate(ideal, one, seed=seed, surfaces=kept), simulate(ideal, one, seed=seed), ("x_m", "layer", "point")
        )
