"""Beams that nothing comes back to have no window: echoes of background, against every detector followed."""

import numpy as np
import pytest

from detector_kit import follow
from lidarcheck.model.detection import chain_echoes
from lidarcheck.scan import Light
from lidarcheck.sensor import Sensor

N = 60_000


@pytest.mark.parametrize(("variant", "background", "threshold"), [("SLIM", 5e-4, 6), ("SMART", 6e-4, 4)])
def test_background_is_seen_from_the_first_bin_on(variant: str, background: float, threshold: int) -> None:
    sensor = Sensor.of(variant, threshold=threshold, max_range_m=8.0)
    (layer, point), none = np.divmod(np.arange(N), 960), np.zeros(0)
    dark = Light(layer, point, np.full(N, background), np.zeros(N + 1, dtype=np.int64), none, none)
    counts = []
    for echoes in (chain_echoes(dark, sensor, seed=5), follow(dark, sensor, seed=6)):  # type: ignore[arg-type]
        centre = echoes.centre[np.arange(echoes.centre.shape[1]) < echoes.held[:, None]]
        early = np.sum(centre <= sensor.on_bins)  # type: ignore[attr-defined]
        counts.append((early, len(centre) - early))
    for ours, theirs in zip(*counts, strict=True):
        assert theirs > 100
        assert abs(ours - theirs) < 4.0 * np.sqrt(ours + theirs), counts
