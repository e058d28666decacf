"""Rays that meet nothing by their estimate: a surface seldom seen shows at one range, what strikes at random not."""

import numpy as np

from lidarcheck.cases.frame import Frame
from lidarcheck.cases.weak_rays import without_weak_rays
from lidarcheck.scan import IdealScan, Scan

LAYER, POINT = (a.ravel() for a in np.meshgrid(np.arange(100, 140), np.arange(300, 340), indexing="ij"))
SURFACE = LAYER < 105


def repeat(k, echoes, part=""):
    """A wall on the lowest layers, and further echoes (layer, point, range)."""
    ideal = IdealScan(LAYER, POINT, np.where(SURFACE, 20.0, 0.0), np.ones(len(LAYER)), np.zeros(len(LAYER)))
    layer, point, range_m = (np.array(c) for c in zip(*echoes, strict=True)) if echoes else (np.zeros(0),) * 3
    scan = Scan.from_beams(
        np.append(LAYER[SURFACE], layer).astype(int),
        np.append(POINT[SURFACE], point).astype(int),
        np.append(np.full(SURFACE.sum(), 20.0), range_m),
    )
    return Frame(k, ideal, scan, 0.1 * k, part=part)


def there(frame):
    return set(zip(frame.ideal.layer.tolist(), frame.ideal.point.tolist(), strict=True))


def test_what_comes_again_beside_is_a_surface_and_left_out_with_its_neighbours() -> None:
    frames = [repeat(0, [(120, 310, 70.0)]), repeat(1, [(120, 312, 70.5)]), repeat(2, [])]
    found = without_weak_rays(frames)
    gone = {(a, b) for a in (119, 120, 121) for b in (309, 310, 311, 312, 313)}
    for frame, before in zip(found, frames, strict=True):
        assert there(before) - there(frame) == gone
        assert frame.measured.layer.max() < 105


def test_what_strikes_anywhere_stays() -> None:
    rng = np.random.default_rng(2)
    drawn = [(rng.integers(106, 140, 30), rng.integers(300, 340, 30), rng.uniform(5, 250, 30)) for _ in range(3)]
    frames = [repeat(k, list(zip(*one, strict=True))) for k, one in enumerate(drawn)]
    found = without_weak_rays(frames)
    kept = sum(int((frame.measured.layer >= 105).sum()) for frame in found)
    assert kept >= 80


def test_an_echo_beside_a_known_surface_at_its_range_is_of_that() -> None:
    [frame, _] = without_weak_rays([repeat(0, [(105, 320, 20.1), (130, 320, 20.1)]), repeat(1, [])])
    assert (105, 320) not in there(frame)
    assert (130, 320) in there(frame)


def test_frames_that_verify_say_nothing_of_the_others() -> None:
    parts = ("fit", "select", "verify")
    frames = [repeat(k, [(120, 310, 70.0)] if part != "select" else [], part) for k, part in enumerate(parts)]
    found = without_weak_rays(frames)
    assert [(120, 310) in there(frame) for frame in found] == [True, True, False]
