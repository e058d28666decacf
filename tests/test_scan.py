"""The table of light: dimming, extinction and added pulses, against a beam-by-beam account."""

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.rays import Rays
from lidarcheck.scan import Haze, IdealScan, Light


def light(haze: Haze | None = None) -> Light:
    """Three beams with two, no and one pulse."""
    return Light(
        layer=np.array([1, 1, 2], dtype=np.int32),
        point=np.array([4, 5, 4], dtype=np.int32),
        background_per_ns=np.array([1e-3, 2e-3, 3e-3]),
        first_pulse=np.array([0, 2, 2, 3]),
        pulse_range_m=np.array([10.0, 20.0, 30.0]),
        pulse_signal=np.array([1.0, 2.0, 4.0]),
        pulse_row=np.array([7, 8, 9], dtype=np.int32),
        haze=haze,
    )


def haze() -> Haze:
    return Haze(0.5, np.array([0.0, 2.0, 1.0]), np.array([0, 1, 2, 4]), np.array([9.0, 9, 9, 3]), np.full(4, 0.5))


def pulses(table: Light) -> list[list[tuple[float, float, int]]]:
    """(range, signal, row) of each beam's pulses."""
    rows = list(zip(table.pulse_range_m.tolist(), table.pulse_signal.tolist(), table.rows().tolist(), strict=True))
    return [rows[a:b] for a, b in zip(table.first_pulse[:-1], table.first_pulse[1:], strict=True)]


def test_dimming_reaches_pulses_haze_and_background_of_each_beam() -> None:
    dim = light(haze()).dimmed(np.array([0.5, 0.0, 2.0]), background=np.array([1.0, 0.5, 0.0]))
    assert dim.pulse_signal.tolist() == [0.5, 1.0, 8.0]
    assert dim.background_per_ns.tolist() == [1e-3, 1e-3, 0.0]
    assert dim.haze is not None
    assert dim.haze.row_share.tolist() == [0.25, 0.0, 1.0, 1.0]


def test_extinction_works_there_and_back_and_at_the_middle_of_the_haze_s_cells() -> None:
    behind = light(haze()).attenuated(0.01)
    assert behind.pulse_signal == pytest.approx([np.exp(-0.2), 2 * np.exp(-0.4), 4 * np.exp(-0.6)])
    assert behind.haze is not None
    assert behind.haze.density_per_m == pytest.approx([0.0, 2 * np.exp(-0.015), np.exp(-0.025)])
    assert behind.background_per_ns.tolist() == [1e-3, 2e-3, 3e-3]


def test_added_pulses_stand_behind_their_beams_own() -> None:
    more = light().with_pulses([2, 1, 0, 1], [3.0, 5.0, 6.0, 4.0], [0.1, 0.2, 0.3, 0.4], [3, -1, 5, 6])
    assert pulses(more) == [
        [(10.0, 1.0, 7), (20.0, 2.0, 8), (6.0, 0.3, 5)],
        [(5.0, 0.2, -1), (4.0, 0.4, 6)],
        [(30.0, 4.0, 9), (3.0, 0.1, 3)],
    ]
    assert more.pulse_beam.tolist() == [0, 0, 0, 1, 1, 2, 2]
    plain = light()
    assert plain.with_pulses([], [], []) is plain


def test_rows_are_unknown_where_nobody_said_them() -> None:
    bare = Light([0], [0], [0.0], [0, 1], [5.0], [1.0])  # type: ignore[arg-type]
    assert bare.rows().tolist() == [-1]


def test_sub_beams_share_equally_unless_told() -> None:
    columns = ([3, 3, 4], [1, 1, 1], [5.0, 6.0, 7.0], [1, 1, 1], [0.0, 0.0, 0.0])
    assert IdealScan(*columns).shares().tolist() == [0.5, 0.5, 1.0]  # type: ignore[arg-type]
    told = IdealScan(*columns, share=[1.0, 0.2, 1.0])  # type: ignore[arg-type]
    assert told.shares().tolist() == [1.0, 0.2, 1.0]
    assert told.take(np.array([1])).shares().tolist() == [0.2]


def test_rays_go_with_their_rows_and_must_be_as_many() -> None:
    rays = Rays(np.zeros((3, 3)), np.eye(3), np.array([0.0, 1.0, 2.0]), np.arange(3))
    columns = ([3, 3, 4], [1, 2, 1], [5.0, 6.0, 7.0], [1, 1, 1], [0.0, 0.0, 0.0])
    table = IdealScan(*columns, rays=rays)  # type: ignore[arg-type]
    kept = table.take(np.array([True, False, True])).rays
    assert kept is not None
    assert kept.time_s.tolist() == [0.0, 2.0]
    assert kept.direction.tolist() == [[1, 0, 0], [0, 0, 1]]
    with pytest.raises(UsageError, match="2 rays for a table of 3 rows"):
        IdealScan(*columns, rays=rays.take(np.arange(2)))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="direction has shape"):
        Rays(np.zeros((1, 3)), np.zeros((1, 2)), np.zeros(1), np.zeros(1, dtype=np.int32))
