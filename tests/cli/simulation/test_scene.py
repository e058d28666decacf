"""`lidarcheck scene` as a user calls it."""

import json
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_ideal
from lidarcheck.harness.scenario.scenario import load_scenario
from lidarcheck.scenes.files.file import builtin_names
from reference_grid import beam_directions
from scenario_texts import TRIANGLE_PLY

PANEL = """\
[[scene.objects]]
name = "pane"
shape = "panel"
position_m = [20.0, 0.0, 0.0]
width_m = 4.0
height_m = 2.0
material = 3

[[scene.objects]]
name = "wall"
shape = "panel"
position_m = [30.0, 0.0, 0.0]
width_m = 40.0
height_m = 20.0
material = 4
velocity_m_s = [-10.0, 0.0, 0.0]

[scene.optics.3]
transmission = 0.5

[scene.sampling]
layers = [255, 264]
points = [470, 489]
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A directory with a scene of 200 beams, made current."""
    monkeypatch.chdir(tmp_path)
    Path("own.toml").write_text(PANEL)
    return tmp_path


def test_a_scene_is_written_and_read_again(here, capsys):
    assert main(["scene", "own.toml", "--out", "a.txt"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "a.txt: 400 rows of 200 beams of own.toml, 200 of which meet something\n"
    ideal = load_ideal("a.txt")
    assert set(ideal.share) == {1.0, 0.25}
    assert set(ideal.material_id) == {3, 4}
    assert set(ideal.object_id) == {1, 2}
    assert ideal.time_s is None


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".parquet", ".pcd", ".ply"])
def test_every_format_keeps_what_the_scene_says(here, suffix):
    assert main(["scene", "own.toml", "--out", f"a{suffix}", "--swept", "--quiet"]) == 0
    ideal = load_ideal(f"a{suffix}")
    assert len(ideal) == 400
    assert np.allclose(ideal.time_s, ideal.point * 0.03 / 959, atol=1e-9)
    wall = ideal.material_id == 4
    forward = beam_directions(ideal.layer, ideal.point)[wall, 0]
    assert np.allclose(ideal.distance_m[wall], (30.0 - 10.0 * ideal.time_s[wall]) / forward, rtol=1e-6)


def test_options_change_what_the_scene_asks_for(here, capsys):
    assert main(["scene", "own.toml", "--out", "a.parquet", "--no-second-hits", "--sub-beams", "3", "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    ideal = load_ideal("a.parquet")
    assert len(ideal) == 200 * 9
    assert ideal.share is None
    assert set(ideal.material_id) == {3}


def test_a_scenario_brings_its_scene(here, capsys):
    text = 'description = "x"\nmodel = "m.toml"\nscene = "own.toml"\n[[kpis]]\nkpi = "area_mean"\ntolerance = 1.0\n'
    Path("m.toml").write_text('variant = "SLIM"\n')
    Path("scenario.toml").write_text(text)
    assert main(["scene", "scenario.toml", "--out", "a.txt", "--quiet"]) == 0
    assert len(load_ideal("a.txt")) == 400
    Path("scenario.toml").write_text(text.replace('scene = "own.toml"\n', "") + PANEL)
    assert main(["scene", "scenario.toml", "--out", "b.txt", "--quiet"]) == 0
    assert Path("a.txt").read_bytes() == Path("b.txt").read_bytes()
    Path("scenario.toml").write_text(text.replace('scene = "own.toml"\n', ""))
    assert main(["scene", "scenario.toml", "--out", "c.txt"]) == 2
    assert "scenario.toml:1: the scenario has no scene" in capsys.readouterr().err
    assert not Path("c.txt").exists()


def test_a_sensor_is_named_by_itself_by_its_file_by_a_model_or_by_the_scenario(here, capsys):
    Path("near.toml").write_text(
        '[[objects]]\nshape = "panel"\nposition_m = [1.5, 0.0, 0.0]\nwidth_m = 9.0\nheight_m = 9.0\nmaterial = 3\n'
    )
    zones = resources.files("lidarcheck").joinpath("sensors/TMF8820.toml").read_text(encoding="utf-8")
    Path("mine.toml").write_text(zones.replace('"TMF8820 map 1"', '"mine"'))
    Path("m.toml").write_text('variant = "mine.toml"\n')
    Path("s.toml").write_text('description = "x"\nmodel = "m.toml"\nscene = "near.toml"\n')
    ways = {
        "name": ["near.toml", "--sensor", "TMF8820"],
        "file": ["near.toml", "--sensor", "mine.toml"],
        "model": ["near.toml", "--model", "m.toml"],
        "scenario": ["s.toml"],
    }
    for name, given in ways.items():
        assert main(["scene", *given, "--out", f"{name}.csv", "-q"]) == 0
    made = {name: Path(f"{name}.csv").read_bytes() for name in ways}
    assert len(set(made.values())) == 1
    assert made["name"].count(b"\n") == 1 + 9 * 81
    Path("m.toml").write_text('variant = "mine.toml"\n[sensor.range]\nmax_m = 1.51\n')
    assert main(["scene", "near.toml", "--model", "m.toml", "--out", "shorter.csv", "-q"]) == 0
    assert Path("shorter.csv").read_bytes() != made["name"]
    assert main(["scene", "near.toml", "--sensor", "mine.toml", "--out", "mine.toml"]) == 2
    assert main(["scene", "near.toml", "--sensor", "TMF8828", "--out", "x.csv"]) == 2
    assert main(["scene", "near.toml", "--sensor", "TMF8820", "--model", "m.toml", "--out", "x.csv"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 3
    assert "there is no sensor variant 'TMF8828'; did you mean TMF8820" in said[1]
    assert "--sensor stands beside --model" in said[2]
    assert not Path("x.csv").exists()
    assert Path("mine.toml").read_text().startswith("# A histogram chip")


def test_a_scan_that_brings_its_directions_is_simulated_along_them(here, capsys):
    rows = [f"{x},{y},0.5,{i % 2},{1000 * i}" for i, (x, y) in enumerate([(9, 1), (8, -3), (7, 0), (9, 2), (-5, 1)])]
    Path("cloud.csv").write_text("x,y,z,line,offset_time\n" + "\n".join(rows) + "\n")
    Path("near.toml").write_text(
        '[[objects]]\nshape = "panel"\nposition_m = [6.0, 0.0, 0.0]\nwidth_m = 9.0\nheight_m = 9.0\nmaterial = 3\n'
    )
    Path("m.toml").write_text('variant = "Livox"\n[materials.3]\nreflectance = 0.8\n')
    assert main(["scene", "near.toml", "--model", "m.toml", "--rays", "cloud.csv", "--out", "i.csv", "-q"]) == 0
    assert main(["simulate", "i.csv", "--model", "m.toml", "--out", "s.csv", "-q"]) == 0
    echoes = Path("s.csv").read_text().splitlines()[1:]
    assert len(echoes) == 4
    assert all(abs(float(line.split(",")[0]) - 6.0) < 0.2 for line in echoes)
    assert main(["scene", "near.toml", "--model", "m.toml", "--out", "x.csv"]) == 2
    assert main(["scene", "near.toml", "--sensor", "XT32", "--rays", "cloud.csv", "--out", "x.csv"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert "Livox HAP has no beams of its own" in said[0]
    assert "--rays is for a sensor whose scans bring their directions" in said[1]


SCENARIO = """\
description = "x"
scene = "own.toml"

[model]
variant = "SMART"

[model.materials.3]
reflectance = 0.1

[model.materials.4]
reflectance = 0.5

[sampling]
points = [475, 476]
sub_beams = 2
swept = true
velocity_m_s = [20.0, 0.0, 0.0]

[[kpis]]
kpi = "area_mean"
tolerance = 1.0
"""


@pytest.mark.parametrize("inline", [False, True])
def test_a_scenario_is_cast_as_check_casts_it(here, inline):
    """The scene says layers and points, the scenario other points and more: key by key the scenario goes before."""
    text = SCENARIO.replace('scene = "own.toml"\n', "") + PANEL if inline else SCENARIO
    Path("scenario.toml").write_text(text)
    assert main(["scene", "scenario.toml", "--out", "a.parquet", "--quiet"]) == 0
    written, checked = load_ideal("a.parquet"), load_scenario("scenario.toml").ideal
    assert len(written) == 10 * 2 * 4 * 2
    assert set(written.point) == {475, 476}
    for name in ("layer", "point", "distance_m", "material_id", "incidence_deg", "object_id", "time_s", "share"):
        assert np.array_equal(getattr(written, name), getattr(checked, name)), name


def test_options_go_before_the_scenario(here):
    Path("scenario.toml").write_text(SCENARIO)
    assert main(["scene", "scenario.toml", "--out", "a.parquet", "--sub-beams", "1", "--no-second-hits", "-q"]) == 0
    assert len(load_ideal("a.parquet")) == 10 * 2


def test_a_fault_of_the_scenarios_sampling_has_its_line(here, capsys):
    Path("scenario.toml").write_text(SCENARIO.replace("sub_beams = 2", "sub_beams = 9"))
    assert main(["scene", "scenario.toml", "--out", "a.txt"]) == 2
    assert capsys.readouterr().err.startswith("error: scenario.toml:15: sampling.sub_beams = 9 is out of range; ")
    assert not Path("a.txt").exists()


MESH = """\
[[objects]]
shape = "mesh"
file = "mesh.ply"
position_m = [9.0, 0.0, 0.0]
material = 3

[sampling]
layers = [255, 264]
points = [470, 489]
"""


@pytest.mark.parametrize("out", ["mesh.ply", "link.ply", "./mesh.ply", "elsewhere/mesh.ply"])
def test_an_output_never_replaces_a_mesh_of_the_scene(here, out, capsys):
    Path("mesh.ply").write_text(TRIANGLE_PLY)
    Path("mesh.toml").write_text(MESH)
    Path("link.ply").symlink_to("mesh.ply")
    Path("elsewhere").symlink_to(here)
    assert main(["scene", "mesh.toml", "--out", out]) == 2
    assert f"error: {Path(out)}: would replace another file of this command" in capsys.readouterr().err
    assert Path("mesh.ply").read_text() == TRIANGLE_PLY
    assert Path("link.ply").is_symlink()
    assert main(["scene", "mesh.toml", "--out", "other.ply", "--quiet"]) == 0


def test_an_output_never_replaces_what_a_link_in_the_scene_leads_to(here, capsys):
    Path("kept.ply").write_text(TRIANGLE_PLY)
    Path("mesh.ply").symlink_to("kept.ply")
    Path("mesh.toml").write_text(MESH)
    assert main(["scene", "mesh.toml", "--out", "kept.ply"]) == 2
    assert "would replace another file" in capsys.readouterr().err
    assert Path("kept.ply").read_text() == TRIANGLE_PLY


@pytest.mark.parametrize("link", ["own.toml", "m.toml", "scenario.toml"])
def test_an_output_never_replaces_a_file_behind_a_link(here, link, capsys):
    """Scene, materials and scenario, by a name that could be an ideal scan's."""
    Path("m.toml").write_text("[materials.3]\nreflectance = 0.1\n[materials.4]\nreflectance = 0.1\n")
    Path("own.toml").write_text('materials = "m.toml"\n' + PANEL)
    Path("scenario.toml").write_text(SCENARIO)
    Path("a.txt").symlink_to(link)
    before = Path(link).read_bytes()
    assert main(["scene", "scenario.toml", "--out", "a.txt"]) == 2
    assert "would replace another file" in capsys.readouterr().err
    assert Path(link).read_bytes() == before


def test_a_scene_of_too_many_triangles_is_one_line(here, capsys):
    ball = 'shape = "ellipsoid"\nposition_m = [9.0, 0.0, 0.0]\nsize_m = [1.0, 1.0, 1.0]\nmaterial = 3\nsides = 720\n'
    Path("balls.toml").write_text(f"[[objects]]\n{ball}copies = 1000\nstep_m = [0.0, 1.0, 0.0]\n")
    assert main(["scene", "balls.toml", "--out", "a.txt"]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith("error: balls.toml:1: objects[0] with its copies brings the scene to ")
    assert "triangles; at most 20000000" in said


def test_a_mesh_in_latin_1_is_cast_and_a_cut_one_is_said_at_its_line(here, capsys):
    Path("mesh.toml").write_text(MESH.replace(".ply", ".obj"))
    Path("mesh.obj").write_bytes(b"# B\xe4r\nv 0 -5 -5\nv 0 5 -5\nv 0 0 5\nf 1 2 3\n")
    assert main(["scene", "mesh.toml", "--out", "a.txt", "--quiet"]) == 0
    Path("mesh.obj").write_bytes(b"\0" * 80 + b"\1\0\0\0" + b"\xe4" * 30)
    assert main(["scene", "mesh.toml", "--out", "b.txt", "--quiet"]) == 2
    assert capsys.readouterr().err.startswith("error: mesh.toml:3: objects[0].file: mesh.obj: not an OBJ mesh: ")


def test_the_help_speaks_of_a_scene_only(capsys):
    assert main(["scene", "--help"]) == 0
    out = capsys.readouterr().out
    assert "SCENARIO" not in out
    assert "SCENE" in out.split("Arguments:")[1]


def test_json_says_what_is_seen(here, capsys):
    assert main(["scene", "own.toml", "--out", "a.parquet", "--json", "--quiet"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["scene"] == "own"
    assert (facts["rows"], facts["beams"], facts["beams_that_meet"]) == (400, 200, 200)
    assert facts["materials"] == [3, 4]
    assert [(o["object"], o["name"], o["rows"]) for o in facts["objects"]] == [(1, "pane", 200), (2, "wall", 200)]
    assert facts["objects"][1]["nearest_m"] == pytest.approx(30.0, abs=1e-4)


def test_a_built_in_scene_is_cast_by_name(here):
    assert main(["scene", "lab_c", "--out", "a.parquet", "--quiet"]) == 0
    assert len(load_ideal("a.parquet")) == 520 * 960


def test_the_built_in_scenes_are_listed(here, capsys):
    assert main(["scene", "--list"]) == 0
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert len(lines) == len(builtin_names()) + 1
    assert [line.split()[0] for line in lines[1:]] == list(builtin_names())
    assert main(["scene", "--list", "--json"]) == 0
    assert [entry["name"] for entry in json.loads(capsys.readouterr().out)] == list(builtin_names())


WRONG = {
    "no scene": (["--out", "a.txt"], "scene is missing"),
    "no output": (["own.toml"], "--out is missing"),
    "misspelled": (["higway", "--out", "a.txt"], "did you mean highway?"),
    "gone": (["gone.toml", "--out", "a.txt"], "gone.toml: there is no such file"),
    "no format": (["own.toml", "--out", "a.doc"], "cannot write '.doc' files"),
    "no directory": (["own.toml", "--out", "no/a.txt"], "its directory does not exist"),
    "itself": (["own.toml", "--out", "own.toml"], "own.toml"),
    "many": (
        ["own.toml", "--out", "a.txt", "--sub-beams", "9"],
        "--sub-beams 9 is out of range; use a whole number from 1 to 8",
    ),
    "none": (["own.toml", "--out", "a.txt", "--sub-beams", "0"], "--sub-beams 0 is out of range"),
    "a fraction": (
        ["own.toml", "--out", "a.txt", "--sub-beams", "1.5"],
        "--sub-beams 1.5 is out of range; use a whole",
    ),
    "a whole fraction": (["own.toml", "--out", "a.txt", "--sub-beams", "2.0"], "--sub-beams 2.0 is out of range"),
    "below none": (["own.toml", "--out", "a.txt", "--sub-beams=-2"], "--sub-beams -2 is out of range"),
    "a word": (["own.toml", "--out", "a.txt", "--sub-beams", "two"], "--sub-beams two is out of range"),
    "list and more": (["own.toml", "--list"], "--list stands beside"),
}


@pytest.mark.parametrize(("arguments", "says"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_one_line_and_nothing_is_written(here, arguments, says, capsys):
    assert main(["scene", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert len(err.splitlines()) == 1
    assert says in err
    assert sorted(path.name for path in here.iterdir()) == ["own.toml"]
    assert Path("own.toml").read_text() == PANEL


def test_a_fault_of_the_scene_has_its_line(here, capsys):
    Path("own.toml").write_text(PANEL.replace("width_m = 4.0", "width_m = -4.0"))
    assert main(["scene", "own.toml", "--out", "a.txt"]) == 2
    assert capsys.readouterr().err.startswith("error: own.toml:5: objects[0].width_m = -4.0 is out of range; ")
