"""The beams of a sensor are found again in its scans, and nothing is guessed where they do not show."""

import re
from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.errors import UsageError
from lidarcheck.formats.assign.bins import bin_columns
from lidarcheck.formats.geometry.placement import rotation
from lidarcheck.formats.guess import Guess, check_scan, clouds_of, document_of, guess_beams
from lidarcheck.formats.guess.elevations import clusters
from lidarcheck.formats.guess.ranges import range_step_m
from lidarcheck.formats.recognise import read_table
from lidarcheck.formats.sensors import document_text, sensor_of_import
from lidarcheck.formats.table import Table
from places import shared_path
from sensor_beams import HDL32, OUSTER, VLP16, Channels, Shot, shoot

FIRED = replace(OUSTER, fire_us=2.7 * np.arange(32), fire_turns=False, first=90.0)


def table(shot: Shot, **columns: np.ndarray) -> Table:
    return Table({**dict(zip("XYZ", shot.position.T, strict=True)), **columns})


def guessed(*tables: Table, **given: str) -> Guess:
    return guess_beams([cloud for one in tables for cloud in clouds_of(one, **given)])


@pytest.mark.parametrize("beams", [VLP16, FIRED, HDL32, replace(FIRED, step=-FIRED.step)])
def test_a_scan_with_layer_and_point_shows_all_of_its_beams(beams: Channels) -> None:
    shot = shoot(beams, every=3, keep=0.9)
    found = guessed(table(shot, Layer=shot.layer, Point=shot.point, RANGE=shot.range_m))
    assert np.allclose(found.rings.elevation_deg, beams.elevation, atol=2e-3)
    assert found.columns.step_deg == pytest.approx(abs(beams.step), rel=1e-5)
    assert found.sense == np.sign(beams.step)
    assert found.repeats == beams.repeats
    assert (found.forward_m, found.up_m) == pytest.approx((beams.origin, beams.height), abs=1e-3)
    assert found.range_offset_m == pytest.approx(beams.range_offset, abs=1e-3)
    assert found.range_step_m == 0.004
    _, azimuth = beams.angles_deg(np.arange(beams.layers), 0)
    off = azimuth - found.beside.first_deg - found.beside.offset_deg
    assert np.max(np.abs((off + 180.0) % 360.0 - 180.0)) < 5e-3


def test_what_is_guessed_is_a_sensor_file_that_its_scan_fits() -> None:
    shot = shoot(FIRED, every=2, keep=0.9)
    imported = document_of(guessed(table(shot, Layer=shot.layer, Point=shot.point)), "scan.pcd", 10.0)
    sensor = sensor_of_import(imported, "guess.toml")
    off = sensor.beams.positions_m(shot.layer, shot.point, shot.range_m - FIRED.range_offset) - shot.position
    assert np.max(np.linalg.norm(off, axis=1) / shot.range_m) < 1e-3
    text = document_text(imported)
    assert "frame_rate_hz = 10.0" in text
    assert "# signal_at_1m" in text


@pytest.mark.parametrize("beams", [VLP16, HDL32, replace(FIRED, first=0.0)])
def test_ring_and_time_show_fire_times_and_the_rate(beams: Channels) -> None:
    shot = shoot(beams, keep=0.9)
    time = np.rint(shot.time_s * 1e9).astype(np.uint32)
    found = guessed(table(shot, ring=shot.layer, t=time))
    assert (found.turning.unit, found.turning.zero) == ("ns", "first")
    assert found.turning.rate_hz == 10.0
    assert found.sense == np.sign(beams.step)
    assert np.allclose(found.beside.fire_us, np.broadcast_to(beams.fire_us, beams.layers), atol=0.05)
    assert found.repeats == beams.repeats
    # The azimuth as it was seen holds what the head turned until the ring fired.
    turned = beams.angles_deg(np.arange(beams.layers), 0)[1] - beams.first
    off = found.beside.offset_deg - turned
    assert np.ptp(off) < 0.01


def test_frames_tell_whether_columns_repeat() -> None:
    shots = [shoot(replace(VLP16, phase=phase), every=1, keep=0.9, seed=k) for k, phase in enumerate((0.0, 0.07))]
    tables = [table(shot, ring=shot.layer) for shot in shots]
    assert guessed(*tables).repeats is False
    assert guessed(tables[0], tables[0]).repeats is True


@pytest.mark.parametrize(
    "beams", [VLP16, HDL32, replace(VLP16, elevation=VLP16.elevation**3 / 225.0 + 0.3 * VLP16.elevation)]
)
def test_x_y_z_alone_show_elevations_columns_and_sense(beams: Channels) -> None:
    shot = shoot(beams, keep=0.9)
    found = guessed(table(shot))
    assert found.told == "elevations"
    assert np.allclose(found.rings.elevation_deg, np.sort(beams.elevation), atol=1e-3)
    assert found.columns.step_deg == pytest.approx(abs(beams.step), rel=1e-5)
    assert (found.sense, found.repeats) == (np.sign(beams.step), beams.repeats)


def test_x_y_z_alone_of_beams_that_start_beside_the_axis() -> None:
    found = guessed(table(shoot(OUSTER, every=2)))
    assert np.allclose(found.rings.elevation_deg, np.sort(OUSTER.elevation), atol=0.02)
    assert (found.forward_m, found.up_m) == pytest.approx((OUSTER.origin, OUSTER.height), abs=2e-3)


def kitti() -> tuple[Channels, np.ndarray]:
    """Rows as KITTI has them: ring after ring, each from ahead once around to the left, and no ring number."""
    beams = replace(VLP16, elevation=np.r_[np.linspace(2.0, -8.33, 32), np.linspace(-8.83, -24.33, 32)], fire_us=0.0)
    beams = replace(beams, step=0.1728, points=2083, first=0.05, repeats=False)
    shot = shoot(beams, every=1, keep=0.6)
    order = np.lexsort((shot.point, shot.layer))
    return beams, np.column_stack([shot.position[order], np.full(len(order), 0.3)]).astype(np.float32)


def test_kitti_s_rows_give_64_elevations() -> None:
    beams, rows = kitti()
    found = guessed(Table(bin_columns(rows)))
    assert found.told == "order of rows"
    assert len(found.rings.number) == 64
    assert np.allclose(found.rings.elevation_deg, beams.elevation, atol=1e-3)
    assert (found.sense, found.columns.step_deg) == (1, pytest.approx(0.1728, rel=1e-5))


def test_nuscenes_rows_give_32_elevations_with_x_to_the_right() -> None:
    beams = replace(HDL32, first=90.0)
    shot = shoot(beams.with_phase(12.0), every=1, keep=0.7)
    # Their frame has X to the right and Y ahead: a quarter turn, which is the first azimuth's.
    position = shot.position @ rotation(0.0, 0.0, 90.0).T
    rows = np.column_stack([position, np.zeros(len(position)), shot.layer]).astype(np.float32)
    found = guessed(Table(bin_columns(rows)))
    assert found.told == "ring"
    assert np.allclose(found.rings.elevation_deg, HDL32.elevation, atol=1e-3)
    assert (found.sense, found.repeats) == (-1, False)
    assert found.columns.step_deg == pytest.approx(0.165888, rel=1e-5)


def test_rings_with_few_rows_or_a_wide_spread_are_left_out_and_named() -> None:
    shot = shoot(VLP16, every=4)
    rng = np.random.default_rng(0)
    kept = (shot.layer != 3) | (rng.random(len(shot.layer)) < 40 / 450)
    position = shot.position.copy()
    wide = shot.layer == 9
    position[wide, 2] += rng.normal(0.0, 0.2, np.count_nonzero(wide))
    columns = dict(zip("XYZ", position[kept].T, strict=True))
    found = guessed(Table({**columns, "ring": shot.layer[kept]}))
    assert sorted(found.others.number.tolist()) == [3, 9]
    assert "no guess of ring 3, 9: " in " ".join(found.notes)
    beams = document_of(found, "x", 10.0).document["beams"]
    assert beams["ring"] == [k for k in range(16) if k not in (3, 9)]
    assert len(beams["elevation_deg"]) == 14


def test_what_shows_no_beams_is_refused_in_one_line() -> None:
    shot = shoot(VLP16, every=4)
    rng = np.random.default_rng(0)
    cloud = rng.normal(0.0, 5.0, (5000, 3))
    none = Table(dict(zip("XYZ", cloud.T, strict=True)))
    with pytest.raises(UsageError, match="rows lie at all of them"):
        guessed(none)
    with pytest.raises(UsageError, match="40 rows without a column of the rings are too few"):
        guessed(Table(dict(zip("XYZ", cloud[:40].T, strict=True))))
    with pytest.raises(UsageError, match="no ring has the 50 rows"):
        guessed(table(shoot(VLP16, every=60), ring=shoot(VLP16, every=60).layer))
    with pytest.raises(UsageError, match="not in m: the ranges fit in cm or mm"):
        guessed(table(replace(shot, position=shot.position * 1000.0), ring=shot.layer))
    moved = shot.position + np.array([3.0, 1.0, -1.0])
    with pytest.raises(UsageError, match="a moved or deskewed cloud"):
        guessed(table(replace(shot, position=moved), ring=shot.layer))


def test_clusters_are_found_under_noise_and_not_in_an_even_spread() -> None:
    rng = np.random.default_rng(3)
    centres = np.cumsum(rng.uniform(0.3, 2.0, 40)) - 20.0
    ring = rng.integers(0, 40, 20_000)
    label = clusters(centres[ring] + rng.normal(0.0, 0.015, len(ring)))
    assert label is not None
    assert np.mean(label == ring) > 0.999
    assert clusters(rng.uniform(-15.0, 15.0, 20_000)) is None


@pytest.mark.parametrize("step", [0.001, 0.002, 0.004, 0.008, 0.01])
def test_the_range_step_is_found_beside_any_offset(step: float) -> None:
    ranges = np.round(np.random.default_rng(1).uniform(1.0, 60.0, 5000) / step) * step + 0.0271
    assert range_step_m(ranges) == step
    assert range_step_m(np.random.default_rng(1).uniform(1.0, 60.0, 5000)) is None


def test_the_vlp32_points_show_the_32_elevations_of_its_calibration() -> None:
    text = shared_path("data/calibrations/velodyne_VeloView-VLP-32C.yaml").read_text(encoding="utf-8")
    elevation, azimuth = (
        np.rad2deg([float(value) for value in re.findall(rf"{key}: ([-0-9.e]+)", text)])
        for key in ("vert_correction", "rot_correction")
    )
    found = guessed(read_table(shared_path("data/bags/vlp32_points.pcd")))
    order = np.argsort(elevation)
    assert found.told == "elevations"
    assert np.allclose(found.rings.elevation_deg, elevation[order], atol=1e-3)
    # The cloud has them with the fire time: within a column.
    assert np.max(np.abs(found.beside.offset_deg - azimuth[order])) < 0.14
    assert (found.sense, found.range_step_m) == (-1, 0.004)


def test_an_xt32_shows_its_calibration_and_an_os0_where_its_beams_start() -> None:
    rows = shared_path("data/calibrations/hesai_PandarXT32.csv").read_text(encoding="utf-8").split()[1:33]
    elevation, azimuth = np.array([[float(cell) for cell in row.split(",")[1:]] for row in rows]).T
    found = guessed(read_table(shared_path("data/hesai_xt32/rotation_0.parquet")))
    assert np.allclose(found.rings.elevation_deg, elevation, atol=1e-5)
    assert np.allclose(found.beside.offset_deg, -azimuth, atol=1e-4)
    assert (found.beside.first_deg, round(found.columns.columns, 4), found.range_step_m) == (90.0, 2000.0, 0.004)
    scans = [read_table(shared_path(f"data/ouster_os0_128/scan_{k}.parquet")) for k in (0, 1)]
    found = guessed(*scans)
    assert (found.forward_m, found.up_m, found.range_offset_m) == pytest.approx(
        (0.027116, 0.038195, 0.027116), abs=2e-4
    )
    assert (round(found.columns.columns, 3), found.repeats, found.beside.first_deg) == (1024.0, True, -180.0)
    # Nothing stands above Layer 16: those are supposed to lie in line with the others, and layers keep their numbers.
    sensor = sensor_of_import(document_of(found, "os0", 10.0), "os0.toml")
    (cloud,) = clouds_of(scans[0], ring="Layer")
    assert (check_scan(cloud, sensor).verdict, check_scan(cloud, sensor).by) == ("fits", "ring and column")
    assert check_scan(clouds_of(scans[0])[0], sensor).by == "Layer and Point"


@pytest.mark.parametrize("name", ["hdl32e", "os1_128", "xt32"])
def test_reference_frames_show_their_sensor_s_beams(name: str) -> None:
    from lidarcheck.model.files.sensor_file import load_sensor

    sensor = load_sensor(shared_path(f"data/reference_frames_any/{name}/sensor.toml"))
    found = guessed(read_table(shared_path(f"data/reference_frames_any/{name}/echoes.csv")))
    elevation = sensor.beams.angles_deg(found.rings.number, 0)[0]
    assert np.allclose(found.rings.elevation_deg, elevation, atol=1e-3)
    assert found.columns.step_deg == pytest.approx(abs(sensor.beams.step_deg), rel=1e-5)
    assert found.repeats == sensor.beams.repeats
    assert found.range_step_m == sensor.range_resolution_m
