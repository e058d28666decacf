"""Echoes that are taken from a model that differs by little are those of the whole computation, bit by bit."""

from dataclasses import replace

import numpy as np
import pytest

from beams_kit import head, in_room, zones
from explain_core_kit import MATERIALS, PANEL, model, same, street
from lidarcheck.effects import make
from lidarcheck.kpi.features import feature_column
from lidarcheck.model import Model, incremental, simulate
from lidarcheck.model.incremental import simulate_detected
from lidarcheck.scan import light_of_beams
from lidarcheck.sensor import Material

IDEAL = street(1, sign=True)
PAINTED = {**MATERIALS, PANEL: Material("panel", 0.55)}
AIRS: list[tuple[str, ...]] = [
    (), ("fog",), ("fog", "ambient_light"), ("fog", "rain", "timing_jitter"),
    ("crosstalk",), ("patchy", "incidence_falloff"), ("fog", "blooming_vertical", "retro_ghost"),
    ("beam_divergence", "fog"),
]  # fmt: skip


@pytest.fixture
def beams(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many beams were simulated, each time."""
    found, echoes_of = [], incremental.echoes_of

    def counted(light, *args, **how):
        found.append(len(light))
        return echoes_of(light, *args, **how)

    monkeypatch.setattr(incremental, "echoes_of", counted)
    return found


def air(*names: str) -> Model:
    return model(*(make("fog", {"patchiness": 0.5}) if name == "patchy" else make(name, {}) for name in names))


@pytest.mark.parametrize("names", AIRS, ids=["+".join(n) or "none" for n in AIRS])
def test_another_reflectance_is_simulated_on_its_own_beams_alone(names: tuple[str, ...], beams: list[int]) -> None:
    before = air(*names)
    after = replace(before, materials=PAINTED)
    like = simulate_detected(IDEAL, before, seed=9, frame=3)
    found = simulate_detected(IDEAL, after, seed=9, frame=3, like=like)
    assert same(found.read_out(after), simulate(IDEAL, after, seed=9, frame=3))
    assert not same(found.scan, like.scan)
    assert 0 < beams[1] < 0.5 * beams[0]


@pytest.mark.parametrize("sensor", [head(), head("spad_array"), zones()], ids=["linear", "spads", "zones"])
def test_on_any_detector_in_fog(sensor, beams: list[int]) -> None:
    room = in_room(sensor.beams)
    room = replace(room, material_id=room.object_id + 1)
    table = {i: Material(f"m{i}", 0.1 * i) for i in range(1, 7)}
    before = Model(sensor, table, (make("fog", {"mor_m": 100.0}),))
    after = replace(before, materials={**table, 4: Material("m4", 0.43)})
    like = simulate_detected(room, before, seed=2)
    found = simulate_detected(room, after, seed=2, like=like)
    whole = simulate(room, after, seed=2)
    assert same(found.read_out(after), whole, ("x_m", "layer", "point", "echo_number"))
    for name in whole.feature_names:
        one, other = (feature_column(scan, name) for scan in (found.read_out(after), whole))
        assert np.array_equal(one, other)
    assert len(beams) == 1 or beams[1] < beams[0]


def test_in_thicker_fog_all_beams_differ_and_with_what_it_had_none(beams: list[int]) -> None:
    before, after = model(make("fog", {"mor_m": 200.0})), model(make("fog", {"mor_m": 150.0}))
    like = simulate_detected(IDEAL, before, seed=9)
    found = simulate_detected(IDEAL, after, seed=9, like=like)
    assert same(found.read_out(after), simulate(IDEAL, after, seed=9))
    assert beams[0] == beams[1]
    later = before.with_(make("range_offset", {}))
    assert same(simulate_detected(IDEAL, later, seed=9, like=like).read_out(later), simulate(IDEAL, later, seed=9))
    assert len(beams) == 2


@pytest.mark.parametrize(("seed", "frame", "sensor"), [(8, 3, {}), (9, 2, {}), (9, 3, {"threshold": 10})])
def test_nothing_is_taken_of_another_seed_frame_or_sensor(seed: int, frame: int, sensor: dict[str, int]) -> None:
    before = air("fog")
    after = before.with_sensor(**sensor)
    like = simulate_detected(IDEAL, before, seed=9, frame=3)
    found = simulate_detected(IDEAL, after, seed=seed, frame=frame, like=like)
    assert same(found.read_out(after), simulate(IDEAL, after, seed=seed, frame=frame))


def test_the_light_of_some_beams_has_their_haze() -> None:
    like = simulate_detected(IDEAL, air("beam_divergence", "fog"), seed=1)
    mask = np.random.default_rng(1).random(len(like.light)) < 0.3
    part = light_of_beams(like.light, mask)
    assert part.haze is not None
    kept = like.scan.take(np.isin(_keys(like.scan), _keys(part)))
    assert same(incremental.echoes_of(part, like.run.sensor, seed=1, rounded=False), kept)


def _keys(table) -> np.ndarray:
    return table.layer.astype(np.int64) << 32 | table.point
