"""The gap on spread columns: in the spreads of the start, by the sensor's parts; whole frames give explain's figure."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.calibration.number import spread as spread_module
from lidarcheck.calibration.number.entry import expected, sample, whole
from lidarcheck.calibration.number.number import Number, in_words, judged
from lidarcheck.cases.frame import Frame
from lidarcheck.cases.source import ideal_of, scan_of
from lidarcheck.errors import UsageError
from lidarcheck.inference.wasserstein import Scale, gap_of
from lidarcheck.model import load_model
from lidarcheck.reading import reading
from number_kit import asked, changed, project


@pytest.fixture(scope="module")
def sign(tmp_path_factory):
    return project(tmp_path_factory.mktemp("sign"))


def longer(folder):
    """The model's text with a pulse that is too long, and the real path of its file."""
    text = (folder / "model.toml").read_text()
    return str((folder / "model.toml").resolve()), text.replace(
        "[materials.1]", "[sensor]\npulse_fwhm_ns = 6.0\n\n[materials.1]"
    )


def test_a_sensor_edit_is_judged_in_the_spreads_of_the_start(sign, monkeypatch):
    monkeypatch.setattr(spread_module, "MOST_BEAMS", 2000)
    file, text = longer(sign)
    start = {file: (sign / "model.toml").read_bytes()}
    first = sample(asked(sign, "gap"))
    assert first.sample == "1 834 beams x 8"
    assert list(first.parts) == ["range", "AREA", "PEAK", "WIDTH", "detected", "other echoes"]
    with reading({file: text.encode()}):
        now = sample(asked(sign, "gap", start=start))
        elsewhere = sample(asked(sign, "gap"))
        assert expected(asked(sign, "gap")) is None
    assert judged(first, now).word == "worse"
    assert judged(now, first).word == "better"
    assert sample(asked(sign, "gap")) == first
    with pytest.raises(UsageError, match="of different measurements, samples or spreads"):
        judged(first, elsewhere)


def test_whole_frames_give_what_explain_prints(sign):
    model = load_model(sign / "model.toml")
    ideal = ideal_of(sign / "ideal_100m.parquet", model.sensor)
    frame = Frame(0, ideal, scan_of(sign / "real_100m.parquet", sensor=model.sensor), 0.0)
    with reading({str((sign / "table.ini").resolve()): changed(7, 3.0).encode()}):
        number, model = whole(asked(sign, "gap")), load_model(sign / "model.toml")
    printed = gap_of(Scale.of([frame], model, 0), [("", model)])
    assert number.value + number.noise == pytest.approx(printed.before.value, rel=1e-9)
    assert number.value > number.floor


def test_few_seeds_do_and_one_does_not(sign):
    assert sample(asked(sign, "gap", seeds=2)).value > 0.0
    with pytest.raises(UsageError, match="1 seeds tell nothing of chance"):
        asked(sign, seeds=1)


def of(value, left_out, simulated="a", scale="s"):
    return Number("gap", value, 0.0, {}, "", np.asarray(left_out), "", scale, simulated)


def test_a_step_is_better_or_worse_where_its_interval_leaves_out_zero():
    blocks = np.array([0.01, -0.01, 0.0, 0.01, -0.01])
    before = of(1.0, np.full(5, 1.0))
    # Delete-one jackknife: sqrt(4 / 5 * 4e-4) = 0.0179, times t(0.95, 4) = 2.132
    step = judged(before, of(0.9, 0.9 + blocks, "b"))
    assert step.high - step.low == pytest.approx(2 * 2.1318 * np.sqrt(0.8 * 4e-4), rel=1e-4)
    assert step.word == "better"
    assert judged(before, of(1.03, 1.03 + blocks, "b")).word == "same"
    assert judged(before, of(1.05, 1.05 + blocks, "b")).word == "worse"
    assert judged(before, of(1.004, np.full(5, 1.004), "b")).word == "same, < 0.005"
    assert judged(before, replace(before, value=2.0)).word == "no beam sees this row"
    one = judged(of(1.0, [1.0]), of(2.0, [2.0], "b"))
    assert (one.word, one.to_dict()["low"]) == ("same", None)


def test_what_is_better_here_and_worse_there_is_said_of_both():
    zero = np.zeros(3)
    better, worse = (judged(of(1.0, 1.0 + zero), of(v, v + zero, "b")) for v in (0.5, 1.5))
    assert in_words({"157 m": worse, "69 m": better}) == "better at 69 m, worse at 157 m"
    assert in_words({"157 m": better, "69 m": better}) == "better"
