"""`lidarcheck ideal from-repeats` on files: what it writes, what it says of rays that are no plain surface, what it
refuses."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_ideal, save_scan
from lidarcheck.ideals.repeats.workflow import repeats_of
from lidarcheck.model import Model, load_model, simulate
from lidarcheck.sensor import shipped
from repeats_kit import COUNTING, MATERIALS, TRUE, counting, frames, names, room

SMALL = {"layers": 24, "points": 120}
STATED = frozenset(TRUE) | {"signal_at_1m", "near_m"}
SENSOR = COUNTING.replace(
    "near_m = 0.0", "near_m = 0.0, " + ", ".join(f"{k} = {v}" for k, v in TRUE.items() if k != "threshold")
)


def write_frames(scans, sensor):
    paths = [f"frame_{k}.parquet" for k in range(len(scans))]
    for path, scan in zip(paths, scans, strict=True):
        save_scan(scan, path, sensor)
    return paths


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(SENSOR)
    return tmp_path


def refused(capsys, *words):
    assert main(["ideal", "from-repeats", *words]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("error: ")
    return lines[0]


def test_each_frame_gets_an_ideal_scan_and_the_model_its_laws(place, capsys):
    sensor = counting(**TRUE)
    truth = room(sensor, **SMALL)
    paths = write_frames(frames(sensor, truth, 4), sensor)
    assert main(["ideal", "from-repeats", *paths, "--sensor", "mine.toml", "--out", "out", "--quiet"]) == 0
    facts = json.loads(Path("out/repeats.json").read_text())
    assert [row["part"] for row in facts["frames"]] == ["fit", "fit", "select", "verify"]
    assert [row["repeats"] for row in facts["frames"]] == [2, 2, 2, 3]
    assert set(facts["laws"]["fitted"]) == {"threshold"}
    fitted = facts["laws"]["fitted"]["threshold"]
    assert fitted["low"] <= fitted["value"] <= fitted["high"]
    assert fitted["value"] == pytest.approx(TRUE["threshold"], abs=1.5)
    model = load_model("out/model.toml")
    assert model.sensor.threshold == pytest.approx(fitted["value"], rel=1e-5)
    assert model.sensor.noise == TRUE["noise"]
    for row in facts["frames"]:
        ideal = load_ideal(Path("out") / row["ideal"], model.sensor)
        assert len(ideal) == row["rays"]
        known = ideal.distance_m > 0
        assert known.sum() == row["known"]
        assert np.isnan(ideal.distance_m).sum() == row["unknown"]
        assert {"Reflectance", "ReflectanceError", "DistanceError", "Edge"} <= set(ideal.extra)
        echoes = simulate(ideal.take(known), model)
        assert len(echoes) == pytest.approx(known.sum(), rel=0.05)
    assert "threshold" in capsys.readouterr().out


def test_a_file_takes_one_ideal_scan_of_all_frames(place):
    sensor = counting(**TRUE)
    paths = write_frames(frames(sensor, room(sensor, **SMALL), 2), sensor)
    command = ["ideal", "from-repeats", *paths, "--sensor", "mine.toml", "--out", "one.parquet", "--json", "one.json"]
    assert main([*command, "--quiet"]) == 0
    facts = json.loads(Path("one.json").read_text())
    assert facts["ideal"]["repeats"] == 2
    assert (load_ideal("one.parquet", sensor).distance_m > 0).sum() == facts["ideal"]["known"]


def test_two_frames_give_laws_and_no_verdict(place, capsys):
    sensor = counting(**TRUE)
    paths = write_frames(frames(sensor, room(sensor, **SMALL), 2), sensor)
    assert main(["ideal", "from-repeats", *paths, "--sensor", "mine.toml", "--out", "out"]) == 0
    assert "2 frames give laws (range, noise, loss), not a verdict: record three or more" in capsys.readouterr().err
    assert not Path("out/ideals").exists()
    assert load_model("out/model.toml").sensor.threshold > 0


def test_a_scene_that_moves_is_refused_with_how_much(place, capsys):
    sensor = counting(**TRUE)
    truth = room(sensor, **SMALL)
    moved = [replace(truth.ideal, distance_m=truth.ideal.distance_m + 1.5 * k) for k in range(3)]
    scans = [simulate(one, Model(sensor, MATERIALS), frame=k) for k, one in enumerate(moved)]
    said = refused(capsys, *write_frames(scans, sensor), "--sensor", "mine.toml", "--out", "out")
    assert "nothing stands still: 100 % of the rays" in said or "nothing stands still: 99 % of the rays" in said
    assert "by 3 m (median)" in said or "by 2.9 m (median)" in said
    assert not Path("out").exists()


def test_two_sensors_in_one_recording_are_told_apart(place, capsys):
    sensor = counting(**TRUE)
    truth = room(sensor, **SMALL)
    other = replace(truth.ideal, distance_m=truth.ideal.distance_m * 0.6)
    scans = [simulate((truth.ideal, other)[k % 2], Model(sensor, MATERIALS), frame=k) for k in range(4)]
    said = refused(capsys, *write_frames(scans, sensor), "--sensor", "mine.toml", "--out", "out")
    first, second = "frame_0.parquet, frame_2.parquet", "frame_1.parquet, frame_3.parquet"
    assert f"two recordings in one: {first} agree among themselves, and {second}" in said


def test_one_frame_and_frames_of_two_kinds_are_refused(place, capsys):
    sensor = counting(**TRUE)
    paths = write_frames(frames(sensor, room(sensor, **SMALL), 2), sensor)
    said = refused(capsys, paths[0], "--sensor", "mine.toml", "--out", "out")
    assert "1 frame: one frame has no repeats" in said
    [first, second] = frames(sensor, room(sensor, **SMALL), 2)
    save_scan(replace(second, features={}), "bare.parquet", sensor)
    said = refused(capsys, paths[0], "bare.parquet", "--sensor", "mine.toml", "--out", "out")
    assert said.startswith("error: bare.parquet: reports ranges alone, and frame_0.parquet SIGNAL")
    assert "--sensor or --model" in refused(capsys, *paths, "--out", "out")
    assert len(first) > 0


def test_rays_of_a_sensor_without_a_lattice_have_no_repeats():
    sensor = shipped("Livox")
    from lidarcheck.errors import UsageError

    with pytest.raises(UsageError, match="no repeats of a ray"):
        repeats_of(names(3), [], sensor, frozenset())


def changed(ideal, layers, points, **columns):
    """The ideal scan with other values on a block of beams."""
    rows = np.isin(ideal.layer, layers) & np.isin(ideal.point, points)
    new = {}
    for name, value in columns.items():
        new[name] = getattr(ideal, name).copy()
        new[name][rows] = value
    return replace(ideal, **new)


def test_a_person_in_one_frame_is_left_out_of_it_and_counted():
    sensor = counting(**TRUE)
    truth = room(sensor, **SMALL)
    person = changed(truth.ideal, range(2, 8), range(40, 46), distance_m=4.0, incidence_deg=0.0)
    model = Model(sensor, MATERIALS)
    scans = [simulate(person if k == 1 else truth.ideal, model, frame=k) for k in range(6)]
    found = repeats_of(names(6), scans, sensor, STATED)
    assert [one.counts.occluded for one in found.ideals] == [0, 64, 0, 0, 0, 0]  # the person's 36 rays and those beside
    for one in found.ideals:
        block = np.isin(one.ideal.layer, range(2, 8)) & np.isin(one.ideal.point, range(40, 46))
        away = one.ideal.distance_m[block]
        if one.frame == 1:
            assert np.isnan(away).all()
        else:
            true = truth.distance_m[2:8, 40:46].ravel()
            assert (away > 0).mean() > 0.8
            np.testing.assert_allclose(away[away > 0], true[away > 0], atol=0.3)


def test_two_surfaces_of_a_beam_are_two_rows_and_alternating_ones_an_edge():
    sensor = counting(**TRUE)
    truth = room(sensor, **SMALL)
    near = changed(truth.ideal, [10], [60], distance_m=5.0)
    behind = near.take((near.layer == 10) & (near.point == 60))
    both = replace(
        truth.ideal,
        **{
            name: np.concatenate([getattr(near, name), getattr(behind, name)])
            for name in ("layer", "point", "material_id", "incidence_deg")
        },
        distance_m=np.concatenate([near.distance_m, behind.distance_m + 3.0]),
    )
    model = Model(sensor, MATERIALS)
    at = changed(both, [12], [80], distance_m=6.0)
    scans = [simulate(at if k % 3 == 0 else both, model, frame=k) for k in range(6)]
    found = repeats_of(names(6), scans, sensor, STATED)
    ideal = found.ideals[-1].ideal
    own = (ideal.layer == 10) & (ideal.point == 60)
    np.testing.assert_allclose(ideal.distance_m[own], [5.0, 8.0], atol=0.1)
    assert (ideal.share == 1.0).all()
    alone = (ideal.layer == 12) & (ideal.point == 80)
    assert alone.sum() == 1
    assert ideal.distance_m[alone] == pytest.approx(truth.distance_m[12, 80], abs=0.2)
    assert ideal.extra["Edge"][alone] == 1


def test_a_column_without_an_echo_was_not_fired():
    sensor = counting(**TRUE)
    truth = room(sensor, **SMALL)
    scans = frames(sensor, truth, 4)
    lost = scans[1].take(~np.isin(scans[1].point, [30, 31]))
    found = repeats_of(names(4), [scans[0], lost, *scans[2:]], sensor, STATED)
    first, second = found.ideals[0].ideal, found.ideals[1].ideal
    assert np.isin([30, 31], first.point).all()
    assert not np.isin([30, 31], second.point).any()
    assert found.ideals[1].counts.rays == found.ideals[0].counts.rays - 2 * SMALL["layers"]
