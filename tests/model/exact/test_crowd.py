"""Crowded background looked up locally: against every detector followed one by one, and the same in any company."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from detector_kit import features, follow, light
from lidarcheck.model import detection
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.exact import kernel
from lidarcheck.model.exact.blocks import tabulate
from lidarcheck.model.exact.long_alone import crowded
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.scan import light_of_beams
from lidarcheck.sensor import Sensor

CASES = [
    ("SLIM", 5.5e-4, {}, 0.05),
    ("SLIM", 7.5e-4, {"max_echoes": 8}, 0.5),
    ("SLIM", 5e-4, {"threshold": 7, "max_echoes": 8}, 0.0),
    ("SLIM", 6e-4, {"dead_bins": 23, "max_echoes": 8}, 0.5),
    ("SMART", 1.2e-3, {"threshold": 7, "max_echoes": 8}, 0.05),
]


def local(sensor: Sensor, background: float) -> bool:
    numbers = numbers_of(sensor)  # type: ignore[arg-type]
    blocks = kernel.new_scratch(numbers).blocks
    tabulate(blocks, numbers.detectors, numbers.threshold, background)
    return not crowded(blocks)


@pytest.mark.parametrize(("variant", "background", "overrides", "signal"), CASES)
def test_echoes_agree_with_every_detector_followed_one_by_one(
    variant: str, background: float, overrides: dict[str, float], signal: float
) -> None:
    sensor, n = Sensor.of(variant, **overrides), 20_000
    assert local(sensor, background)
    range_m = np.random.default_rng(3).uniform(1.0, 290.0, n)
    beams = light(signal, n, range_m=range_m, background=background)
    ours, theirs = chain_echoes(beams, sensor, seed=5, threads=1), follow(beams, sensor, seed=6)  # type: ignore[arg-type]
    one, other = features(ours, sensor), features(theirs, sensor)
    p_values = {}
    for column, name in enumerate(("range", "width", "area", "peak"), start=1):
        p_values[name] = stats.ks_2samp(one[:, column].round(3), other[:, column].round(3)).pvalue
    for name, least in (("detection", 0), ("further echoes", 1)):
        mine, his = ours.held > least, theirs.held > least
        error = np.sqrt((mine.var() + his.var()) / n)
        p_values[name] = 2 * stats.norm.sf(abs(mine.mean() - his.mean()) / max(error, 1e-9))
    assert (ours.held > (1 if signal > 0.0 else 0)).sum() > 50
    assert min(p_values.values()) > 1e-3 / len(p_values), p_values


def test_a_beam_has_the_same_echoes_in_any_company(monkeypatch: pytest.MonkeyPatch) -> None:
    """Side by side and on its own: backgrounds that fourteen beams share, and that three do."""
    sensor = Sensor.of("SLIM", max_echoes=8)
    n = 700
    background = np.repeat(np.linspace(4.5e-4, 8e-4, n // 14), 14)
    beams = replace(
        light(0.5, n, range_m=np.random.default_rng(0).uniform(2.0, 200.0, n)), background_per_ns=background
    )
    together = chain_echoes(beams, sensor, seed=2, threads=1)  # type: ignore[arg-type]
    assert together.held.sum() > 1.02 * n
    few = np.arange(n) % 14 < 3
    apart = chain_echoes(light_of_beams(beams, few), sensor, seed=2, threads=1)  # type: ignore[arg-type]
    assert np.array_equal(together.held[few], apart.held)
    held = np.arange(8) < apart.held[:, None]
    assert np.array_equal(together.centre[few][held], apart.centre[held])
    monkeypatch.setattr(detection, "_CHUNK", 37)
    again = chain_echoes(beams, sensor, seed=2, threads=2)  # type: ignore[arg-type]
    assert np.array_equal(again.held, together.held)
