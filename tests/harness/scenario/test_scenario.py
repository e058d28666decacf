"""Scenario files: the geometry of their shapes, what they refuse, and the ones that the project ships."""

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from lidarcheck.errors import ConfigError, InputError, LidarcheckError
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.scenario.file import KpiTable, ScenarioTable
from lidarcheck.harness.scenario.scenario import Scenario, load_scenario
from lidarcheck.harness.scenario.shapes import (
    Ground,
    Incidence,
    Nothing,
    Panels,
    Shape,
    Stripes,
    Surface,
    Target,
    Wall,
    lay_beams,
)
from lidarcheck.scan import IdealScan, Scan
from reference_grid import azimuth_deg, beam_directions, elevation_deg
from scenario_texts import panel_scene

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
SHIPPED = sorted(SCENARIOS.glob("*.toml"))

HEAD = """\
description = "a small one"

[model]
variant = "SMART"

[model.materials.1]
reflectance = 0.5
"""
BEAMS = """
[[beams]]
shape = "surface"
layers = [10, 12]
points = [100, 109]
material = 1
range_m = [20.0, 29.0]
"""
KPIS = """
[[kpis]]
kpi = "area_mean"
tolerance = 1.0
"""

GROUND = """
[[beams]]
shape = "ground"
layers = [10, 20]
points = [100, 109]
material = 1
height_m = 2.0
"""
WALL = """
[[beams]]
shape = "wall"
layers = [10, 20]
points = [600, 700]
material = 1
x_m = 20
turn_deg = 10
"""
TARGET = """
[[beams]]
shape = "target"
layers = [10, 20]
points = [100, 109]
target_layers = [12, 13]
target_points = [104, 105]
material = 1
range_m = 20
"""


def load(directory: Path, text: str) -> Scenario:
    file = directory / "small.toml"
    file.write_text(text, encoding="utf-8")
    return load_scenario(file)


def faults(directory: Path, text: str) -> list[tuple[int | None, str]]:
    with pytest.raises(ConfigError) as caught:
        load(directory, text)
    assert len(caught.value.lines()) == len(caught.value.faults)
    return [(fault.line, fault.what) for fault in caught.value.faults]


def line_of(text: str, part: str) -> int:
    """The line, from 1, where `part` stands last."""
    return text[: text.rindex(part)].count("\n") + 1


# Shapes


def test_surface_sweeps_its_range_over_the_points():
    shape = Surface(shape="surface", layers=(3, 4), points=(7, 11), material=2, range_m=(10.0, 50.0))
    ideal, of_shape = lay_beams([shape])
    assert ideal.layer.tolist() == [3] * 5 + [4] * 5
    assert ideal.point.tolist() == [7, 8, 9, 10, 11] * 2
    np.testing.assert_allclose(ideal.distance_m, [10, 20, 30, 40, 50] * 2)
    assert not ideal.incidence_deg.any()
    assert set(ideal.material_id) == {2}
    assert not of_shape.any()


def test_one_point_takes_the_first_range():
    shape = Surface(shape="surface", layers=(3, 3), points=(7, 7), material=2, range_m=(10.0, 50.0))
    assert lay_beams([shape])[0].distance_m.tolist() == [10.0]


def test_panels_lie_on_their_planes_and_share_the_layers():
    shape = Panels(shape="panels", layers=(0, 519), points=(0, 959), material=1, x_m=(5.0, 40.0))
    ideal, _ = lay_beams([shape])
    x_m = (beam_directions(ideal.layer, ideal.point) * ideal.distance_m[:, None])[:, 0]
    np.testing.assert_allclose(x_m, np.where(ideal.layer < 260, 5.0, 40.0))
    assert ideal.object_id.tolist() == np.where(ideal.layer < 260, 1, 2).tolist()
    theta, phi = np.deg2rad(azimuth_deg(ideal.point)), np.deg2rad(elevation_deg(ideal.layer))
    np.testing.assert_allclose(np.cos(np.deg2rad(ideal.incidence_deg)), np.cos(theta) * np.cos(phi))


def test_incidence_is_swept_at_one_range():
    shape = Incidence(
        shape="incidence", layers=(0, 0), points=(0, 4), material=1, range_m=30.0, incidence_deg=(0.0, 80.0)
    )
    ideal, _ = lay_beams([shape])
    assert set(ideal.distance_m) == {30.0}
    np.testing.assert_allclose(ideal.incidence_deg, [0, 20, 40, 60, 80])


def test_a_wall_is_a_turned_plane():
    shape = Wall(shape="wall", layers=(200, 319), points=(300, 659), material=1, x_m=20.0, turn_deg=30.0)
    ideal, _ = lay_beams([shape])
    xyz_m = beam_directions(ideal.layer, ideal.point) * ideal.distance_m[:, None]
    # A wall through (20, 0) that runs at 30 degrees off the Y axis: x cos 30 + y sin 30 = 20 cos 30.
    np.testing.assert_allclose(xyz_m[:, 0] + np.tan(np.deg2rad(30.0)) * xyz_m[:, 1], 20.0)
    left, right = (ideal.distance_m[(ideal.layer == 260) & (ideal.point == point)][0] for point in (659, 300))
    assert left < 20.0 < right
    # The beam that looks along the normal, 30 degrees to the left, meets it squarely.
    assert ideal.incidence_deg.argmin() == np.argmax(xyz_m @ [np.cos(np.pi / 6), 0.5, 0] / ideal.distance_m)
    assert (ideal.incidence_deg >= 0.0).all()
    straight = Wall(shape="wall", layers=(200, 319), points=(300, 659), material=1, x_m=20.0, turn_deg=0.0)
    panel = Panels(shape="panels", layers=(200, 319), points=(300, 659), material=1, x_m=(20.0,))
    np.testing.assert_allclose(lay_beams([straight])[0].distance_m, lay_beams([panel])[0].distance_m)


def test_ground_is_level():
    shape = Ground(shape="ground", layers=(0, 200), points=(0, 959), material=1, height_m=1.8)
    ideal, _ = lay_beams([shape])
    np.testing.assert_allclose(ideal.distance_m * np.sin(np.deg2rad(elevation_deg(ideal.layer))), -1.8)
    np.testing.assert_allclose(ideal.incidence_deg, 90.0 + elevation_deg(ideal.layer))


def test_a_target_stands_before_a_background_or_before_nothing():
    keys = {"layers": (10, 19), "points": (50, 69), "target_layers": (14, 15), "target_points": (60, 62)}
    shape = Target(shape="target", **keys, material=4, range_m=30.0)
    ideal, _ = lay_beams([shape])
    inside = (ideal.layer >= 14) & (ideal.layer <= 15) & (ideal.point >= 60) & (ideal.point <= 62)
    assert np.array_equal(ideal.distance_m, np.where(inside, 30.0, 0.0))
    assert np.array_equal(ideal.object_id, np.where(inside, 1, 2))
    before = Target(shape="target", **keys, material=4, range_m=30.0, behind_m=50.0, behind_material=2, object=7)
    ideal, _ = lay_beams([before, Nothing(shape="nothing", layers=(0, 0), points=(0, 0))])
    assert np.array_equal(ideal.distance_m[:-1], np.where(inside, 30.0, 50.0))
    assert np.array_equal(ideal.material_id[:-1], np.where(inside, 4, 2))
    assert np.array_equal(ideal.object_id, [*np.where(inside, 7, 8), 9])


def test_stripes_stand_at_two_ranges_in_turn():
    keys = {"layers": (5, 9), "points": (100, 106), "material": 2, "range_m": 20.0, "behind_m": 21.0}
    ideal, _ = lay_beams([Stripes(shape="stripes", **keys, width=3)])
    assert ideal.distance_m.reshape(5, 7).tolist() == [[20, 20, 20, 21, 21, 21, 20]] * 5
    assert set(ideal.material_id) == {2}
    ideal, _ = lay_beams([Stripes(shape="stripes", **keys, width=2, across="layers", behind_material=3)])
    assert ideal.distance_m.reshape(5, 7)[:, 0].tolist() == [20, 20, 21, 21, 20]
    assert ideal.material_id.reshape(5, 7)[:, 0].tolist() == [2, 2, 3, 3, 2]


def test_objects_are_numbered_over_all_shapes_and_can_be_set():
    nothing = Nothing(shape="nothing", layers=(0, 0), points=(0, 0))
    panels = Panels(shape="panels", layers=(1, 2), points=(0, 0), material=1, x_m=(5.0, 6.0))
    own = Nothing(shape="nothing", layers=(3, 3), points=(0, 0), object=9)
    last = Nothing(shape="nothing", layers=(4, 4), points=(0, 0))
    ideal, of_shape = lay_beams([nothing, panels, own, last])
    assert ideal.object_id.tolist() == [1, 2, 3, 9, 10]
    assert of_shape.tolist() == [0, 1, 1, 2, 3]
    assert ideal.distance_m[0] == 0.0


# Reading


def test_a_scenario_with_an_inline_model(tmp_path):
    scenario = load(tmp_path, HEAD + BEAMS + KPIS)
    assert scenario.name == "small"
    assert scenario.description == "a small one"
    assert scenario.model.sensor.variant == "SMART"
    assert scenario.frames == 1
    assert len(scenario.ideal) == 30
    (kpi,) = scenario.kpis
    assert (kpi.name, kpi.kind, kpi.unit, kpi.direction) == ("area_mean", "mean", "counts", "target")
    assert (kpi.tolerance, kpi.low, kpi.high, kpi.feature) == (1.0, None, None, None)


def test_a_model_file_is_found_beside_the_scenario(tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models/m.toml").write_text('variant = "SLIM"\n[materials.1]\nreflectance = 0.5\n')
    scenario = load(tmp_path, 'description = "d"\nmodel = "models/m.toml"\n' + BEAMS + KPIS)
    assert scenario.model.sensor.variant == "SLIM"


def test_default_names_tell_selections_apart(tmp_path):
    more = """
[[kpis]]
kpi = "detection_probability"
object = 1
range_m = [20.0, 25.5]
window_m = 1.0
tolerance = 0.01
low = 0.9

[[kpis]]
kpi = "area_distance"
material = [1, 2]
tolerance = 3
"""
    _, detection, distance = load(tmp_path, HEAD + BEAMS + KPIS + more).kpis
    assert detection.name == "detection_probability.object_1.20_25p5m.within_1m"
    assert (detection.kind, detection.direction, detection.low) == ("proportion", "target", 0.9)
    assert (distance.name, distance.kind) == ("area_distance.material_1_2", "distance")
    assert distance.feature == distance.name


def test_a_kpi_may_look_at_some_layers_points_and_echo_ranges(tmp_path):
    more = (
        KPIS.replace("area_mean", "echo_share") + "layers = [11, 12]\npoints = [100, 103]\necho_range_m = [5, 12.5]\n"
    )
    _, asked = load(tmp_path, HEAD + BEAMS + KPIS + more).asked
    assert asked.spec.name == "echo_share.layers_11_12.points_100_103.echo_5_12p5m"
    selection, ideal = asked.selection, load(tmp_path, HEAD + BEAMS + KPIS).ideal
    assert selection.zone_m == (5.0, 12.5)
    assert np.array_equal(selection.rows, (ideal.layer >= 11) & (ideal.point <= 103))
    assert np.count_nonzero(selection.beams) == 8
    assert asked.spec.kind == "proportion"


def test_keys_that_are_left_out_do_not_enter_the_hash(tmp_path):
    """Scenarios that are older than a key keep their goldens: this hash is from before there were further keys."""
    text = HEAD + BEAMS + KPIS
    hashes = {
        load(tmp_path, text + more).content_hash for more in ("", "layers = [10, 12]\n", "echo_range_m = [1, 9]\n")
    }
    assert len(hashes) == 3
    assert load(tmp_path, text).content_hash == "a5ca66086616eb29d8a9563555848cbd97a3fa1a2959874df6ffa745e9edf452"


def test_the_hash_covers_beams_and_kpis_but_not_words_and_model(tmp_path):
    text = HEAD + BEAMS + KPIS
    same = load(tmp_path, text).content_hash
    for other in (text.replace("a small one", "another"), "# why\n" + text, text.replace("SMART", "SLIM")):
        assert load(tmp_path, other).content_hash == same
    changes = [
        ("29.0", "28.0"),
        ("12]", "13]"),
        ("tolerance = 1.0", "tolerance = 2.0"),
        ("area_mean", "peak_mean"),
        ("material = 1\n", "material = 1\nobject = 4\n"),
    ]
    for old, new in changes:
        assert load(tmp_path, text.replace(old, new)).content_hash != same


def test_the_hash_covers_surface_points_where_a_kpi_rests_on_them(tmp_path):
    def hashed(kpi: str, x_m: float) -> str:
        place = {"X": np.full(3, x_m), "Y": np.zeros(3), "Z": np.zeros(3)}
        table = (np.full(3, 259), np.arange(479, 482), np.full(3, 10.0), np.ones(3), np.zeros(3))
        save_ideal(IdealScan(*table, extra=place), tmp_path / "ideal.parquet")
        text = HEAD.replace("description", 'ideal = "ideal.parquet"\ndescription', 1) + KPIS
        return load(tmp_path, text.replace("area_mean", kpi)).content_hash

    assert hashed("area_mean", 10.0) == hashed("area_mean", 10.5)
    assert hashed("position_bias_x", 10.0) == hashed("position_bias_x", 10.0) != hashed("position_bias_x", 10.5)


def test_the_number_of_an_echo_is_in_its_kpis_name(tmp_path):
    one = KPIS.replace("area_mean", "echo_number_share") + "number = 1\n"
    first, third = load(tmp_path, HEAD + BEAMS + one + one.replace("number = 1", "number = 3")).asked
    assert [first.spec.name, third.spec.name] == ["echo_number_share.number_1", "echo_number_share.number_3"]
    assert [first.selection.number, third.selection.number] == [1, 3]


def test_an_ideal_file_in_place_of_shapes(tmp_path):
    n = 6
    ideal = IdealScan(np.arange(n), np.zeros(n), np.full(n, 10.0), np.ones(n), np.zeros(n))
    save_ideal(ideal, tmp_path / "ideal.csv")
    text = 'ideal = "ideal.csv"\n' + HEAD + KPIS
    scenario = load(tmp_path, text)
    assert scenario.ideal.layer.tolist() == list(range(n))
    assert faults(tmp_path, text + "object = 1\n") == [
        (line_of(text, "[[kpis]]"), "object is asked for, but the ideal scan has no ObjectID")
    ]


def test_a_measured_file_makes_distances_means(tmp_path):
    text = 'measured = "measured.csv"\n' + HEAD + BEAMS + KPIS.replace("area_mean", "area_distance")
    layer, point = np.array([10, 11], dtype=np.int32), np.array([100, 100], dtype=np.int32)
    save_scan(
        Scan.from_beams(layer, point, np.array([20.0, 20.1]), area=np.array([5.0, 7.0])), tmp_path / "measured.csv"
    )
    scenario = load(tmp_path, text)
    assert scenario.kpis[0].kind == "mean"
    assert scenario.kpis[0].feature is None
    assert scenario.asked[0].measured.tolist() == [5.0, 7.0]
    save_scan(Scan.from_beams(layer + 90, point, np.array([20.0, 20.1])), tmp_path / "measured.csv")
    (fault,) = faults(tmp_path, text)
    assert fault[0] == 1
    assert "Layer 100, Point 100" in fault[1]


def test_other_measured_echoes_are_another_scenario(tmp_path):
    text = 'measured = "measured.csv"\n' + HEAD + BEAMS + KPIS.replace("area_mean", "area_distance")
    layer, point = np.array([10, 11], dtype=np.int32), np.array([100, 100], dtype=np.int32)

    def content_hash(area: list[float]) -> str:
        echoes = Scan.from_beams(layer, point, np.array([20.0, 20.1]), area=np.array(area))
        save_scan(echoes, tmp_path / "measured.csv")
        return load(tmp_path, text).content_hash

    assert content_hash([5.0, 7.0]) == content_hash([5.0, 7.0]) != content_hash([5.0, 7.5])


# Scenes


SCENE = panel_scene((240, 279), (450, 509))


def test_a_scene_in_place_of_shapes(tmp_path):
    scenario = load(tmp_path, HEAD + SCENE + KPIS)
    assert scenario.scene is not None
    ideal = scenario.ideal
    assert len(ideal) == 40 * 60
    assert (ideal.layer.min(), ideal.layer.max(), ideal.point.min(), ideal.point.max()) == (240, 279, 450, 509)
    met = ideal.distance_m > 0.0
    forward = (beam_directions(ideal.layer, ideal.point) * ideal.distance_m[:, None])[met]
    np.testing.assert_allclose(forward[:, 0], 25.0, atol=1e-3)
    assert np.abs(forward[:, 1:]).max() < 0.5
    # The panel covers 2.3 by 2.3 degrees: 18 points, and more than the 40 layers.
    assert np.count_nonzero(met) == pytest.approx(18 * 40, abs=40)
    assert load(tmp_path, HEAD + BEAMS + KPIS).scene is None


def test_a_scene_file_brings_its_materials_and_its_sampling(tmp_path):
    """The scenario's own sampling stands in its place key by key; materials only the model has stay."""
    file = 'description = "one panel"\n[materials.1]\nreflectance = 0.9\n' + SCENE.replace("sampling", "scene.sampling")
    (tmp_path / "panel.toml").write_text(file, encoding="utf-8")
    text = 'scene = "panel.toml"\n' + HEAD + "\n[model.materials.2]\nreflectance = 0.2\n"
    scenario = load(tmp_path, text + KPIS)
    assert {number: m.reflectance for number, m in scenario.model.materials.items()} == {1: 0.9, 2: 0.2}
    assert len(scenario.ideal) == 40 * 60
    fewer = load(tmp_path, text + "\n[sampling]\nlayers = [250, 259]\nsub_beams = 2\n" + KPIS)
    assert len(fewer.ideal) == 10 * 60 * 4
    assert len(fewer.asked[0].selection.fired) == 10 * 60


def test_a_scene_that_comes_along_is_named(tmp_path):
    small = "\n[sampling]\nlayers = [200, 204]\npoints = [470, 489]\n"
    scenario = load(tmp_path, 'scene = "lab_c"\ndescription = "d"\n[model]\nvariant = "SLIM"\n' + small + KPIS)
    assert len(scenario.asked[0].selection.fired) == 100
    assert set(scenario.ideal.material_id[scenario.ideal.distance_m > 0.0]) <= set(scenario.model.materials)
    found = faults(tmp_path, 'scene = "lab_d"\n' + HEAD + KPIS)
    assert found == [(1, 'scene = "lab_d" is neither a file nor a built-in')]


def test_the_hash_covers_the_scene_and_how_it_is_cast(tmp_path):
    text = HEAD + SCENE + KPIS
    same = load(tmp_path, text).content_hash
    unseen = SCENE.replace("[25.0, 0.0, 0.0]", "[-25.0, 0.0, 0.0]").split("[sampling]")[0]
    for old, new in (
        ("width_m = 1.0", "width_m = 1.0000001"),
        ("points = [450, 509]", "points = [450, 508]"),
        ("points = [450, 509]", "points = [450, 509]\nsub_beams = 2"),
        ("[sampling]", unseen.strip() + "\n[sampling]"),
        ("material = 1\n", "material = 1\nvelocity_m_s = [0, 1, 0]\n"),
        ("tolerance = 1.0", "tolerance = 2.0"),
    ):
        assert load(tmp_path, text.replace(old, new)).content_hash != same, new
    for old, new in (("a small one", "another"), ("material = 1\n", 'material = 1\nname = "a panel"\n')):
        assert load(tmp_path, text.replace(old, new)).content_hash == same


# Faults


def test_all_faults_of_a_file_come_at_once_with_their_lines(tmp_path):
    text = HEAD.replace("description", "descripton") + BEAMS.replace("[10, 12]", "[12, 10]").replace("29.0", "-1.0")
    text += KPIS.replace("area_mean", "area_meen").replace("1.0", "0.0")
    found = faults(tmp_path, text)
    assert [line for line, _ in found if line] == sorted(line for line, _ in found if line)
    words = "\n".join(f"{line} {what}" for line, what in found)
    for part in ("descripton", "layers = ", "range_m = ", 'kpi = "area_meen"', "tolerance = "):
        assert f"{line_of(text, part)} " in words
    assert "description is missing" in words


@pytest.mark.parametrize(
    ("old", "new", "at", "says"),
    [
        ('shape = "surface"', 'shape = "surfaces"', "[[beams]]", "surfaces"),
        ("material = 1\n", "material = 7\n", "material = 7", "has material 7, which the model's table lacks"),
        ("29.0]", "400.0]", "[[beams]]", "reaches 400.0 m, the sensor only 300 m"),
        ("points = [100, 109]", "points = [100, 1090]", "points = ", "out of range"),
        ("tolerance = 1.0", "tolerance = 1.0\nmaterial = 3", "[[kpis]]", "selects no beams"),
        ("tolerance = 1.0", "tolerance = 1.0\nrange_m = [5, 3]", "range_m = [5", "lower end is above the upper"),
        ("tolerance = 1.0", "tolerance = 1.0\nlow = 3\nhigh = 2", "[[kpis]]", "low = 3 is above high = 2"),
        ("tolerance = 1.0", "tolerance = 1.0\nobject = true", "object = true", "object = true"),
        ("tolerance = 1.0", "tolerance = 1.0\nmaterial = []", "material = []", "empty"),
        ("tolerance = 1.0", 'tolerance = 1.0\nname = "a b"', 'name = "a b"', "not valid"),
        ("tolerance = 1.0", 'tolerance = 1.0\ndirection = "up"', "direction", "not a valid choice"),
        ("tolerance = 1.0", "tolerance = nan", "tolerance", "not a finite number"),
        (KPIS, KPIS + KPIS, "[[kpis]]", "two KPIs"),
        (BEAMS, BEAMS + BEAMS, "[[beams]]", "beams[1] shares Layer 10, Point 100 with beams[0]"),
        (BEAMS, "", "description", "no beams"),
        (HEAD, 'frames = 0\nmodel = "none.toml"\ndescription = "d"\n', "frames = 0", "out of range"),
        (HEAD, 'model = "none.toml"\ndescription = "d"\n', "model = ", 'model = "none.toml" is not a file'),
        (HEAD, f'model = "{"x" * 3000}"\ndescription = "d"\n', "model = ", "is not a file"),
        ('variant = "SMART"', 'variant = "SMALL"', "variant", "there is no sensor variant 'SMALL'"),
        ("description =", 'ideal = "a"\ndescription =', "description", "stand beside each other"),
        ("reflectance = 0.5", "reflectance = 1.5", "reflectance", "out of range"),
        ("tolerance = 1.0", "tolerance = 1.0\nlayers = [3, 4]", "[[kpis]]", "selects no beams"),
        ("tolerance = 1.0", "tolerance = 1.0\nlayers = [12, 10]", "layers = [12", "first is above the last"),
        ("tolerance = 1.0", "tolerance = 1.0\npoints = [100, 960]", "points = [100, 960]", "out of range"),
        ("tolerance = 1.0", "tolerance = 1.0\necho_range_m = [9, 8]", "echo_range_m", "lower end is above the upper"),
        ('"area_mean"', '"area_mean"\nnumber = 1', "[[kpis]]", "area_mean is of all echo numbers"),
        ('"area_mean"', '"echo_number_share"', "[[kpis]]", "does not say of which echo number"),
        ('"area_mean"', '"echo_number_share"\nnumber = -1', "number = -1", "out of range"),
        (
            '"area_mean"',
            '"mixed_pixel_share"\nwindow_m = 2',
            "[[kpis]]",
            "needs neighbouring surfaces more than 4 m apart",
        ),
        (BEAMS, GROUND.replace("20]", "260]"), "[[beams]]", "layer 260 looks above the horizon"),
        (BEAMS, GROUND.replace("20]", "259]"), "[[beams]]", "the sensor only 300 m"),
        (BEAMS, WALL.replace("turn_deg = 10", "turn_deg = -80"), "[[beams]]", "look past the wall"),
        (BEAMS, WALL.replace("turn_deg = 10", "turn_deg = 90"), "turn_deg", "out of range"),
        (BEAMS, TARGET.replace("[12, 13]", "[12, 21]"), "[[beams]]", "target_layers = [12, 21] is not within layers"),
        (BEAMS, TARGET + "behind_m = 40\nbehind_material = 5\n", "behind_material", "has material 5, which the model"),
        (BEAMS, TARGET.replace("material = 1", "material = 6"), "material = 6", "has material 6, which the model"),
        (BEAMS, SCENE.replace("material = 1", "material = 6"), "[[scene", "the scene has material 6, which the model"),
        (BEAMS, SCENE.replace("width_m = 1.0", "width_m = -1.0"), "width_m", "out of range"),
        (BEAMS, SCENE.replace("[450, 509]", "[450, 1509]"), "points = ", "out of range"),
        (BEAMS, SCENE.split("[sampling]")[0] + "[sampling]\nsub_beam = 2\n", "sub_beam", "unknown key"),
        (BEAMS, BEAMS + "[sampling]\nsub_beams = 2\n", "description", "sampling says how a scene is cast"),
        ("description =", "scene = 3\ndescription =", "scene", "scene = 3"),
        (BEAMS, BEAMS + SCENE.split("[sampling]")[0], "description", "[[beams]] and scene stand beside each other"),
    ],
)
def test_a_fault_names_its_line(tmp_path, old, new, at, says):
    good = HEAD + BEAMS + KPIS
    text = good.replace(old, new)
    assert text != good
    (fault,) = faults(tmp_path, text)
    assert says in fault[1]
    whole_document = any(part in says for part in ("has no beams", "stand beside", "sampling says"))
    assert fault[0] == (1 if whole_document else line_of(text, at))


def test_a_fix_is_in_words(tmp_path):
    path = tmp_path / "one.toml"
    text = HEAD + BEAMS.replace("[10, 12]", "[240]") + KPIS + 'name = ""\n'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    said = str(caught.value)
    assert "layers = [240]: 1 entry; write [first, last], both included" in said
    assert 'name = "" is not valid; use a name of letters, digits, _, . and -' in said


def test_a_surface_kpi_on_nothing_is_refused(tmp_path):
    nothing = '\n[[beams]]\nshape = "nothing"\nlayers = [0, 1]\npoints = [0, 1]\n'
    (fault,) = faults(tmp_path, HEAD + nothing + KPIS)
    assert "no selected beam meets one" in fault[1]
    alarms = KPIS.replace("area_mean", "false_alarms_per_beam")
    assert load(tmp_path, HEAD + nothing + alarms).kpis[0].name == "false_alarms_per_beam"


def test_panels_must_share_their_layers_evenly(tmp_path):
    panels = BEAMS.replace("surface", "panels").replace("range_m = [20.0, 29.0]", "x_m = [5.0, 6.0]")
    (fault,) = faults(tmp_path, HEAD + panels + KPIS)
    assert fault[1] == "3 layers cannot be shared evenly by 2 panels"


def test_an_external_model_knows_no_frames(tmp_path):
    external = 'description = "d"\nframes = 2\n[model.external]\ncommand = ["true", "{scan}"]\n'
    (fault,) = faults(tmp_path, external + BEAMS + KPIS)
    assert fault == (2, "frames = 2, but an external model does not know frames")


@pytest.mark.parametrize("text", ["", "x", "[[beams]]", "\0", "description = 1\nmodel = 2\nbeams = 3\nkpis = 4\n"])
def test_rubbish_is_an_error_of_ours(tmp_path, text):
    with pytest.raises(LidarcheckError) as caught:
        load(tmp_path, text)
    assert all(line.startswith("error: ") for line in caught.value.lines())


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml"):
        load_scenario(tmp_path / "none.toml")


# The shipped ones


def test_at_least_twelve_are_shipped_for_both_variants():
    assert len(SHIPPED) >= 12
    # What watches single parameters and terms is of one sensor: the code is that of both.
    of_both = [file for file in SHIPPED if not file.stem.startswith(("watch_", "empirical_"))]
    variants = [load_scenario(file).model.sensor.variant for file in of_both]
    assert variants.count("SMART") == variants.count("SLIM")


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_shipped_scenario_is_well_formed(file):
    scenario = load_scenario(file)
    assert 1 <= len(scenario.kpis) <= 16
    assert len(scenario.ideal) <= 60_000
    of_effect = re.fullmatch(r"effect_(\w+)_(?:SMART|SLIM)", file.stem)
    if file.stem.startswith("scene_"):
        assert scenario.scene is not None
    elif not file.stem.startswith(("watch_", "empirical_")):
        assert [effect.name for effect in scenario.model.effects] == ([of_effect[1]] if of_effect else [])
    assert all(asked.kind in KINDS for asked in scenario.asked)
    assert file.read_text(encoding="utf-8").startswith("# ")


def test_the_documentation_names_every_kind_and_shape():
    text = (SCENARIOS.parent / "docs/scenarios.md").read_text(encoding="utf-8")
    for name, kind in KINDS.items():
        assert f"| `{name}` | {kind.meaning} | {kind.unit} | {kind.direction} |" in text
    for shape in Shape.__subclasses__():
        for named in shape.__subclasses__() or [shape]:
            name = get_args(named.model_fields["shape"].annotation)[0]
            row = next(line for line in text.splitlines() if line.startswith(f'| `shape = "{name}"` |'))
            keys = set(named.model_fields) - {"shape", "layers", "points", "material", "object"}
            assert all(f"`{key}" in row for key in keys)


@pytest.mark.parametrize("table", [KpiTable, ScenarioTable])
def test_the_documentation_names_every_key(table):
    text = (SCENARIOS.parent / "docs/scenarios.md").read_text(encoding="utf-8")
    first_cells = "\n".join(line.split(" | ")[0] for line in text.splitlines() if line.startswith("| "))
    told = {
        key for key in table.model_fields for form in ("`{}`", "`[{}]`", "`[[{}]]`") if form.format(key) in first_cells
    }
    assert set(table.model_fields) - told == set()


def test_the_documentation_shows_a_scenario_that_works(tmp_path):
    text = (SCENARIOS.parent / "docs/scenarios.md").read_text(encoding="utf-8")
    shapes, scene = (part.split("```")[0] for part in text.split("```toml\n")[1:])
    (tmp_path / "models").mkdir()
    (tmp_path / "models/SMART.toml").write_text((SCENARIOS / "models/SMART.toml").read_text())
    assert len(load(tmp_path, shapes).kpis) == 3
    assert load(tmp_path, scene).scene is not None
