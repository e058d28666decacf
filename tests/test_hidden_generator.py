"""The independent generator of hidden cases: it agrees with the references, hides what it says, and keeps it sealed."""

import ast
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import hidden
from hidden import forms
from hidden.cases import MATERIALS_BY_SCENE, Setting, comparable, setting
from hidden.chain import Effect, Nuisance, View, measure
from hidden.orders import GROUPS, NAMES, SCENES_FOR, CaseOrder, plan
from hidden.places import CAR, GLASS, TABLE, arrange
from hidden.rays import Beams, Hits
from hidden.sealing import NoAnswerError, Sealed
from hidden.sensor import ALL_SHOTS, BACKGROUND_PER_NS, THRESHOLD, Detectors, Echoes, Light, detect
from hidden.visibility import VISIBLE_Z, Seen, seen, stands_out
from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.model import load_model, simulate
from places import shared_path

PACKAGE = Path(hidden.__file__).parent
THINNED = Beams.block(range(210, 306, 2), range(430, 526, 2))
SEEDS = 4


def quiet_order(scene: str, variant: str, seed: int = 77) -> CaseOrder:
    return CaseOrder(0, "null", seed, (), "medium", variant, scene)


def plain(scene: str, variant: str, glass: bool = False) -> Setting:
    """A setting with nothing hidden and no nuisance."""
    table = {m: row for m, row in TABLE.items() if m != GLASS or glass}
    nothing = setting(quiet_order(scene, variant))
    return replace(nothing, known=(), nuisance=Nuisance(), glass=glass, table=table)


def test_shares_no_code_with_the_package():
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any("lidarcheck" in name for name in names), path


# --- effect-free frames ---------------------------------------------------------------------------------------------


def echoes_of_ideal(ideal, variant: str, seed: int) -> tuple[Beams, Hits, Echoes]:
    """The generator's detectors on an ideal scan that was read from a file."""
    n = len(ideal)
    beams = Beams(ideal.layer.astype(np.int64), ideal.point.astype(np.int64))
    met = ideal.distance_m > 0
    hits = Hits(ideal.distance_m, ideal.incidence_deg, ideal.material_id, np.zeros(n, np.int64), np.where(met, 0, -1))
    material, rows = ideal.material_id[met].astype(np.int64), np.flatnonzero(met)
    rho, gain = (np.array([TABLE[m][k] for m in material]) for k in (1, 2))
    lambert = np.where(gain > 0, gain, np.cos(np.deg2rad(ideal.incidence_deg[met])))
    range_m = ideal.distance_m[met]
    light = Light(
        rows, range_m, 6000.0 * rho * lambert / range_m**2, material, ideal.incidence_deg[met],
        np.ones(len(rows), bool), np.full(len(rows), ALL_SHOTS), np.full(n, BACKGROUND_PER_NS), ideal.distance_m,
    )  # fmt: skip
    echoes = detect(light, Detectors(np.full(n, float(THRESHOLD))), variant, seed)
    echoes.range_m = np.round(echoes.range_m, 2)
    return beams, hits, echoes


def echoes_of_scan(ideal, scan) -> Echoes:
    """A scan read or simulated by the package, as the generator's table."""
    beam_of = {key: i for i, key in enumerate(zip(ideal.layer.tolist(), ideal.point.tolist(), strict=True))}
    beam = np.array([beam_of[key] for key in zip(scan.layer.tolist(), scan.point.tolist(), strict=True)], np.int64)
    range_m = np.sqrt(scan.x_m**2 + scan.y_m**2 + scan.z_m**2)
    return Echoes(beam, range_m, scan.peak, scan.area, scan.width_ns).kept(np.arange(len(beam)))


@pytest.mark.parametrize("name", ["SMART_lab", "SMART_street", "SLIM_sign"])
def test_agrees_with_the_reference_frames(name):
    folder = "data/reference_frames"
    ideal = load_ideal(shared_path(f"{folder}/{name}_ideal.txt"))
    reference = echoes_of_scan(ideal, load_scan(shared_path(f"{folder}/{name}_echoes.txt")))
    beams, hits, _ = runs = echoes_of_ideal(ideal, name.split("_")[0], 0)
    own = [runs[2]] + [echoes_of_ideal(ideal, name.split("_")[0], s)[2] for s in range(1, SEEDS)]
    z, where = stands_out(seen([reference], beams, [hits]), seen(own, beams, [hits] * SEEDS))
    print(f"{name}: z {z:.2f}, {where}")
    assert z < VISIBLE_Z


@pytest.mark.parametrize(("scene", "variant"), [("lab", "SMART"), ("sign", "SLIM")])
def test_agrees_with_the_package(tmp_path, scene, variant):
    order = CaseOrder(0, "null", 4, (), "medium", variant, scene)
    hidden.write_case(order, tmp_path, frames=2)
    ideals = [load_ideal(tmp_path / f"frame_0{k}_ideal.txt") for k in (0, 1)]
    model = load_model(tmp_path / "model.toml")
    assert not model.effects
    measured = [echoes_of_scan(i, load_scan(tmp_path / f"frame_0{k}_measured.txt")) for k, i in enumerate(ideals)]
    simulated = [echoes_of_scan(i, simulate(i, model, seed=s)) for s in (1, 2) for i in ideals]
    s = setting(order)
    hits = [s.ideal(0), s.ideal(1)]
    z, where = stands_out(seen(measured, s.beams, hits), seen(simulated, s.beams, hits * 2))
    print(f"{scene} {variant}: z {z:.2f}, {where}")
    assert z < VISIBLE_Z


def test_noise_alone_stays_below_the_mark():
    s = plain("mixed", "SMART")
    hits = [s.ideal(i) for i in range(3)]
    runs = [seen([s.echoes(i, (), repeat) for i in range(3)], s.beams, hits) for repeat in range(3)]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert stands_out(runs[i], runs[j])[0] < VISIBLE_Z


# --- the effects ----------------------------------------------------------------------------------------------------


@cache
def thinned(scene: str, variant: str, glass: bool) -> tuple[Setting, list[Hits], Seen]:
    """Frames of every other layer and point with nothing hidden."""
    s = plain(scene, variant, glass)
    hits = [thin_hits(s.ideal(i)) for i in range(3)]
    frames = [thin_echoes(s, i, (), 1) for i in range(3)]
    return s, hits, seen(frames, THINNED, hits)


def thin_hits(hits: Hits) -> Hits:
    def every_other(column):
        return column.reshape(96, 96)[::2, ::2].ravel()

    return Hits(
        *(every_other(getattr(hits, n)) for n in ("range_m", "incidence_deg", "material", "object_id", "rectangle"))
    )


def thin_echoes(s: Setting, index: int, effects: tuple[Effect, ...], seed: int) -> Echoes:
    return measure(s.scene(index), THINNED, s.order.variant, s.table, effects, s.nuisance, seed, index)


def draw_for(scene: str, strength: str = "strong", seed: int = 5) -> forms.Draw:
    return forms.Draw(np.random.default_rng(seed), strength, "SMART", MATERIALS_BY_SCENE[scene])


def assert_shows(effect: Effect, scene: str) -> None:
    s, hits, without = thinned(scene, "SMART", effect.name == "mirror_multipath")
    frames = [thin_echoes(s, i, (effect,), 2) for i in range(3)]
    for echoes in frames:
        assert np.all(np.isfinite(echoes.range_m))
        assert np.all(echoes.range_m > 0)
        assert np.all(np.diff(echoes.beam) >= 0)
    z, where = stands_out(seen(frames, THINNED, hits), without)
    print(f"{effect.name} {effect.form}: z {z:.1f}, {where}")
    assert z > VISIBLE_Z


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_every_form_of_every_effect_shows(name):
    scene = SCENES_FOR.get(name, ("mixed",))[0]
    assert len(forms.FORMS[name]) >= 2
    for kind in sorted(forms.FORMS[name]):
        assert_shows(forms.draw_effect(name, draw_for(scene), kind), scene)


@pytest.mark.parametrize("name", sorted(forms.ALIENS))
def test_every_alien_shows(name):
    assert name not in NAMES
    assert_shows(forms.draw_alien(name, draw_for("mixed")), "mixed")


def test_a_number_is_one_car_with_one_speed_in_every_frame():
    traffic = forms.draw_effect("motion", draw_for("mixed"), "traffic")
    speeds: dict[int, set[float]] = {}
    for kind in ("street", "sign"):
        for seed in range(12):
            scene = arrange(kind, [seed], glass=False)
            cars = {r.object_id for r in scene.rectangles if r.material == CAR}
            assert cars.isdisjoint(r.object_id for r in scene.rectangles if r.material != CAR)
            view = View(np.zeros(1), np.zeros(1), np.zeros(3))
            traffic.aim(view, SimpleNamespace(scene=scene))
            assert set(view.velocity) == cars
            for car in cars:
                speeds.setdefault(car, set()).add(float(view.velocity[car][0]))
    assert [len(of_one) for of_one in speeds.values()] == [1, 1]


def test_the_catalogue_is_whole():
    assert sorted(forms.FORMS) == sorted(NAMES)
    assert len(NAMES) == 28
    assert sorted(n for names in GROUPS.values() for n in names) == sorted(NAMES)


# --- the plan -------------------------------------------------------------------------------------------------------


def test_plan_is_balanced_and_deterministic():
    orders = plan(200, 3)
    assert orders == plan(200, 3)
    assert orders[:60] == plan(60, 3)
    assert orders != plan(200, 4)
    kinds = [o.kind for o in orders]
    for kind, share in {"single": 80, "pair": 30, "null": 24, "null_nuisance": 26, "left_out": 20, "alien": 20}.items():
        assert abs(kinds.count(kind) - share) <= 1
    singles = [o for o in orders if o.kind == "single"]
    assert {o.effects[0] for o in singles} == set(NAMES)
    assert {o.strength for o in singles} == {"weak", "medium", "strong"}
    for o in orders:
        assert o.exclude == (o.effects if o.kind == "left_out" else ())
        groups = {g for g, names in GROUPS.items() if set(names) & set(o.effects)}
        assert len(groups) == (2 if o.kind == "pair" else len(groups))
    assert {o.kind for o in plan(20, 1, only="alien")} == {"alien"}


def test_three_and_four_effects_are_of_as_many_groups_and_asked_for_by_name():
    orders = plan(56, 1, only="several")
    assert [len(o.effects) for o in orders] == [3, 4] * 28
    for o in orders:
        assert len({g for g, names in GROUPS.items() if set(names) & set(o.effects)}) == len(o.effects)
        assert o.kind == "several"
        assert o.strength in ("medium", "strong")
    assert {name for o in orders for name in o.effects} == set(NAMES)


# --- cases and their seal -------------------------------------------------------------------------------------------

PAIR = CaseOrder(3, "pair", 12345, ("range_offset", "dropout"), "medium", "SMART", "sign")


@pytest.fixture(scope="module")
def pair_case(tmp_path_factory) -> tuple[Path, Sealed]:
    directory = tmp_path_factory.mktemp("pair")
    return directory, hidden.write_case(PAIR, directory, frames=2)


def test_same_order_same_bytes(pair_case, tmp_path):
    directory, sealed = pair_case
    again = hidden.write_case(PAIR, tmp_path, frames=2)
    assert again.digest == sealed.digest
    names = sorted(p.name for p in directory.iterdir())
    assert names == sorted(p.name for p in tmp_path.iterdir())
    for name in names:
        assert (directory / name).read_bytes() == (tmp_path / name).read_bytes()


def test_directory_tells_nothing(pair_case):
    directory, sealed = pair_case
    names = {p.name for p in directory.iterdir()}
    frames = {f"frame_0{k}_{what}.txt" for k in (0, 1) for what in ("ideal", "measured")}
    assert names == frames | {"case.toml", "model.toml", "sealed.txt"}
    text = "".join((directory / n).read_text() for n in names - frames)
    assert not any(name in text for name in NAMES)
    assert (directory / "sealed.txt").read_text().strip() == sealed.digest
    assert sealed.salt not in text
    assert "_truth" not in repr(sealed)


def test_seal_opens_for_the_first_answer_only(pair_case):
    sealed = replace(pair_case[1])
    for nothing in ({}, {"verdict": "perhaps"}, None):
        with pytest.raises(NoAnswerError):
            sealed.open(nothing)
    truth = sealed.open({"verdict": "no_gap"})
    assert sealed.holds()
    assert truth.effects == PAIR.effects
    assert set(truth.observable) == set(truth.z) == set(PAIR.effects)
    assert set(truth.comparable) >= {"range_offset.offset_m", "dropout.share"}
    assert json.loads(truth.text())["kind"] == "pair"
    assert sealed.open({"verdict": "no_gap"}) == truth
    with pytest.raises(NoAnswerError):
        sealed.open({"verdict": "explained"})


def test_case_is_read_by_the_package(pair_case):
    directory, _ = pair_case
    model = load_model(directory / "model.toml")
    assert str(model.sensor.variant).endswith("SMART")
    for k in (0, 1):
        ideal = load_ideal(directory / f"frame_0{k}_ideal.txt")
        scan = load_scan(directory / f"frame_0{k}_measured.txt")
        assert len(ideal) == 9216
        assert set(np.unique(ideal.material_id[ideal.distance_m > 0])) <= set(model.materials)
        assert set(zip(scan.layer, scan.point, strict=True)) <= set(zip(ideal.layer, ideal.point, strict=True))
        assert scan.echo_number.min() == 1


def test_fresh_frames_share_the_truth_and_nothing_else(pair_case, tmp_path):
    directory, _ = pair_case
    paths = hidden.fresh_frames(PAIR, tmp_path, 1, frames=2)
    assert len(paths) == 1
    ideal, measured = paths[0]
    assert (tmp_path / "model.toml").read_bytes() == (directory / "model.toml").read_bytes()
    assert ideal.read_bytes() != (directory / "frame_00_ideal.txt").read_bytes()
    assert len(load_scan(measured)) > 1000


def test_comparable_values_take_the_nuisance_in():
    with_nuisance = replace(
        setting(CaseOrder(0, "single", 8, ("boresight",), "weak", "SMART", "lab")), nuisance=Nuisance(yaw_deg=0.01)
    )
    hidden_yaw = with_nuisance.hidden[0].parameters["yaw_deg"]
    assert comparable(with_nuisance)["boresight.yaw_deg"] == pytest.approx(hidden_yaw + 0.01)


@pytest.mark.parametrize("frames", [1, 11])
def test_too_few_or_too_many_frames_are_refused(tmp_path, frames):
    with pytest.raises(ValueError, match="2 to 10 frames"):
        hidden.write_case(PAIR, tmp_path, frames=frames)
