"""Covariates, summaries and the split: what is in which bin, what is chance, and what a shift moves."""

import dataclasses
import itertools
import random
import re

import numpy as np
import pytest

from explain_core_kit import MATERIALS, PANEL, SIGN, at_ranges, frames, model, street, together
from lidarcheck.cases.frame import Frame
from lidarcheck.cases.split import Split, split_frames
from lidarcheck.errors import UsageError
from lidarcheck.inference import optimiser
from lidarcheck.inference.observed.beam_table import beams_of
from lidarcheck.inference.observed.expectation import _smooth_probability
from lidarcheck.inference.observed.observations import observations_of
from lidarcheck.inference.observed.strata import Division, binned, divisions, fine_divisions
from lidarcheck.inference.observed.summaries import compressed
from lidarcheck.inference.simulator import Simulator
from lidarcheck.model import simulate
from lidarcheck.scan import IdealScan, Scan

NAMES = {i: m.name for i, m in MATERIALS.items()}
COUNTED = ("echoes in front", "echoes behind", "echoes without a surface", "other echoes")


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    return Simulator(frames(model(), 2, sign=True), model(), 11)


@pytest.fixture(scope="module")
def beams():
    return beams_of([street(k, sign=True) for k in range(3)], model())


@pytest.fixture(scope="module")
def log_area(beams):
    """Some amplitude for all but a few beams."""
    rng = np.random.default_rng(1)
    area = np.where(beams.distance_m > 0.0, rng.uniform(4.0, 9.0, len(beams)), np.nan)
    area[beams.distance_m > 25.0] = np.nan
    return area


@pytest.fixture(scope="module")
def found(beams, log_area) -> dict[str, Division]:
    every = [*divisions(beams, log_area, NAMES), *fine_divisions(beams)]
    assert len({d.covariate for d in every}) == len(every)
    return {d.covariate: d for d in every}


def test_every_bin_has_beams_and_a_name_of_its_own(found, beams) -> None:
    for division in found.values():
        assert division.bin.shape == (len(beams),)
        assert division.bin.min() >= -1
        used = set(division.bin[division.bin >= 0].tolist())
        assert division.covariate == "field of view" or used == set(range(len(division.names)))
        assert used <= set(range(len(division.names)))
        assert len(set(division.names)) == len(division.names)


def test_who_takes_part(found, beams, log_area) -> None:
    hit = beams.distance_m > 0.0
    bright = beams.bright > 0
    expected = {
        "all": np.ones(len(beams), dtype=bool),
        "range": hit,
        "incidence": hit,
        "material": hit,
        "amplitude": hit,
        "layers to a bright target": bright[:, :2].any(axis=1),
        "points to a bright target": bright[:, 2:].any(axis=1),
    }
    for name, division in found.items():
        takes_part = expected.get(name, expected["all"])
        assert np.array_equal(division.bin >= 0, takes_part), name
    assert bright.any()


@pytest.mark.parametrize(("covariate", "column"), [("range", "distance_m"), ("incidence", "incidence_deg")])
def test_bins_of_a_number_hold_what_their_names_say(found, beams, covariate: str, column: str) -> None:
    division, value = found[covariate], getattr(beams, column)
    for i, name in enumerate(division.names):
        mine = value[division.bin == i]
        ends = [float(x) for x in re.findall(r"[\d.]+", name)]
        assert mine.min() >= ends[0]
        assert name.startswith("over") or mine.max() < ends[1]


@pytest.mark.parametrize("covariate", ["layer", "point", "frame", "each layer"])
def test_strips_and_numbers_hold_what_their_names_say(found, beams, covariate: str) -> None:
    division, value = found[covariate], getattr(beams, covariate.removeprefix("each "))
    for i, name in enumerate(division.names):
        ends = [int(x) for x in name.split("-")]
        mine = value[division.bin == i]
        assert ends[0] <= mine.min() <= mine.max() <= ends[-1]


def test_materials_the_map_and_amplitudes_hold_what_their_names_say(found, beams, log_area) -> None:
    for i, name in enumerate(found["material"].names):
        assert {NAMES[m] for m in beams.material_id[found["material"].bin == i]} == {name}
    for i in np.unique(found["field of view"].bin):
        mine = found["field of view"].bin == i
        first, last, left, right = map(int, re.findall(r"\d+", found["field of view"].names[i]))
        assert ((beams.layer[mine] >= first) & (beams.layer[mine] <= last)).all()
        assert ((beams.point[mine] >= left) & (beams.point[mine] <= right)).all()
    amplitude = found["amplitude"]
    assert amplitude.names[-1] == "seldom seen"
    assert np.array_equal(amplitude.bin == len(amplitude.names) - 1, np.isnan(log_area) & (beams.distance_m > 0.0))
    starts = [float(name.removeprefix("AREA from ")) for name in amplitude.names[:-1]] + [np.inf]
    assert {2000.0, 4000.0} < set(starts)
    for i, (low, high) in enumerate(itertools.pairwise(starts)):
        mine = np.exp(log_area[amplitude.bin == i])
        assert mine.min() >= (low - 0.5 if i else 0.0)
        assert mine.max() < high + 0.5


def test_offsets_to_a_bright_target_are_told_with_their_side(found, beams) -> None:
    seen = set()
    for first, covariate in ((0, "layers to a bright target"), (2, "points to a bright target")):
        for i, name in enumerate(found[covariate].names):
            side = ("above", "below", "left", "right").index(name.split("target ")[1])
            seen.add(side)
            mine = beams.bright[found[covariate].bin == i]
            ends = [int(x) for x in re.findall(r"\d+", name)]
            other = mine[:, 2 * first + 1 - side]
            assert mine[:, side].min() >= ends[0] + name.startswith("over")
            assert name.startswith("over") or mine[:, side].max() <= ends[1]
            assert ((other == 0) | (other >= mine[:, side])).all()
    assert seen == {0, 1, 2, 3}


def test_edges_are_told_by_what_stands_beside(beams) -> None:
    layer, point = np.array([5, 5, 5, 5, 5, 6, 6, 6, 6, 6]), np.tile(np.arange(5), 2)
    distance = np.array([10.0, 10.1, 30.0, 30.1, 0.0, 0.0, 10.1, 30.0, 30.1, 0.0])
    lone = IdealScan([9, 20], [1, 40], np.zeros(2), np.ones(2), np.zeros(2))
    few = beams_of([IdealScan(layer, point, distance, np.ones(10), np.zeros(10)), lone], model())
    edge = next(d for d in divisions(few, np.full(12, np.nan), {}) if d.covariate == "edge")
    on_progress = [edge.names[i] for i in edge.bin[:10]]
    assert on_progress[0] == "the sky's edge"
    assert on_progress[1] == "a farther edge"
    assert on_progress[2] == "a nearer edge"
    assert on_progress[3] == "the sky's edge"
    assert on_progress[4] == "beside a surface"
    assert on_progress[5] == "beside a surface"
    assert {edge.names[i] for i in edge.bin[10:]} == {"sky"}


def test_no_value_and_no_amplitude_take_no_part() -> None:
    division = binned("x", np.array([np.nan, 0.5, 1.0, 9.0]), (0.0, 1.0, 2.0), "m")
    assert division.bin.tolist() == [-1, 0, 1, 2]
    assert division.names == ("0-1 m", "1-2 m", "over 2 m")
    few = beams_of([IdealScan([1], [1], [0.0], [1], [0.0])], model())
    names = {d.covariate for d in divisions(few, np.array([np.nan]), {})}
    assert names == {"all", "layer", "point", "frame", "edge"}


def test_compressed_is_the_number_itself_near_zero_and_its_logarithm_far_off() -> None:
    z = np.linspace(-300.0, 300.0, 2001)
    c = compressed(z)
    assert (np.diff(c) > 0.0).all()
    assert c == pytest.approx(-compressed(-z))
    assert (np.abs(c) <= np.abs(z)).all()
    assert compressed(np.array([0.0, 0.01, 0.5])) == pytest.approx([0.0, 0.01, 0.5], rel=0.01)
    doublings = np.diff(compressed(1e3 * 2.0 ** np.arange(6)))
    assert doublings == pytest.approx(doublings[0], rel=1e-3)
    assert compressed(np.array([1e3]))[0] < 30.0


def test_summaries_are_about_standard_normal_where_nothing_is_missing(simulator) -> None:
    z = np.array([simulator.summaries.plain(simulator.observations(model(), 40_000 + k)) for k in range(40)])
    rare = np.array([name.feature in COUNTED for name in simulator.summaries.names])
    assert len(set(simulator.summaries.names)) == len(simulator.summaries) == z.shape[1] > 300
    plain = z[:, ~rare]
    assert abs(plain.mean()) < 0.1
    assert 0.75 < np.sqrt((plain**2).mean()) < 1.25
    assert np.abs(plain.mean(axis=0)).max() < 1.2
    assert (np.abs(plain) > 3.5).mean() < 0.005
    assert 0.05 < z[:, rare].std() < 1.25
    assert (np.abs(z[:, rare]) > 5.0).mean() < 0.002


def shift_of(simulator: Simulator, change) -> dict[tuple[str, str, str], float]:
    """Change of each summary when a scan of the model's is changed by hand, in standard deviations."""
    scans = simulator.scans(model(), 33_000)
    plain = simulator.summaries.plain(observations_of(simulator.beams, scans))
    changed = [change(scan, frame.ideal) for scan, frame in zip(scans, simulator.frames, strict=True)]
    z = simulator.summaries.plain(observations_of(simulator.beams, changed)) - plain
    return {tuple(name): value for name, value in zip(simulator.summaries.names, z, strict=True)}


def of_material(scan: Scan, ideal: IdealScan, material: int):
    there = ideal.material_id == material
    return np.isin(scan.layer * 1000 + scan.point, ideal.layer[there] * 1000 + ideal.point[there])


def test_longer_ranges_of_one_material_show_there(simulator) -> None:
    def longer(scan: Scan, ideal: IdealScan) -> Scan:
        return at_ranges(scan, scan.range_m + 0.1 * of_material(scan, ideal, PANEL))

    z = shift_of(simulator, longer)
    assert z["range", "material", "panel"] > 8.0
    assert z["range", "all", "all beams"] > 3.0
    assert all(abs(z["range", "material", other]) < 1e-9 for other in ("wall", "road", "sign"))
    # At an edge another echo may now be the nearer one.
    assert max(abs(v) for name, v in z.items() if name[0] in ("area", "peak", "width", "detected")) < 3.0


def test_a_lost_layer_shows_in_its_place(simulator) -> None:
    z = shift_of(simulator, lambda scan, ideal: scan.take(scan.layer != 254))
    assert z["detected", "each layer", "254"] < -5.0
    others = {name[2]: v for name, v in z.items() if name[:2] == ("detected", "each layer") and name[2] != "254"}
    assert len(others) >= 15
    assert max(map(abs, others.values())) < 1e-9
    strips = {name[2]: v for name, v in z.items() if name[:2] == ("detected", "layer")}
    worst = min(strips, key=strips.get)
    low, _, high = worst.partition("-")
    assert int(low) <= 254 <= int(high or low)


def test_echoes_at_twice_a_retro_reflector_s_range_show_there(simulator) -> None:
    def ghosts(scan: Scan, ideal: IdealScan) -> Scan:
        own = np.flatnonzero(of_material(scan, ideal, SIGN))[:10]
        few = scan.take(own)
        plate_m = ideal.distance_m[ideal.material_id == SIGN].mean()
        return together(scan, at_ranges(few, np.full(len(few), 2.0 * plate_m)))

    z = shift_of(simulator, ghosts)
    added = sum(len(ghosts(f.measured, f.ideal)) - len(f.measured) for f in simulator.frames)
    assert added >= 15
    assert z["other echoes", "over their retro-reflector's range", "1.95-2.05 times"] > 8.0
    ratios = {k[2]: v for k, v in z.items() if k[:2] == ("other echoes", "over their retro-reflector's range")}
    assert all(v == 0.0 for name, v in ratios.items() if name != "1.95-2.05 times")
    assert z["echoes behind", "material", "sign"] > 8.0
    assert z["echoes in front", "all", "all beams"] == z["echoes without a surface", "all", "all beams"] == 0.0
    assert max(abs(v) for k, v in z.items() if k[0] in ("range", "area", "detected", "area scatter")) < 1e-9


def test_frames_without_any_echo_or_surface_are_summed_up_all_the_same() -> None:
    sky = IdealScan(*(c.ravel() for c in np.meshgrid(range(400, 410), range(300, 310))), *np.zeros((3, 100)))
    nothing = Scan.from_beams(np.zeros(0, int), np.zeros(0, int), np.zeros(0))
    frame = Frame(0, sky, nothing, 0.0)
    simulator = Simulator([frame, dataclasses.replace(frame, number=1)], model(), 3)
    assert np.isfinite(simulator.measured).all()
    assert np.abs(simulator.measured).max() < 4.0
    blind = Simulator([dataclasses.replace(f, measured=nothing) for f in frames(model())], model(), 3)
    assert np.isfinite(blind.measured).all()
    assert blind.distance(np.zeros((1, len(blind.measured)))) > 10.0 * blind.floor_distance


def cheap_frames(distances: list[float]) -> list[Frame]:
    nothing = Scan.from_beams(np.zeros(0, int), np.zeros(0, int), np.zeros(0))
    return [
        Frame(i, IdealScan([1, 1], [1, 2], [d, d], [1, 1], [0.0, 0.0]), nothing, 0.0) for i, d in enumerate(distances)
    ]


@pytest.mark.parametrize("count", range(3, 15))
def test_the_split_deals_every_frame_once_over_all_distances(count: int) -> None:
    given = cheap_frames(random.Random(count).sample(range(5, 100), count))
    split = split_frames(given)
    dealt = [number for numbers in split.numbers().values() for number in numbers]
    assert sorted(dealt) == list(range(count))
    assert split.select
    assert split.verify.numbers
    assert len(split.fit) >= len(split.verify.numbers) >= len(split.select)
    assert len(split.fit) == (2 if count == 4 else (count + 1) // 2 if count > 4 else 1)
    rank = {f.number: i for i, f in enumerate(sorted(given, key=lambda f: f.ideal.distance_m[0]))}
    ranks = sorted(rank[f.number] for f in split.fit)
    assert ranks[0] == 0
    assert ranks[-1] >= count - 2 or count == 3
    assert all(b - a <= 3 for a, b in itertools.pairwise(ranks))
    words = split.words()
    assert all(str(number) in words for number in range(count))
    assert split.numbers()["verify"] == tuple(f.number for f in split.verify.look())


def test_the_frames_that_verify_are_looked_at_once() -> None:
    split = split_frames(cheap_frames([10.0, 20.0, 30.0]))
    assert len(split.verify.look()) == 1
    with pytest.raises(RuntimeError, match="looked at already"):
        split.verify.look()
    assert split.numbers()["verify"] == split.verify.numbers


def test_the_split_depends_on_the_scenes_alone() -> None:
    given = cheap_frames([30.0, 0.0, 10.0, 10.0, 50.0, 20.0, 40.0])
    split = split_frames(given)
    assert split_frames(given[::-1]).numbers() == split.numbers()
    measured = simulate(street(0), model(), seed=1)
    other = split_frames([dataclasses.replace(f, measured=measured, time_s=9.0) for f in given])
    assert other.numbers() == split.numbers()


def test_the_frames_of_the_fit_have_in_view_what_the_others_have() -> None:
    """Two each of three places, in an order of distances that would deal both of one place to the fit."""
    distances, places = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0], [1, 2, 1, 3, 2, 3]

    def dealt(materials: list[int]) -> tuple[Split, list[set[int]]]:
        given = [
            dataclasses.replace(f, ideal=dataclasses.replace(f.ideal, material_id=np.array([m, 9])))
            for f, m in zip(cheap_frames(distances), materials, strict=True)
        ]
        split = split_frames(given)
        return split, [{materials[number] for number in numbers} for numbers in split.numbers().values()]

    split, (fit, _, _) = dealt(places)
    assert fit == {1, 2, 3}
    assert [len(numbers) for numbers in split.numbers().values()] == [3, 1, 2]
    alike = split_frames(cheap_frames(distances))
    assert dealt([5] * 6)[0].numbers() == alike.numbers()
    assert split.numbers() != alike.numbers()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_frames_are_refused(count: int) -> None:
    with pytest.raises(UsageError, match=f"{count} frames? (is|are) too few") as error:
        split_frames(cheap_frames([10.0] * count))
    assert "at least 3" in error.value.fix


def lost(scan: Scan) -> Scan:
    """Without one echo in sixty."""
    return scan.take(np.arange(len(scan)) % 60 != 7)


@pytest.mark.parametrize(("changed", "off"), [(lost, True), (None, False)])
def test_few_beams_of_bright_surfaces_that_are_lost_say_much(changed, off: bool) -> None:
    """The wall and the panel are always seen: that of a thousand beams none is lost is known to less than one beam."""
    fine = {"layers": range(250, 290, 2), "points": range(320, 640, 6)}
    simulator = Simulator(frames(model(), 3, changed=changed, **fine), model(), 11)
    bright = simulator.summaries.expected.known & (simulator.beams.distance_m > 0.0)
    sure = np.mean([simulator.observations(simulator.model, 900 + k).detected for k in range(8)], axis=0) == 1.0
    probability = simulator.summaries.expected.probability[bright & sure]
    assert np.mean(probability > 0.995) > 0.8
    at = [
        k for k, name in enumerate(simulator.summaries.names) if (name.feature, name.covariate) == ("detected", "all")
    ]
    [z] = simulator.measured_plain[at]
    missing = (~simulator.measured_observations.detected)[bright & sure & ~simulator.summaries.expected.at_edge].sum()
    assert (missing > 10) == off
    assert (z < -6.0) == off
    assert abs(z) < 4.0 or off


def test_a_beam_is_as_likely_to_see_its_surface_as_beams_about_as_bright() -> None:
    """Bright ones always, faint ones in three of four seeds, hardly any of the rest; sky says nothing of these."""
    rng = np.random.default_rng(4)
    log_area = np.concatenate([rng.uniform(5.0, 7.0, 1000), rng.uniform(2.0, 3.0, 1000), np.zeros(2000)])
    count = np.concatenate(
        [np.full(1000, 8), rng.binomial(8, 0.75, 1000), np.tile([1, 0, 0, 0], 250), np.zeros(1000, int)]
    )
    known = (log_area > 0.0) & (count >= 2)
    hit = np.arange(4000) < 3000
    found = _smooth_probability(np.where(known, log_area, 0.0), count, 8, known, hit)
    assert found[:1000].min() > 0.99
    assert found[1000:2000].mean() == pytest.approx(0.75, abs=0.02)
    assert found[2000:3000].mean() == pytest.approx(1.0 / 32.0, abs=0.01)
    assert found[2000:3000].min() > 0.0
    assert not found[3000:].any()


@pytest.mark.parametrize(
    ("area", "peak", "width_ns"), [(10.0, 10.0, 1.0), (3000.0, 135.0, 24.0)], ids=["just detected", "a sign's bloom"]
)
def test_one_echo_more_is_seen_and_is_no_slope_however_weak_or_strong(
    simulator: Simulator, area: float, peak: float, width_ns: float
) -> None:
    """A descent takes a difference for a slope where any summary changes by more than single beams make."""
    beams, measured = simulator.beams, simulator.measured_observations
    beam = np.flatnonzero((beams.bright[:, 1] > 0) & ~beams.retro & (beams.distance_m > 0.0))[:1]
    extra = {
        "extra_beam": beam, "extra_m": beams.bright_m[beam, 1], "extra_side": np.array([-1]),
        "extra_area": np.log([area]), "extra_peak": np.log([peak]), "extra_width": np.array([width_ns]),
    }  # fmt: skip
    one, none = (
        simulator.summaries.plain(dataclasses.replace(measured, **{n: c[:count] for n, c in extra.items()}))
        for count in (1, 0)
    )
    for feature in ("strength of other echoes", "area of bloom", "peak of bloom", "width of bloom"):
        of = [name.feature == feature for name in simulator.summaries.names]
        assert 0.3 < np.abs(one - none)[of].max() < optimiser._SEEN
