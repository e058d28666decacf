"""`simulate` with many frames: what is written, what is kept, what is refused, and how much memory it takes."""

import json
import shutil
import sys
import tracemalloc

import numpy as np
import pytest

from explain_kit import MODEL, ideal_scan
from lidarcheck.cli import main
from lidarcheck.formats import load_scan, save_ideal
from lidarcheck.harness.frames import FrameBatch
from lidarcheck.model import load_model, simulate
from lidarcheck.workers import WorkerPool

SMALL = {"layers": range(250, 256), "points": range(470, 480)}


@pytest.fixture
def place(tmp_path):
    for k in range(2):
        save_ideal(ideal_scan(k, **SMALL), tmp_path / f"i{k}.txt")
    (tmp_path / "model.toml").write_text(MODEL.format(variant="SMART"))
    return tmp_path


def run(place, *arguments, ideals=("i0.txt",), model="model.toml"):
    files = [str(place / name) for name in ideals]
    return main(["simulate", *files, "--model", str(place / model), "--out", str(place / "out"), *arguments])


def names(place):
    return sorted(path.name for path in (place / "out").iterdir())


def same(scan, other):
    return all(np.array_equal(getattr(scan, name), getattr(other, name)) for name in ("layer", "area", "x_m", "peak"))


def test_every_frame_has_random_numbers_of_its_own(place, capsys):
    assert run(place, "--frames", "3", "--format", "pcd", "--seed", "4", "--jobs", "1") == 0
    files = ["i0_000000.pcd", "i0_000001.pcd", "i0_000002.pcd"]
    assert names(place) == ["frames.json", *files]
    model, ideal = load_model(place / "model.toml"), ideal_scan(0, **SMALL)
    scans = [load_scan(place / "out" / name) for name in files]
    assert [len(scan) for scan in scans] == [len(simulate(ideal, model, seed=4, frame=k)) for k in range(3)]
    main(
        [
            "simulate",
            str(place / "i0.txt"),
            "--model",
            str(place / "model.toml"),
            "--out",
            str(place / "one.pcd"),
            "--seed",
            "4",
        ]
    )
    assert same(scans[0], load_scan(place / "one.pcd"))
    assert not same(scans[0], scans[1])
    total = sum(len(scan) for scan in scans)
    assert f"out: 3 frames with {total} echoes, seed 4\n" in capsys.readouterr().err


def test_several_ideal_scans_give_a_file_each(place):
    assert run(place, "--jobs", "1", ideals=("i0.txt", "i1.txt")) == 0
    assert names(place) == ["frames.json", "i0.parquet", "i1.parquet"]
    main(["simulate", str(place / "i1.txt"), "--model", str(place / "model.toml"), "--out", str(place / "one.parquet")])
    assert (place / "out/i1.parquet").read_bytes() == (place / "one.parquet").read_bytes()


def test_frames_that_are_there_are_kept_and_the_others_made(place, capsys):
    assert run(place, "--frames", "2", "--jobs", "1") == 0
    kept, lost = (place / "out" / f"i0_00000{k}.parquet" for k in range(2))
    content, before = lost.read_bytes(), kept.stat().st_mtime_ns
    lost.unlink()
    capsys.readouterr()
    assert run(place, "--frames", "4", "--jobs", "1") == 0
    assert "3 frames with" in (said := capsys.readouterr().err)
    assert said.endswith("seed 0; 1 were there already\n")
    assert lost.read_bytes() == content
    assert kept.stat().st_mtime_ns == before
    assert run(place, "--frames", "1", "--jobs", "1", ideals=("i0.txt", "i1.txt")) == 0
    assert len(names(place)) == 6
    assert sorted(json.loads((place / "out/frames.json").read_text())["ideals"]) == ["i0", "i1"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda place: (place / "model.toml").write_text(MODEL.format(variant="SLIM")), "another model"),
        (lambda place: save_ideal(ideal_scan(1, **SMALL), place / "i0.txt"), "another i0"),
        (lambda place: None, "another seed"),
    ],
)
def test_frames_of_something_else_are_not_mixed_with_these(place, capsys, change, words):
    assert run(place, "--frames", "2", "--jobs", "1") == 0
    before = {path.name: path.read_bytes() for path in (place / "out").iterdir()}
    capsys.readouterr()
    change(place)
    assert run(place, "--frames", "3", "--jobs", "1", *(["--seed", "1"] if words == "another seed" else [])) == 2
    said = f"error: {place / 'out'}: holds frames of {words}; remove it, or name another directory\n"
    assert capsys.readouterr().err == said
    assert {path.name: path.read_bytes() for path in (place / "out").iterdir()} == before


def test_files_of_unknown_origin_are_not_replaced(place, capsys):
    (place / "out").mkdir()
    (place / "out/i0_000001.parquet").write_text("mine")
    assert run(place, "--frames", "2", "--jobs", "1") == 2
    assert "i0_000001.parquet: is there already, without a frames.json" in capsys.readouterr().err
    assert names(place) == ["i0_000001.parquet"]
    (place / "out/frames.json").write_text("{")
    assert run(place, "--frames", "2", "--jobs", "1") == 2
    assert "frames.json: cannot be read" in capsys.readouterr().err


REFUSED = {
    ("--frames", "0"): "--frames 0 is out of range; use a whole number from 1 to 1000000",
    ("--frames", "1.5"): "--frames 1.5 is out of range",
    ("--format", "pcd"): "--format is for many frames; add --frames N, or name several ideal scans",
    ("--scheduler", "tcp://h:1"): "--scheduler is for many frames",
}


@pytest.mark.parametrize(("arguments", "words"), REFUSED.items())
def test_what_does_not_go_together_is_said(place, capsys, arguments, words):
    assert run(place, *arguments) == 2
    assert words in capsys.readouterr().err
    assert not (place / "out").exists()


def test_what_cannot_be_done_is_said_before_the_work(place, capsys):
    (place / "b").mkdir()
    shutil.copy(place / "i0.txt", place / "b")
    assert run(place, ideals=("i0.txt", "b/i0.txt")) == 2
    assert "would be written to the same files" in capsys.readouterr().err
    (place / "external.toml").write_text('[external]\ncommand = ["true", "{scan}"]\n')
    assert run(place, "--frames", "2", model="external.toml") == 2
    assert "an external model does not know frames: all would be the same" in capsys.readouterr().err
    (place / "out").mkdir()
    shutil.copy(place / "i0.txt", place / "out")
    where = ["--model", str(place / "model.toml"), "--out", str(place / "out"), "--format", "txt"]
    assert main(["simulate", str(place / "out/i0.txt"), str(place / "i1.txt"), *where]) == 2
    assert "i0.txt would be replaced by its frame; name another" in capsys.readouterr().err
    shutil.rmtree(place / "out")
    (place / "out").write_text("a file")
    assert run(place, "--frames", "2") == 2
    assert "out: is not a directory" in capsys.readouterr().err


@pytest.mark.parametrize("after", [0, 2])
def test_an_interrupt_leaves_whole_frames_and_nothing_where_there_are_none(place, after):
    def told(done, of, name):
        if done == after:
            raise KeyboardInterrupt

    many = FrameBatch([place / "i0.txt"], load_model(place / "model.toml"), place / "out", 3)
    with pytest.raises(KeyboardInterrupt):
        many.run(WorkerPool(), told)
    assert (place / "out").exists() == (after > 0)
    if after:
        assert names(place) == ["frames.json", "i0_000000.parquet", "i0_000001.parquet"]
        assert many.run(WorkerPool()).kept == 2


SCAN = "X Y Z Point Layer EchoNumber WIDTH AREA PEAK\\n1 0 0 480 260 1 5 90 20\\n"


@pytest.mark.usefixtures("trusting")
def test_an_external_model_simulates_several_ideal_scans(place):
    script = place / "model.py"
    script.write_text(f"import sys\nopen(sys.argv[1], 'w').write('{SCAN}')\n")
    python = json.dumps(sys.executable)
    (place / "external.toml").write_text(f'[external]\ncommand = [{python}, "{script}", "{{scan}}"]\n')
    assert run(place, ideals=("i0.txt", "i1.txt"), model="external.toml") == 0
    assert [len(load_scan(place / "out" / f"i{k}.parquet")) for k in range(2)] == [1, 1]


def test_memory_does_not_grow_with_the_number_of_frames(place):
    save_ideal(ideal_scan(0, layers=range(240, 280), points=range(400, 500)), place / "wide.txt")
    model = load_model(place / "model.toml")

    def peak(count):
        tracemalloc.start()
        try:
            FrameBatch([place / "wide.txt"], model, place / f"out{count}", count, ".pcd").run(WorkerPool())
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(1)  # what is loaded with the first use
    few, many = peak(3), peak(40)
    frame = (place / "out3/wide_000000.pcd").stat().st_size
    kept = (many - few) / 37  # the line in frames.json is kept of each: about 2 kB
    assert kept < frame / 10
