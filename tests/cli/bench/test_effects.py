"""`bench --effects`: what it runs for which sensor, what it counts of a beam, and its two outputs."""

import json

import numpy as np
import pytest
from scipy.special import ndtr

from fast_kit import small_library
from lidarcheck.cli import main
from lidarcheck.cli.bench import effects as bench_effects
from lidarcheck.cli.bench.effects import PLAIN, SENSORS, tried
from lidarcheck.cli.bench.floor import floor_of
from lidarcheck.cli.bench.mixes import mixes, with_effects
from lidarcheck.cli.bench.scene import lab_model, sized_frame
from lidarcheck.effects import catalogue
from lidarcheck.model.fast.grid import Grid
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray

SOME = ("fog", "crosstalk", "dirty window and crosstalk")


def test_every_effect_and_six_mixes_are_tried_and_fit_each_sensor_or_say_why_not():
    assert len(mixes("mixes")) == 6
    assert set(tried()) == {PLAIN, *catalogue(), *mixes("mixes")}
    left_out = 0
    for sensor in SENSORS:
        plain = lab_model(sensor)
        for mix in tried().values():
            model, why = with_effects(plain, mix)
            assert {effect.name for effect in model.effects} | set(why) == set(mix)
            assert all(why.values())
            left_out += len(why)
            for effect in model.effects:
                effect.check(plain.sensor)
    assert left_out > 10


@pytest.mark.parametrize("sensor", SENSORS)
def test_frames_have_about_the_size_that_was_asked_for(sensor):
    most = len(sized_frame(lab_model(sensor).sensor, 10_000_000))
    assert most == len(lab_model(sensor).sensor.beams.every()[0])
    for beams in (100, 4000):
        frame = sized_frame(lab_model(sensor).sensor, beams)
        assert 0 < len(frame) <= max(1.7 * beams, 200)
        assert np.all(frame.distance_m > 0.0)


def one_beam(background_per_ns, range_m, signal):
    beam = np.zeros(1, dtype=np.int32)
    return Light(beam, beam, np.array([background_per_ns]), np.array([0, 1]), np.array([range_m]), np.array([signal]))


@pytest.mark.parametrize(("range_m", "signal"), [(30.0, 0.02), (100.3, 3.0)])
def test_bins_worth_a_draw_are_those_that_light_reaches(range_m, signal):
    sensor = SpadArray.of("SMART")
    found = floor_of(one_beam(sensor.background_per_ns, range_m, signal), sensor)
    edge_ns = np.arange(sensor.bins + 1) * sensor.bin_ns - 2.0 * range_m / LIGHT_SPEED_M_PER_NS
    avalanches = sensor.detectors * signal * np.diff(ndtr(edge_ns / sensor.sigma_ns))
    assert found.worth == np.count_nonzero(avalanches >= 0.01)
    assert found.worth < found.walked < 100
    assert found.beam_ns == found.worth * found.draw_ns > 0.0


def test_a_crowded_background_is_walked_bin_by_bin():
    sensor = SpadArray.of("SLIM")
    assert floor_of(one_beam(0.05, 30.0, 1.0), sensor).walked == sensor.bins


@pytest.fixture
def few_effects(monkeypatch, tmp_path):
    monkeypatch.setattr(bench_effects, "tried", lambda: {name: tried()[name] for name in (PLAIN, *SOME)})
    with small_library(tmp_path / "library", Grid(sample_bits=2)):
        yield


def test_speeds_stages_and_reasons_for_machines(few_effects, capsys):
    assert main(["bench", "--effects", "--beams", "40", "--sensor", "SMART", "XT32", "--json", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)["sensors"]
    counted, linear = ({row["name"]: row for row in found[name]["rows"]} for name in ("SMART", "XT32"))
    assert [*counted] == [PLAIN, *SOME]
    for row in counted.values():
        assert row["exact_mpts_s"] > 0.0
        assert row["fast_mpts_s"] > 0.0
        assert list(row["stages_ms"]) == ["light", "pulses", "draws", "table"]
    assert counted["fog"]["bins_walked"] > counted[PLAIN]["bins_walked"] > 0.0
    assert linear["fog"]["fast_mpts_s"] is linear["fog"]["bins_walked"] is None
    assert "one amplitude" in linear["crosstalk"]["why_not"]
    assert list(linear["dirty window and crosstalk"]["without"]) == ["crosstalk"]


def test_a_table_for_people_and_what_goes_with_what(few_effects, capsys):
    assert main(["bench", "--effects", "--beams", "40", "--sensor", "XT32"]) == 0
    out, err = capsys.readouterr()
    assert all(words in out for words in ("XT32", "million beams/s", PLAIN, "fog", "light [ms]"))
    assert "crosstalk: it adds avalanches into one amplitude" in out
    assert "dirty window and crosstalk without crosstalk: " in out
    assert "cores, load" in err
    for wrong, said in ((["--beams", "40"], "--beams is for"), (["--effects", "--scaling"], "different things")):
        assert main(["bench", *wrong]) == 2
        assert said in capsys.readouterr().err
