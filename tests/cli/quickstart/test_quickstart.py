"""From a recording to a verdict: every step is a command, what is done stays done, and what is wrong is one line."""

import json
import shlex
import shutil
from pathlib import Path

import pytest

from lidarcheck.cli import main
from lidarcheck.effects.finding import catalogue
from places import shared_path
from recording_kit import write_frame, write_recording

EFFECTS = len(catalogue())


@pytest.fixture(scope="module")
def two_frames(tmp_path_factory):
    """A quick start of two frames, which ends after the laws; its place and what it printed."""
    place = tmp_path_factory.mktemp("two")
    write_recording(place / "recording", frames=2)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        assert main("quickstart recording --out first --json first.json".split()) == 0  # noqa: SIM905
    return place


@pytest.fixture
def here(two_frames, tmp_path, monkeypatch):
    shutil.copytree(two_frames, tmp_path / "q", copy_function=shutil.copy2)
    monkeypatch.chdir(tmp_path / "q")
    return tmp_path / "q"


def test_two_frames_give_laws_and_say_so(two_frames):
    found = json.loads((two_frames / "first.json").read_text())
    assert found["first"][0] == f"0 of {EFFECTS} effects can be shown by these data"
    assert found["first"][1].startswith("2 frames give laws of range, noise and loss, not a verdict")
    assert found["verdict"] is None
    assert 0.008 < found["laws"]["range_floor_m"]["value"] < 0.012  # the recording's noise is 1 cm
    page = (two_frames / "first/report.html").read_text()
    assert found["first"][0] in page.partition("<main>")[0]
    assert all(line in page for line in found["first"][2:])
    assert list(found["commands"]) == ["frames", "sensor", "repeats"]
    assert not (two_frames / "first/case").exists()


def test_each_step_is_a_command_that_gives_the_same(here):
    kept = {path: path.read_bytes() for path in Path("first/frames").iterdir()}
    model = Path("first/repeats/model.toml").read_text()
    commands = json.loads(Path("first.json").read_text())["commands"]
    shutil.rmtree("first")
    Path("first/steps").mkdir(parents=True)
    for line in commands.values():
        assert main([*shlex.split(line)[1:], "-q"]) == 0
    assert {path: path.read_bytes() for path in Path("first/frames").iterdir()} == kept
    assert Path("first/repeats/model.toml").read_text() == model


def test_what_is_done_is_not_done_again(here, capsys):
    """A copy has other places and the same times: only what reads other files is done anew."""
    shutil.rmtree("first")
    assert main(["quickstart", "recording", "--out", "first"]) == 0
    before = Path("first/repeats/repeats.json").stat().st_mtime_ns
    capsys.readouterr()
    assert main(["quickstart", "recording", "--out", "first"]) == 0
    err = capsys.readouterr().err
    assert err.count("done before: lidarcheck") == 3
    assert Path("first/repeats/repeats.json").stat().st_mtime_ns == before
    shutil.rmtree("first/repeats")  # as a run that was stopped leaves it
    assert main(["quickstart", "recording", "--out", "first"]) == 0
    assert capsys.readouterr().err.count("done before: lidarcheck") == 2
    assert Path("first/repeats/repeats.json").is_file()


def refused(words, capsys):
    assert main(shlex.split(words)) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error")]
    assert len(lines) == 1
    return lines[0]


def test_another_recording_is_not_mixed_with_the_first(here, capsys):
    write_recording(Path("other"), frames=2, place_m=(1.0, 0.0, 0.0))
    assert "is the quick start of another recording" in refused("quickstart other --out first", capsys)
    Path("mine").mkdir()
    Path("mine/notes.txt").write_text("mine")
    assert "is there already, and no quick start" in refused("quickstart other --out mine", capsys)


def test_a_recording_that_cannot_be_used_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    assert "empty: holds no frame" in refused("quickstart empty --out first", capsys)
    assert not Path("first").exists()
    write_frame(Path("one.csv"), 1)
    assert "is a single frame" in refused("quickstart one.csv --out first", capsys)
    Path("drive").mkdir()
    for k in range(4):
        write_frame(Path(f"drive/f{k}.csv"), k, place_m=(0.5 * k, 0.0, 0.0))
    assert "nothing stands still" in refused("quickstart drive --out driven", capsys)
    for k in range(4):
        write_frame(Path(f"drive/f{k}.csv"), k, place_m=(1.5 * (k % 2), 0.0, 0.0))
    assert "the frames of two sensors take turns" in refused("quickstart drive --out taken", capsys)


def test_a_sensor_that_did_not_measure_this_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(Path("recording"), frames=2)
    said = refused("quickstart recording --sensor XT32 --out first", capsys)
    assert "XT32" in said
    assert "name the sensor that measured with --sensor, or leave it out" in said


def test_two_real_scans_end_after_the_laws(tmp_path, monkeypatch):
    """An OS0-128 whose range scatters the less the more light comes back, down to about 2 mm."""
    folder = shared_path("data/ouster_os0_128")
    monkeypatch.chdir(tmp_path)
    assert main(["quickstart", str(folder), "--out", "first", "--json", "found.json", "-q"]) == 0
    found = json.loads(Path("found.json").read_text())
    assert found["first"][0].startswith("0 of")
    assert 0.001 < found["laws"]["range_floor_m"]["value"] < 0.004


@pytest.mark.long
def test_a_recording_of_the_model_itself_has_no_gap(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(Path("recording"), frames=6)
    assert main("quickstart recording --out first --jobs 1 --json found.json".split()) == 0  # noqa: SIM905
    found = json.loads(Path("found.json").read_text())
    shown = found["shown"]["shown"]
    assert capsys.readouterr().out.startswith(f"{len(shown)} of {EFFECTS} effects can be shown by these data: ")
    assert found["verdict"].startswith("NO GAP")
    assert found["verdict"].endswith("Nothing is missing that repeats can show.")
    report = json.loads(Path("first/found/report.json").read_text())
    assert sorted(report["not_testable"]) == sorted(found["shown"]["not_testable"])
    assert found["first"][0] in Path("first/report.html").read_text()


@pytest.mark.long
def test_a_loss_that_no_weakness_explains_is_named(tmp_path, monkeypatch):
    """One echo in twenty is lost, whatever its strength: the only effect that this recording has."""
    monkeypatch.chdir(tmp_path)
    write_recording(Path("recording"), frames=6, lost=0.05)
    assert main("quickstart recording --out first --jobs 1 -q".split()) == 0  # noqa: SIM905
    report = json.loads(Path("first/found/report.json").read_text())
    assert [effect["name"] for effect in report["effects"]] == ["dropout"]
    assert report["gap"]["closed"] > 0.8
