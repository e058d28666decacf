"""Comparative scenes: what is hidden in measured frames of the independent generator is named first."""

from dataclasses import replace

import numpy as np
import pytest

from hidden.chain import Nuisance, measure
from hidden.places import TABLE
from hidden.rays import Beams
from lidarcheck.calibration.scenes.effects import chosen_effects
from lidarcheck.calibration.scenes.frame import SceneFrame, simulated_frame
from lidarcheck.calibration.scenes.groups import labels_of, sector_edges, sector_of
from lidarcheck.calibration.scenes.units import units_of, values_of
from lidarcheck.calibration.scenes.words import _how_much
from lidarcheck.calibration.scenes.workflow import compare_scene
from lidarcheck.effects import make
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.data import Grid
from lidarcheck.figures.pages.scenes import page
from lidarcheck.kpi.overlap import overlap
from lidarcheck.model import simulate
from lidarcheck.scan import IdealScan, Scan
from scene_kit import BEAMS, halved, hits_of, ideal_of, measured, model_of, scan_of, scene_of, shifted

SEED = 31
"""Not among those that the method was tuned on."""
THIN = Beams.block(range(210, 306, 2), range(430, 526, 2))


@pytest.fixture(scope="module")
def street():
    """Scene, what beams meet, ideal scan, measured frame, model."""
    scene = scene_of("street", SEED)
    hits = hits_of(scene)
    return scene, hits, ideal_of(hits), measured(scene, 5), model_of()


def compared(scan, ideal, model, seed=9, **options):
    return compare_scene([simulated_frame(scan, ideal, model, seed=seed)], **options)


def car_of(scene):
    """The object that is a car seen by most beams."""
    hits = hits_of(scene)
    cars = {part.object_id for part in scene.rectangles if part.material == 5}
    return max(cars, key=lambda number: np.sum(hits.object_id == number))


def test_a_dead_layer_is_first_and_alone(street):
    _, _, ideal, scan, model = street
    result = compared(scan.take(scan.layer != 250), ideal, model)
    assert [d.name for d in result.disagreements] == ["layer 250"]
    assert "100 % fewer echoes in layer 250" in result.disagreements[0].words
    assert result.disagreements[0].measured == 0.0
    assert "layer 250" in page(result).summary


def test_an_object_that_returns_half_the_light_is_first(street):
    scene, _, ideal, _, model = street
    number = car_of(scene)
    other, table = halved(scene, number)
    result = compared(measured(other, 6, table=table), ideal, model)
    assert result.disagreements[0].name == f"object {number}"
    part = next(p for p in result.parts if p.name == f"object {number}")
    assert part.range_bias_m > 0.05  # it is near and saturates: less light is less pile-up
    assert part.strength == max(p.strength for p in result.parts)


def test_an_object_that_stands_farther_is_first_with_its_shift(street):
    scene, hits, ideal, _, model = street
    number = car_of(scene)
    azimuth = np.deg2rad(np.median(BEAMS.azimuth_deg[hits.object_id == number]))
    moved = shifted(scene, number, (0.3 * np.cos(azimuth), 0.3 * np.sin(azimuth), 0.0))
    first = compared(measured(moved, 6), ideal, model).disagreements[0]
    assert first.name == f"object {number}"
    assert first.feature == "range_residual"
    assert first.measured - first.simulated == pytest.approx(0.3, abs=0.06)


def test_weaker_light_everywhere_is_the_whole_frame(street):
    scene, _, ideal, _, model = street
    weak = scan_of(measure(scene, BEAMS, "SMART", TABLE, (), Nuisance(gain=0.85), 6, 0))
    whole = next(d for d in compared(weak, ideal, model).disagreements if d.name == "the whole frame")
    assert any("AREA" in words and "lower" in words for words in (whole.words, *whole.also))


@pytest.mark.parametrize("kind", ["street", "lab", "sign"])
def test_a_frame_of_the_same_distribution_lists_nothing(kind):
    for seed in (41, 42):
        scene = scene_of(kind, seed)
        ideal = ideal_of(hits_of(scene, THIN), THIN)
        variant = ("SMART", "SLIM")[seed % 2]
        result = compared(measured(scene, seed, variant, beams=THIN), ideal, model_of(variant))
        assert result.disagreements == ()
        assert "disagree nowhere" in page(result).summary


def test_an_effect_that_is_left_out_is_seen_and_one_that_is_in_is_not(street):
    _, _, ideal, scan, model = street
    dimmer = model.with_(make("signal_gain", {"gain": 0.7}))
    assert compared(scan, ideal, dimmer).disagreements
    chosen, added = chosen_effects(dimmer, without=["signal_gain"])
    assert added == ()
    assert compared(scan, ideal, chosen).disagreements == ()


def test_frames_of_one_scene_are_taken_together(street):
    scene, _, ideal, _, model = street
    number = car_of(scene)
    other, table = halved(scene, number)
    frames = [
        simulated_frame(measured(other, seed, table=table), ideal, model, seed=seed, number=i)
        for i, seed in enumerate((3, 4))
    ]
    one, both = compare_scene(frames[:1]), compare_scene(frames)
    assert both.beams == 2 * one.beams
    assert len(both.overlap) == 2
    assert both.disagreements[0].name == f"object {number}"
    assert both.disagreements[0].strength > one.disagreements[0].strength


def test_without_a_second_simulation_it_says_what_that_costs(street):
    _, _, ideal, scan, model = street
    frame = SceneFrame(scan.take(scan.layer != 250), ideal, simulate(ideal, model, seed=2))
    result = compare_scene([frame])
    assert result.disagreements[0].name == "layer 250"
    assert result.overlap_floor is None
    assert "no second simulation" in " ".join(page(result).sections[0].words)


def test_kpis_are_those_of_the_points(street):
    _, _, ideal, scan, model = street
    frame = simulated_frame(scan, ideal, model, seed=9)
    result = compare_scene([frame], radius_m=0.2)
    clouds = [np.stack([s.x_m, s.y_m, s.z_m], axis=-1) for s in (scan, frame.simulated)]
    assert result.overlap[0] == overlap(*clouds, radius_m=0.2)
    assert sum(part.beams for part in result.parts if part.name != "object -1") == np.sum(ideal.distance_m > 0)
    near = ideal.object_id == 1
    found = {(a, b) for a, b, r in zip(scan.layer, scan.point, scan.range_m, strict=True) for _ in [r]}
    of_one = [(a, b) in found for a, b in zip(ideal.layer[near], ideal.point[near], strict=True)]
    part = next(p for p in result.parts if p.name == "object 1")
    assert part.echo_measured == pytest.approx(np.mean(of_one), abs=0.02)


def test_sectors_hold_every_beam_once(street):
    _, _, ideal, scan, model = street
    result = compared(scan, ideal, model, sectors=(5, 3))
    assert result.sectors.beams.shape == (3, 5)
    assert result.sectors.beams.sum() == len(ideal)
    grids = [f for f in page(result).figures() if isinstance(f, Grid)]
    assert all(grid.values.shape == (3, 5) for grid in grids)
    units = units_of(ideal, labels_of(ideal, "object"))
    row, column = sector_of(units, sector_edges(units, 5, 3))
    assert row[np.argmin(units.layer)] == 0
    assert column[np.argmax(units.point)] == 4


def test_the_sectors_that_stand_out_come_first_in_the_table(street):
    _, _, ideal, scan, model = street
    corner = (scan.layer > np.median(ideal.layer)) & (scan.point > np.median(ideal.point))
    result = compared(scan.take(~corner), ideal, model, sectors=(4, 2))
    table = page(result).sections[-1].tables[0]
    assert sum(int(row[2]) for row in table.rows) == len(ideal)
    strength = [float(row[-1] or 0.0) for row in table.rows]
    assert strength[0] > 0.0
    assert strength == sorted(strength, reverse=True)
    assert float(table.rows[0][3]) < -50.0


def ideal_of_rows(rows, **columns):
    layer, point, distance, material = (np.array(c) for c in zip(*rows, strict=True))
    return IdealScan(layer, point, distance, material, np.zeros(len(rows)), **columns)


def test_a_beam_has_a_unit_for_each_object_and_echoes_go_to_their_own():
    ideal = ideal_of_rows(
        [(10, 5, 20.0, 1), (10, 5, 40.0, 2), (10, 6, 0.0, 0), (10, 7, 20.0, 1), (10, 7, 0.0, 0)],
        object_id=np.array([3, 4, 0, 3, 0]),
    )
    units = units_of(ideal, labels_of(ideal, "object"))
    assert units.label.tolist() == [3, 4, -1, 3]
    assert units.first.tolist() == [True, False, True, True]
    scan = Scan.from_beams(
        np.full(4, 10), np.array([5, 5, 6, 7]), np.array([20.1, 30.0, 55.0, 19.9]), area=np.array([100.0, 10, 10, 100])
    )
    values, _ = values_of(units, ideal, scan)
    assert np.nan_to_num(values.of["echo"], nan=-9).tolist() == [1, 0, -9, 1]
    assert np.nan_to_num(values.of["stray"], nan=-9).tolist() == [1, -9, 1, 0]
    assert values.of["log10_area"][0] == 2.0
    assert values.stray_offset_m[0] == pytest.approx(10.0)


def test_parts_without_numbers_are_materials_or_connected_surfaces(street):
    _, _, ideal, scan, model = street
    plain = replace(ideal, object_id=None)
    assert compared(scan, plain, model).by == "material"
    one = model_of()
    same = replace(plain, material_id=np.ones(len(plain), dtype=np.int32))
    assert compared(scan, same, one).by == "surface"


def test_surfaces_are_parted_by_jumps_of_range():
    rows = [(a, b, 20.0 if b < 15 else 30.0 if b < 20 else 20.0, 1) for a in range(10) for b in range(25)]
    labels = labels_of(ideal_of_rows(rows), "surface").reshape(10, 25)
    assert (labels[:, :15] == 1).all()
    assert len(np.unique(labels)) == 3
    assert (labels[:, 15:20] != labels[:, 20:]).all()


def test_effects_are_chosen_by_name():
    model = model_of().with_(make("signal_gain", {"gain": 0.7})).with_(make("dropout", {"share": 0.1}))
    kept, added = chosen_effects(model, only=["dropout", "range_offset"])
    assert {e.name for e in kept.effects} == {"dropout", "range_offset"}
    assert kept.effects[[e.name for e in kept.effects].index("dropout")].settings()["share"] == 0.1
    assert added == ("range_offset",)
    assert chosen_effects(model, only=[])[0].effects == ()
    for options, says in (
        ({"only": ["dropuot"]}, "did you mean dropout"),
        ({"without": ["signal_gian"]}, "did you mean signal_gain"),
        ({"without": ["fog"]}, "it has signal_gain, dropout"),
    ):
        with pytest.raises(UsageError) as caught:
            chosen_effects(model, **options)
        assert says in str(caught.value)


def test_another_scene_is_refused(street):
    _, _, ideal, _, model = street
    empty = scene_of("sign", 3)
    other = measured(replace(empty, rectangles=empty.rectangles[1:2]), 4)
    near = ideal_of(hits_of(replace(empty, rectangles=empty.rectangles[:1])))
    near = replace(near, distance_m=np.full(len(near), 12.0), material_id=np.full(len(near), 4))
    with pytest.raises(InputError, match="another scene"):
        compared(other, near, model)
    assert len(ideal)


def test_what_does_not_belong_together_is_refused(street):
    _, _, ideal, scan, model = street
    thin = ideal_of(hits_of(scene_of("street", SEED), THIN), THIN)
    with pytest.raises(InputError, match=r"beams that the ideal scan does not have.*layers 210 to 305"):
        compared(scan, thin, model)
    with pytest.raises(InputError, match="measured frame holds no echoes"):
        compared(scan.take(scan.layer < 0), ideal, model)
    with pytest.raises(InputError, match="no beam meets a surface"):
        compared(scan, replace(ideal, distance_m=np.zeros(len(ideal))), model)
    with pytest.raises(InputError, match="has no ObjectID"):
        compared(scan, replace(ideal, object_id=None), model, by="object")
    with pytest.raises(UsageError, match="no parts by 'thing'"):
        compared(scan, ideal, model, by="thing")
    with pytest.raises(UsageError, match="0 by 3 sectors"):
        compared(scan, ideal, model, sectors=(0, 3))
    with pytest.raises(UsageError, match="no frame"):
        compare_scene([])


def test_echoes_where_none_is_simulated_are_said_in_percent():
    """All beams, not 1e+02 % of them."""
    assert _how_much("echo", 1.0, 0.0) == "echoes on 100 % of the beams instead of none"
    assert _how_much("echo", 0.038, 0.0) == "echoes on 3.8 % of the beams instead of none"


def test_several_scenes_in_one_map_are_said(street):
    """The same street with another wall: two scenes. Frames of one scene, and copies of it, are one."""
    _, _, ideal, scan, model = street
    farther = replace(ideal, distance_m=np.where(ideal.distance_m > 0.0, ideal.distance_m + 0.5, 0.0))
    frames = [
        simulated_frame(scan, ideal, model, seed=1, number=0),
        simulated_frame(scan, replace(ideal), model, seed=2, number=1),
        simulated_frame(simulate(farther, model, seed=3), farther, model, seed=3, number=2),
    ]
    assert compare_scene(frames[:2]).scenes == 1
    result = compare_scene(frames)
    assert (result.frames, result.scenes) == (3, 2)
    shown = page(result)
    assert "3 frames of 2 scenes, taken together," in shown.summary
    (sectors,) = [section for section in shown.sections if section.title == "By sector"]
    assert any(line.startswith("The 2 scenes stand in one map") for line in sectors.words)
