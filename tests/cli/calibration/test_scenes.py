"""`scenes compare` and `vehicles` as a user calls them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_scan, save_ideal, save_scan
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.model import save_model, simulate
from lidarcheck.scenes.files.file import builtin_path, load_scene
from merging import merge
from scene_kit import hits_of, ideal_of, measured, model_of, scene_of

MODEL = 'variant = "SMART"\n' + "".join(
    f'[materials.{n}]\nname = "m{n}"\nreflectance = 0.4\n' for n in (5, 8, *range(9, 25))
)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A street of the generator and a built-in scene with vehicles, as files."""
    where = tmp_path_factory.mktemp("scenes")
    scene = scene_of("street", 51)
    ideal = ideal_of(hits_of(scene))
    scan = measured(scene, 3)
    save_ideal(ideal, where / "ideal.parquet")
    save_scan(scan, where / "real.pcd")
    save_scan(scan.take(scan.layer != 240), where / "dead.pcd")
    model = model_of()
    save_model(model, where / "model.toml")
    shown = simulate(ideal, model, seed=4)
    save_scan(shown, where / "sim.pcd")
    save_scan(
        replace(shown, **{axis: 2.0 * getattr(shown, axis) for axis in ("x_m", "y_m", "z_m")}), where / "elsewhere.pcd"
    )
    (where / "street.toml").write_text(MODEL)
    everything = load_scene(builtin_path("vehicles_25m")).ideal(second_hits=False)
    near = (everything.layer > 150) & (everything.layer < 300) & (abs(everything.point - 480) < 90)
    save_ideal(everything.take(near), where / "car_ideal.parquet")
    from lidarcheck.model import load_model

    plain = load_model(where / "street.toml")
    for name, seed in (("car_25m.pcd", 1), ("sim_25m.pcd", 2)):
        save_scan(simulate(everything.take(near), plain, seed=seed), where / name)
    return where


@pytest.fixture
def here(files, tmp_path, monkeypatch):
    """An empty directory to work in, the files beside it."""
    for file in files.iterdir():
        (tmp_path / file.name).symlink_to(file)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def scenes(*more):
    return main(["scenes", "compare", *more])


def vehicles(verb, *more):
    return main(["vehicles", verb, *more])


# --- scenes compare -------------------------------------------------------------------------------------------------


def test_a_dead_layer_is_printed_first_and_written(here, capsys):
    arguments = ("dead.pcd", "--ideal", "ideal.parquet", "--model", "model.toml", "--out", "found", "--seed", "3")
    assert scenes(*arguments) == 0
    out, err = capsys.readouterr()
    assert out.startswith("Measured and simulated frame disagree in one place; most: 100 % fewer echoes in layer 240")
    assert "report.html, result.json" in err
    result = json.loads(Path("found/result.json").read_text())
    assert result["result"]["disagreements"][0]["name"] == "layer 240"
    assert "worst_points" not in result["result"]
    assert "model.toml, effects: none, seed 3" in result["provenance"]["model"]
    assert (here / "found/report.html").stat().st_size > 1000
    assert len(list((here / "found/pictures").glob("*.png"))) >= 5


def test_the_same_seed_gives_the_same_result(here, capsys):
    texts = []
    for _ in range(2):
        arguments = ("real.pcd", "--ideal", "ideal.parquet", "--model", "model.toml", "--json", "-", "--sectors", "4x2")
        assert scenes(*arguments) == 0
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1]
    assert np.shape(json.loads(texts[0])["result"]["sectors"]["beams"]) == (2, 4)


def test_simulated_frames_stand_in_for_a_model(here, capsys):
    assert scenes("dead.pcd", "--ideal", "ideal.parquet", "--simulated", "sim.pcd", "--quiet") == 0
    out, err = capsys.readouterr()
    assert "layer 240" in out
    assert "no second simulation" in out
    assert err == ""


def test_an_effect_that_the_model_lacks_is_added_and_said(here, capsys):
    arguments = ("real.pcd", "--ideal", "ideal.parquet", "--model", "model.toml", "--effects", "range_offset")
    assert scenes(*arguments) == 0
    out, err = capsys.readouterr()
    assert "range_offset is not in model.toml: added with offset_m = " in err
    assert "disagree in" in out


WRONG = {
    "--ideal ideal.parquet --model model.toml": "no measured frame is named",
    "real.pcd --ideal ideal.parquet": "neither --model nor --simulated is given",
    "real.pcd --ideal ideal.parquet --model model.toml --simulated sim.pcd": "--model stands beside --simulated",
    "real.pcd dead.pcd --ideal ideal.parquet --model model.toml": "2 measured frames and 1 ideal scans",
    "real.pcd --ideal ideal.parquet --simulated sim.pcd dead.pcd": "1 measured frames and 2 simulated",
    "real.pcd --ideal ideal.parquet --simulated sim.pcd --effects fog": "choose what a model does",
    "real.pcd --ideal ideal.parquet --model model.toml --effects fog --without rain": "--effects stands beside",
    "real.pcd --ideal ideal.parquet --simulated real.pcd": "real.pcd is named twice",
    "real.pcd --ideal ideal.parquet --simulated elsewhere.pcd": "elsewhere.pcd: only 0 % of the simulated echoes lie",
    "real.pcd --ideal ideal.parquet --model model.toml --effects fgo": "did you mean fog?",
    "real.pcd --ideal ideal.parquet --model model.toml --without fog": "has no effect 'fog' to leave out; it has none",
    "real.pcd --ideal ideal.parquet --model model.toml --sectors 12": "--sectors 12 is no grid",
    "real.pcd --ideal ideal.parquet --model model.toml --sectors 0x4": "--sectors 0x4 is no grid",
    "real.pcd --ideal ideal.parquet --model model.toml --radius -1": "--radius -1 is out of range",
    "real.pcd --ideal ideal.parquet --model model.toml --by car": "there are no parts by 'car'",
    "real.pcd --ideal ideal.parquet --model model.toml --out real.pcd": "is not a directory",
    "real.pcd --ideal ideal.parquet --model model.toml --json real.pcd": "would replace another file",
    "real.pcd --ideal ideal.parquet --model street.toml": "material",
    "real.pcd --ideal car_ideal.parquet --model street.toml": "this is not the same scene: only 0 % of the beams",
    "real.pcd --ideal sim.pcd --model model.toml": "echoes, not an ideal scan",
    "ideal.parquet --ideal car_ideal.parquet --model model.toml": "this is an ideal scan, not echoes",
    "real.pcd --ideal ideal.parquet --model model.toml --scene city_stret": "city_street",
    "real.pcd --ideal ideal.parquet --model model.toml --scene city_street": "not cast from the scene city_street: ",
    "real.pcd --ideal ideal.parquet --model model.toml --sectors 1.5x4": "--sectors 1.5x4 is no grid",
}


@pytest.mark.parametrize(("arguments", "says"), WRONG.items())
def test_scenes_compare_says_what_is_wrong(here, arguments, says, capsys):
    before = sorted(here.rglob("*"))
    assert scenes(*arguments.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert says in err
    assert len(err.splitlines()) == 1
    assert sorted(here.rglob("*")) == before


def test_another_variant_is_refused(here, capsys):
    Path("slim.toml").write_text(Path("model.toml").read_text().replace("SMART", "SLIM"))
    scan = load_scan("real.pcd")
    from dataclasses import replace

    save_scan(replace(scan, peak=np.where(scan.peak > 60, 135.0, scan.peak)), "saturated.pcd")
    assert scenes("saturated.pcd", "--ideal", "ideal.parquet", "--model", "slim.toml") == 2
    assert "that is how SMART saturates, not SLIM at 236" in capsys.readouterr().err
    save_scan(replace(scan, peak=scan.peak * 1.7), "slim.pcd")
    assert scenes("slim.pcd", "--ideal", "ideal.parquet", "--model", "model.toml") == 2
    assert "name the model of the variant that measured, SLIM?" in capsys.readouterr().err
    assert scenes("slim.pcd", "--ideal", "ideal.parquet", "--simulated", "saturated.pcd") == 2
    assert "slim.pcd: saturates as SLIM does" in capsys.readouterr().err


def test_frames_of_a_merged_file_are_compared_as_those_of_files(here, capsys):
    merge(["real.pcd", "dead.pcd"], "drive.pcd", number="Frame")
    merge(["sim.pcd", "sim.pcd"], "shown.parquet", number="FrameNumber")
    assert scenes("drive.pcd", "--ideal", "ideal.parquet", "--simulated", "shown.parquet", "--json", "-", "-q") == 0
    merged = json.loads(capsys.readouterr().out)["result"]
    Path("ideal_2.parquet").write_bytes(Path("ideal.parquet").read_bytes())
    Path("sim_2.pcd").write_bytes(Path("sim.pcd").read_bytes())
    ideals, shown = ("ideal.parquet", "ideal_2.parquet"), ("sim.pcd", "sim_2.pcd")
    assert scenes("real.pcd", "dead.pcd", "--ideal", *ideals, "--simulated", *shown, "--json", "-", "-q") == 0
    apart = json.loads(capsys.readouterr().out)["result"]
    assert {k: v for k, v in merged.items() if k != "frames"} == {k: v for k, v in apart.items() if k != "frames"}


def test_vehicles_of_a_merged_file_are_compared_frame_by_frame(here, capsys):
    merge(["car_25m.pcd", "sim_25m.pcd"], "drive.pcd", number="Frame")
    merge(["sim_25m.pcd", "car_25m.pcd"], "shown.pcd", number="Frame")
    common = ("--vehicle", "car", "--json", "-", "-q")
    assert vehicles("compare", "drive.pcd@25", "--simulated", "shown.pcd", *common) == 0
    merged = json.loads(capsys.readouterr().out)["result"]
    assert len(merged["distances"]) == 2
    assert vehicles("compare", "car_25m.pcd@25", "--simulated", "sim_25m.pcd", *common) == 0
    alone = json.loads(capsys.readouterr().out)["result"]
    assert merged["distances"][0]["features"] == alone["distances"][0]["features"]


# --- vehicles -------------------------------------------------------------------------------------------------------


def test_vehicles_are_compared_and_drawn(here, capsys):
    assert vehicles("compare", "car_25m.pcd", "--vehicle", "car", "--simulated", "sim_25m.pcd", "--out", "car") == 0
    out, _ = capsys.readouterr()
    assert out.startswith("car at 25 m: the largest difference is of ")
    assert {"distances.png", "report.html", "result.json", "pictures"} == {p.name for p in (here / "car").iterdir()}
    assert (here / "car/distances.png").read_bytes().startswith(b"\x89PNG")
    at = json.loads(Path("car/result.json").read_text())["result"]["distances"][0]
    assert at["features"]["AREA"]["ks"] < 2.0 * at["ks_chance"]["AREA"]
    assert "cluster" in at["real"]["how"]


def test_a_model_simulates_on_the_spot_and_the_object_is_found(here, capsys):
    arguments = ("car_25m.pcd", "--vehicle", "truck", "--model", "street.toml", "--ideal", "car_ideal.parquet")
    assert vehicles("compare", *arguments, "--json", "-", "--variant", "SMART") == 0
    at = json.loads(capsys.readouterr().out)["result"]["distances"][0]
    assert at["real"]["how"] == "object 2 of the ideal scan"
    assert at["detection_real"] == pytest.approx(at["detection_simulated"], abs=0.02)


def test_merged_vehicles_stand_beside_each_other(here, capsys):
    arguments = ("car_25m.pcd", "sim_25m.pcd", "--out", "both.pcd", "--vehicle", "car", "--plot", "top", "--y", "-4")
    assert vehicles("merge", *arguments) == 0
    out, err = capsys.readouterr()
    assert "4 m to the right" in out
    assert "from above" in out
    assert "Simulated is 0 for the real ones" in err
    both = scan_from_table(read_table("both.pcd"))  # two frames on purpose
    real = both.extra["Simulated"] == 0
    assert both.y_m[~real].mean() - both.y_m[real].mean() == pytest.approx(-4.0, abs=1e-4)
    assert both.y_m[~real].max() < both.y_m[real].min()


def test_a_negative_box_is_a_value(here, capsys):
    arguments = ("car_25m.pcd", "sim_25m.pcd", "--out", "both.csv", "--box", "-1,30,-1.2,1.2,-1.7,0")
    assert vehicles("merge", *arguments, "--json", "merge.json") == 0
    assert json.loads(Path("merge.json").read_text())["result"]["how_real"] == "by the box"


BAD = {
    "compare --vehicle car --simulated sim_25m.pcd": "no real frame is named",
    "compare car_25m.pcd --vehicle car": "neither --simulated nor --model is given",
    "compare car_25m.pcd --vehicle car --simulated sim_25m.pcd --model street.toml": "--model stands beside",
    "compare car_25m.pcd --vehicle car --model street.toml": "--model needs --ideal",
    "compare car_25m.pcd real.pcd --vehicle car --simulated sim_25m.pcd": "2 real frames and 1 simulated",
    "compare car_25m.pcd --vehicle cart --simulated sim_25m.pcd": "did you mean car?",
    "compare car_25m.pcd@9 --vehicle car --simulated sim_25m.pcd": "pair 1 is car_25m.pcd at 9 m",
    "compare car_25m.pcd@far --vehicle car --simulated sim_25m.pcd": "car_25m.pcd@far names no distance",
    "compare car_25m.pcd@900 --vehicle car --simulated sim_25m.pcd": "900 m is out of range",
    "compare car_25m.pcd@60 --vehicle car --simulated sim_25m.pcd@60": "the name says 60 m",
    "compare car_25m.pcd --vehicle car --simulated car_25m.pcd": "is named twice",
    "compare car_25m.pcd --vehicle car --simulated sim_25m.pcd --variant SLAM": "no sensor variant 'SLAM'",
    "compare car_25m.pcd --vehicle car --simulated sim_25m.pcd --object 1": "--object needs --ideal",
    "compare car_25m.pcd --vehicle car --simulated sim_25m.pcd --box 1,2,3": "--box 1,2,3 is no box",
    "compare car_25m.pcd --vehicle car --simulated sim_25m.pcd --box 2,1,0,1,0,1": "is no box",
    "compare car_25m.pcd --vehicle car --simulated sim_25m.pcd --box 0,1,0,1,0,1": "the box holds 0 of",
    "merge car_25m.pcd sim_25m.pcd --out both.pcd": "more than a vehicle",
    "merge car_25m.pcd sim_25m.pcd --out car_25m.pcd --vehicle car": "would replace another file",
    "merge car_25m.pcd sim_25m.pcd --out both.doc --vehicle car": "cannot write '.doc' files",
    "compare car_25m.pcd --vehicle car --model street.toml --ideal car_ideal.parquet --object 1.5": "no whole number",
    "merge car_25m.pcd car_25m.pcd --out both.pcd --vehicle car": "is named twice",
    "merge car_25m.pcd sim_25m.pcd --out both.pcd --vehicle car --x 1e9": "--x 1e+09 is out of range",
    "merge car_25m.pcd sim_25m.pcd --out both.pcd --ideal car_ideal.parquet": "--ideal needs --object or --vehicle",
}


@pytest.mark.parametrize(("arguments", "says"), BAD.items())
def test_vehicles_say_what_is_wrong(here, arguments, says, capsys):
    before = sorted(here.rglob("*"))
    assert main(["vehicles", *arguments.split()]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert err.splitlines()[-1].startswith("error: ")
    assert sorted(here.rglob("*")) == before
