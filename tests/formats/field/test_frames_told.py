"""What is said of all frames together is what one table of them would say, in the memory of one frame."""

import tracemalloc

import numpy as np
import pytest

from bag_kit import CLOUD, PERIOD_NS, START_NS, Message, cdr_cloud, write_ros2
from lidarcheck.formats.describe import describe
from lidarcheck.formats.recognise import write_table
from lidarcheck.formats.table import Table


def frame(number, rows):
    rng = np.random.default_rng(number)
    xyz = {axis: rng.uniform(5, 30, rows) for axis in "xyz"}
    xyz["x"][3] = xyz["y"][3] = xyz["z"][3] = 0.0
    intensity = rng.uniform(0, 255, rows)
    intensity[number::7] = np.nan
    return {**xyz, "intensity": intensity, "ring": rng.integers(0, 16, rows).astype(np.uint16)}


def write(place, count, rows=60):
    messages = [
        Message("/points", CLOUD, START_NS + n * PERIOD_NS, cdr_cloud(frame(n, rows + n))) for n in range(count)
    ]
    return write_ros2(place, messages)


def test_a_bag_is_told_as_its_rows_in_one_table_are(tmp_path):
    bag = describe(write(tmp_path / "a", 6))
    frames = [frame(n, 60 + n) for n in range(6)]
    merged = {name: np.concatenate([one[name] for one in frames]) for name in frames[0]}
    write_table(Table({**merged, "Frame": np.repeat(np.arange(6), [60 + n for n in range(6)])}), tmp_path / "a.csv")
    table = describe(tmp_path / "a.csv")
    assert bag.rows == table.rows == 375
    assert bag.beams == table.beams
    assert bag.range_m == pytest.approx(table.range_m)
    assert bag.facts["no return"] == table.facts["no return"] == "6 rows, 6 of unknown beams"
    told = {column.name: column for column in table.columns}
    for column in bag.columns:
        other = told[column.name]
        assert (column.low, column.high, column.mean) == pytest.approx((other.low, other.high, other.mean))
        assert column.missing == other.missing
    assert bag.facts["frames"] == "6, read one by one; 60 to 65 rows each"
    assert bag.facts["recorded"] == "over 0.5 s, a frame every 0.1 s"
    assert describe(f"{tmp_path}/a/a.mcap#/points@2").rows == 62


def test_a_long_bag_takes_no_more_memory_than_a_short_one(tmp_path):
    peaks = {}
    for count in (3, 30):
        bag = write(tmp_path / str(count), count, rows=20_000)
        tracemalloc.start()
        describe(bag)
        peaks[count] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peaks[30] < 1.3 * peaks[3]
