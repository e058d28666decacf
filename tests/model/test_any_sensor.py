"""Whole frames of other sensors against an independent simulator's: read, held against beams, simulated, written."""

import numpy as np
import pytest

from lidarcheck.formats import load_ideal, load_scan, save_scan
from lidarcheck.model import load_model, simulate
from places import shared_path

FOLDER = "data/reference_frames_any"
SEEDS = 12


@pytest.fixture(scope="module", params=["hdl32e", "os1_128", "xt32"])
def frame(request):
    """The reference's echoes, and ours with several seeds, of one frame."""
    model = load_model(shared_path(f"{FOLDER}/{request.param}/model.toml"))
    ideal = load_ideal(shared_path(f"{FOLDER}/{request.param}/ideal.txt"), model.sensor)
    reference = load_scan(shared_path(f"{FOLDER}/{request.param}/echoes.csv"), sensor=model.sensor)
    return model.sensor, reference, [simulate(ideal, model, seed=seed) for seed in range(SEEDS)]


def test_the_reference_s_echoes_lie_on_their_beams(frame):
    _, reference, _ = frame
    assert reference.geometry.verdict == "ok"
    assert reference.geometry.passed == reference.geometry.judged > 5000


def test_every_direction_is_the_reference_s(frame):
    """On beams that both have an echo on, to a thousandth of a degree and the last digit of the file."""
    _, reference, ours = frame
    ranges = reference.range_m
    again = ours[0].beams.positions_m(reference.layer, reference.point, ranges)
    xyz = np.column_stack([reference.x_m, reference.y_m, reference.z_m])
    assert np.abs(again - xyz).max() < 2e-6 + np.deg2rad(1e-4) * ranges.max()


def test_as_many_echoes_and_the_same_means(frame):
    _, reference, ours = frame
    counts = np.array([len(scan) for scan in ours], dtype=float)
    assert abs(len(reference) - counts.mean()) < 4.0 * max(counts.std(ddof=1), 1.0) * np.sqrt(1.0 + 1.0 / SEEDS)
    for name in reference.feature_names:
        means = np.array([scan.feature(name).mean() for scan in ours])
        spread = max(float(means.std(ddof=1)), 1e-3)
        assert abs(reference.feature(name).mean() - means.mean()) < 4.0 * spread * np.sqrt(1.0 + 1.0 / SEEDS), name


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".pcd"])
def test_what_is_written_is_read_again(frame, suffix, tmp_path):
    sensor, _, (one, *_) = frame
    save_scan(one, tmp_path / f"echoes{suffix}", sensor)
    back = load_scan(tmp_path / f"echoes{suffix}", sensor=sensor)
    assert len(back) == len(one)  # copies that the sensor writes are told from echoes
    assert np.array_equal(back.layer, one.layer)
    assert np.array_equal(back.point, one.point)
    np.testing.assert_allclose(back.range_m, one.range_m, atol=1e-4)
    for name in one.feature_names:
        np.testing.assert_array_equal(back.feature(name), one.feature(name))


def test_a_chip_s_histograms_are_read_and_written(tmp_path):
    model = load_model(shared_path(f"{FOLDER}/tmf8820_short/model.toml"))
    ideal = load_ideal(shared_path(f"{FOLDER}/tmf8820_short/ideal_00.txt"), model.sensor)
    reference = load_scan(shared_path(f"{FOLDER}/tmf8820_short/echoes_00.csv"), sensor=model.sensor)
    ours = [simulate(ideal, model, seed=seed) for seed in range(SEEDS)]
    counts = np.stack([scan.histograms.counts for scan in ours])
    spread = np.sqrt(np.maximum(counts.mean(axis=0), 1.0) * (1.0 + 1.0 / SEEDS))
    off = (reference.histograms.counts - counts.mean(axis=0)) / spread
    assert (off**2).mean() == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / off.size))
    save_scan(ours[0], tmp_path / "echoes.csv", model.sensor)
    back = load_scan(tmp_path / "echoes.csv", sensor=model.sensor)
    assert np.array_equal(back.histograms.counts, ours[0].histograms.counts)
