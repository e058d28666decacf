"""Vehicles of known size and place, measured by the independent generator: cut out, compared, merged."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hidden.rays import Beams, Scene
from lidarcheck.calibration.vehicles.compare import Pair, compare_vehicles
from lidarcheck.calibration.vehicles.cut import Cut, CutBox, CutSource, cut_vehicle, find_object, xyz_of
from lidarcheck.calibration.vehicles.kinds import VEHICLES, Extent, extent_of, suggested_offset, vehicle_named
from lidarcheck.calibration.vehicles.merge import MARK, merge_vehicles
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.data import Cloud, Distribution
from lidarcheck.figures.pages.vehicles import merge_page, page
from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.model import simulate
from lidarcheck.scan import Scan
from scene_kit import halved, hits_of, ideal_of, measured, model_of, vehicle_scene

BEAMS = Beams.block(range(170, 300, 2), range(400, 560, 2))


@pytest.fixture(scope="module")
def at_20m():
    """Scene, ideal scan, measured frame, model, true echoes of the vehicle."""
    scene = vehicle_scene(20.0)
    hits = hits_of(scene, BEAMS)
    return scene, ideal_of(hits, BEAMS), measured(scene, 1, beams=BEAMS), model_of()


def on_vehicle(ideal, scan) -> np.ndarray:
    """Which echoes are the vehicle's, from the truth."""
    of = {(a, b): n for a, b, n in zip(ideal.layer, ideal.point, ideal.object_id, strict=True)}
    return np.array([of[key] == 2 for key in zip(scan.layer.tolist(), scan.point.tolist(), strict=True)])


# --- cutting out ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("near_m", "turn", "slope"), [(12.0, 0.0, 0.0), (20.0, 35.0, 0.0), (25.0, 90.0, 0.03)])
def test_the_cluster_is_the_vehicle(near_m, turn, slope):
    scene = vehicle_scene(near_m, turn_deg=turn, slope=slope)
    ideal = ideal_of(hits_of(scene, BEAMS), BEAMS)
    scan = measured(scene, 3, beams=BEAMS)
    true = on_vehicle(ideal, scan)
    cut = cut_vehicle(scan, VEHICLES["car"], CutSource())
    key = scan.layer.astype(np.int64) * 1000 + scan.point
    found = np.isin(key, cut.scan.layer.astype(np.int64) * 1000 + cut.scan.point)
    # What is lower than the cut above the ground is lost, and hardly anything else is taken.
    assert np.mean(found[true]) > 0.85
    assert np.mean(true[found]) > 0.97
    assert cut.distance_m == pytest.approx(np.linalg.norm(xyz_of(scan)[true].mean(axis=0)), abs=0.3)


def test_object_and_box_cut_the_same_echoes(at_20m):
    _, ideal, scan, _ = at_20m
    true = on_vehicle(ideal, scan)
    car = VEHICLES["car"]
    assert find_object(ideal, car, None) == 2
    by_object = cut_vehicle(scan, car, CutSource(ideal, 2))
    assert len(by_object.scan) == true.sum()
    xyz = xyz_of(scan)[true]
    box = CutBox(tuple(xyz.min(axis=0) - 1e-6), tuple(xyz.max(axis=0) + 1e-6))
    by_box = cut_vehicle(scan, None, CutSource(box=box))
    assert set(zip(by_object.scan.layer, by_object.scan.point, strict=True)) <= set(
        zip(by_box.scan.layer, by_box.scan.point, strict=True)
    )


def test_a_file_of_the_vehicle_alone_is_taken_whole(at_20m):
    _, ideal, scan, _ = at_20m
    alone = scan.take(on_vehicle(ideal, scan))
    for vehicle in (VEHICLES["car"], None):
        cut = cut_vehicle(alone, vehicle, CutSource())
        assert cut.how == "the whole file"
        assert len(cut.scan) == len(alone)


def test_a_known_distance_chooses_among_several():
    near, far = vehicle_scene(14.0, azimuth_deg=-2.0), vehicle_scene(26.0, azimuth_deg=3.0)
    both = Scene((*near.rectangles, *(replace(r, object_id=9) for r in far.rectangles if r.object_id == 2)), "street")
    scan = measured(both, 2, beams=BEAMS)
    car = VEHICLES["car"]
    assert cut_vehicle(scan, car, CutSource()).distance_m == pytest.approx(15.0, abs=1.5)
    assert cut_vehicle(scan, car, CutSource(distance_m=27.0)).distance_m == pytest.approx(27.0, abs=1.5)
    with pytest.raises(InputError, match=r"the name says 80 m, but what may be a car is at 1[4-6], 2[6-8] m"):
        cut_vehicle(scan, car, CutSource(distance_m=80.0))
    ideal = ideal_of(hits_of(both, BEAMS), BEAMS)
    assert find_object(ideal, car, None) == 2
    assert find_object(ideal, car, 27.0) == 9


def test_a_missing_vehicle_is_said_with_what_is_there(at_20m):
    _, ideal, scan, _ = at_20m
    with pytest.raises(InputError) as caught:
        cut_vehicle(scan, VEHICLES["truck"], CutSource(file="real.pcd"))
    text = str(caught.value)
    assert text.startswith("error: real.pcd: there is no truck (5.5 to 19 m long, 2 to 2.7 m wide, 2.4 to 4.2 m high)")
    assert "closest in size" in text
    assert "--box" in text
    with pytest.raises(InputError, match=r"no truck .* among 4 objects in the ideal scan"):
        find_object(ideal, VEHICLES["truck"], None)


def test_too_few_points_are_said(at_20m):
    _, ideal, scan, _ = at_20m
    few = scan.take(np.flatnonzero(on_vehicle(ideal, scan))[:7])
    with pytest.raises(InputError, match="it has 7 echoes; at least 20 are needed"):
        cut_vehicle(few, None, CutSource())
    nowhere = CutBox((0.0, 0.0, 50.0), (1.0, 1.0, 51.0))
    with pytest.raises(InputError, match=r"the box holds 0 of the \d+ echoes, which span X"):
        cut_vehicle(scan, VEHICLES["car"], CutSource(box=nowhere))
    with pytest.raises(InputError, match="holds no echoes"):
        cut_vehicle(scan.take(np.zeros(len(scan), dtype=bool)), VEHICLES["car"], CutSource())
    with pytest.raises(InputError, match="more than a vehicle"):
        cut_vehicle(scan, None, CutSource())


def test_without_ground_the_message_says_so():
    rng = np.random.default_rng(0)
    xyz = np.array([30.0, 0.0, 0.0]) + rng.uniform(-1, 1, (500, 3)) * [0.2, 0.2, 30.0]
    zeros = np.zeros(500)
    scan = Scan(*xyz.T, zeros, zeros, zeros + 1, zeros, zeros, zeros)
    with pytest.raises(InputError, match="there is no ground"):
        cut_vehicle(scan, VEHICLES["car"], CutSource())


def test_extent_is_that_of_a_turned_box():
    rng = np.random.default_rng(5)
    box = (rng.random((20000, 3)) - 0.5) * [4.0, 1.6, 1.4]
    for angle in (0.0, 0.3, 1.1, 2.5):
        c, s = math.cos(angle), math.sin(angle)
        extent = extent_of(box @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
        assert (extent.long_m, extent.short_m, extent.height_m) == pytest.approx((4.0, 1.6, 1.4), abs=0.12)


@pytest.mark.parametrize("name", VEHICLES)
def test_a_kind_fits_its_own_usual_size(name):
    vehicle = VEHICLES[name]
    length, width, height = vehicle.usual_m
    assert vehicle.fits(Extent(length, width, height))
    assert vehicle.fits(Extent(width, 0.1, height))  # from behind
    assert vehicle.fits(Extent(length, 0.05, height))  # square on from the side
    assert vehicle.is_flat(Extent(length, 0.05, height))
    assert not vehicle.is_flat(Extent(width, 0.05, height))
    assert not vehicle.fits(Extent(length, width, 6.0))
    with pytest.raises(UsageError, match=f"did you mean {name}"):
        vehicle_named(name + "x")


# --- comparing ------------------------------------------------------------------------------------------------------


def pair_of(scene, seed: int, model, *, table=None, with_ideal: bool = True, variant: str = "SMART") -> Pair:
    ideal = ideal_of(hits_of(scene, BEAMS), BEAMS)
    options = {} if table is None else {"table": table}
    real = measured(scene, seed, variant, beams=BEAMS, **options)
    named = (CutSource(file="real.pcd"), CutSource(file="sim.pcd"))
    return Pair(real, simulate(ideal, model, seed=seed), *named, ideal=ideal if with_ideal else None)


def test_the_same_vehicle_differs_by_chance_alone(at_20m):
    model = at_20m[3]
    pairs = [pair_of(vehicle_scene(near), 4, model) for near in (40.0, 12.0, 20.0)]
    result = compare_vehicles(VEHICLES["car"], pairs)
    assert [round(at.distance_m / 10) for at in result.distances] == [1, 2, 4]
    for at in result.distances:
        assert set(at.features) == {"PEAK", "AREA", "WIDTH"}
        assert at.detection_ratio == pytest.approx(1.0, abs=0.05)
        assert at.detection_real == pytest.approx(at.detection_simulated, abs=0.05)
        assert all(gap.ks < 1.3 * at.ks_chance[name] for name, gap in at.features.items())


def test_half_the_reflectance_shows_in_area_and_by_as_much(at_20m):
    scene, ideal, _, model = at_20m
    dark, table = halved(scene, 2)
    at = compare_vehicles(VEHICLES["car"], [pair_of(scene, 5, model, table=None)]).distances[0]
    real = measured(dark, 5, table=table, beams=BEAMS)
    pair = Pair(real, simulate(ideal, model, seed=5), CutSource(), CutSource(), ideal=ideal)
    less = compare_vehicles(VEHICLES["car"], [pair]).distances[0]
    real_area, simulated_area = less.samples["AREA"]
    gap = less.features["AREA"]
    assert gap.dvm_bias == pytest.approx(real_area.mean() - simulated_area.mean())
    assert gap.ks > 3 * less.ks_chance["AREA"] > 3 * at.features["AREA"].ks / 1.3
    assert less.real.echoes == np.sum(on_vehicle(ideal, real))


def test_the_page_has_every_distance_and_feature(at_20m):
    model = at_20m[3]
    result = compare_vehicles(VEHICLES["car"], [pair_of(vehicle_scene(n), 4, model) for n in (12.0, 20.0)])
    shown = page(result)
    histograms = [f for f in shown.figures() if isinstance(f, Distribution)]
    assert [f.quantity for f in histograms] == ["PEAK", "AREA", "WIDTH"] * 2
    assert all(f.log_x for f in histograms)
    assert sum(isinstance(f, Cloud) for f in shown.figures()) == 2
    assert len(shown.tables()[1].rows) == 6
    assert "samples" not in str(result.to_dict())


def test_frames_that_do_not_match_are_refused(at_20m):
    scene, ideal, scan, model = at_20m
    car = VEHICLES["car"]
    near = pair_of(vehicle_scene(12.0), 1, model, with_ideal=False)
    far = pair_of(scene, 1, model, with_ideal=False)
    with pytest.raises(InputError, match=r"real.pcd: its vehicle \(the cluster .* at X 1.*same distance"):
        compare_vehicles(car, [replace(near, simulated=far.simulated)])
    every_other = far.simulated.take(far.simulated.layer % 4 == 2)
    with pytest.raises(InputError, match="on layers 2 apart, the simulated one 4 apart"):
        compare_vehicles(car, [replace(far, simulated=every_other)])
    thin = ideal.take(ideal.layer % 4 == 2)
    with pytest.raises(InputError, match="real echoes are on beams that the ideal scan does not have"):
        compare_vehicles(car, [replace(far, ideal=thin)])
    source = CutSource(object_id=77, file="real.pcd")
    with pytest.raises(InputError, match="no beam meets object 77; it has 1, 2, 3, 4"):
        compare_vehicles(car, [Pair(scan, far.simulated, source, source, ideal)])
    with pytest.raises(InputError, match="has no ObjectID, so no object 77"):
        compare_vehicles(car, [Pair(scan, far.simulated, source, source, replace(ideal, object_id=None))])
    with pytest.raises(UsageError, match="no pair"):
        compare_vehicles(car, [])


def test_scans_without_a_common_feature_are_refused(at_20m):
    scene, _, _, model = at_20m
    pair = pair_of(scene, 1, model)
    bare = replace(pair.real, defaulted=("PEAK", "AREA", "WIDTH"))
    with pytest.raises(InputError, match="none of PEAK, AREA, WIDTH"):
        compare_vehicles(VEHICLES["car"], [replace(pair, real=bare)])
    result = compare_vehicles(VEHICLES["car"], [replace(pair, real=replace(pair.real, defaulted=("PEAK",)))])
    assert result.left_out == {"PEAK": "not in real.pcd"}


# --- merging --------------------------------------------------------------------------------------------------------


def cut_of(xyz, **extra) -> Cut:
    n = len(xyz)
    ones = np.ones(n, dtype=np.int32)
    scan = Scan(
        *np.asarray(xyz, dtype=np.float64).T, ones, 2 * ones, ones, 1.0 * ones, 5.0 * ones, 3.0 * ones, extra=extra
    )
    centre = tuple(float(c) for c in np.mean(xyz, axis=0))
    return Cut(scan, "the whole file", extent_of(np.asarray(xyz)), centre)


def test_centroids_are_aligned_and_then_offset():
    rng = np.random.default_rng(8)
    real, simulated = rng.normal(size=(2, 60, 3)) + np.array([[[20.0, 3.0, 1.0]], [[21.0, 2.0, 1.5]]])
    merged = merge_vehicles(cut_of(real), cut_of(simulated), x_m=2.0, y_m=-7.0)
    one, other = merged.clouds
    assert np.array_equal(one, real)
    assert other.mean(axis=0) == pytest.approx(real.mean(axis=0) + np.array([2.0, -7.0, 0.0]))
    assert np.diff(other, axis=0) == pytest.approx(np.diff(simulated, axis=0))
    assert merged.columns.columns[MARK].tolist() == [0] * 60 + [1] * 60


def test_the_suggested_offset_parts_any_two_to_the_right():
    rng = np.random.default_rng(9)
    for _ in range(50):
        sizes = rng.uniform(0.5, 12.0, (2, 1, 3))
        real, simulated = rng.random((2, 80, 3)) ** rng.uniform(0.3, 3.0) * sizes
        merged = merge_vehicles(cut_of(real), cut_of(simulated), VEHICLES["car"])
        one, other = merged.clouds
        assert other[:, 1].max() < one[:, 1].min()
        assert not merged.overlaps
        assert merged.offset_m[1] * 2 == int(merged.offset_m[1] * 2)


def test_the_suggestion_follows_the_kind_and_the_points():
    thin = np.random.default_rng(1).random((50, 3)) * [4.0, 1.0, 1.0]
    offsets = {name: suggested_offset(v, thin, thin)[1] for name, v in VEHICLES.items()}
    assert offsets == {"car": -3.0, "van": -3.0, "truck": -4.0}  # 1.25 x width + 0.5 m, up to half a metre
    across = thin[:, [1, 0, 2]]
    assert suggested_offset(VEHICLES["car"], across, across)[1] <= -(1.25 * np.ptp(across[:, 1]) + 0.5)


def test_columns_of_both_are_kept_in_a_pcd(tmp_path):
    rng = np.random.default_rng(2)
    real = cut_of(rng.random((30, 3)), Gain=np.arange(30), Stamp=np.arange(30) * 0.5)
    simulated = cut_of(rng.random((40, 3)), gain=np.arange(40) + 100)
    merged = merge_vehicles(real, simulated, VEHICLES["car"])
    write_table(merged.columns, tmp_path / "both.pcd")
    back = read_table(tmp_path / "both.pcd")
    assert back.columns["Gain"].tolist() == [*range(30), *range(100, 140)]
    assert back.columns["Stamp"].tolist() == [i * 0.5 for i in range(30)] + [0.0] * 40
    assert back.columns[MARK].sum() == 40
    assert back.columns["Layer"].tolist() == [1] * 70
    assert merged.filled == {"Stamp": "simulated"}
    assert "30 real and 40 simulated points" in merge_page(merged, "car").summary


def test_unknown_beams_are_left_out_and_a_taken_name_is_refused(caplog):
    xyz = np.random.default_rng(2).random((30, 3))
    real, simulated = cut_of(xyz), cut_of(xyz)
    strange = replace(simulated, scan=replace(simulated.scan, layer=np.full(30, -1)))
    merged = merge_vehicles(real, strange)
    assert "Layer" not in merged.columns.columns
    assert "Point" in merged.columns.columns
    assert "Layer is left out" in caplog.text
    with pytest.raises(InputError, match="has a column Simulated of its own"):
        merge_vehicles(cut_of(xyz, simulated=np.zeros(30)), real)


def test_an_offset_that_does_not_part_them_is_said(caplog):
    xyz = np.random.default_rng(2).random((30, 3)) * 2.0
    assert merge_vehicles(cut_of(xyz), cut_of(xyz), y_m=0.5).overlaps
    assert "overlap" in caplog.text
    assert "left of the real one" in caplog.text
