"""The closed loop on frames that an independent simulator measured with numbers that are known."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from calibrate_kit import Truth, write_case
from lidarcheck.calibration.parameters.fit_data import FitData
from lidarcheck.calibration.parameters.holdout import is_separable, split_beams, thinned
from lidarcheck.calibration.parameters.workflow import Request, calibrate, prepared
from lidarcheck.cases.case import load_case
from lidarcheck.cli import main
from lidarcheck.effects import make
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.data import Course, Distribution
from lidarcheck.figures.pages.parameters import document, page
from lidarcheck.model import load_model
from lidarcheck.workers.checkpoint import Checkpoint

SMALL = {"frames": 2, "layers": range(210, 306, 4), "points": range(430, 526, 3)}
LAB = {**SMALL, "scene": "lab"}
SIGNAL = {"signal_at_1m": 4800.0, "pulse_fwhm_ns": 5.6}
FIVE_ERRORS = 5.0 / 1.645


def case_of(directory: Path, values, **how):
    return write_case(Truth(values, **how), directory)


def far(p, truth):
    """By how many half intervals the truth is off."""
    return abs(p.value - truth) / max(0.5 * (p.high - p.low), 1e-12)


@pytest.fixture(scope="module")
def signal_case(tmp_path_factory) -> Path:
    return case_of(tmp_path_factory.mktemp("signal") / "case", SIGNAL, seed=3, **LAB)


@pytest.fixture(scope="module")
def by_command(signal_case, tmp_path_factory) -> Path:
    """What the command writes."""
    out = tmp_path_factory.mktemp("by_command") / "out"
    code = main(
        ["calibrate", str(signal_case), "--free", "signal_at_1m, pulse_fwhm_ns", "--out", str(out), "--jobs", "1"]
    )
    assert code == 0
    return out


def test_the_command_finds_what_was_hidden(by_command):
    record = json.loads((by_command / "result.json").read_text())
    result = record["result"]
    assert record["summary"].startswith("2 parameters are fitted")
    for p in result["parameters"]:
        assert p["status"] == "fitted"
        assert p["low"] < p["value"] < p["high"]
        assert abs(p["value"] - SIGNAL[p["name"]]) < FIVE_ERRORS * 0.5 * (p["high"] - p["low"])
        assert p["high"] - p["low"] < 0.05 * p["value"]
    assert result["improved"]
    assert result["held_out"]["after"] < 0.5 * result["held_out"]["before"]
    assert result["held_out"]["after"] < 1.3 * result["held_out"]["floor"]
    assert [one["round"] for one in result["rounds"]] == list(range(len(result["rounds"])))


def test_the_written_model_keeps_its_text(by_command, signal_case):
    model, before = load_model(by_command / "model.toml"), load_model(signal_case / "model.toml")
    assert model.sensor.signal_at_1m == pytest.approx(SIGNAL["signal_at_1m"], rel=0.02)
    assert model.materials == before.materials
    text, source = ((place / "model.toml").read_text() for place in (by_command, signal_case))
    head, _, tail = source.partition("\n\n")
    assert text.startswith(f"{head}\n\n[sensor]\n")
    assert text.endswith(f"\n\n{tail}")


def test_the_report_shows_the_course_and_both_models(by_command):
    html = (by_command / "report.html").read_text()
    for words in ("Distance over rounds", "signal_at_1m over rounds", "simulated before", "What changes in the model"):
        assert words in html
    assert len(list((by_command / "pictures").glob("*.png"))) == 7
    assert not (by_command / ".calibrate").exists()


@pytest.fixture(scope="module")
def readout_case(tmp_path_factory):
    values = {"threshold": 11.0, "effects.range_offset.offset_m": -0.12, "effects.walk_error.per_decade_m": 0.08}
    return values, load_case(case_of(tmp_path_factory.mktemp("readout"), values, seed=5, **SMALL), fewest=1)


@pytest.fixture(scope="module")
def readout(readout_case):
    values, case = readout_case
    seen = []
    found = calibrate(case, Request(tuple(values)), seed=2, on_round=lambda one, left: seen.append((one, left)))
    return found, seen


def test_whole_numbers_and_effects_that_are_added(readout, readout_case):
    values, _ = readout_case
    found, _ = readout
    threshold, offset, walk = found.parameters
    assert (threshold.value, threshold.low, threshold.high) == (11.0, 11.0, 11.0)
    assert far(offset, values[offset.name]) < FIVE_ERRORS
    assert far(walk, values[walk.name]) < FIVE_ERRORS
    assert found.model.sensor.threshold == 11
    assert [effect.name for effect in found.model.effects] == ["range_offset", "walk_error"]
    assert any("walk_error is not in the model and is added" in note for note in found.notes)


def test_the_course_is_told_round_by_round(readout):
    found, seen = readout
    assert tuple(one for one, _ in seen) == found.rounds
    assert seen[0][1] is None
    assert all(left > 0.0 for _, left in seen[1:])
    figures = page(found, [], {}).figures()
    assert sum(isinstance(figure, Course) for figure in figures) == 4
    assert all(
        set(f.samples) == {"real", "simulated before", "simulated after"}
        for f in figures
        if isinstance(f, Distribution)
    )
    assert document(found)["held_out"]["after"] == found.rounds[-1].held_out.value


class Stop(Exception):
    pass


def test_an_interrupted_run_goes_on_and_ends_the_same(readout, readout_case, tmp_path):
    values, case = readout_case

    def stop(one, _left):
        if one.number == 1:
            raise Stop

    asked = Request(tuple(values))
    with pytest.raises(Stop), Checkpoint(tmp_path / "kept", "key") as checkpoint:
        calibrate(case, asked, seed=2, on_round=stop, checkpoint=checkpoint)
    with Checkpoint(tmp_path / "kept", "key") as checkpoint:
        assert len(checkpoint) == 1
        again = calibrate(case, asked, seed=2, checkpoint=checkpoint)
    assert again.parameters == readout[0].parameters
    assert [one.held_out for one in again.rounds] == [one.held_out for one in readout[0].rounds]


def test_confounded_parameters_are_named_and_left_open(signal_case):
    asked = Request(("signal_at_1m", "effects.signal_gain.gain"))
    found = calibrate(load_case(signal_case, fewest=1), asked, rounds=1)
    assert {p.status for p in found.parameters} == {"not identified"}
    assert [(p.low, p.high) for p in found.parameters] == [(0.0, 1e9), (0.0, 100.0)]
    (words,) = [w for w in found.warnings if "cannot both be fitted" in w]
    assert "only their product shows" in words
    assert "--fix" in words


def test_all_reflectances_and_the_signal_are_confounded_too(signal_case):
    case = load_case(signal_case, fewest=1)
    met = {int(i) for f in case.frames for i in f.ideal.material_id[f.ideal.distance_m > 0.0]}
    names = ("signal_at_1m", *(f"materials.{i}.reflectance" for i in sorted(met)))
    found = calibrate(case, Request(names), rounds=1)
    assert any("cannot all be fitted: only their products show" in w for w in found.warnings)
    fixed = calibrate(case, Request(names, fixed={"signal_at_1m": 4800.0, "pulse_fwhm_ns": 5.6}), rounds=1)
    assert not any("cannot" in w for w in fixed.warnings)
    assert {p.status for p in fixed.parameters} == {"fitted"}


def test_what_changes_nothing_is_said_and_not_fitted(signal_case):
    case = load_case(signal_case, fewest=1)
    with pytest.raises(UsageError, match="nothing to fit"):
        calibrate(case, Request(("materials.sign.retro_gain",)))
    found = calibrate(case, Request(("signal_at_1m", "materials.sign.retro_gain")), rounds=1)
    signal, gain = found.parameters
    assert (signal.status, gain.status) == ("fitted", "no effect")
    assert gain.value == gain.start
    assert any("materials.7.retro_gain changes nothing" in w for w in found.warnings)
    assert found.model.materials == case.model.materials


def test_one_frame_holds_out_blocks_of_beams(tmp_path):
    how = {**SMALL, "frames": 1, "layers": range(210, 306, 3), "points": range(430, 526, 2)}
    case = load_case(case_of(tmp_path, {"effects.range_offset.offset_m": 0.2}, seed=9, **how), fewest=1)
    found = calibrate(case, Request(("effects.range_offset.offset_m",)), rounds=2)
    assert any("every other block" in note for note in found.notes)
    assert far(found.parameters[0], 0.2) < FIVE_ERRORS
    data = FitData.of(case.frames, case.model, 0)
    split = split_beams(data, "case")
    assert not (split.fit.used & split.held_out.used).any()
    assert (split.fit.used | split.held_out.used).all()


def test_beams_can_be_left_out_only_where_none_looks_at_another(signal_case):
    case = load_case(signal_case, fewest=1)
    data = FitData.of(case.frames, case.model, 0)
    assert is_separable(data, case.model)
    assert not is_separable(data, case.model.with_(make("vibration", {"pitch_deg": 0.5})))
    fewer = thinned(data, 400, "test")
    assert len(fewer.beams) <= 400
    counts = [np.count_nonzero(fewer.beams.material_id == i) for i in np.unique(data.beams.material_id)]
    there = [np.count_nonzero(data.beams.material_id == i) for i in np.unique(data.beams.material_id)]
    assert all(count >= min(of, 400 // len(there)) for count, of in zip(counts, there, strict=True))
    whole, part = data.observations(case.model, "test", 0), fewer.observations(case.model, "test", 0)
    kept = np.isin(data.beams.key, fewer.beams.key)
    assert np.array_equal(whole.feature[kept], part.feature)


def test_too_few_beams_are_refused(tmp_path):
    how = {"frames": 1, "layers": range(240, 252), "points": range(470, 482)}
    case = load_case(case_of(tmp_path, {}, seed=2, **how), fewest=1)
    with pytest.raises(InputError, match="beams that meet a surface are left"):
        calibrate(case, Request(("signal_at_1m",)))


def test_the_start_is_the_model_with_what_is_asked(signal_case):
    case = load_case(signal_case, fewest=1)
    asked = Request(("effects.fog.mor_m",), starts={"effects.fog.mor_m": 500.0}, fixed={"effects.fog.backscatter": 0.0})
    model, free, _ = prepared(case, asked)
    assert [one.name for one in free] == ["effects.fog.mor_m"]
    assert model.effects == (make("fog", {"mor_m": 500.0, "backscatter": 0.0}),)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--free", "signal_at_lm"], "did you mean signal_at_1m?"),
        (["--free", ","], "no parameter is free"),
        (["--free", "threshold", "--fix", "threshold"], "no parameter is free"),
        (["--free", "threshold", "--bounds", "threshold=10..20"], "outside its bounds"),
        (["--free", "threshold", "--bounds", "threshold=10-20"], "give NAME=LOW..HIGH"),
        (["--free", "threshold", "--bounds", "threshold=a..b"], "'a' is no number"),
        (["--free", "threshold", "--start", "threshold"], "has no value"),
        (["--free", "threshold", "--start", "threshold=nan"], "is no number"),
        (["--free", "threshold", "--rounds", "0"], "use a whole number from 1 to 50"),
        (["--free", "threshold", "--json", "{case}/model.toml"], "would replace another file"),
    ],
)
def test_a_wrong_option_is_refused_before_the_work(signal_case, tmp_path, capsys, options, said):
    out = tmp_path / "out"
    options = [text.format(case=signal_case) for text in options]
    assert main(["calibrate", str(signal_case), "--out", str(out), *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.startswith("error: ")
    assert not out.exists()


def test_the_case_s_own_directory_is_not_written(signal_case, capsys):
    assert main(["calibrate", str(signal_case), "--free", "threshold", "--out", str(signal_case)]) == 2
    assert "is the case's own directory" in capsys.readouterr().err


def test_a_case_without_frames_is_refused(tmp_path, capsys):
    (tmp_path / "case.toml").write_text('model = "model.toml"\n')
    (tmp_path / "model.toml").write_text('variant = "SMART"\n')
    assert main(["calibrate", str(tmp_path), "--free", "threshold", "--out", str(tmp_path / "out")]) == 2
    assert "the case has no frames, too few to fit" in capsys.readouterr().err


def test_an_interrupt_leaves_the_best_so_far(signal_case, tmp_path, capsys, monkeypatch):
    from lidarcheck.calibration.parameters import workflow

    def stopped(self, history, x):
        raise KeyboardInterrupt

    monkeypatch.setattr(workflow._Rounds, "finish", stopped)
    out = tmp_path / "out"
    assert main(["calibrate", str(signal_case), "--free", "signal_at_1m", "--out", str(out), "--rounds", "1"]) == 130
    assert "has the best numbers so far, of round 1" in capsys.readouterr().err
    assert load_model(out / "model.toml").sensor.signal_at_1m != 6000.0
    monkeypatch.undo()
    assert main(["calibrate", str(signal_case), "--free", "signal_at_1m", "--out", str(out), "--rounds", "1"]) == 0
    assert "going on with what an interrupted run left" in capsys.readouterr().err
    assert (out / "result.json").exists()


def test_what_models_show_is_the_same_with_echoes_that_are_kept_and_without(signal_case):
    case = load_case(signal_case, fewest=1)
    foggy = case.model.with_(make("fog", {"mor_m": 150.0}))
    panel = {**foggy.materials, 2: dataclasses.replace(foggy.materials[2], reflectance=0.37)}
    late = foggy.with_(make("range_offset", {"offset_m": 0.1}))
    models = [foggy, dataclasses.replace(foggy, materials=panel), late, case.model, foggy]
    kept = FitData.of(case.frames, case.model, 5)
    for k in (0, 1, 0):
        for model in models:
            fresh = FitData.of(case.frames, case.model, 5)
            one, other = (data.observations(model, "fit", k) for data in (kept, fresh))
            for column in dataclasses.fields(one):
                assert np.array_equal(getattr(one, column.name), getattr(other, column.name), equal_nan=True)
