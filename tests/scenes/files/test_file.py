"""Scene files: what they say, what is wrong with them and where, and the scenes that come with lidarcheck."""

import functools
import math
import pickle
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.config.schema import validate
from lidarcheck.errors import ConfigError, InputError, UsageError
from lidarcheck.formats import load_ideal
from lidarcheck.formats.config import parse_toml
from lidarcheck.formats.convert import convert
from lidarcheck.model import load_model, simulate
from lidarcheck.scenes import Optics
from lidarcheck.scenes.files.file import SceneTable, build_scene, builtin_names, builtin_path, load_scene, scene_of
from reference_grid import beam_directions

ROOT = Path(__file__).resolve().parents[3]

PANEL = """\
[[scene.objects]]
shape = "panel"
position_m = [20.0, 0.0, 0.0]
width_m = 4.0
height_m = 2.0
material = 3
"""


def write(tmp_path, text, name="scene.toml"):
    file = tmp_path / name
    file.write_text(text)
    return file


def test_a_scene_table_and_a_scene_at_the_top_say_the_same(tmp_path):
    inner = load_scene(write(tmp_path, 'description = "a panel"\n' + PANEL))
    outer = load_scene(write(tmp_path, PANEL.replace("[[scene.objects]]", "[[objects]]"), "flat.toml"))
    assert inner.description == "a panel"
    assert inner.name == "scene"
    assert inner.materials is None
    assert inner.scene.digest() == outer.scene.digest()
    ideal = inner.ideal(layers=(259, 260), points=(479, 480))
    assert np.allclose(ideal.distance_m, 20.0, atol=1e-3)
    assert set(ideal.material_id) == {3}
    assert ideal.file == str(tmp_path / "scene.toml")


def test_objects_are_numbered_from_one_and_copied_in_steps(tmp_path):
    text = (
        PANEL
        + "copies = 3\nstep_m = [5.0, 1.0, 0.0]\n"
        + PANEL.replace("material = 3", "material = 4\nobject = 50\nname = 'far'")
        + PANEL.replace("material = 3", "material = 5\nvelocity_m_s = [1.0, 2.0, 3.0]")
    )
    scene = load_scene(write(tmp_path, text)).scene
    assert [thing.object_id for thing in scene.objects] == [1, 2, 3, 50, 51]
    assert [thing.name for thing in scene.objects] == ["panel 1", "panel 2", "panel 3", "far", "panel"]
    assert [thing.triangles_m[..., 0].mean() for thing in scene.objects[:3]] == [20.0, 25.0, 30.0]
    assert [thing.triangles_m[..., 1].max() for thing in scene.objects[:3]] == [2.0, 3.0, 4.0]
    assert dict(scene.velocities_m_s) == {51: (1.0, 2.0, 3.0)}


def test_sampling_and_optics_are_read(tmp_path):
    text = PANEL + (
        "[scene.optics.3]\nmirror = 0.25\ntransmission = 0.5\n"
        "[scene.sampling]\nlayers = [250, 259]\npoints = [470, 479]\nsub_beams = 2\nsecond_hits = false\n"
        "swept = true\nvelocity_m_s = [10.0, 0.0, 0.0]\nyaw_deg_s = 5.0\nmax_range_m = 100.0\n"
    )
    file = load_scene(write(tmp_path, text))
    assert file.scene.optics == {3: Optics(0.25, 0.5)}
    ideal = file.ideal()
    assert len(ideal) == 400
    assert (ideal.layer.min(), ideal.layer.max(), ideal.point.min(), ideal.point.max()) == (250, 259, 470, 479)
    assert ideal.time_s is not None
    assert ideal.share is None
    assert ideal.rays.origin_m[:, 0].max() == pytest.approx(10.0 * 479 * 0.03 / 959)
    assert len(file.ideal(sub_beams=1, swept=False)) == 100
    assert pickle.loads(pickle.dumps(file)).ideal().distance_m.tolist() == ideal.distance_m.tolist()


def test_a_mesh_is_found_beside_the_scene(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/wall.obj").write_text("v 0 -5 -5\nv 0 5 -5\nv 0 0 5\nf 1 2 3\n")
    keys = 'file = "parts/wall.obj"\nposition_m = [7.0, 0.0, 0.0]\nmaterial = 2\nscale = 2.0\n'
    text = f'[[objects]]\nshape = "mesh"\n{keys}'
    ideal = load_scene(write(tmp_path, text)).ideal(layers=(259, 259), points=(479, 479))
    assert ideal.distance_m[0] == pytest.approx(7.0, rel=1e-5)
    (tmp_path / "parts/wall.obj").write_text("v 0 0 0\n")
    with pytest.raises(ConfigError, match=r"scene\.toml:3: objects\[0\]\.file: parts/wall\.obj: the mesh has no tri"):
        load_scene(tmp_path / "scene.toml")
    # A byte of Latin-1, cut off: no text, and no mesh.
    (tmp_path / "parts/wall.obj").write_bytes(b"# B\xe4r\n")
    with pytest.raises(ConfigError, match=r"scene\.toml:3: objects\[0\]\.file: parts/wall\.obj: not an OBJ mesh"):
        load_scene(tmp_path / "scene.toml")


def test_a_scene_has_a_limit_of_triangles(tmp_path, monkeypatch):
    balls = '[[objects]]\nshape = "ellipsoid"\nposition_m = [9.0, 0.0, 0.0]\nsize_m = [1.0, 1.0, 1.0]\nmaterial = 1\n'
    many = f"{balls}{balls}sides = 720\ncopies = 1000\nstep_m = [0.0, 1.0, 0.0]\n"
    # 720 meridians and 360 belts: two triangles a cell, but for the poles' one; before it 24 and 12.
    total = 24 * 2 * 11 + 1000 * 720 * 2 * 359
    with pytest.raises(ConfigError) as caught:
        load_scene(write(tmp_path, many))
    (said,) = caught.value.lines()
    assert said.startswith(
        f"error: {tmp_path / 'scene.toml'}:6: objects[1] with its copies brings the scene to {total} "
    )
    assert "at most 20000000" in said
    monkeypatch.setattr("lidarcheck.scenes.files.objects.MAX_TRIANGLES", 24 * 2 * 11)
    assert load_scene(write(tmp_path, balls)).scene.triangles == 24 * 2 * 11
    monkeypatch.setattr("lidarcheck.scenes.files.objects.MAX_TRIANGLES", 24 * 2 * 11 - 1)
    with pytest.raises(ConfigError, match="brings the scene to 528 triangles"):
        load_scene(tmp_path / "scene.toml")


SHAPES = {
    "plane": "position_m = [20.0, 0.0, -1.8]\nsize_m = [30.0, 20.0]\nmaterial = 1",
    "box": "position_m = [20.0, 0.0, -1.8]\nsize_m = [2.0, 3.0, 4.0]\nmaterial = 1",
    "panel": "position_m = [20.0, 0.0, 0.0]\nwidth_m = 3.0\nheight_m = 2.0\nmaterial = 1",
    "sign": "position_m = [20.0, 0.0, 0.0]\nwidth_m = 3.0\nheight_m = 2.0\nmaterial = 17\npost_m = 2.0",
    "pole": "position_m = [20.0, 0.0, -1.8]\ndiameter_m = 1.0\nheight_m = 4.0\nmaterial = 1\ntop_diameter_m = 0.5",
    "ellipsoid": "position_m = [20.0, 0.0, 0.0]\nsize_m = [1.0, 2.0, 2.0]\nmaterial = 1",
    "car": "position_m = [20.0, 0.0, -1.8]\nmaterial = 1",
    "van": "position_m = [20.0, 0.0, -1.8]\nmaterial = 1\nglass = 2",
    "truck": "position_m = [20.0, 0.0, -1.8]\nmaterial = 1\nyaw_deg = 90.0",
    "person": "position_m = [20.0, 0.0, -1.8]",
    "tree": "position_m = [20.0, 0.0, -1.8]\nheight_m = 6.0\ncrown_m = 3.0",
}


@pytest.mark.parametrize(("shape", "keys"), SHAPES.items())
def test_every_shape_can_be_named_and_is_seen(tmp_path, shape, keys):
    ideal = load_scene(write(tmp_path, f'[[objects]]\nshape = "{shape}"\n{keys}\n')).ideal()
    met = ideal.distance_m > 0.0
    assert met.sum() > 50
    assert 4.0 < ideal.distance_m[met].min() <= 20.1


def changed(old, new):
    assert old in PANEL
    return PANEL.replace(old, new)


MESH = '[[scene.objects]]\nshape = "mesh"\nposition_m = [1.0, 0.0, 0.0]\nmaterial = 1\nfile = '
BAD = {
    "unknown key": (PANEL + "colour = 3\n", 7, "unknown key objects[0].colour"),
    "near key": (PANEL + "yaw = 3.0\n", 7, "did you mean yaw_deg?"),
    "wrong type": (changed("4.0", '"wide"'), 4, "is text"),
    "zero size": (changed("width_m = 4.0", "width_m = 0.0"), 4, "out of range"),
    "negative size": (changed("height_m = 2.0", "height_m = -2.0"), 5, "out of range"),
    "nan": (changed("width_m = 4.0", "width_m = nan"), 4, "not a finite number"),
    "nan place": (changed("20.0", "nan"), 3, "not a finite number"),
    "infinite speed": (PANEL + "velocity_m_s = [inf, 0.0, 0.0]\n", 7, "not a finite number"),
    "too fast": (PANEL + "velocity_m_s = [1e4, 0.0, 0.0]\n", 7, "out of range"),
    "two numbers": (changed("[20.0, 0.0, 0.0]", "[20.0, 0.0]"), 3, "[x, y, z]"),
    "negative material": (changed("= 3", "= -3"), 6, "out of range"),
    "fraction": (changed("= 3", "= 3.5"), 6, "a whole number"),
    "missing": (changed("height_m = 2.0\n", ""), 1, "height_m is missing"),
    "unknown shape": (changed('"panel"', '"pannel"'), 1, "pannel"),
    "no shape": (changed('shape = "panel"\n', ""), 1, "shape is missing"),
    "no objects": ("[scene]\nobjects = []\n", 2, "no objects"),
    "nothing": ('description = "x"\n', 1, "objects is missing"),
    "copies in place": (PANEL + "copies = 2\n", 1, "one place"),
    "step alone": (PANEL + "step_m = [1.0, 0.0, 0.0]\n", 1, "without copies"),
    "missing mesh": (MESH + '"gone.stl"\n', 5, 'file = "gone.stl" is not a file'),
    "empty mesh name": (MESH + '""\n', 5, "is not a file"),
    "too much light": (PANEL + "[scene.optics.3]\nmirror = 0.7\ntransmission = 0.7\n", 7, "above 1"),
    "negative mirror": (PANEL + "[scene.optics.3]\nmirror = -0.1\n", 8, "out of range"),
    "optics of a word": (PANEL + "[scene.optics.glass]\nmirror = 0.1\n", 7, "not valid"),
    "layers": (PANEL + "[scene.sampling]\nlayers = [0, 520]\n", 8, "out of range"),
    "falling": (PANEL + "[scene.sampling]\npoints = [9, 3]\n", 8, "first is above the last"),
    "sub-beams": (PANEL + "[scene.sampling]\nsub_beams = 9\n", 8, "out of range"),
    "truth": (PANEL + "[scene.sampling]\nswept = 1\n", 8, "true or false"),
    "beside": ("optics = {}\n" + PANEL, 1, "optics stands beside [scene]"),
    "no materials": ('materials = "gone.toml"\n' + PANEL, 1, "is not a file"),
    "lacks a material": ("[materials.1]\nreflectance = 0.5\n" + PANEL, 8, "lacks"),
    "bad material": ("[materials.3]\nreflectance = 1.5\n" + PANEL, 2, "out of range"),
    "no TOML": ("[[scene.objects]\n", 1, "not valid TOML"),
    "two speeds": (
        PANEL + "object = 1\n" + PANEL + "object = 1\nvelocity_m_s = [1.0, 0.0, 0.0]\n",
        1,
        "two velocities",
    ),
}


@pytest.mark.parametrize(("text", "line", "says"), BAD.values(), ids=BAD.keys())
def test_a_fault_is_one_line_with_its_place(tmp_path, text, line, says):
    file = write(tmp_path, text)
    with pytest.raises((InputError, ConfigError)) as caught:
        load_scene(file).ideal()
    (said,) = caught.value.lines()
    assert said.startswith(f"error: {file}:{line}: ")
    assert says in said
    assert "; " in said


def test_all_faults_are_found_at_once(tmp_path):
    text = changed("width_m = 4.0", "width_m = 0.0") + changed("= 3", "= -3") + "[scene.sampling]\nsub_beams = 0\n"
    with pytest.raises(ConfigError) as caught:
        load_scene(write(tmp_path, text))
    assert [fault.line for fault in caught.value.faults] == [4, 12, 14]


def test_a_fault_of_a_materials_file_names_that_file(tmp_path):
    write(tmp_path, "[materials.3]\nreflectance = 2\n", "m.toml")
    with pytest.raises(ConfigError, match=r"m\.toml:2: "):
        load_scene(write(tmp_path, 'materials = "m.toml"\n' + PANEL))
    write(tmp_path, "[materials.3]\nreflectance = 0.5\nname = 'x'\n", "m.toml")
    assert load_scene(tmp_path / "scene.toml").materials[3].name == "x"


def reference(tmp_path, text):
    data, lines = parse_toml(write(tmp_path, text, "scenario.toml"))
    return scene_of(data["scene"], lines)


def test_a_scene_is_named_by_built_in_path_or_table(tmp_path):
    assert reference(tmp_path, 'x = 1\nscene = "lab_c"\n').path == builtin_path("lab_c")
    write(tmp_path, PANEL, "own.toml")
    assert reference(tmp_path, 'scene = "own.toml"\n').path == tmp_path / "own.toml"
    inline = reference(tmp_path, "frames = 1\n" + PANEL)
    assert inline.path == tmp_path / "scenario.toml"
    assert inline.scene.digest() == load_scene(tmp_path / "own.toml").scene.digest()


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ('x = 1\nscene = "labc"\n', 2, "did you mean lab_c?"),
        ("scene = 3\n", 1, "scene = 3 is not a scene"),
        ("x = 1\n" + PANEL.replace("4.0", "0.0"), 5, "width_m"),
        ("x = 1\n" + MESH + '"gone.stl"\n', 6, "gone.stl"),
    ],
)
def test_a_wrong_reference_is_said_at_its_line(tmp_path, text, line, says):
    with pytest.raises(ConfigError) as caught:
        reference(tmp_path, text)
    (said,) = caught.value.lines()
    assert said.startswith(f"error: {tmp_path / 'scenario.toml'}:{line}: ")
    assert says in said


def test_a_table_is_built_from_its_directory(tmp_path):
    data, lines = parse_toml(write(tmp_path, PANEL.replace("[[scene.objects]]", "[[objects]]")))
    table = validate(data, lines, SceneTable)
    assert build_scene(table, tmp_path, lines).triangles == 2


def test_the_example_of_the_documentation_is_a_scene(tmp_path):
    text = (ROOT / "docs/scenes.md").read_text(encoding="utf-8")
    example = text.split("```toml\n")[1].split("```")[0]
    file = load_scene(write(tmp_path, example))
    ideal = file.ideal()
    assert set(ideal.object_id[ideal.distance_m > 0.0]) == {1, 2, 3, 4}
    assert {round(share, 6) for share in ideal.share} == {1.0, 0.64, 0.0064}


@functools.cache
def built_in(name):
    file = load_scene(builtin_path(name))
    return file, file.ideal()


NAMED = {
    **{f"sign_vertical_{text}m": ("sign", 17, r) for text, r in (("69", 69.0), ("156", 156.6), ("199", 199.0))},
    "sign_horizontal_20m": ("sign", 17, 20.0),
    **{f"sign_ghost_{r}m": ("sign", 17, float(r)) for r in (25, 45, 58, 62)},
    "bus_stop_glass": ("glass side wall near", 15, 12.4),
    "city_street": ("crossing car", None, 29.3),
    "highway": ("car ahead", None, 29.8),
    "bridge_signs": ("bridge sign left", 17, 59.7),
    "wet_road": ("car ahead", None, 19.8),
    "lab_c": ("panel 80 % at 80 m", 3, 80.0),
    **{f"vehicles_{r}m": ("car", None, float(r)) for r in (10, 15, 25, 50)},
}


def test_the_built_in_scenes_are_those_that_are_documented():
    assert set(builtin_names()) == set(NAMED)
    text = (ROOT / "docs/scenes.md").read_text(encoding="utf-8")
    for name in NAMED:
        assert f"`{name}`" in text
    with pytest.raises(UsageError, match="did you mean highway"):
        builtin_path("higway")


@pytest.mark.parametrize(("name", "named"), NAMED.items())
def test_a_built_in_scene_shows_its_object_at_its_distance(name, named):
    file, ideal = built_in(name)
    label, material, distance = named
    (number,) = (number for number, text in file.scene.names.items() if text == label)
    rows = (ideal.object_id == number) & (ideal.distance_m > 0.0)
    rows &= True if material is None else ideal.material_id == material
    assert len(set(zip(ideal.layer[rows], ideal.point[rows], strict=True))) >= 50
    assert len(set(ideal.layer[rows])) >= 5
    assert len(set(ideal.point[rows])) >= 5
    assert ideal.distance_m[rows].min() == pytest.approx(distance, abs=0.1)
    assert 90 < file.scene.triangles < 20_000
    assert file.description != "a scene"
    assert np.all(np.isfinite(ideal.distance_m))
    assert ideal.incidence_deg.max() <= 90.0
    assert np.all(np.bincount(ideal.layer, minlength=520) >= 960)


@pytest.mark.parametrize("distance", [10, 15, 25, 50])
def test_car_truck_and_van_stand_side_by_side(distance):
    file, ideal = built_in(f"vehicles_{distance}m")
    for number, name in ((1, "car"), (2, "truck"), (3, "van")):
        assert file.scene.names[number] == name
        rows = (ideal.object_id == number) & (ideal.distance_m > 0.0)
        plate = rows & (ideal.material_id == 18)
        assert plate.sum() >= 5
        corners = next(thing.triangles_m for thing in file.scene.objects if thing.object_id == number)
        assert corners[..., 0].min() == pytest.approx(distance, abs=0.02)


def test_the_lab_has_panels_of_three_reflectances_at_each_distance():
    file, ideal = built_in("lab_c")
    for distance in (5, 10, 20, 30, 40, 50, 60, 70, 80):
        for material, label in ((1, "10 %"), (2, "50 %"), (3, "80 %")):
            (number,) = (n for n, text in file.scene.names.items() if text == f"panel {label} at {distance} m")
            rows = ideal.object_id == number
            assert rows.sum() >= 100
            assert set(ideal.material_id[rows]) == {material}
            assert np.abs(ideal.distance_m[rows] - distance).max() < 0.15
            assert ideal.incidence_deg[rows].max() < 10.0


@pytest.mark.parametrize("name", ["bus_stop_glass", "wet_road", "city_street"])
def test_glass_and_water_show_what_stands_behind(name):
    _, ideal = built_in(name)
    assert ideal.share is not None
    assert np.sum(ideal.share < 1.0) > 5000
    assert ideal.share.min() > 0.0


def test_the_highway_moves():
    file, still = built_in("highway")
    moving = file.scene.velocities_m_s
    assert len(moving) == 8
    swept = file.ideal(swept=True, points=(400, 560), second_hits=False)
    inside = (still.point >= 400) & (still.point <= 560)
    assert swept.time_s.max() == pytest.approx(0.03 * 560 / 959)
    truck = next(n for n, text in file.scene.names.items() if text == "gantry beam")
    nearer = (
        still.distance_m[inside & (still.object_id == truck)].min() - swept.distance_m[swept.object_id == truck].min()
    )
    assert 33.0 * 0.03 * 400 / 959 < nearer < 33.0 * 0.03 * 560 / 959


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_the_models_of_the_scenes_have_the_materials_of_the_scenes(variant):
    model = load_model(ROOT / f"scenarios/models/scenes_{variant}.toml")
    reference_model = load_model(ROOT / f"scenarios/models/{variant}.toml")
    assert model.sensor == reference_model.sensor
    assert {number: model.materials[number] for number in reference_model.materials} == reference_model.materials
    for name in NAMED:
        assert built_in(name)[0].materials == model.materials


def test_a_built_in_scene_is_simulated():
    model = load_model(ROOT / "scenarios/models/scenes_SMART.toml")
    file, _ = built_in("sign_vertical_69m")
    ideal = file.ideal(layers=(255, 275), points=(460, 500))
    scan = simulate(ideal, model, seed=1, scene=file.scene)
    on_sign = np.abs(scan.range_m - 69.0) < 1.0
    assert on_sign.sum() > 200
    assert scan.peak[on_sign].max() == 135


def test_retro_reflectors_have_the_gain_of_their_coefficient():
    text = (builtin_path("lab_c").parent.parent / "materials.toml").read_text(encoding="utf-8")
    materials = tomllib.loads(text)["materials"]
    for number, coefficient in ((17, 250.0), (18, 45.0), (20, 450.0)):
        entry = materials[str(number)]
        assert entry["reflectance"] * entry["retro_gain"] == pytest.approx(math.pi * coefficient, rel=0.01)


def test_a_scene_as_the_semantic_lidar_of_a_simulator_becomes_the_same_ideal_scan(tmp_path):
    ideal = load_scene(builtin_path("city_street")).ideal(layers=(200, 230), points=(400, 520), second_hits=False)
    xyz = beam_directions(ideal.layer, ideal.point) * ideal.distance_m[:, None] * [1.0, -1.0, 1.0]
    cosine = np.cos(np.deg2rad(ideal.incidence_deg))
    rows = zip(*xyz.T, cosine, ideal.object_id, ideal.material_id, ideal.distance_m > 0.0, strict=True)
    lines = [f"{x:.9f} {y:.9f} {z:.9f} {c:.9f} {o} {m}" for x, y, z, c, o, m, met in rows if met]
    columns = [
        f"property {kind} {name}"
        for kind, name in zip(
            ("float64",) * 4 + ("uint32",) * 2, ("x", "y", "z", "CosAngle", "ObjIdx", "ObjTag"), strict=True
        )
    ]
    header = ["ply", "format ascii 1.0", f"element vertex {len(lines)}", *columns, "end_header"]
    (tmp_path / "semantic.ply").write_text("\n".join([*header, *lines]) + "\n")
    convert(tmp_path / "semantic.ply", tmp_path / "ideal.parquet")
    again = load_ideal(tmp_path / "ideal.parquet")
    assert len(again) == len(ideal)
    for name in ("layer", "point", "material_id", "object_id"):
        assert np.array_equal(getattr(again, name), getattr(ideal, name))
    assert np.allclose(again.distance_m, ideal.distance_m, atol=1e-6)
    assert np.allclose(again.incidence_deg, ideal.incidence_deg, atol=1e-3)


def test_a_scene_says_which_files_it_was_read_from(tmp_path):
    (tmp_path / "wall.obj").write_text("v 0 -5 -5\nv 0 5 -5\nv 0 0 5\nf 1 2 3\n")
    write(tmp_path, "[materials.1]\nreflectance = 0.5\n", "m.toml")
    file = load_scene(write(tmp_path, 'materials = "m.toml"\n' + (MESH + '"wall.obj"\n') * 2))
    assert file.files == (tmp_path / "scene.toml", tmp_path / "wall.obj", tmp_path / "m.toml")


def test_the_file_of_materials_of_the_documentation_is_one(tmp_path):
    text = (Path(__file__).resolve().parents[3] / "docs/scenes.md").read_text(encoding="utf-8")
    shown = text.split("with the keys that they have in a model file:\n\n```toml\n")[1].split("```")[0]
    write(tmp_path, shown, "materials.toml")
    file = load_scene(write(tmp_path, 'materials = "materials.toml"\n' + changed("= 3", "= 17")))
    assert file.materials[17].retro_gain == 982.0


def test_the_file_an_ideal_scan_names_is_the_scene(tmp_path):
    file = load_scene(write(tmp_path, PANEL))
    assert replace(file, path=Path("x.toml")).ideal(layers=(0, 0), points=(0, 0)).file == "x.toml"
