"""`simulate`, `compare`, `convert`, `info`, `effects` and `bench` as a user calls them."""

import json
import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from command_kit import MODEL, simulate
from fast_kit import small_library
from lidarcheck.cli import main
from lidarcheck.model.fast.grid import Grid


def test_simulate_writes_echoes_and_says_so(bench_dir, capsys):
    assert simulate("a.txt") == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "a.txt: 40 echoes from 40 rows of ideal.txt, seed 0\n"
    assert len(Path("a.txt").read_text().splitlines()) >= 41


def test_a_program_is_told_how_far_the_work_is(bench_dir, capsys, monkeypatch):
    monkeypatch.setenv("LIDARCHECK_PROGRESS", "json")
    assert simulate("a.txt") == 0
    out, err = capsys.readouterr()
    *told, last = err.splitlines()
    assert out == ""
    assert last == "a.txt: 40 echoes from 40 rows of ideal.txt, seed 0"
    found = [json.loads(line) for line in told]
    assert {"now": "reading ideal.txt", "done": 0, "of": 0} in found
    assert {"now": "simulating 40 beams", "done": 40, "of": 40} in found
    assert simulate("b.txt", "--quiet") == 0
    assert capsys.readouterr() == ("", "")


def test_simulate_takes_a_fidelity(bench_dir, capsys):
    with small_library(bench_dir / "library", Grid(sample_bits=2)):
        assert simulate("fast.txt", "--fidelity", "fast") == 0
    assert simulate("exact.txt", "--fidelity", "exact", "--quiet") == 0
    assert simulate("plain.txt", "--quiet") == 0
    assert simulate("reference.txt", "--fidelity", "reference", "--quiet") == 0
    written = {path.name: path.read_bytes() for path in Path().glob("*.txt")}
    assert written["exact.txt"] == written["plain.txt"]
    assert len({written[name] for name in ("fast.txt", "exact.txt", "reference.txt")}) == 3
    capsys.readouterr()
    assert simulate("other.txt", "--fidelity", "quick") == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "--fidelity" in err
    assert all(word in err for word in ("fast", "exact", "reference"))
    assert not Path("other.txt").exists()


def test_the_same_seed_gives_the_same_bytes(bench_dir, capsys):
    for name, seed in (("a.txt", "7"), ("b.txt", "7"), ("c.txt", str(2**64 - 1))):
        assert simulate(name, "--seed", seed, "--quiet") == 0
    a, b, c = (Path(name).read_bytes() for name in ("a.txt", "b.txt", "c.txt"))
    assert a == b
    assert a != c
    assert capsys.readouterr() == ("", "")


BAD_PLACES = {
    "a.xyzzy": "cannot write '.xyzzy' files",
    "nosuffix": "the name has no suffix",
    "nowhere/a.txt": "its directory does not exist",
    "model.toml/a.txt": "its directory does not exist",
}


@pytest.mark.parametrize(("out", "says"), BAD_PLACES.items())
def test_simulate_refuses_a_bad_place_before_it_works(bench_dir, out, says, capsys, monkeypatch):
    monkeypatch.setattr("lidarcheck.model.simulate", lambda *_, **__: pytest.fail("worked for nothing"))
    before = sorted(bench_dir.rglob("*"))
    assert simulate(out) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"error: {out}: ")
    assert err.count("\n") == 1
    assert says in err
    assert sorted(bench_dir.rglob("*")) == before


def test_simulate_does_not_write_onto_a_directory(bench_dir, capsys):
    Path("dir.txt").mkdir()
    assert simulate("dir.txt") == 2
    assert capsys.readouterr().err == "error: dir.txt: is a directory; name a file for --out\n"


REPLACING = (
    "simulate ideal.txt --model model.toml --out ./ideal.txt",
    "compare ideal.txt ideal.txt --json ideal.txt",
    "compare ideal.txt ideal.txt --model model.toml --json model.toml",
    "check model.toml --junit model.toml",
    "check model.toml --json report --html report",
)


@pytest.mark.parametrize("line", REPLACING)
def test_an_output_does_not_replace_another_file_of_the_command(bench_dir, line, capsys):
    before = {path: path.read_bytes() for path in bench_dir.iterdir()}
    assert main(line.split()) == 2
    assert "would replace another file of this command" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in bench_dir.iterdir()} == before


def test_a_full_disk_leaves_nothing(bench_dir, capsys, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    Path("a.txt").write_text("before")
    monkeypatch.setattr("os.fsync", full)
    assert simulate("a.txt", "-q") == 2
    assert (
        capsys.readouterr().err
        == "error: a.txt: cannot write: No space left on device; nothing was changed; free some space\n"
    )
    assert Path("a.txt").read_text() == "before"
    assert sorted(path.name for path in bench_dir.iterdir()) == ["a.txt", "ideal.txt", "model.toml"]


@pytest.mark.parametrize(
    ("name", "content", "where"),
    [
        ("ideal.txt", "Layer Point Distance MaterialID IncidenceAngle\n1 2 x 1 0\n", "ideal.txt:2: "),
        ("ideal.txt", "", "ideal.txt: the file is empty"),
        ("ideal.txt", "Layer Point Distance MaterialID IncidenceAngle\n1 2 30 9 0\n", "material 9 is not in the table"),
        ("model.toml", MODEL.replace("0.5", "1.5"), "model.toml:4: "),
        ("model.toml", MODEL.replace("variant", "varaint"), "model.toml:1: "),
        ("model.toml", "variant = \n", "model.toml:1: "),
    ],
)
def test_a_bad_input_is_one_line_and_nothing_is_written(bench_dir, name, content, where, capsys):
    Path(name).write_text(content)
    assert simulate("a.txt") == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert all(line.startswith("error: ") for line in err.splitlines())
    assert where in err
    assert not Path("a.txt").exists()


NO_FILE = (
    "simulate no.txt --model model.toml --out a.txt",
    "info no.txt",
    "convert no.txt b.pcd",
    "compare no.txt no.txt",
)


@pytest.mark.parametrize("line", NO_FILE)
def test_a_file_that_is_not_there(bench_dir, line, capsys):
    assert main(line.split()) == 2
    err = capsys.readouterr().err
    assert err.startswith("error: no.txt: ")
    assert err.count("\n") == 1


@pytest.fixture
def scans(bench_dir, capsys):
    assert simulate("a.txt", "-q") == simulate("b.pcd", "--seed", "1", "-q") == 0
    return bench_dir


def test_compare_prints_a_table(scans, capsys):
    assert main(["compare", "a.txt", "b.pcd", "--ideal", "ideal.txt"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[0].split() == ["KPI", "of", "value", "chance", "unit", "verdict", "measured", "simulated"]
    for kpi in ("wasserstein", "ks", "energy", "js", "dvm_bias", "dvm_scatter", "detection_probability", "overlap"):
        assert kpi in out
    assert "\x1b" not in out
    assert "not compared: ghost, blooming_profile" in err


def test_compare_shows_what_no_float_holds(bench_dir, capsys):
    Path("a.txt").write_text("Layer Point RANGE AREA\n250 480 3 1e308\n250 481 4 1.7e308\n")
    with np.errstate(over="ignore"):
        assert main(["compare", "a.txt", "a.txt", "-q"]) == 0
    assert "inf" in capsys.readouterr().out


def test_compare_writes_json_to_a_file_beside_the_table(scans, capsys):
    assert main(["compare", "a.txt", "b.pcd", "--json", "k.json", "-q"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("KPI")
    assert err == ""
    assert json.loads(Path("k.json").read_text())["features"]["AREA"]["ks"] >= 0.0


def test_compare_prints_json_alone(scans, capsys):
    assert main(["compare", "a.txt", "b.pcd", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["echoes"]["measured"] == 40


def test_compare_refuses_a_bad_place_for_json_before_it_works(scans, capsys):
    assert main(["compare", "a.txt", "b.pcd", "--json", "nowhere/k.json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "its directory does not exist" in err


@pytest.mark.parametrize("suffix", [".pcd", ".csv", ".parquet", ".ply", ".laz"])
def test_convert_and_info(scans, suffix, capsys):
    assert main(["convert", "a.txt", f"c{suffix}"]) == 0
    assert capsys.readouterr().err == f"c{suffix}: written from a.txt\n"
    assert main(["info", f"c{suffix}", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 40
    assert main(["info", f"c{suffix}"]) == 0
    assert "AREA" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["ideal.txt", "model.toml"])
def test_info_of_what_else_there_is(bench_dir, name, capsys):
    assert main(["info", name]) == 0
    assert capsys.readouterr().out.startswith(f"{name}: ")


def test_effects_lists_and_explains(capsys):
    assert main(["effects"]) == 0
    assert "layer_gain" in capsys.readouterr().out
    assert main(["effects", "layer_gain"]) == 0
    assert 'name = "layer_gain"' in capsys.readouterr().out
    assert main(["effects", "--json"]) == 0
    assert "layer_gain" in {effect["name"] for effect in json.loads(capsys.readouterr().out)}
    assert main(["effects", "layer_gain", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["parameters"]["gain"]["low"] == 0.0


def test_every_explained_effect_is_one_a_model_can_name(bench_dir, capsys):
    from lidarcheck.cli.simulation.effects_text import example
    from lidarcheck.effects import catalogue
    from lidarcheck.model import load_model

    assert main(["effects", "layer_gain"]) == 0
    assert example(catalogue()["layer_gain"], "  ") in capsys.readouterr().out
    for name, effect in catalogue().items():
        Path("model.toml").write_text(MODEL + example(effect))
        assert [effect.name for effect in load_model("model.toml").effects] == [name]


def test_an_unknown_effect_is_refused(capsys):
    assert main(["effects", "layer_gian"]) == 2
    assert capsys.readouterr().err == "error: there is no effect 'layer_gian'; did you mean layer_gain?\n"


def test_completion_is_installed_where_the_shell_looks(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    assert main(["--install-completion", "--shell", "bash"]) == 0
    script = tmp_path / ".local/share/bash-completion/completions/lidarcheck"
    assert str(script) in capsys.readouterr().out
    assert subprocess.run(["bash", "-n", script], check=False).returncode == 0


def test_a_missing_column_is_a_warning_on_standard_error(scans, capsys):
    Path("short.txt").write_text("X Y Z\n1 2 3\n")
    assert main(["info", "short.txt"]) == 0
    out, err = capsys.readouterr()
    assert err.startswith("warning: short.txt")
    assert "warning" not in out
    assert logging.getLogger("lidarcheck").handlers == []


def test_an_interrupt_leaves_nothing_and_no_traceback(bench_dir):
    program = (
        "import sys, lidarcheck.model\n"
        "def stop(*_, **__): raise KeyboardInterrupt\n"
        "lidarcheck.model.simulate = stop\n"
        "from lidarcheck.cli import main\n"
        "sys.exit(main(['simulate', 'ideal.txt', '--model', 'model.toml', '--out', 'a.txt']))\n"
    )
    ran = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
    assert (ran.returncode, ran.stdout, ran.stderr) == (130, "", "")
    assert not Path("a.txt").exists()


@pytest.fixture
def small_bench(monkeypatch, bench_dir):
    """A bench of a few beams and rows, which takes a moment."""
    from lidarcheck.cli.bench import figures as bench_figures
    from lidarcheck.cli.bench import scene as bench_scene

    frame = bench_scene.lab_frame()
    monkeypatch.setattr(bench_scene, "lab_frame", lambda: frame.take(slice(0, len(frame), 5000)))
    monkeypatch.setattr(bench_scene, "write_rows", lambda path, rows: path.write_text("X Y Z\n" + "1 2 3\n" * 100))
    monkeypatch.setattr(bench_figures, "_lidarcheck", lambda *arguments: None)
    monkeypatch.setattr(bench_figures, "cluster_figures", lambda *_: [])  # tests/workers/test_cluster.py has a cluster
    Path("scenarios").mkdir()
    with small_library(Path("library").absolute(), Grid(sample_bits=2)):
        yield


FIGURES = {
    "simulate_exact_smart_1_mpts_s": "Mpoints/s",
    "simulate_exact_slim_1_mpts_s": "Mpoints/s",
    "simulate_fast_smart_1_mpts_s": "Mpoints/s",
    "simulate_fast_slim_1_mpts_s": "Mpoints/s",
    "frame_to_pcd_s": "s",
    "read_text_mb_s": "MB/s",
    "kpi_wasserstein_mpts_s": "Mpoints/s",
    "check_s": "s",
    "explain_s": "s",
    "help_s": "s",
}


def test_bench_measures_each_figure_beside_what_else_there_is(small_bench, capsys):
    assert main(["bench", "--quick", "--json", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {name: found["figures"][name]["unit"] for name in FIGURES} == FIGURES
    for figure in found["figures"].values():
        best, median = figure["best"], figure["median"]
        assert (best <= median) if figure["unit"] == "s" else (best >= median)
        assert all(other["ratio"] > 0.0 for other in figure["against"])
    assert found["machine"]["cores"] >= 1
    figures = {name: figure["best"] for name, figure in found["figures"].items()}
    for fidelity in ("fast", "exact"):
        speeds = [best for name, best in figures.items() if name.startswith(f"simulate_{fidelity}_smart_")]
        assert found[f"simulate_{fidelity}_mpts_s"] == max(speeds)
    for name in ("frame_to_pcd_s", "read_text_mb_s", "raycast_mrays_s", "check_s", "explain_s"):
        assert found[name] == figures[name]


def test_bench_prints_a_table(small_bench, capsys):
    assert main(["bench", "--quick"]) == 0
    out, err = capsys.readouterr()
    assert all(name in out for name in FIGURES)
    assert "numpy, a coin per detector" in out
    assert "cores, load" in err


def test_bench_draws_how_the_speed_scales(small_bench, capsys):
    assert main(["bench", "--scaling", "--quick", "--out", "curves"]) == 0
    out = capsys.readouterr().out
    assert all(words in out for words in ("Beams", "Pulses per beam", "Frames", "Cores", "Mbeams/s"))
    assert len([*Path("curves").glob("*.png")]) == 4
    assert main(["bench", "--scaling", "--quick", "--json", "-q"]) == 0
    courses = json.loads(capsys.readouterr().out)["courses"]
    assert [course["title"] for course in courses] == ["Beams", "Pulses per beam", "Frames", "Cores"]
    for course in courses:
        assert [curve["name"] for curve in course["curves"]] == ["fast", "exact"]
        assert all(speed > 0.0 for curve in course["curves"] for speed in curve["y"])
    assert main(["bench", "--out", "curves"]) == 2
    assert "--out is for the curves of --scaling" in capsys.readouterr().err


def test_the_case_that_bench_explains_can_be_read(tmp_path):
    from lidarcheck.cases.case import load_case
    from lidarcheck.cli.bench.explain import FRAMES, SIDE, write_case

    write_case(tmp_path)
    case = load_case(tmp_path)
    assert [len(frame.ideal) for frame in case.frames] == [97 * SIDE] * FRAMES


def test_the_numpy_references_follow_the_sensor():
    import numpy as np

    from lidarcheck.cli.bench.reference import count_chain, every_detector, rates
    from lidarcheck.cli.bench.scene import lab_frame, lab_model

    model, frame = lab_model("SMART"), lab_frame()
    same = np.full(400, int(np.argmin(np.abs(frame.distance_m - 40.0))))
    rate = rates(frame.take(same), model)
    draw = np.random.Generator(np.random.Philox(1))
    chain = count_chain(rate, model.sensor, draw)
    detectors = every_detector(rate[:, :60], model.sensor, draw)
    peak = int(np.argmax(chain.mean(axis=1)))
    assert detectors[peak].mean() == pytest.approx(chain[peak].mean(), rel=0.05)
    assert detectors[100].mean() == pytest.approx(chain[100].mean(), abs=0.4)
