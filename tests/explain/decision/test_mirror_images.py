"""What a mirror shows of things that no beam meets stays open, and speaks for the name as long as all else is there."""

import numpy as np
import pytest

from explain_core_kit import PANEL, ROAD, WALL, frames, model, street, together
from lidarcheck.effects import make
from lidarcheck.explain.decision.mirror_images import only_images_stay
from lidarcheck.explain.decision.model_check import Open, carries_over
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.wasserstein import PARTS, Scale
from lidarcheck.model import Model, simulate
from lidarcheck.scan import Scan

FINE = {"layers": range(230, 290, 2), "points": range(400, 560, 4)}
MIRROR = make("mirror_multipath", {"reflectivity": 0.9, "material_id": ROAD})
RNG_SEED, COUNT = 3, 60


def measured(true: Model, more_on: int | None = None) -> Scale:
    """Frames of a sensor, with echoes of nothing in view behind some beams of a material."""
    found, rng = [], np.random.default_rng(RNG_SEED)
    for frame in frames(true, 2, **FINE):
        scan = frame.measured
        if more_on is not None:
            there = np.flatnonzero(frame.ideal.material_id == more_on)
            row = rng.choice(there, COUNT, replace=False)
            farther_m = frame.ideal.distance_m[row] + rng.uniform(40.0, 90.0, COUNT)
            extra = Scan.from_beams(
                frame.ideal.layer[row], frame.ideal.point[row], farther_m,
                echo_number=np.full(COUNT, 2), width_ns=np.full(COUNT, 4.0), area=np.full(COUNT, 40.0),
                peak=np.full(COUNT, 12.0),
            )  # fmt: skip
            scan = together(scan, extra)
        found.append(type(frame)(frame.number, frame.ideal, scan, frame.time_s))
    return Scale.of(found, model(), 5)


@pytest.mark.parametrize("more_on", [None, ROAD])
def test_images_of_what_is_not_in_view_may_stay(more_on: int | None) -> None:
    assert only_images_stay(measured(model(MIRROR), more_on), model(MIRROR), Nuisance())


@pytest.mark.parametrize("more_on", [WALL, PANEL])
def test_other_echoes_elsewhere_may_not(more_on: int) -> None:
    assert not only_images_stay(measured(model(MIRROR), more_on), model(MIRROR), Nuisance())


@pytest.mark.parametrize("more_on", [None, ROAD])
def test_what_is_in_view_must_be_seen_in_the_mirror(more_on: int | None) -> None:
    assert not only_images_stay(measured(model(), more_on), model(MIRROR), Nuisance())


def test_without_a_mirror_there_are_no_images() -> None:
    assert not only_images_stay(measured(model(), ROAD), model(), Nuisance())


def test_the_mirror_has_images() -> None:
    """What the tests above rest on: the road shows the wall, in beams that without it have one echo only."""
    ideal = street(0, **FINE)
    plain, mirrored = (simulate(ideal, one, seed=1, threads=1) for one in (model(), model(MIRROR)))
    assert len(mirrored) > len(plain) + 50


@pytest.mark.parametrize(("images", "carries"), [(True, True), (False, False)])
def test_the_names_close_the_gap_but_for_these(images: bool, carries: bool) -> None:
    before = np.full(len(PARTS), 1.0)
    after = np.where([part == "other echoes" for part in PARTS], 0.9, 0.05)
    noise = np.full((4, len(PARTS)), 0.01)
    assert carries_over(Open(before, after, noise, noise, images), ["mirror_multipath"]) == carries
