"""Histograms, driven by keys on a small bench: what is found, compared, left out, put side by side and written."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bench_kit import make_bench
from lidarcheck.calibration.number.number import Number
from lidarcheck.cli import main
from lidarcheck.session.project import Entry, Project, read_project
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.engine import Known
from lidarcheck.tui.jobs.vehicles import FILES, groups_of, job_of, options_of, source_of
from lidarcheck.tui.screens.histograms import Histograms
from lidarcheck.tui.screens.vehicle_numbers import number_lines
from tui_kit import apart_from_key, as_stored, done, drive, misses, says, sees, text_of, until


@pytest.fixture
def bench(tmp_path):
    return make_bench(tmp_path / "bench")


@pytest.fixture
def inside(bench, monkeypatch):
    """The bench as the directory that one is in: files are named as on the command line."""
    (bench / "car_50m_SMART_real.txt").unlink()
    monkeypatch.chdir(bench)
    return Path()


def histograms(project, do, size=(80, 24)):
    async def on_it(app, pilot):
        await until(pilot, lambda: isinstance(app.view, Histograms) and app.view.listed)
        await do(app, pilot, app.view)

    drive(LidarcheckApp(project, screen="histograms"), on_it, size)


async def computed(pilot, view):
    await pilot.press("r")
    await until(pilot, lambda: view.running is None and view.page is not None, lambda: view.state)


async def on_vehicle(pilot, view, name):
    """Move the cursor to a vehicle."""
    names = [job.name for job in view.listed]
    await pilot.press("home", *["down"] * names.index(name))
    await until(pilot, lambda: view.job.name == name)


def project_of(*names):
    entries = [Entry(Path("p") / name, "ideal" if "ideal" in name else "scan", name) for name in sorted(names)]
    return Project(Path("p"), (*entries, Entry(Path("p/m_SLIM.toml"), "model", "m_SLIM.toml")))


def found(*names):
    """What belongs to each measurement, by its name."""
    return {
        m.name: (group.name, m.distance_m, m.simulated and m.simulated.name, m.ideal and m.ideal.name)
        for group in groups_of(project_of(*names))
        for m in group.measurements
    }


@pytest.mark.parametrize(
    ("real", "simulated", "ideal", "of"),
    [
        ("car_20m_real.txt", "car_20m_sim.txt", "car_20m_ideal.txt", ("car", 20.0)),
        ("real_car_20m_SLIM.pcd", "sim_car_20m.pcd", "ideal_20m.parquet", ("car SLIM", 20.0)),
        ("truck_7.5m.pcd", "simulated_7.5m.pcd", "ideal_truck_7.5m.pcd", ("truck", 7.5)),
        ("SMART/van/real_9m.las", "SMART/van/sim_9m.las", "van-9m-ideal.txt", ("van SMART", 9.0)),
        ("car.txt", "car_sim.txt", "car_ideal.txt", ("car", None)),
    ],
)
def test_files_belong_together_by_their_names(real, simulated, ideal, of):
    belongs = found(real, simulated, ideal, "postcard_20m.txt", "street.txt", "car_20m_merged.pcd")
    assert belongs == {real: (*of, Path(simulated).name, Path(ideal).name)}


def test_files_of_another_variant_or_distance_do_not_belong():
    belongs = found(
        "a/car_20m_SLIM_real.txt", "a/car_20m_SMART_sim.txt", "a/car_25m_SLIM_sim.txt", "b/van_20m_ideal.txt"
    )
    assert belongs == {"a/car_20m_SLIM_real.txt": ("car SLIM", 20.0, None, None)}
    (group,) = groups_of(project_of("car_20m_real.txt"))
    assert options_of(group, []) == []
    assert "named like car_20m_real.txt" in job_of(group, "", []).fault


def test_of_same_names_those_beside_each_other_belong_together():
    belongs = found("a/car_9m_real.txt", "b/car_9m_real.txt", "a/car_9m_sim.txt", "b/car_9m_sim.txt", "c/sim_9m.txt")
    groups = groups_of(project_of("a/car_9m_real.txt", "b/car_9m_real.txt", "a/car_9m_sim.txt", "b/car_9m_sim.txt"))
    assert {m.simulated.parent.name for g in groups for m in g.measurements} == {"a", "b"}
    assert len(belongs) == 2


def test_the_project_is_grouped_and_what_is_missing_is_said(bench):
    project = read_project(bench)
    groups = {group.name: group for group in groups_of(project)}
    assert [m.distance_m for m in groups["car SMART"].measurements] == [10.0, 16.0, 22.0, 28.0, 50.0]
    models = project.of("model")
    assert options_of(groups["car SMART"], models) == [FILES, "models/SMART.toml"]
    assert options_of(groups["van SLIM"], models) == ["models/SLIM.toml"]
    job = job_of(groups["car SMART"], "models/SMART.toml", models)
    assert job.words == "at 10, 16, 22, 28 m, simulated with models/SMART.toml"
    assert job.notes == ("left out: car_50m_SMART_real.txt: no ideal scan is named like it",)
    assert "there are ideal scans, but no model" in job_of(groups["van SLIM"], "", []).fault
    others = [Entry(Path(f"{name}.toml"), "model", f"{name}.toml") for name in ("one", "two")]
    assert source_of(groups["van SLIM"], others, "") == ""
    assert "any of 2 models could be meant: o chooses one" in job_of(groups["van SLIM"], "", others).fault
    assert source_of(groups["van SLIM"], others, "two.toml") == "two.toml"
    assert source_of(groups["car SMART"], others, "") == FILES


def test_features_side_by_side_where_there_is_room(bench):
    async def do(app, pilot, view):
        await computed(pilot, view)
        for feature in ("PEAK", "AREA", "WIDTH"):
            await sees(app, pilot, f"10 m, {feature} ▆ real ┌┐ sim")
        await sees(app, pilot, "Left out: car_50m_SMART_real.txt.")
        await sees(app, pilot, "car_50m_SMART_real.txt:2: 'Z' is 'x', not a number")
        await pilot.press("n")
        await sees(app, pilot, "22 m, PEAK")
        # A distance is chosen for all screens, and one that is chosen elsewhere is gone to.
        assert app.choice.of("measurement") == "car_22m_SMART_real.pcd"
        app.choice.choose("measurement", "car_16m_SMART_real.pcd")
        await sees(app, pilot, "16 m, PEAK")
        # At 80 columns one plot, and the numbers of all three.
        await pilot.resize_terminal(80, 24)
        view.turned = 0
        view.draw()
        await sees(app, pilot, "1/16 10 m, PEAK")
        await misses(app, pilot, "10 m, AREA")
        await sees(app, pilot, "KS  by chance")
        numbers = view.query_one("#numbers").text.splitlines()
        assert [row.split()[0].strip(">") for row in numbers] == ["PEAK", "AREA", "WIDTH"]
        for feature in ("AREA", "WIDTH"):
            await pilot.press("n", "n", "n", "n")
            await sees(app, pilot, f"10 m, {feature}")
        await pilot.press("n", "n", "n", "n")
        await sees(app, pilot, "10 m, points: from above")
        await pilot.press("p", "v")
        await says(app, pilot, "drawn as: qq")
        await sees(app, pilot, "quantiles of simulated")

    histograms(bench, do, (160, 50))


def test_the_export_is_what_the_command_writes(inside, capsys):
    for file in inside.glob("*_2?m*"):  # pictures of all would take long
        file.unlink()

    async def do(app, pilot, view):
        await computed(pilot, view)
        await pilot.press("v", "e")
        await sees(app, pilot, "to which directory")
        await pilot.press("enter")
        await says(app, pilot, "car_SMART_out: report.html, result.json, pictures/, distances.png")
        await done(app, "sheet")
        await sees(app, pilot, "to which PNG file")
        await pilot.press("enter")
        await says(app, pilot, "car_SMART_distances.png: all distances")
        await done(app, "sheet")
        await sees(app, pilot, "to which PNG file")
        await pilot.press("ctrl+u", *"x.bmp", "enter")
        await says(app, pilot, "no name of a PNG picture; end it with .png")

    histograms(inside, do)
    near = (10, 16)
    real, simulated = ([f"car_{m}m_SMART_{side}.pcd" for m in near] for side in ("real", "sim"))
    ideal = [f"ideal_car_{m}m.parquet" for m in near]
    options = ("--vehicle", "car", "--variant", "SMART", "--plot", "qq", "--out", "by_command")
    assert main(["vehicles", "compare", *real, "--simulated", *simulated, "--ideal", *ideal, *options]) == 0
    (by_command, read), (by_key, named) = map(apart_from_key, map(Path, ("by_command", "car_SMART_out")))
    assert by_command.keys() == by_key.keys()
    assert by_command == by_key
    assert read == named
    assert Path("car_SMART_distances.png").read_bytes() == by_key["distances.png"]


def test_what_a_model_makes_is_what_the_command_makes(inside, capsys):
    async def do(app, pilot, view):
        await on_vehicle(pilot, view, "van SLIM")
        await computed(pilot, view)
        await pilot.press("e")
        await sees(app, pilot, "to which directory")
        await pilot.press("enter")
        await says(app, pilot, "van_SLIM_out: report.html")

    histograms(inside, do)
    files = ("slim/van_14m_real.pcd", "--ideal", "slim/van_14m_ideal.parquet", "--model", "models/SLIM.toml")
    assert main(["vehicles", "compare", *files, "--vehicle", "van", "--out", "by_command"]) == 0
    (by_command, read), (by_key, named) = map(apart_from_key, map(Path, ("by_command", "van_SLIM_out")))
    assert [by_command[name] for name in ("report.html", "result.json")] == [
        by_key[name] for name in ("report.html", "result.json")
    ]
    assert read == named


def test_the_source_is_chosen_and_kept_and_going_back_computes_nothing(bench):
    async def do(app, pilot, view):
        await computed(pilot, view)
        await done(app, "next source")
        await says(app, pilot, "car SMART: models/SMART.toml (2 of 2)")
        await sees(app, pilot, "left out: car_50m_SMART_real.txt: no ideal scan is named like it")
        await done(app, "next source")  # the other model is of SLIM and is not offered
        await says(app, pilot, "car SMART: simulated files (1 of 2)")
        await until(pilot, lambda: "10 m, PEAK" in text_of(app))
        assert view.running is None
        await done(app, "next source")
        await on_vehicle(pilot, view, "truck SMART")
        await sees(app, pilot, "truck SMART cannot be computed: no simulated file or ideal scan")
        await done(app, "next source")
        await says(app, pilot, "there is nothing to compare with")
        await done(app, "sheet")
        await says(app, pilot, "r computes it first")

    async def again(app, pilot, view):
        assert view.job.name == "truck SMART"
        await pilot.press("home")
        await sees(app, pilot, "simulated with models/SMART.toml")

    histograms(bench, do)
    histograms(bench, again)


def test_a_fault_in_every_file_is_that_of_the_vehicle(bench):
    for file in bench.glob("car_*_sim.pcd"):
        file.write_bytes(file.read_bytes()[:60])

    async def do(app, pilot, view):
        await on_vehicle(pilot, view, "car SMART")
        await pilot.press("r")
        await until(pilot, lambda: view.running is None and view.fault_of(view.job))
        await sees(app, pilot, "car SMART cannot be computed: car_10m_SMART_sim.pcd")

    histograms(bench, do)


def test_an_empty_project_says_what_is_needed(tmp_path):
    async def do(app, pilot):
        await sees(app, pilot, "car_20m_real.txt")
        await pilot.press("r", "n", "v", "t", "e", "down")
        await pilot.press("b")
        await until(pilot, lambda: app.view.NAME == "cloud")

    drive(LidarcheckApp(tmp_path, screen="histograms"), do)


def test_any_size_down_to_one_by_one(bench):
    async def do(app, pilot, view):
        await computed(pilot, view)
        for size in ((1, 1), (5, 3), (40, 10), (200, 60), (3, 40), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.press("n", "n", "t")
            await pilot.pause()
        await sees(app, pilot, "? Help")

    histograms(bench, do)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_snapshots(bench, size):
    async def do(app, pilot, view):
        await computed(pilot, view)
        await pilot.press("n")
        await says(app, pilot, "2 of ")
        await as_stored(app, pilot, f"histograms_{size[0]}x{size[1]}")

    histograms(bench, do, size)


def test_the_numbers_have_each_features_part_now_before_and_at_the_start():
    gap = SimpleNamespace(ks=0.062, mean_measured=100.0, mean_simulated=103.0)
    at = SimpleNamespace(distance_m=16.0, features={"PEAK": gap, "AREA": gap}, ks_chance={"PEAK": 0.03, "AREA": 0.133})
    now, start = (
        Number("gap", 0.7, 0.4, {"PEAK": part, "AREA": 12.345}, "", np.zeros(3), "", "", "") for part in (0.52, 0.5)
    )
    title, lines = number_lines(at, "AREA", Known("OLD, of edit 3", now, None, None, None, start))
    assert title == "16 m     now before  start     KS  by chance  gap [sd], OLD, of edit 3"
    assert ["".join(text for text, _ in one) for one in lines] == [
        " PEAK        0.52      -   0.50  0.062     0.030  mean +3.0 %, beyond chance",
        ">AREA        12.3      -   12.3  0.062     0.133  within chance",
    ]
    assert number_lines(at, "AREA", Known("not yet known"))[0] == "16 m      KS  by chance"
