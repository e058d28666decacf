"""Commands around somebody else's program that has no chance of its own: each works without it, or says why not."""

import re
import shutil
from pathlib import Path

import pytest

from hidden.around.cases import write_case
from hidden.foreign.orders import CaseOrder
from lidarcheck.cases.case import load_case
from lidarcheck.cases.chance import check_chance
from lidarcheck.cli import main
from lidarcheck.errors import InputError
from own_models_kit import COMPILED, FUNCTION

pytestmark = [
    pytest.mark.usefixtures("trusting"),
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc on this machine"),
]

STILL = """\
from own_lidar.model import simulate as own


def simulate(ideal):
    return own(ideal, 0)
"""
RUN = 'command = ["./waveform", "{ideal}", "{ini}", "{scan}", "1", "0"]'
NO_CHANCE = "the program ignores its seed: nothing says what chance makes of its echoes, and how much of a gap it is"
IDEAL, MEASURED = "frame_00_ideal.txt", "frame_00_measured.txt"
TABLE = "PostPro.LUT_blooming_X = -10, 0, 10\nPostPro.LUT_blooming_Y = 0.001, 1, 0.001\n"


def case(name: str, place: Path, *, seedless: bool = True, says_so: bool = True) -> Path:
    """A case around an example, that does or does not ignore its seed, and says so or not."""
    write_case(CaseOrder(1, "null", 1001, (), "medium", name, "street"), place / "case", frames=3)
    model = place / "case" / "model.toml"
    text = re.sub(r"\[external\.parameters\.threshold\][^\[]*", "", model.read_text())
    if seedless:
        text = text.replace('command = ["./waveform", "--server"]\nserver = true', RUN)
        if name == FUNCTION:
            (place / "case" / "own_lidar" / "still.py").write_text(STILL)
            text = text.replace("own_lidar.model:", "own_lidar.still:")
    model.write_text(text.replace(', "Seed", "Frame"', "") if says_so else text)
    return place / "case"


@pytest.fixture(scope="module", params=[COMPILED, FUNCTION])
def still(request, tmp_path_factory):
    """A case around a program without a seed, which its model file says."""
    place = case(request.param, tmp_path_factory.mktemp("still"))
    (place / "table.ini").write_text(TABLE)
    return place


def refused(capsys, *words: str) -> str:
    """The one line of a command that must be refused."""
    assert main([*words, "-q"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    return err


def test_what_needs_no_chance_of_the_model_works(still, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(still)
    shown = str(tmp_path / "shown.csv")
    model = ("--ideal", IDEAL, "--model", "model.toml", "-q")
    assert main(["simulate", IDEAL, "--model", "model.toml", "--out", shown, "-q"]) == 0
    assert main(["compare", MEASURED, shown, *model]) == 0
    assert "wasserstein" in capsys.readouterr().out, "what chance gives comes from exchanges of the two sides"
    assert main(["panels", MEASURED, *model, "--out", str(tmp_path / "panels")]) == 0
    assert (tmp_path / "panels" / "report.html").is_file()


@pytest.mark.parametrize(
    "words",
    [
        ("explain", ".", "--out", "out"),
        ("calibrate", ".", "--free", "materials.3.reflectance", "--out", "out"),
        ("gap", "."),
    ],
)
def test_what_needs_it_says_so_in_one_line(still, words, monkeypatch, capsys):
    monkeypatch.chdir(still)
    error = refused(capsys, *words)
    assert f"model.toml: {NO_CHANCE}; let it draw its noise from " in error
    assert not list(Path("out").glob("[a-z]*")), "no more is left than the notebook of a run that may go on"


@pytest.mark.parametrize("what", ["bloom", "ghosts"])
def test_fits_of_other_detectors_name_the_detector(still, what, monkeypatch, capsys):
    monkeypatch.chdir(still)
    more = ("--lut", "table.ini") if what == "bloom" else ()
    error = refused(capsys, what, "fit", MEASURED, "--ideal", IDEAL, "--model", "model.toml", *more, "--out", "out")
    assert "has the detector external" in error


@pytest.mark.parametrize("name", [COMPILED, FUNCTION])
def test_a_program_that_only_claims_to_read_its_seed_is_found_out(name, tmp_path):
    place = case(name, tmp_path, says_so=False)
    found = load_case(place)
    with pytest.raises(InputError, match=NO_CHANCE) as caught:
        check_chance(found.model, found.frames, found.model_file)
    source = "its argument seed" if name == FUNCTION else "{seed}"
    assert f"let it draw its noise from {source}" in str(caught.value)


@pytest.mark.parametrize("name", [COMPILED, FUNCTION])
def test_one_that_draws_from_its_seed_passes(name, tmp_path):
    found = load_case(case(name, tmp_path, seedless=False, says_so=False))
    check_chance(found.model, found.frames, found.model_file)
