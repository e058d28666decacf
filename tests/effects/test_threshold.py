"""A threshold between two whole numbers: each beam has one of the two."""

from __future__ import annotations

import numpy as np
import pytest

from lidarcheck import effects
from lidarcheck.errors import UsageError
from lidarcheck.model import Model, simulate
from lidarcheck.model.chain import echoes_of
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor

MATERIALS = {1: Material("wall", 0.4)}
CROSSTALK = effects.make("crosstalk", {"sides": 0.1})
FOG = effects.make("fog", {"mor_m": 60.0})


def ideal_of(n: int = 4000) -> IdealScan:
    layer, point = np.divmod(np.arange(n), 100)
    return IdealScan(layer + 240, point + 400, np.linspace(30.0, 140.0, n), np.ones(n), np.zeros(n))


def echoes_by_beam(scan: Scan) -> dict[tuple[int, int], list[tuple[float, ...]]]:
    found: dict[tuple[int, int], list[tuple[float, ...]]] = {}
    for layer, point, *echo in zip(scan.layer, scan.point, scan.range_m, scan.width_ns, scan.area, strict=True):
        found.setdefault((int(layer), int(point)), []).append(tuple(map(float, echo)))
    return found


def shifted(shift: float, *others: effects.Effect) -> Model:
    made = (*others, effects.make("threshold", {"shift": shift}))
    return Model(Sensor.of("SMART"), MATERIALS, tuple(sorted(made, key=lambda one: one.stage == "detector")))


@pytest.mark.parametrize("others", [(), (CROSSTALK,), (FOG,)], ids=["alone", "crosstalk", "fog"])
def test_every_beam_has_one_of_the_two_whole_thresholds(others: tuple[effects.Effect, ...]) -> None:
    ideal = ideal_of(1500)
    low, between, high = (echoes_by_beam(simulate(ideal, shifted(shift, *others), seed=3)) for shift in (2.0, 2.3, 3.0))
    beams = [(int(layer), int(point)) for layer, point in zip(ideal.layer, ideal.point, strict=True)]
    telling = [beam for beam in beams if low.get(beam) != high.get(beam)]
    assert len(telling) > 400
    assert all(between.get(beam) in (low.get(beam), high.get(beam)) for beam in beams)
    higher = np.mean([between.get(beam) == high.get(beam) for beam in telling])
    assert higher == pytest.approx(0.3, abs=4.0 * np.sqrt(0.21 / len(telling)))


def test_shifts_add_up_to_a_whole_number_again() -> None:
    half = effects.make("threshold", {"shift": 0.5})
    twice = Model(Sensor.of("SMART"), MATERIALS, (half, half))
    ideal = ideal_of()
    assert echoes_by_beam(simulate(ideal, twice, seed=1)) == echoes_by_beam(simulate(ideal, shifted(1.0), seed=1))
    below = Model(Sensor.of("SMART", threshold=0), MATERIALS, (effects.make("threshold", {"shift": -0.5}),))
    sensor = below.effects[0].detector(below.sensor)
    assert (sensor.threshold, sensor.nonideal.threshold_dither) == (0, 0.0)


def test_the_same_bytes_for_any_threads_and_order() -> None:
    ideal, model = ideal_of(20_000), shifted(-1.6)
    plain = echoes_by_beam(simulate(ideal, model, seed=5, threads=1))
    assert plain == echoes_by_beam(simulate(ideal, model, seed=5, threads=3))
    mixed = np.random.default_rng(0).permutation(len(ideal))
    turned = IdealScan(*(column[mixed] for column in (ideal.layer, ideal.point, ideal.distance_m, ideal.material_id)),
                       ideal.incidence_deg[mixed])  # fmt: skip
    assert plain == echoes_by_beam(simulate(turned, model, seed=5))
    assert plain != echoes_by_beam(simulate(ideal, model, seed=5, frame=1))


def test_progress_counts_the_beams_of_both_thresholds() -> None:
    told: list[tuple[int, int]] = []
    simulate(ideal_of(20_000), shifted(0.5), seed=1, threads=1, progress=lambda done, of: told.append((done, of)))
    assert [done for done, _ in told] == sorted({done for done, _ in told})
    assert told[-1] == (20_000, 20_000)


def test_it_agrees_with_every_detector_followed_on_its_own() -> None:
    ideal, model = ideal_of(500), shifted(2.4)
    reference = simulate(ideal, model, seed=1, fidelity="reference")
    chain = [simulate(ideal, model, seed=seed) for seed in range(20)]
    for column in ("width_ns", "area"):
        means = [float(getattr(scan, column).sum()) / len(ideal) for scan in chain]
        off = float(getattr(reference, column).sum()) / len(ideal) - np.mean(means)
        assert abs(off) < 4.5 * np.std(means, ddof=1)


def test_a_gpu_is_told_that_it_cannot() -> None:
    from lidarcheck.model.detection import chain_echoes
    from lidarcheck.model.stages import light_after_effects

    light, sensor = light_after_effects(ideal_of(10), shifted(0.5))
    with pytest.raises(UsageError, match="threshold between two whole numbers is not simulated on a GPU"):
        chain_echoes(light, sensor, device="cuda")
    assert len(echoes_of(light, sensor)) > 0
