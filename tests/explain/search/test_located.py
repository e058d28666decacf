"""Effects of several kinds have starts of each: fog with either rise of the overlap, rain with drops of either kind, a
fall-off with incidence that levels off or does not."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import Effect, make
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.explain.search.trial import tried
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.inference.simulator import Simulator

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}
RISES = {"backscatter": 0.05, "overlap_start_m": 1.0, "overlap_full_m": 9.0, "overlap_power": 2.0}


def tried_on(true: Effect) -> tuple[Simulator, list[Fit]]:
    """The fits from all starts of an effect's name, the nearest first, on frames of a sensor that has the effect."""
    simulator = Simulator(frames(model(true), 2, **FINE), model(), 3)
    nothing = np.zeros((1, len(simulator.measured)))
    now = Fit((), (), simulator.distance(nothing), nothing)
    fits = [tried(simulator, simulator, now, nothing, 10.0, probe)[0] for probe in fixed_probes([true.name])]
    return simulator, sorted(fits, key=lambda fit: fit.distance)


def variants(fits: list[Fit]) -> list[str]:
    return [fit.probes[0].variant for fit in fits]


@pytest.mark.long
@pytest.mark.parametrize("mor_m", [300.0, 700.0])
def test_an_overlap_that_rises_smoothly_has_starts_of_its_own(mor_m: float) -> None:
    _, fits = tried_on(make("fog", RISES | {"mor_m": mor_m}))
    linear = next(fit for fit in fits if "overlap_power" not in fit.probes[0].settings)
    assert fits[0].probes[0].variant.startswith("smooth")
    assert fits[0].distance < linear.distance - 200.0, variants(fits)
    assert fits[0].effects()[0].settings()["overlap_full_m"] == pytest.approx(9.0, rel=0.3)


def test_rain_of_few_small_drops_has_a_start_of_its_own() -> None:
    beam = {"rate_mm_h": 12.0, "beam_diameter_m": 0.001, "divergence_mrad": 2.0}
    _, fits = tried_on(make("rain", beam | {"drop_shape": 2.0, "drop_echo": 6.0, "drop_density": 0.15}))
    plain = fits[variants(fits).index("")]
    assert fits[0].probes[0].variant == "large drops"
    assert fits[0].distance < plain.distance - 50.0, variants(fits)


def test_a_sheen_is_a_falloff_that_levels_off() -> None:
    angle = np.deg2rad(np.arange(0.0, 91.0, 10.0))
    factors = tuple((0.5 + 0.5 * np.cos(angle) ** 3).tolist())
    simulator, fits = tried_on(make("incidence_falloff", {"exponent": 1.0, "factors": factors}))
    plain = fits[variants(fits).index("")]
    assert fits[0].probes[0].variant == "levelling"
    assert fits[0].distance - simulator.floor_distance < 0.3 * (plain.distance - simulator.floor_distance)
