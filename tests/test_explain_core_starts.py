"""Effects of several kinds have starts of each: fog with either rise of the overlap, rain with drops of either kind, a
fall-off with incidence that levels off or does not."""

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.explain.candidates import fixed_probes
from lidarcheck.explain.fit import Fit
from lidarcheck.explain.lab import Lab
from lidarcheck.explain.trials import tried

FINE = {"layers": range(230, 290, 2), "points": range(320, 640, 6)}
RISES = {"backscatter": 0.05, "overlap_start_m": 1.0, "overlap_full_m": 9.0, "overlap_power": 2.0}


@pytest.mark.parametrize("mor_m", [300.0, 700.0])
def test_an_overlap_that_rises_smoothly_has_starts_of_its_own(mor_m: float) -> None:
    lab = Lab(frames(model(make("fog", RISES | {"mor_m": mor_m})), 2, **FINE), model(), 3)
    nothing = np.zeros((1, len(lab.measured)))
    now = Fit((), (), lab.distance(nothing), nothing)
    fits = [tried(lab, lab, now, nothing, 10.0, probe)[0] for probe in fixed_probes(["fog"])]
    best = min(fits, key=lambda fit: fit.distance)
    linear = min((fit for fit in fits if "overlap_power" not in fit.probes[0].settings), key=lambda fit: fit.distance)
    assert best.probes[0].variant.startswith("smooth")
    assert best.distance < linear.distance - 200.0, [(fit.probes[0].variant, fit.distance) for fit in fits]
    assert best.effects()[0].settings()["overlap_full_m"] == pytest.approx(9.0, rel=0.3)


def test_rain_of_few_small_drops_has_a_start_of_its_own() -> None:
    drops = {
        "beam_diameter_m": 0.001,
        "divergence_mrad": 2.0,
        "drop_shape": 2.0,
        "drop_echo": 6.0,
        "drop_density": 0.15,
    }
    lab = Lab(frames(model(make("rain", drops | {"rate_mm_h": 12.0})), 2, **FINE), model(), 3)
    nothing = np.zeros((1, len(lab.measured)))
    now = Fit((), (), lab.distance(nothing), nothing)
    fits = [tried(lab, lab, now, nothing, 10.0, probe)[0] for probe in fixed_probes(["rain"])]
    best = min(fits, key=lambda fit: fit.distance)
    plain = min((fit for fit in fits if not fit.probes[0].variant), key=lambda fit: fit.distance)
    assert best.probes[0].variant == "large drops"
    assert best.distance < plain.distance - 50.0, [(fit.probes[0].variant, fit.distance) for fit in fits]


def test_a_sheen_is_a_falloff_that_levels_off() -> None:
    angle = np.deg2rad(np.arange(0.0, 91.0, 10.0))
    sheen = {"exponent": 1.0, "factors": tuple((0.5 + 0.5 * np.cos(angle) ** 3).tolist())}
    lab = Lab(frames(model(make("incidence_falloff", sheen)), 2, **FINE), model(), 3)
    nothing = np.zeros((1, len(lab.measured)))
    now = Fit((), (), lab.distance(nothing), nothing)
    fits = [tried(lab, lab, now, nothing, 10.0, probe)[0] for probe in fixed_probes(["incidence_falloff"])]
    best = min(fits, key=lambda fit: fit.distance)
    plain = min((fit for fit in fits if not fit.probes[0].variant), key=lambda fit: fit.distance)
    assert best.probes[0].variant == "levelling"
    assert best.distance - lab.floor_distance < 0.3 * (plain.distance - lab.floor_distance)
