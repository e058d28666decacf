"""What searches read off the beams of sensors that are no built-in grid."""

from types import SimpleNamespace

import numpy as np
import pytest

from beams_kit import head, zones
from lidarcheck.effects.search import FreeParameter
from lidarcheck.effects.search.fog_patches import _sector_deg, _sectors
from lidarcheck.effects.search.layer_gain import _lines
from lidarcheck.effects.search.vibration import _times
from lidarcheck.sensor import Sensor


def seen(sensor: Sensor) -> SimpleNamespace:
    layer, point = (lines.astype(np.int64) for lines in sensor.beams.every())
    return SimpleNamespace(sensor=sensor, beams=SimpleNamespace(layer=layer, point=point))


def test_columns_are_fired_when_their_beams_are_on_the_mean() -> None:
    points = np.array([3, 500, 899])
    assert _times(seen(head()), points) == pytest.approx(points * 0.1 / 900 + 15e-6, rel=1e-12)  # type: ignore[arg-type]
    slim = SimpleNamespace(sensor=Sensor.of("SLIM"), beams=SimpleNamespace(layer=np.array([7, 8])))
    assert _times(slim, points).tolist() == (points * (0.03 / 959)).tolist()  # type: ignore[arg-type]


def test_sectors_are_a_degree_of_azimuth_or_whole_points_of_a_grid() -> None:
    evidence = seen(head())
    sector = _sectors(evidence.sensor.beams, evidence.beams)
    azimuth = evidence.sensor.beams.angles_deg(evidence.beams.layer, evidence.beams.point)[1]
    assert np.array_equal(sector, np.floor(azimuth).astype(int) + 180)
    slim = seen(Sensor.of("SLIM"))
    assert np.array_equal(_sectors(slim.sensor.beams, slim.beams), slim.beams.point // 8)
    assert [_sector_deg(s.beams) for s in (Sensor.of("SLIM"), head(), zones())] == [1.0, 1.0, 10.0]


def test_zones_have_gains_of_their_own_and_other_detectors_layers() -> None:
    assert _lines(seen(zones())).tolist() == list(range(9))  # type: ignore[arg-type]
    assert np.array_equal(_lines(seen(head())), seen(head()).beams.layer)  # type: ignore[arg-type]


def test_a_fit_does_not_leave_the_sensors_beams() -> None:
    line = FreeParameter("last_layer", 4.0, whole=True, most=15.0)
    assert [line.decode(x, 0.0, 1e6) for x in (-1.0, 2.1, 5.0)] == [0.0, 8.0, 15.0]
