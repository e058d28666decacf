"""Signs and their ghosts, found in frames of the independent simulator whose truth is known, and in real rows."""

from dataclasses import replace

import numpy as np
import pytest

from ghost_frames import GHOST_LABEL, Recipe, made, scan_of
from lidarcheck.calibration.ghosts.targets import typical
from lidarcheck.calibration.ghosts.workflow import GHOST, OTHER, SIGN, find_ghosts
from lidarcheck.errors import InputError
from lidarcheck.figures.pages.ghosts import find_page
from lidarcheck.formats import load_scan
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor
from places import shared_path

RANGES_M = (25.0, 45.0, 65.0, 85.0)


def beams_scan(layer, point, range_m, area, peak=200.0) -> Scan:
    """Echoes of given beams, for cases that are made by hand."""
    n = len(np.atleast_1d(layer))
    columns = (np.broadcast_to(np.asarray(c, dtype=np.float64), n) for c in (range_m, area, peak))
    r, a, p = columns
    return Scan.from_beams(np.asarray(layer), np.asarray(point), r, area=a, peak=p, width_ns=np.full(n, 20.0),
                           echo_number=np.ones(n, dtype=np.int32))  # fmt: skip


def counted(frame, label):
    """Precision and recall of sign and ghost."""
    both = [(np.count_nonzero((label == k) & (frame.label == k)), np.count_nonzero(label == k),
             np.count_nonzero(frame.label == k)) for k in (SIGN, GHOST)]  # fmt: skip
    return np.array(both)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
@pytest.mark.parametrize("hard", [False, True])
def test_sign_and_ghost_at_four_distances(variant, hard):
    """Noise behind the sign, strays, blooming and a wall at twice the range, from seeds that nothing was tuned on."""
    total = np.zeros((2, 3), dtype=int)
    for k, range_m in enumerate(RANGES_M):
        recipe = Recipe(variant=variant, range_m=range_m, seed=7000 + k, ratio=2.5e-4, turn_deg=9.0)
        if hard:
            recipe = replace(
                recipe, wall_at_ghost=True, noise_share=0.5, blooming="medium", ghost_share=0.6, second_sign=k == 1
            )
        frame = made(recipe)
        total += counted(frame, find_ghosts(scan_of(frame)).label)
    right, found, true = total.T
    assert np.all(true > 80)
    assert np.all(right / found >= 0.98)
    assert np.all(right / true >= 0.98)


def test_the_range_is_the_sign_s_own_whatever_glimmers_behind_it():
    quiet, noisy = (
        find_ghosts(scan_of(made(Recipe(range_m=45.0, seed=31, noise_share=share, ratio=2e-4)))) for share in (0.0, 0.8)
    )
    assert noisy.signs[0].range_m == pytest.approx(quiet.signs[0].range_m, abs=0.02)
    assert noisy.signs[0].pulled > quiet.signs[0].pulled


def test_echoes_that_most_beams_have_drawn_away_do_not_pull_the_plane():
    rng = np.random.default_rng(4)
    layer, point = (a.ravel() + 250 for a in np.mgrid[0:20, 0:12])
    own = 30.0 + 0.01 * (layer - 260) + rng.normal(0.0, 0.01, len(layer))
    drawn = rng.random(len(layer)) < 0.55
    late = own + np.where(drawn, rng.uniform(0.1, 0.9, len(layer)), 0.0)
    sign = find_ghosts(beams_scan(layer, point, late, 5000.0)).signs[0]
    assert sign.range_m == pytest.approx(30.0, abs=0.02)
    assert abs(np.mean(late) - 30.0) > 0.2
    assert sign.pulled == pytest.approx(np.count_nonzero(late - own > 0.15), abs=12)


def test_the_most_frequent_value_is_not_pulled():
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.normal(10.0, 0.01, 60), rng.uniform(10.05, 12.0, 90)])
    assert typical(values) == pytest.approx(10.0, abs=0.02)
    assert np.median(values) > 10.2
    assert typical(np.array([3.0])) == 3.0
    assert typical(np.repeat([2.0, 2.01, 2.02], [4, 9, 4])) == pytest.approx(2.01)


def test_a_sign_without_ghost_says_so_with_a_limit():
    frame = made(Recipe(seed=41, ghost_share=0.0, wall_at_ghost=True))
    found = find_ghosts(scan_of(frame))
    sign = found.signs[0]
    assert not sign.has_ghost
    assert np.count_nonzero(found.label == GHOST) == 0
    assert 0.0 < sign.fraction_high < 0.03
    assert "no ghost" in found.notes[0]
    assert find_page([found]).summary.startswith("No ghost")


def test_a_wall_beside_the_sign_at_twice_its_range_is_no_ghost():
    frame = made(Recipe(range_m=30.0, seed=42, wall_at_ghost=True, ratio=2e-4))
    found = find_ghosts(scan_of(frame))
    ghosts = found.label == GHOST
    beside = (np.abs(found.scan.range_m - 60.3) < 1.0) & (frame.label == OTHER)
    assert np.count_nonzero(beside) > 100
    assert not np.any(ghosts & beside)
    assert np.count_nonzero(ghosts) == np.count_nonzero(frame.label == GHOST_LABEL)


def test_a_wide_beam_that_sees_past_the_sign_makes_no_ghost():
    """At the edge half the light passes by: the wall at twice the range shows there and beside, never in the core."""
    layer, point = (a.ravel() for a in np.mgrid[240:270, 470:490])
    on = (np.abs(layer - 255) <= 6) & (np.abs(point - 480) <= 4)
    edge = on & ((np.abs(layer - 255) == 6) | (np.abs(point - 480) == 4))
    sign = beams_scan(layer[on], point[on], 30.0, 5600.0)
    wall = beams_scan(layer[~on], point[~on], 60.2, 400.0, 50.0)
    past = beams_scan(layer[edge], point[edge], 60.2, 200.0, 25.0)
    parts = (sign, wall, past)
    columns = {
        name: np.concatenate([getattr(p, name) for p in parts])
        for name in ("layer", "point", "range_m", "echo_number", "width_ns", "area", "peak")
    }
    both = Scan.from_beams(**columns)
    assert not find_ghosts(both).signs[0].has_ghost
    inner = on & ~edge
    ghost = beams_scan(layer[inner], point[inner], 60.2, 210.0, 26.0)
    columns = {name: np.concatenate([columns[name], getattr(ghost, name)]) for name in columns}
    with_ghost = find_ghosts(Scan.from_beams(**columns)).signs[0]
    assert len(with_ghost.ghost_rows) >= np.count_nonzero(inner)


@pytest.mark.parametrize(("name", "signs", "ghosts"), [("1_25m.txt", 4, 4), ("2_45m.txt", 6, 2)])
def test_rows_of_a_real_sign(name, signs, ghosts):
    found = find_ghosts(load_scan(shared_path(f"samples/{name}")))
    own = found.scan.range_m < 46.0
    own &= ~((found.scan.range_m > 45.0) & (name == "1_25m.txt"))
    assert found.label.tolist() == np.where(own, SIGN, GHOST).tolist()
    sign = found.signs[0]
    assert (len(sign.rows), len(sign.ghost_rows)) == (signs, ghosts)
    assert 0.1 < sign.offset_m < 0.4
    assert sign.ratio.range_ratio == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("number", [0, 3, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2))])
def test_an_indoor_scan_without_ghosts_has_none(number):
    found = find_ghosts(load_scan(shared_path(f"data/hesai_xt32/rotation_{number}.parquet")))
    assert found.brightness.column == "INTENSITY"
    assert not any(sign.has_ghost for sign in found.signs)
    assert np.count_nonzero(found.label == GHOST) == 0
    assert find_page([found]).summary.startswith("No ghost")


@pytest.mark.parametrize("name", ["SLIM_sign", "SMART_street"])
def test_reference_frames_without_effects_have_signs_and_no_ghost(name):
    found = find_ghosts(load_scan(shared_path(f"data/reference_frames/{name}_echoes.txt")))
    assert found.signs
    assert np.count_nonzero(found.label == GHOST) == 0


def test_what_is_left_is_signs_and_ghosts_with_their_labels():
    frame = made(Recipe(seed=43, ratio=2e-4))
    found = find_ghosts(scan_of(frame))
    part = found.stripped()
    assert len(part) == np.count_nonzero(found.label)
    assert sorted(set(part.extra["Label"])) == [SIGN, GHOST]
    assert set(part.extra["SignNumber"]) == {1}
    assert part.range_m[part.extra["Label"] == GHOST].min() > 1.9 * part.range_m[part.extra["Label"] == SIGN].max()
    ratio = found.signs[0].ratio
    assert ratio.size_ratio == pytest.approx(2.0, abs=0.15)
    assert ratio.range_ratio == pytest.approx(2.0, abs=0.05)


def test_the_largest_cut_sign_is_called_cut():
    cut = find_ghosts(scan_of(made(Recipe(seed=2, azimuth_deg=-3.8, ratio=2e-4))))
    assert cut.signs[0].cut == ("point 448",)
    assert "cut by the field of view" in cut.notes[0]
    whole = find_ghosts(scan_of(made(Recipe(seed=2, ratio=2e-4))))
    assert whole.signs[0].cut == ()


def test_a_ghost_beyond_what_the_sensor_measures_is_not_asked_for():
    found = find_ghosts(scan_of(made(Recipe(seed=6, range_m=160.0))))
    assert "beyond the 300 m" in found.notes[0]


def test_every_second_beam_is_enough():
    frame = made(Recipe(seed=44, ratio=2e-4, layers=range(232, 296, 2), points=range(448, 512, 2)))
    right, found, true = counted(frame, find_ghosts(scan_of(frame)).label).T
    assert np.all(right >= 0.98 * np.maximum(found, true))


def test_a_short_pulse_makes_a_sign_no_brighter_than_a_wall_and_the_ghost_tells():
    """Pulses so short that no SPAD fires twice: the sign is saturated like near walls, and found by its ghost alone."""
    layer, point = (a.ravel() for a in np.mgrid[250:270, 470:486])
    rng = np.random.default_rng(3)
    sign = beams_scan(layer, point, 30.0 + rng.normal(0, 0.01, len(layer)), 2830.0, 236.0)
    ghost = beams_scan(layer, point, 60.3 + rng.normal(0, 0.05, len(layer)), 500.0, 60.0)
    names = ("layer", "point", "range_m", "echo_number", "width_ns", "area", "peak")
    both = Scan.from_beams(**{n: np.concatenate([getattr(sign, n), getattr(ghost, n)]) for n in names})
    assert np.count_nonzero(find_ghosts(both).label == GHOST) == len(layer)
    with pytest.raises(InputError, match="no sign"):
        find_ghosts(sign)


# --- what is refused ------------------------------------------------------------------------------------------------


def test_a_scan_without_sign_says_what_is_there():
    scan = scan_of(made(Recipe(seed=1, gain=1e-4)))
    with pytest.raises(InputError, match=r"no sign: the brightest of \d+ echoes has AREA \d+ at .* at least 3119"):
        find_ghosts(scan, name="street")
    with pytest.raises(InputError, match="no echoes"):
        find_ghosts(scan.take(np.zeros(0, dtype=int)))


def test_near_bright_surfaces_are_no_signs():
    layer, point = (a.ravel() for a in np.mgrid[250:265, 470:480])
    with pytest.raises(InputError, match="could be ordinary surfaces that are near"):
        find_ghosts(beams_scan(layer, point, 5.0, 4000.0, 236.0))


def test_single_bright_echoes_are_no_sign():
    with pytest.raises(InputError, match="no three of them side by side"):
        find_ghosts(beams_scan([100, 200, 300], [100, 500, 800], 40.0, 5000.0, 236.0))


def test_a_sign_elsewhere_than_expected_is_named():
    scan = scan_of(made(Recipe(seed=43, ratio=2e-4)))
    with pytest.raises(InputError, match=r"no sign at 45 m .* signs found: \d+ echoes at 24\.7"):
        find_ghosts(scan, expected_m=(45.0,))
    assert find_ghosts(scan, expected_m=(25.0,)).signs


def test_a_scan_without_amplitude_is_refused():
    bare = Scan.from_beams(np.array([1, 2, 3]), np.array([1, 1, 1]), np.full(3, 9.0))
    with pytest.raises(InputError, match="no amplitude"):
        find_ghosts(bare)


def test_a_threshold_of_one_s_own():
    frame = made(Recipe(seed=43, ratio=2e-4))
    with pytest.raises(InputError, match="99999, as given"):
        find_ghosts(scan_of(frame), above=99999.0)
    given = find_ghosts(scan_of(frame), above=2000.0, sensor=Sensor.of("SLIM"))
    assert given.brightness.why == "as given"
    assert np.count_nonzero(given.label == GHOST) == np.count_nonzero(frame.label == GHOST_LABEL)
