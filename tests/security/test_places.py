"""Files of a project name none outside of it, and nothing of a file outside is ever in a message."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cases.case import load_case
from lidarcheck.cli import main
from lidarcheck.errors import LidarcheckError
from lidarcheck.harness.layout import select
from lidarcheck.harness.scenario.scenario import load_scenario
from lidarcheck.model.files.model_file import load_model
from lidarcheck.permissions import Permissions, granted
from lidarcheck.scenes.files.file import load_scene
from lidarcheck.scenes.meshes import load_mesh
from lidarcheck.session.inputs import files_named_by
from lidarcheck.trust.places import is_permitted, named_file, own_place, project_of
from lidarcheck.trust.user_file import user_file_path
from scenario_texts import PANEL_MODEL, TRIANGLE_PLY, kpis, panel_scene, surface

SECRET = "hunter2"
LUT = f"PostPro.LUT_blooming_X = 0, 1\nPostPro.LUT_blooming_Y = 1, 0.5\nPassword = {SECRET}\n"
EFFECT = '[[effects]]\nname = "blooming_vertical"\nlut = "{name}"\n'
KPIS = kpis(area_mean=1)
SCENARIO = 'description = "d"\nmodel = "{name}"\n' + surface((1, 2), (1, 2), (9, 9)) + KPIS
CASE = "".join(f'[[frames]]\nideal = "i{i}.txt"\nmeasured = "m{i}.txt"\ntime = {i}\n' for i in range(1, 4))
OBJECT = '[[objects]]\nshape = "mesh"\nfile = "{name}"\nmaterial = 1\nposition_m = [9.0, 0.0, 0.0]\n'
PANEL = panel_scene((1, 2), (1, 2)).partition("[sampling]")[0].replace("[[scene.objects]]", "[[objects]]")

NAMES = {
    "a model's table": ("models/m.toml", PANEL_MODEL + EFFECT, load_model),
    "an external program's settings": (
        "models/m.toml",
        '[external]\ncommand = ["true", "{{scan}}"]\nini = "{name}"\n',
        load_model,
    ),
    "a scenario's model": ("scenarios/s.toml", SCENARIO, load_scenario),
    "a scenario's ideal scan": (
        "scenarios/s.toml",
        'description = "d"\nideal = "{name}"\n[model]\n' + PANEL_MODEL.replace("[mat", "[model.mat") + KPIS,
        load_scenario,
    ),
    "a scenario's measured scan": (
        "scenarios/s.toml",
        'description = "d"\nmeasured = "{name}"\n[model]\n'
        + PANEL_MODEL.replace("[mat", "[model.mat")
        + surface((1, 2), (1, 2), (9, 9))
        + KPIS,
        load_scenario,
    ),
    "a scenario's scene": (
        "scenarios/s.toml",
        'description = "d"\nscene = "{name}"\n[model]\n' + PANEL_MODEL.replace("[mat", "[model.mat") + KPIS,
        load_scenario,
    ),
    "a scene's materials": ("scenes/s.toml", 'materials = "{name}"\n' + PANEL, load_scene),
    "a scene's mesh": ("scenes/s.toml", OBJECT, load_scene),
    "a case's model": ("case/case.toml", 'model = "{name}"\n' + CASE, load_case),
    "a case's ideal scan": ("case/case.toml", 'model = "m.toml"\n' + CASE.replace("i1.txt", "{name}"), load_case),
    "a case's measured scan": ("case/case.toml", 'model = "m.toml"\n' + CASE.replace("m1.txt", "{name}"), load_case),
}


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A project beside a file of secrets."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "user"))
    for suffix in ("toml", "txt", "ply", "ini"):
        (tmp_path / f"secret.{suffix}").write_text(LUT if suffix == "ini" else f"{SECRET} = {SECRET} X\n{SECRET}\n")
    project = tmp_path / "project"
    (project / "scenarios").mkdir(parents=True)
    for folder in ("models", "scenes", "case"):
        (project / folder).mkdir()
    (project / "case" / "m.toml").write_text(PANEL_MODEL)
    return project


def written(root, what, name):
    place, text, load = NAMES[what]
    (root / place).write_text(text.replace("{{scan}}", "{scan}").replace("{name}", name))
    return lambda: load(root / place)


def refusal(call):
    with pytest.raises(LidarcheckError) as caught:
        call()
    return "\n".join(caught.value.lines())


SUFFIX = {"a model's table": "ini", "an external program's settings": "ini", "a scene's mesh": "ply"}


def secret_for(what):
    return f"secret.{SUFFIX.get(what, 'txt' if 'scan' in what else 'toml')}"


@pytest.mark.parametrize("what", NAMES)
@pytest.mark.parametrize("how", ["up", "whole", "link", "linked folder"])
def test_no_file_outside_is_read(root, what, how):
    secret = root.parent / secret_for(what)
    place = root / NAMES[what][0]
    name = {"up": f"../../{secret.name}", "whole": str(secret)}.get(how, f"link.{secret.suffix[1:]}")
    if how == "link":
        (place.parent / name).symlink_to(secret)
    if how == "linked folder":
        (place.parent / "linked").symlink_to(root.parent)
        name = f"linked/{secret.name}"
    said = refusal(written(root, what, name))
    assert SECRET not in said
    assert "leads out of" in said
    assert said.startswith(f"error: {place}")


@pytest.mark.parametrize("what", [what for what in NAMES if "case" not in what])
def test_what_is_permitted_is_read(root, what):
    secret = root.parent / secret_for(what)
    call = written(root, what, f"../../{secret.name}")
    with granted(Permissions(roots=(root.parent,))):
        permitted = attempt(call)
    assert "leads out of" not in permitted
    user_file_path().parent.mkdir(parents=True)
    user_file_path().write_text(f'roots = ["{root.parent}"]\n')
    assert attempt(call) == permitted


def attempt(call):
    try:
        call()
    except LidarcheckError as error:
        return str(error)
    return ""


def test_a_link_among_the_scenarios_a_golden_and_a_case_that_leads_out(root, capsys, monkeypatch):
    (root / "scenarios" / "evil.toml").symlink_to(root.parent / "secret.toml")
    assert "evil.toml: leads out of the project" in refusal(lambda: select([root]))
    monkeypatch.chdir(root)
    assert main(["check", "-q"]) == 2
    (root / "case" / "case.toml").symlink_to(root.parent / "secret.toml")
    assert main(["explain", "case", "--out", "found", "-q"]) == 2
    assert main(["calibrate", "case", "--free", "signal_at_1m", "--out", "found", "-q"]) == 2
    said = capsys.readouterr().err
    assert SECRET not in said
    assert said.count("leads out of the project") == 3


def test_a_mesh_names_no_file_outside(root):
    """A GLB file may keep its numbers in a file of its own, named in it."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    (root.parent / "outside.bin").write_bytes(corners)
    (root / "scenes" / "inside.bin").write_bytes(corners)
    for name, is_read in (("inside.bin", True), ("../../outside.bin", False)):
        view = {"buffer": 0, "byteOffset": 0, "byteLength": len(corners)}
        accessor = {
            "bufferView": 0,
            "componentType": 5126,
            "count": 3,
            "type": "VEC3",
            "min": [0, 0, 0],
            "max": [1, 1, 0],
        }
        document = {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "scene": 0,
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [accessor],
            "bufferViews": [view],
            "buffers": [{"uri": name, "byteLength": len(corners)}],
        }
        content = json.dumps(document).encode()
        content += b" " * (-len(content) % 4)
        chunk = struct.pack("<I4s", len(content), b"JSON") + content
        mesh = root / "scenes" / "mesh.glb"
        mesh.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk)
        if is_read:
            assert len(load_mesh(mesh, 1).triangles_m) == 1
        else:
            with pytest.raises(LidarcheckError, match="leads out of the project"):
                load_mesh(mesh, 1)


def test_the_project_is_the_nearest_folder_with_a_mark(tmp_path):
    inner = tmp_path / "a" / "b" / "c"
    inner.mkdir(parents=True)
    assert project_of(inner / "m.toml") == inner
    (tmp_path / "a" / "scenarios").write_text("a file is no mark")
    assert project_of(inner / "m.toml") == inner
    for folder, mark in ((tmp_path, ".git"), (tmp_path / "a", "dataset.toml"), (tmp_path / "a" / "b", "case.toml")):
        (folder / mark).write_text("")
        assert project_of(inner / "m.toml") == folder
    (inner / "scenarios").mkdir()
    assert project_of(inner / "m.toml") == inner


def test_what_lidarcheck_keeps_belongs_to_the_folder_that_it_lies_in(tmp_path):
    kept = tmp_path / "bench/.lidarcheck/tui/runs/1/out"
    kept.mkdir(parents=True)
    assert project_of(kept / "model.toml") == tmp_path / "bench"
    assert project_of(tmp_path / "bench/model.toml") == tmp_path / "bench"
    (tmp_path / "scenarios").mkdir()
    assert project_of(kept / "model.toml") == tmp_path


def test_paths_within_are_as_they_were(tmp_path):
    (tmp_path / "case.toml").write_text("")
    (tmp_path / "real").mkdir()
    (tmp_path / "models").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    naming = tmp_path / "models" / "m.toml"
    assert named_file(naming, "../link/x.ini") == tmp_path / "models" / "../link/x.ini"
    assert named_file(naming, str(tmp_path / "real" / "x")) == tmp_path / "real" / "x"
    assert not is_permitted(Path("\0"), naming)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert named_file(naming, "../loop/x").name == "x"  # inside, and no file


def test_a_linked_project_is_as_good_as_its_folder(tmp_path):
    (tmp_path / "real" / "scenarios").mkdir(parents=True)
    (tmp_path / "real" / "t.ply").write_text(TRIANGLE_PLY)
    (tmp_path / "way").symlink_to(tmp_path / "real")
    assert named_file(tmp_path / "way" / "scenarios" / "s.toml", "../t.ply").is_file()
    assert own_place(tmp_path / "way" / ".lidarcheck" / "x", tmp_path / "way")


def test_the_terminal_looks_at_no_file_outside(root):
    (root / "models" / "m.toml").write_text(
        f'x = "../../secret.toml"\ny = "../case/m.toml"\nz = "{root.parent}/secret.ini"\n'
    )
    assert [path.name for path in files_named_by(root / "models" / "m.toml")] == ["m.toml"]


def test_a_root_on_the_command_line(root, monkeypatch, capsys):
    monkeypatch.chdir(root)
    (root / "models" / "m.toml").write_text(PANEL_MODEL + EFFECT.replace("{name}", "../../secret.ini"))
    assert main(["info", "models/m.toml"]) == 2
    said = capsys.readouterr().err
    assert f"--root {root.parent}" in said
    assert main(["info", "models/m.toml", "--root", str(root.parent)]) == 0
    assert main(["info", "models/m.toml"]) == 2
