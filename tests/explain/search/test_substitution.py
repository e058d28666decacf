"""What is left out is taken over where another effect can do exactly that: by a walk an offset, the same shifts at all
amplitudes, and by the gains of all layers the gain of all."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.effects.search import FreeParameter, Probe, search_spec
from lidarcheck.effects.walk_error import WalkError
from lidarcheck.explain.search.search import without
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.explain.search.substitution import is_within_another, others_of
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator

AREA = np.geomspace(10.0, 5000.0, 40)
REFERENCE = FreeParameter("reference_area", 0.1, log=True)


def walk_probe(**settings: object) -> Probe:
    power = float(settings.pop("power", 0.0))  # type: ignore[arg-type]
    free = (*search_spec("walk_error").free[: 1 if power else 2], REFERENCE)
    return Probe("walk_error", {"bend_m": 0.0, **settings}, free, {"power": power} if power else {})


def beside_an_offset(probe: Probe, offset_m: float) -> Fit:
    offset = Probe("range_offset", {"offset_m": offset_m}, search_spec("range_offset").free)
    probes = (offset, probe)
    return Fit(probes, tuple(one.start() for one in probes), 0.0, np.zeros((1, 1)))


def shifts(probe: Probe, x: np.ndarray) -> np.ndarray:
    return WalkError(**probe.effect(x).settings()).shift_m(AREA)


@pytest.mark.parametrize(
    "settings",
    [
        {"per_decade_m": 0.178, "reference_area": 843.0},
        {"per_decade_m": -0.05, "reference_area": 300.0},
        {"per_decade_m": 0.2, "bend_m": 0.03, "reference_area": 843.0},
        {"per_decade_m": 0.2, "bend_m": -0.02, "reference_area": 500.0, "shifts_m": (0.0, 0.01, 0.02)},
        {"per_decade_m": 0.15, "reference_area": 843.0, "power": -0.3},
        {"per_decade_m": 0.15, "reference_area": 843.0, "power": 0.4},
    ],
    ids=["logarithm", "falling", "bent", "with a table", "power below 0", "power above 0"],
)
@pytest.mark.parametrize("offset_m", [-0.1, 0.08])
def test_the_walk_shifts_as_both_did(settings: dict[str, object], offset_m: float) -> None:
    probe = walk_probe(**settings)
    [alone], [x] = others_of(beside_an_offset(probe, offset_m), 0)
    np.testing.assert_allclose(shifts(alone, x), offset_m + shifts(probe, probe.start()), atol=1e-9)
    assert alone.free == probe.free
    assert alone.effect().settings()["reference_area"] != probe.effect().settings()["reference_area"]


@pytest.mark.parametrize(
    ("settings", "offset_m"),
    [
        ({"per_decade_m": 0.01, "reference_area": 843.0}, 0.5),
        ({"per_decade_m": 0.1, "bend_m": 0.1, "reference_area": 843.0}, 1.0),
        ({"per_decade_m": 0.0, "reference_area": 843.0}, 0.1),
        ({"per_decade_m": 0.0, "reference_area": 843.0, "power": 0.5}, 0.1),
    ],
    ids=["beyond its range", "zero nowhere", "none", "no power"],
)
def test_where_its_curve_cannot_it_stays_as_it_is(settings: dict[str, object], offset_m: float) -> None:
    probe = walk_probe(**settings)
    [alone], [x] = others_of(beside_an_offset(probe, offset_m), 0)
    assert alone == probe
    assert x.tolist() == probe.start().tolist()


@pytest.mark.parametrize("offset_m", [-0.157, -0.155])
def test_a_power_alone_has_its_reference_far_off(offset_m: float) -> None:
    """0.178 (1 - u) / (0.5 ln 10) - 0.155, u = (AREA / 843)^-0.5, is -0.155 u: zero nowhere, or nearly so."""
    probe = walk_probe(per_decade_m=0.178, reference_area=843.0, power=-0.5)
    [alone], [x] = others_of(beside_an_offset(probe, offset_m), 0)
    both = offset_m + shifts(probe, probe.start())
    np.testing.assert_allclose(shifts(alone, x), both, atol=0.008)
    assert np.ptp(both) > 1.0


def test_others_are_left_alone() -> None:
    gain = fixed_probes(["signal_gain"])[0]
    walk = walk_probe(per_decade_m=0.1, reference_area=300.0)
    both = Fit((gain, walk), (gain.start(), walk.start()), 0.0, np.zeros((1, 1)))
    assert others_of(both, 0)[0] == [walk]
    assert others_of(both, 1)[0] == [gain]
    assert others_of(beside_an_offset(walk, 0.1), 1)[0][0].name == "range_offset"


def test_an_offset_beside_a_walk_is_left_out_at_no_loss() -> None:
    """The walk of two fits is zero at an AREA of 843, the sensor's at 6400, which no fit with a fixed one could be."""
    true = model(make("walk_error", {"per_decade_m": 0.178, "reference_area": 6430.0}))
    simulator = Simulator(frames(true, layers=range(230, 290, 2), points=range(320, 640, 8)), model(), 3)
    now = beside_an_offset(walk_probe(per_decade_m=0.178, reference_area=843.0), -0.157)
    both = fit(simulator, now.probes, now.x, rounds=0)
    alone = without(simulator, both, 0)
    assert alone.names() == ("walk_error",)
    assert alone.distance < both.distance + 5.0


@pytest.mark.parametrize("gain", [0.7, 1.2])
def test_gains_of_all_layers_take_over_a_gain_of_all(gain: float) -> None:
    common = Probe("signal_gain", {"gain": gain}, search_spec("signal_gain").free)
    settings = {"gain": 1.0, "gains": (0.9, 1.0, 1.1, 9.5)}
    layers = Probe(
        "layer_gain", settings, search_spec("layer_gain").free, {"first_layer": 230, "last_layer": 233, "every": 1}
    )
    both = Fit((common, layers), (common.start(), layers.start()), 0.0, np.zeros((1, 1)))
    [alone], [x] = others_of(both, 0)
    assert [is_within_another(both, at) for at in (0, 1)] == [True, False]
    assert alone.effect(x).settings()["gains"] == pytest.approx(np.minimum(gain * np.array(settings["gains"]), 10.0))
    assert alone.free == layers.free
    # Of the two the gains of layers can do all, and not the reverse.
    [common_alone], _ = others_of(both, 1)
    assert common_alone is common
