"""What a program reads is found out by trying it, once."""

from dataclasses import replace
from pathlib import Path

import pytest

from lidarcheck.effects.finding import catalogue
from lidarcheck.errors import ExternalModelError
from lidarcheck.model import load_model
from lidarcheck.model.external import reads as module
from lidarcheck.model.external.reads import readied, seedless
from waveform_kit import EVERYTHING, model_text, wall_scan, write_program

pytestmark = pytest.mark.usefixtures("trusting")

MATERIAL = '[materials.2]\nname = "bright"\nreflectance = 0.6\n'


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    place = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("LIDARCHECK_CACHE", str(place))
    return place


def model(folder: Path, more: str = ""):
    """The kit's model with one material, so that the trials are short."""
    text = model_text(more)
    (folder / "model.toml").write_text(text[: text.index("[materials.1]")] + MATERIAL)
    return load_model(folder / "model.toml")


@pytest.mark.parametrize(
    ("reads", "found"),
    [
        (EVERYTHING, ("Share", "Reflectance", "Background", "Time", "Frame", "Seed")),
        (("Parts", "Reflectance"), ("Parts", "Reflectance")),
        ((), ()),
    ],
)
def test_each_column_is_tried(tmp_path, reads, found):
    write_program(tmp_path, reads)
    program = readied(model(tmp_path)).sensor
    assert program.reads == found
    assert set(program.tells) == {"AREA", "PEAK", "WIDTH"}
    assert program.unlit == ""


def test_the_answer_is_kept_until_the_program_changes(tmp_path, monkeypatch):
    write_program(tmp_path, ("Share", "Seed"))
    assert readied(model(tmp_path)).sensor.reads == ("Share", "Seed")

    def nobody_runs(*_args, **_more):
        raise AssertionError("the program runs again")

    with monkeypatch.context() as patch:
        patch.setattr(module, "run_requests", nobody_runs)
        assert readied(model(tmp_path)).sensor.reads == ("Share", "Seed")
        write_program(tmp_path, ("Share",))
        with pytest.raises(AssertionError, match="runs again"):
            readied(model(tmp_path))


def test_a_run_that_fails_on_a_column_means_that_it_is_not_read(tmp_path):
    write_program(tmp_path, EVERYTHING)
    text = (tmp_path / "waveform.py").read_text()
    picky = text.replace("beams = {}\n", 'beams = {}\nassert not {"Share", "Time"} & set(names), "what is that?"\n')
    assert picky != text
    (tmp_path / "waveform.py").write_text(picky)
    assert readied(model(tmp_path)).sensor.reads == ("Reflectance", "Background", "Frame", "Seed")


def test_a_program_that_never_repeats_itself_must_say_what_it_reads(tmp_path):
    write_program(tmp_path, ("Share",))
    text = (tmp_path / "waveform.py").read_text()
    (tmp_path / "waveform.py").write_text(
        text.replace('draw = random.Random(" ".join(map(str, key)))', "draw = random")
    )
    found = readied(model(tmp_path))
    assert found.sensor.reads == ()
    assert "write `reads` in [external]" in catalogue()["signal_gain"].why_not(found.sensor)
    assert seedless(found)
    said = readied(model(tmp_path, 'reads = ["Share"]\n'))
    assert said.sensor.reads == ("Share",)
    assert catalogue()["signal_gain"].why_not(said.sensor) == ""


def test_nothing_runs_that_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.delenv("LIDARCHECK_TRUST")
    write_program(tmp_path)
    text = (tmp_path / "waveform.py").read_text()
    (tmp_path / "waveform.py").write_text(f'open("ran", "w")\n{text}')
    with pytest.raises(ExternalModelError, match="runs a program that you do not trust"):
        readied(model(tmp_path))
    assert not (tmp_path / "ran").exists()


def test_a_program_that_fails_says_so_and_nothing_is_kept(tmp_path, cache):
    (tmp_path / "waveform.py").write_text('import sys; sys.exit("no licence")\n')
    with pytest.raises(ExternalModelError, match="no licence"):
        readied(model(tmp_path))
    assert not list(cache.glob("programs/*"))


def test_a_reflectance_that_cannot_be_told_hides_every_effect_of_light(tmp_path):
    around = model(tmp_path, 'reads = ["Background"]\n')
    ideal = replace(wall_scan(), extra={"Reflectance": wall_scan().distance_m / 100.0})
    found = readied(around, [ideal]).sensor
    reasons = {name: effect.why_not(found) for name, effect in catalogue().items()}
    assert "the program reads neither that nor Share" in reasons["ambient_light"]
    assert reasons["dropout"] == reasons["boresight"] == ""
    assert readied(around, [wall_scan()]).sensor.unlit == ""
