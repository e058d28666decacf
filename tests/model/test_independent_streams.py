"""The draws of two effects, and of an effect and the chain, are independent: a stream each, without correlation.

No golden can tell: two effects on one stream would each look as they should.
"""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck import effects
from lidarcheck.effects.finding import empirical_terms
from lidarcheck.model import Model, simulate, streams
from lidarcheck.model.stages import Run, run_of
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, Sensor

CHAIN = ("spads", "threshold", "traces", "reference", "fast", "fast alarms", "fast haze", "fast histories")
"""What the model itself draws for. The effect `threshold` leaves its draws to the chain, which names them so."""
EFFECTS = {**effects.catalogue(), **empirical_terms()}
MODEL = Model(Sensor.of("SMART"), {1: Material("wall", 0.4), 2: Material("sign", 0.8, "retro", 1000.0)})
BEAMS, DRAWS = 10_000, 4


def wall() -> IdealScan:
    """A turned wall with a sign, and sky above it."""
    layer, point = (grid.ravel() for grid in np.meshgrid(np.arange(256, 272), np.arange(474, 490), indexing="ij"))
    sign = (abs(layer - 260) < 3) & (abs(point - 480) < 3)
    distance_m = np.where(layer < 269, 20.0 + 0.2 * (point - 474), 0.0)
    return IdealScan(layer, point, distance_m, np.where(sign, 2, 1), np.full(layer.size, 20.0))


def streams_of_effects() -> dict[str, set[str]]:
    """By effect: the purposes for which a simulation with it alone draws, besides the chain's."""
    asked: list[str] = []
    right = streams.purpose_key

    def noted(purpose: str) -> int:
        asked.append(purpose)
        return right(purpose)

    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(streams, "purpose_key", noted)
        for name, effect in EFFECTS.items():
            asked.clear()
            simulate(wall(), replace(MODEL, effects=(effect(),)), seed=5, threads=1)
            found[name] = set(asked) - set(CHAIN)
    return found


def most_correlated() -> tuple[float, set[str]]:
    """The largest correlation of draws of two streams at the same seed, frame and beam, and whose they are."""
    layer, point = np.divmod(np.arange(BEAMS), 960)
    drawn = {}
    for name, effect in EFFECTS.items():
        drawn[name] = run_of(wall(), MODEL, 7, 3, None, None).of(effect()).uniforms(layer, point, DRAWS)
    drawn.pop("threshold")
    for purpose in CHAIN:
        drawn[f"chain: {purpose}"] = streams.uniforms(7, purpose, 3, layer, point, DRAWS)
    together = np.abs(np.corrcoef(np.concatenate(list(drawn.values()), axis=1).T))
    np.fill_diagonal(together, 0.0)
    worst = np.unravel_index(np.argmax(together), together.shape)
    return float(together[worst]), {list(drawn)[i // DRAWS] for i in worst}


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rain draws for interference."""
    right = Run.of

    def of(run: Run, effect: effects.Effect) -> Run:
        return right(run, effects.find("interference")() if effect.name == "rain" else effect)

    monkeypatch.setattr(Run, "of", of)


def test_every_purpose_has_a_key_of_its_own() -> None:
    purposes = {*EFFECTS, *CHAIN}
    assert len({streams.purpose_key(purpose) for purpose in purposes}) == len(purposes)


def test_an_effect_draws_from_its_own_stream_alone() -> None:
    found = streams_of_effects()
    assert all(own <= {name} for name, own in found.items()), found
    drawing = {name for name, own in found.items() if own}
    assert {"dropout", "timing_jitter", "rain", "interference", "vibration"} <= drawing


def test_no_two_streams_are_correlated() -> None:
    """Draw by draw, and each draw with every other one of another stream."""
    correlation, whose = most_correlated()
    assert correlation < 6.0 / np.sqrt(BEAMS), whose


@pytest.mark.usefixtures("shared")
def test_a_stream_that_two_effects_share_is_noticed() -> None:
    assert streams_of_effects()["rain"] == {"interference"}
    correlation, whose = most_correlated()
    assert correlation > 0.999
    assert whose == {"rain", "interference"}
