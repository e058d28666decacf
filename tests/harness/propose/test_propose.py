"""A scenario that would have caught a missing effect: what it asks for, and that it really catches."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.effects import Effect, catalogue, empirical_terms, find, make
from lidarcheck.effects.search import search_specs
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats import save_ideal
from lidarcheck.harness.check import check
from lidarcheck.harness.goldens.file import load_proposal
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.propose.candidates import OTHERS, watches
from lidarcheck.harness.propose.propose import propose_scenario
from lidarcheck.harness.review.accept import accept
from lidarcheck.harness.review.review import review
from lidarcheck.harness.scenario.scenario import load_scenario
from lidarcheck.model import Model, load_model, save_model
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import Material, Sensor
from reference_grid import beam_directions

MATERIALS = {1: Material("wall", 0.4), 2: Material("sign", 0.8, "retro", 900.0), 3: Material("road", 0.6)}


def street() -> IdealScan:
    """A slanted wall above a road, a traffic sign before it, and sky; 2 304 beams."""
    layer, point = (grid.ravel() for grid in np.meshgrid(np.arange(224, 272), np.arange(456, 504), indexing="ij"))
    direction = beam_directions(layer, point)
    normal = np.array([-np.cos(0.6), -np.sin(0.6), 0.0])
    wall_m = 30.0 * np.cos(0.6) / -(direction @ normal)
    road_m = np.where(direction[:, 2] < 0.0, 0.4 / -direction[:, 2].clip(max=-1e-9), np.inf)
    sign = (abs(layer - 255) < 4) & (abs(point - 480) < 4)
    distance = np.where(sign, 22.0, np.minimum(road_m, wall_m))
    cosine = np.where(sign, 1.0, np.where(road_m < wall_m, -direction[:, 2], -(direction @ normal)))
    material = np.where(sign, 2, np.where(road_m < wall_m, 3, 1))
    distance[layer >= 266] = 0.0
    return IdealScan(layer, point, distance, material, np.rad2deg(np.arccos(cosine.clip(0.0, 1.0))))


def model(*chosen: Effect) -> Model:
    found = Model(Sensor.of("SMART"), MATERIALS)
    for effect in chosen:
        found = found.with_(effect)
    return found


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "project" / "scenarios").mkdir(parents=True)
    save_ideal(street(), tmp_path / "frame.txt")
    return tmp_path / "project"


def everything(tree: Path) -> set[str]:
    return {path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file()}


def test_every_effect_and_term_has_kpis_that_know_it() -> None:
    watchers = {name: spec.watched_by for name, spec in search_specs().items()}
    assert set(watchers) == {*catalogue(), *empirical_terms()}
    assert all(watchers.values())
    assert {kind for kinds in watchers.values() for kind in kinds} | set(OTHERS) <= set(KINDS)
    for name in watchers:
        found = watches(street(), model(), make(name, find(name).example()))
        assert 10 < len(found) < 120
        names = [asked.spec.name for _, asked in found]
        assert len(set(names)) == len(names)


def test_the_proposed_scenario_holds_and_fails_when_an_effect_is_lost(tree: Path) -> None:
    whole = model(make("fog", {"mor_m": 60.0}), make("range_offset", {"offset_m": 0.1}))
    made = propose_scenario([tree.parent / "frame.txt"], whole, ["fog", "range_offset"], "seen", tree=tree, jobs=2)
    assert made.scenario == tree / "scenarios" / "seen.toml"
    assert everything(tree) == {
        "scenarios/seen.toml",
        "scenarios/models/seen.toml",
        "scenarios/ideals/seen.txt",
        ".lidarcheck/proposals/seen.toml",
        ".lidarcheck/.gitignore",
    }
    assert {path.relative_to(tree).as_posix() for path in made.files} < everything(tree)
    assert made.uncaught == ()
    for effect in ("fog", "range_offset"):
        assert made.catches[effect]
        assert all(catch.margin > 1.0 for catch in made.catches[effect])
    assert "range_residual" in made.catches["range_offset"][0].kpi
    assert abs(made.catches["range_offset"][0].present - made.catches["range_offset"][0].lost) == pytest.approx(
        0.1, abs=0.03
    )
    caught = {catch.kpi for found in made.catches.values() for catch in found}
    assert {spec.name for spec in load_scenario(made.scenario).kpis} == caught
    assert dataclasses.replace(load_scenario(made.scenario).model, file=None) == whole
    assert load_proposal(made.proposal).complete

    found = review([made.scenario], jobs=2)
    assert not [text for one in found.scenarios for kpi in one.kpis for text in kpi.refused]
    accept(found, ["all"], reason="first golden")
    assert check([made.scenario], jobs=2).exit_code == 0
    assert not made.proposal.exists()
    for effect in ("fog", "range_offset"):
        save_model(whole.without(effect), tree / "lost.toml")
        assert check([made.scenario], model=tree / "lost.toml", jobs=2).exit_code == 1, effect


def test_an_effect_that_is_only_weaker_than_it_should_be_is_a_loss_too(tree: Path) -> None:
    now, then = (model(make("signal_gain", {"gain": gain})) for gain in (0.8, 0.9))
    made = propose_scenario(
        [tree.parent / "frame.txt"], now, ["signal_gain"], "gain", tree=tree, lost={"signal_gain": then}, jobs=2
    )
    best = made.catches["signal_gain"][0]
    assert best.present < best.lost
    without = propose_scenario([tree.parent / "frame.txt"], now, ["signal_gain"], "gain2", tree=tree, jobs=2)
    same = {catch.kpi: catch for catch in without.catches["signal_gain"]}
    assert any(
        abs(same[c.kpi].lost - c.present) > abs(c.lost - c.present)
        for c in made.catches["signal_gain"]
        if c.kpi in same
    )


def test_the_frame_that_shows_the_effect_is_taken(tree: Path) -> None:
    blind = dataclasses.replace(street(), material_id=np.ones(2304))
    save_ideal(blind, tree.parent / "blind.txt")
    whole = model(make("material_reflectance", {"material_id": 3, "factor": 2.0}))
    frames = [tree.parent / "blind.txt", tree.parent / "frame.txt"]
    made = propose_scenario(frames, whole, ["material_reflectance"], "frames", tree=tree, jobs=2)
    assert (tree / "scenarios/ideals/frames.txt").read_bytes() == (tree.parent / "frame.txt").read_bytes()
    assert any("material_3" in catch.kpi for catch in made.catches["material_reflectance"])


def test_an_effect_that_the_beams_cannot_show_is_said_and_not_pretended(tree: Path) -> None:
    whole = model(make("range_offset", {"offset_m": 0.1}), make("material_reflectance", {"material_id": 9}))
    names = ["range_offset", "material_reflectance"]
    made = propose_scenario([tree.parent / "frame.txt"], whole, names, "some", tree=tree, jobs=2)
    assert made.uncaught == ("material_reflectance",)
    assert any("material_reflectance: no KPI catches" in line for line in made.lines())
    before = everything(tree)
    with pytest.raises(UsageError, match="no KPI catches the loss of material_reflectance on these beams"):
        propose_scenario([tree.parent / "frame.txt"], whole, names[1:], "none", tree=tree, jobs=2)
    assert everything(tree) == before


def test_tables_that_an_effect_names_travel_with_the_scenario(tree: Path) -> None:
    lut = tree.parent / "lut.ini"
    lut.write_text("PostPro.LUT_blooming_X = -60, 0, 60\nPostPro.LUT_blooming_Y = 0.0001, 0.01, 0.0001\n")
    path = tree.parent / "model.toml"
    save_model(model(), path)
    path.write_text(path.read_text() + '[[effects]]\nname = "blooming_vertical"\nlut = "lut.ini"\n')
    made = propose_scenario(
        [tree.parent / "frame.txt"], load_model(path), ["blooming_vertical"], "lut", tree=tree, jobs=2
    )
    assert (tree / "scenarios/models/lut_blooming_vertical_lut.ini").read_bytes() == lut.read_bytes()
    lut.unlink()
    (effect,) = load_scenario(made.scenario).model.effects
    assert effect.lut.y == (0.0001, 0.01, 0.0001)  # type: ignore[attr-defined]


def test_nothing_is_overwritten_and_nothing_is_left_of_what_failed(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frame, whole = tree.parent / "frame.txt", model(make("range_offset", {"offset_m": 0.1}))
    names = ["range_offset"]
    for there in ("scenarios/a.toml", "goldens/b.toml", "scenarios/models/c.toml", "scenarios/ideals/d.txt"):
        (tree / there).parent.mkdir(exist_ok=True)
        (tree / there).write_text("mine")
        with pytest.raises(UsageError, match="is there already; give the scenario another name"):
            propose_scenario([frame], whole, names, Path(there).stem, tree=tree)
        assert (tree / there).read_text() == "mine"
    before = everything(tree)
    for wrong, says in (
        ({"effects": ["fog"]}, "the model has no effect 'fog'; it has range_offset"),
        ({"effects": []}, "no effect is named"),
        ({"scenario": ".hidden"}, "is no name for a scenario"),
        ({"ideals": []}, "no ideal scan is given"),
    ):
        given = {"ideals": [frame], "model": whole, "effects": names, "scenario": "new", "tree": tree} | wrong
        with pytest.raises(UsageError, match=says):
            propose_scenario(**given)  # type: ignore[arg-type]
    with pytest.raises(InputError):
        propose_scenario([tree / "nowhere.txt"], whole, names, "new", tree=tree)
    monkeypatch.setattr("lidarcheck.harness.propose.propose.review", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        propose_scenario([frame], whole, names, "new", tree=tree, jobs=2)
    assert everything(tree) == before


def test_a_name_goes_to_the_project_and_a_path_to_where_it_says(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frame, whole = tree.parent / "frame.txt", model(make("range_offset", {"offset_m": 0.1}))
    (tree / "deep").mkdir()
    monkeypatch.chdir(tree / "deep")
    assert propose_scenario([frame], whole, ["range_offset"], "near", jobs=2).scenario == tree / "scenarios/near.toml"
    other = tree.parent / "other" / "scenarios" / "far.toml"
    made = propose_scenario([frame], whole, ["range_offset"], other, jobs=2)
    assert (made.scenario, made.proposal) == (other, tree.parent / "other/.lidarcheck/proposals/far.toml")
