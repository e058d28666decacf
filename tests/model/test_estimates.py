"""What an ideal scan may be off by, drawn once for an ideal scan and ray: its distribution, and what shares a draw."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from explain_core_kit import model, street
from lidarcheck.effects import make
from lidarcheck.model import simulate
from lidarcheck.model.estimates import drawn, is_estimate, row_keys
from lidarcheck.model.stages import Surfaces, aimed, light_after_effects
from lidarcheck.scan import IdealScan

WIDE = {"layers": range(200, 300), "points": range(300, 360)}


def estimated(ideal: IdealScan, error_m: float = 0.02, error: float = 0.05, own: float = 0.4) -> IdealScan:
    """The same with errors, and a reflectance of its own."""
    n = len(ideal)
    columns = {"DistanceError": error_m, "Reflectance": own, "ReflectanceError": error}
    return dataclasses.replace(ideal, extra={name: np.full(n, value) for name, value in columns.items()})


def test_distances_and_reflectances_are_even_about_what_is_written() -> None:
    ideal = estimated(street(0, **WIDE))
    met = ideal.distance_m > 0.0
    found = [drawn(ideal, seed) for seed in range(3)]
    off = np.concatenate([(one.distance_m - ideal.distance_m)[met] / 0.02 for one in found])
    rho = np.concatenate([(one.extra["Reflectance"] - 0.4)[met] / 0.05 for one in found])
    for column in (off, rho):
        assert stats.kstest(column, "uniform", args=(-np.sqrt(3.0), np.sqrt(12.0))).pvalue > 1e-3
    assert abs(np.corrcoef(off, rho)[0, 1]) < 4.0 / np.sqrt(len(off))
    assert (found[0].distance_m[~met] == 0.0).all()


def test_a_draw_hangs_on_the_seed_and_on_what_the_row_says_and_on_nothing_else() -> None:
    ideal = estimated(street(0))
    first = drawn(ideal, 7).distance_m
    assert np.array_equal(drawn(ideal, 7).distance_m, first)
    order = np.random.default_rng(1).permutation(len(ideal))
    assert np.array_equal(drawn(ideal.take(order), 7).distance_m, first[order])
    met = ideal.distance_m > 0.0
    assert (drawn(ideal, 8).distance_m != first)[met].all()
    # Frames judged against one estimate share it also where one of them leaves rays out.
    fewer = ideal.take(np.arange(0, len(ideal), 3))
    assert np.array_equal(drawn(fewer, 7).distance_m, first[::3])
    farther = dataclasses.replace(ideal, distance_m=np.where(met, ideal.distance_m + 0.001, 0.0))
    one, other = (drawn(a, 7).distance_m - a.distance_m for a in (ideal, farther))
    assert abs(np.corrcoef(one[met], other[met])[0, 1]) < 4.0 / np.sqrt(met.sum())


@pytest.mark.parametrize("fidelity", ["exact", "fast"])
def test_what_has_no_error_is_simulated_as_ever(fidelity: str) -> None:
    plain = street(0, sign=True)
    zero = estimated(plain, 0.0, 0.0)
    assert not is_estimate(plain)
    assert not is_estimate(zero)
    no_error = dataclasses.replace(plain, extra={"Reflectance": np.full(len(plain), 0.4)})
    one, other = (simulate(a, model(), seed=3, fidelity=fidelity) for a in (zero, no_error))  # type: ignore[arg-type]
    assert np.array_equal(one.x_m, other.x_m)
    assert np.array_equal(one.area, other.area)
    unknown = dataclasses.replace(plain, extra={"DistanceError": np.full(len(plain), np.nan)})
    assert np.array_equal(simulate(unknown, model(), seed=3).x_m, simulate(plain, model(), seed=3).x_m)


def test_a_simulation_scatters_by_the_error_besides_its_noise() -> None:
    ideal = street(0, **WIDE)
    ideal = dataclasses.replace(ideal, extra={"DistanceError": np.full(len(ideal), 0.3)})
    near = (ideal.distance_m > 0.0) & (ideal.distance_m < 40.0)
    rows = ideal.take(near)
    spread = []
    for one in (rows, dataclasses.replace(rows, extra={})):
        scan = simulate(one, model(), seed=5)
        at = dict(zip(zip(one.layer.tolist(), one.point.tolist(), strict=True), one.distance_m, strict=True))
        keys = zip(scan.layer.tolist(), scan.point.tolist(), strict=True)
        off = scan.range_m - [at[key] for key in keys]
        spread.append(off[np.abs(off) < 3.0].std())
    assert spread[0] == pytest.approx(np.hypot(0.3, spread[1]), rel=0.1)


def test_frames_of_one_estimate_share_the_draw_and_their_noise_is_their_own() -> None:
    ideal = street(0, **WIDE)
    ideal = dataclasses.replace(ideal, extra={"DistanceError": np.full(len(ideal), 1.0)})
    one, other = (simulate(ideal, model(), seed=5, frame=frame) for frame in (0, 1))
    both = {}
    for scan in (one, other):
        for key, range_m in zip(zip(scan.layer.tolist(), scan.point.tolist(), strict=True), scan.range_m, strict=True):
            both.setdefault(key, []).append(range_m)
    apart = np.array([a - b for a, b in (v for v in both.values() if len(v) == 2)])
    assert np.median(np.abs(apart)) < 0.1
    assert (apart != 0.0).any()


def test_an_aim_keeps_the_draw_of_its_rays() -> None:
    ideal = estimated(street(0))
    turned = aimed(ideal, model(make("boresight", {"yaw_deg": 0.02, "own_surface": 1})))
    assert np.array_equal(row_keys(turned), row_keys(ideal))
    surfaces = Surfaces(ideal)
    assert surfaces.keyed is surfaces.keyed
    one = drawn(turned, 3).distance_m - turned.distance_m
    assert np.allclose(one, drawn(ideal, 3).distance_m - ideal.distance_m, atol=1e-9)


def test_light_without_a_simulation_is_of_what_is_written() -> None:
    ideal = estimated(street(0))
    light, _ = light_after_effects(ideal, model())
    met = np.sort(ideal.distance_m[ideal.distance_m > 0.0])
    assert np.array_equal(np.sort(light.pulse_range_m[light.pulse_range_m > 0.0]), met)


def test_a_reflectance_that_is_no_better_known_than_zero_stays_a_reflectance() -> None:
    ideal = estimated(street(0), error=1.0, own=0.01)
    found = drawn(ideal, 1).extra["Reflectance"]
    assert found.min() == 0.0
    assert found.max() > 0.5
    assert abs((drawn(estimated(street(0), error=0.1), 1).extra["Reflectance"] - 0.4).std() - 0.1) < 0.01
