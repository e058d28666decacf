"""Times from the frame's start, echoes that repeat, fired beams and rows of public data sets."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.formats.assign.bins import bin_columns, rings_by_wrap
from lidarcheck.formats.assign.clock import DRIVERS, frame_time
from lidarcheck.formats.assign.fired import fired_within
from lidarcheck.formats.assign.returns import copies, merged_returns
from lidarcheck.formats.geometry.head import Head
from sensor_beams import HDL32, VLP16, Channels, shoot

SINCE = np.linspace(0.0, 0.0999, 2000)
EPOCH = 1_700_000_000.0


@pytest.mark.parametrize(
    ("driver", "values", "unit", "zero", "exact_s"),
    [
        ("velodyne (ROS)", (SINCE - 0.1).astype(np.float32), "s", "last", 1e-7),
        ("ouster-ros", np.rint(SINCE * 1e9).astype(np.uint32), "ns", "first", 1e-9),
        ("Hesai, RoboSense", SINCE + EPOCH, "s", "epoch", 3e-7),
        ("Livox PointCloud2", (SINCE + EPOCH) * 1e9, "ns", "epoch", 6e-7),
        ("Livox CustomMsg", np.rint(SINCE * 1e9).astype(np.uint32), "ns", "first", 1e-9),
        ("nebula", np.rint(SINCE * 1e9).astype(np.uint32), "ns", "first", 1e-9),
        ("velodyne-decoder", SINCE.astype(np.float32), "s", "first", 1e-7),
    ],
)
def test_each_driver_s_time_is_read(driver: str, values: np.ndarray, unit: str, zero: str, exact_s: float) -> None:
    found = frame_time(values, 0.1)
    assert (found.unit, found.zero) == (unit, zero)
    assert np.abs(found.time_s - SINCE).max() <= exact_s
    row = next(one for one in DRIVERS if one.driver == driver)
    assert (row.dtype, row.unit, row.zero) == (values.dtype.name, unit, zero)


def test_an_integer_stamp_keeps_its_nanoseconds_and_a_declared_unit_is_held() -> None:
    values = np.rint(SINCE * 1e9).astype(np.int64) + 1_700_000_000_123_456_789
    assert np.abs(frame_time(values, 0.1).time_s - SINCE).max() < 1e-9
    assert frame_time(SINCE * 1e3, 0.1, unit="ms").time_s[-1] == pytest.approx(SINCE[-1])
    with pytest.raises(UsageError, match='time_unit = "ms"'):
        frame_time(SINCE * 1e3, 0.1, unit="s")
    with pytest.raises(UsageError, match=r"no frame of 0\.1 s"):
        frame_time(SINCE * 1e5, 0.1)


def test_the_stamp_is_the_start_where_it_is_near_and_rows_without_a_time_stay_without() -> None:
    values = np.r_[np.nan, SINCE + EPOCH]
    near, far = (frame_time(values, 0.1, stamp_s=EPOCH - before) for before in (0.02, 5.0))
    assert near.time_s[1] == pytest.approx(0.02, abs=1e-6)
    assert far.time_s[1] == 0.0
    assert np.isnan(near.time_s[0])


def test_a_copy_is_another_number_of_the_same_echo() -> None:
    layer, point = np.array([1, 1, 1, 1, 2]), np.array([5, 5, 6, 6, 6])
    ranges = np.array([8.0, 8.002, 8.0, 8.0, 8.0])
    intensity, number = np.array([7, 7, 7, 9, 7]), np.array([1, 2, 1, 2, 1])
    found = copies(layer, point, ranges, 0.004, apart=[number], features=[intensity])
    assert found.tolist() == [False, True, False, False, False]
    assert not copies(layer, point, ranges, 0.002, apart=[number], features=[intensity])[1]
    same = np.array([1, 1, 1, 1, 1])
    assert not copies(layer, point, ranges, 0.004, apart=[same], features=[intensity]).any()
    # Without numbers a copy stands beside its twin in the order of rows.
    assert copies(layer, point, ranges, 0.004, features=[intensity])[1]
    apart = np.array([0, 4, 1, 2, 3])
    assert not copies(layer[apart], point[apart], ranges[apart], 0.002, features=[intensity[apart]]).any()


def test_two_clouds_of_one_frame_are_merged_and_another_frame_s_is_not() -> None:
    first = {"ring": np.arange(4), "t": np.arange(4) * 10, "RANGE": np.ones(4)}
    second = {"ring": np.arange(4), "t": np.arange(4) * 10, "RANGE": np.full(4, 2.0)}
    merged = merged_returns([first, second])
    assert merged["return"].tolist() == [1] * 4 + [2] * 4
    assert merged["RANGE"].tolist() == [1.0] * 4 + [2.0] * 4
    with pytest.raises(UsageError, match="cloud 2 is another frame"):
        merged_returns([first, {**second, "t": second["t"] + 1_000_000}])


@pytest.mark.parametrize("beams", [VLP16, HDL32])
def test_fired_beams_are_those_within_the_frame_s_time(beams: Channels) -> None:
    shot = shoot(beams, keep=0.3)
    part = (shot.point >= 100) & (shot.point <= 300)
    fired = fired_within(Head.of(beams.beams()), shot.layer[part], shot.point[part])
    assert fired is not None
    assert fired.source == "sensor"
    assert fired.has(shot.layer[part], shot.point[part]).all()
    inside = fired.point[(fired.point > 101) & (fired.point < 299)]
    assert len(inside) == 197 * beams.layers
    assert fired.point.min() >= 99
    assert fired.point.max() <= 301
    assert fired_within(Head.of(beams.beams()), np.array([-1]), np.array([-1])) is None


def kitti_rows() -> tuple[np.ndarray, np.ndarray]:
    beams = replace(VLP16, elevation=np.linspace(2.0, -24.8, 64), fire_us=0.0, step=0.18, points=2000, first=0.05)
    shot = shoot(beams, every=10, keep=0.8)
    order = np.lexsort((shot.point, shot.layer))
    position, layer = shot.position[order], shot.layer[order]
    return np.column_stack([position, np.full(len(layer), 0.4)]).astype(np.float32), layer


def test_kitti_rows_have_rings_where_the_azimuth_wraps() -> None:
    rows, layer = kitti_rows()
    position = np.stack([bin_columns(rows)[name] for name in "XYZ"], axis=-1).astype(float)
    assert np.array_equal(rings_by_wrap(position), layer)
    assert rings_by_wrap(position[layer < 60]) is None
    assert rings_by_wrap(position[np.random.default_rng(0).permutation(len(position))]) is None


def test_nuscenes_rows_have_a_ring_and_a_ring_of_minus_one_is_none() -> None:
    rows, layer = kitti_rows()
    assert np.array_equal(bin_columns(np.column_stack([rows, layer]).astype(np.float32))["ring"], layer)
    assert "ring" not in bin_columns(np.column_stack([rows, np.full(len(rows), -1.0)]).astype(np.float32))
    with pytest.raises(UsageError, match="is no ring"):
        bin_columns(np.column_stack([rows, layer + 0.5]).astype(np.float32))
    with pytest.raises(UsageError, match="4 or 5 numbers a row"):
        bin_columns(rows[:, :3])
