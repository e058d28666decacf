"""Scans of a sensor whose echoes bring their directions, and ideal scans cast along them; and where Point 0 looks."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats import load_ideal, load_scan, save_ideal
from lidarcheck.scenes import Scene, SceneObject
from lidarcheck.scenes.facets import placed, wall
from lidarcheck.sensor import sensor_of, shipped

LIVOX = shipped("Livox")
ECHOES = [
    # x, y, z, line, time [ns]; the third and fourth are two returns of one firing.
    (10.0, 1.0, 0.5, 0, 1000),
    (12.0, -3.0, 1.5, 1, 1000),
    (5.0, 2.0, -0.5, 0, 3000),
    (20.0, 8.0, -2.0, 0, 3000),
    (9.0, 0.0, 0.0, 1, 2000),
    (7.0, 4.0, 2.0, 3, 9000),
]


def write(place, head, rows):
    place.write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    return place


def test_a_beam_is_a_line_and_a_moment(tmp_path):
    scan = load_scan(write(tmp_path / "a.csv", "x,y,z,line,offset_time", ECHOES), sensor=LIVOX)
    assert scan.layer.tolist() == [0, 1, 0, 0, 1, 3]
    assert scan.point.tolist() == [0, 0, 1, 1, 1, 0]
    assert scan.echo_number.tolist() == [1, 1, 1, 2, 1, 1]
    beams = scan.beams
    assert not beams.lattice
    layer, point = beams.every()
    assert list(zip(layer.tolist(), point.tolist(), strict=True)) == [(0, 0), (0, 1), (1, 0), (1, 1), (3, 0)]
    # Each looks at its own echoes, and along them ranges lead back.
    xyz = np.array([row[:3] for row in ECHOES])
    along = beams.positions_m(scan.layer, scan.point, np.linalg.norm(xyz, axis=1))
    assert np.abs(along - xyz).max() < 1e-12
    assert beams.fire_time_s([0, 0, 1, 3], [0, 1, 1, 0]).tolist() == pytest.approx([1e-6, 3e-6, 2e-6, 9e-6])


def test_without_a_time_every_row_is_a_beam_and_without_a_line_there_is_one(tmp_path):
    rows = [row[:3] for row in ECHOES]
    scan = load_scan(write(tmp_path / "a.csv", "x,y,z", rows), sensor=LIVOX)
    assert not scan.layer.any()
    assert scan.point.tolist() == [0, 1, 2, 3, 4, 5]
    numbered = [(*row, 4, 7 - i) for i, row in enumerate(rows)]
    scan = load_scan(write(tmp_path / "b.csv", "x,y,z,Layer,Point", numbered), sensor=LIVOX)
    assert set(scan.layer) == {4}
    assert scan.point.tolist() == [7, 6, 5, 4, 3, 2]


def ideal_along(scan):
    face = placed(wall(8.0, 8.0, 2), (9.5, 0.0, 0.0))
    scene = Scene((SceneObject(face.triangles_m, face.material_id, 1),))
    return scene.ideal(replace(LIVOX, beams=scan.beams))


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_ideal_scan_keeps_the_directions_of_all_its_rays(tmp_path, suffix):
    scan = load_scan(write(tmp_path / "a.csv", "x,y,z,line,offset_time", ECHOES), sensor=LIVOX)
    ideal = ideal_along(scan)
    assert (ideal.distance_m == 0.0).any()
    assert (ideal.distance_m > 0.0).any()
    save_ideal(ideal, tmp_path / f"i{suffix}")
    again = load_ideal(tmp_path / f"i{suffix}", LIVOX)
    assert np.array_equal(again.layer, ideal.layer)
    assert np.array_equal(again.point, ideal.point)
    assert np.array_equal(again.distance_m, ideal.distance_m)
    apart = again.beams.directions(again.layer, again.point) - scan.beams.directions(ideal.layer, ideal.point)
    assert np.abs(apart).max() < 1e-12


@pytest.mark.parametrize(
    ("head", "row", "says"),
    [
        ("Layer,Point,Distance,MaterialID,IncidenceAngle", "0,1,5,1,0", "no beams of its own, and X, Y, Z are missing"),
        ("Layer,Point,Distance,MaterialID,X,Y,Z", "0,1,0,1,0,0,0", "a.csv:3: X, Y, Z name no direction"),
    ],
)
def test_rays_without_a_direction_are_refused(tmp_path, head, row, says):
    good = row if "X" not in head else "0,0,5,1,5,0,0"
    (tmp_path / "a.csv").write_text(f"{head}\n{good}\n{row}\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_ideal(tmp_path / "a.csv", LIVOX)
    (line,) = caught.value.lines()
    assert says in line


def test_point_0_looks_where_the_column_says_whatever_its_channels_are_turned_by(tmp_path):
    document = {
        "name": "loose", "detector": "linear", "frame_rate_hz": 10, "linear": {"signal_at_1m": 1e5},
        "beams": {
            "kind": "channels", "elevation_deg": [-3.0, 4.0], "azimuth_offset_deg": [4.2, -1.4],
            "fire_time_us": [20.0, 0.0], "azimuth_step_deg": 0.47, "columns_repeat": False,
        },
    }  # fmt: skip
    sensor = sensor_of(document)
    face = placed(wall(90.0, 40.0, 2), (12.0, 0.0, 0.0))
    scene = Scene((SceneObject(face.triangles_m, face.material_id, 1),))
    ideal = scene.ideal(sensor, frame=3)
    for drop in ((), ("Azimuth0",), ("X", "Y", "Z")):
        extra = {name: column for name, column in ideal.extra.items() if name not in drop}
        save_ideal(replace(ideal, extra=extra), tmp_path / "i.parquet")
        again = load_ideal(tmp_path / "i.parquet", sensor)
        apart = again.beams.directions(ideal.layer, ideal.point) - ideal.beams.directions(ideal.layer, ideal.point)
        assert np.abs(apart).max() < 1e-9
