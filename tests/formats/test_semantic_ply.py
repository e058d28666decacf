"""The driving simulator's semantic LiDAR as an ideal scan."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.errors import InputError
from lidarcheck.formats import load_ideal
from lidarcheck.formats.ideals import ideal_from_table
from lidarcheck.formats.ply import write_ply
from lidarcheck.formats.semantic_ply import ideal_table, is_semantic, read_semantic_ply
from lidarcheck.formats.table import Table
from reference_grid import beam_directions

HEAD = """ply
format ascii 1.0
element vertex {count}
property float32 x
property float32 y
property float32 z
property float32 CosAngle
property uint32 ObjIdx
property uint32 ObjTag
end_header
"""


def _file(path: Path, rows: list[str]) -> Path:
    path.write_text(HEAD.format(count=len(rows)) + "\n".join(rows) + "\n")
    return path


def _row(layer: int, point: int, range_m: float, cosine: float = 1.0, index: int = 0, tag: int = 1) -> str:
    """A hit on a beam, in the simulator's left-handed axes."""
    x, y, z = beam_directions(layer, point) * range_m
    return f"{x:.6f} {-y:.6f} {z:.6f} {cosine:.4f} {index} {tag}"


def test_a_point_becomes_the_beam_that_sees_it(tmp_path: Path) -> None:
    rows = [_row(100, 200, 12.5, 0.5, 7, 14), _row(100, 900, 30.0, 1.0, 0, 3)]
    table = read_semantic_ply(_file(tmp_path / "a.ply", rows))
    assert table.names == ("Layer", "Point", "Distance", "MaterialID", "IncidenceAngle", "ObjectID")
    ideal = ideal_from_table(table)
    assert ideal.layer.tolist() == [100, 100]
    assert ideal.point.tolist() == [200, 900]
    np.testing.assert_allclose(ideal.distance_m, [12.5, 30.0], atol=1e-5)
    np.testing.assert_allclose(ideal.incidence_deg, [60.0, 0.0], atol=1e-5)
    assert ideal.material_id.tolist() == [14, 3]
    assert ideal.object_id is not None
    assert ideal.object_id.tolist() == [7, 0]


def test_right_of_the_simulator_is_right_of_the_sensor(tmp_path: Path) -> None:
    """Positive y is to the right there; azimuth, and with it Point, grows to the left here."""
    table = read_semantic_ply(_file(tmp_path / "a.ply", ["10 5 0 1 0 1"]))
    assert table.columns["Point"][0] < 480


def test_every_beam_of_the_grid_finds_itself() -> None:
    layer, point = (grid.ravel() for grid in np.meshgrid(np.arange(520), np.arange(960), indexing="ij"))
    xyz = beam_directions(layer, point) * 50.0
    ones = np.ones(len(layer))
    columns = {"x": xyz[:, 0], "y": -xyz[:, 1], "z": xyz[:, 2], "CosAngle": ones, "ObjIdx": ones, "ObjTag": ones}
    table = ideal_table(Table(columns))
    assert len(table) == 520 * 960
    assert np.array_equal(table.columns["Layer"], layer)
    assert np.array_equal(table.columns["Point"], point)
    np.testing.assert_allclose(table.columns["Distance"], 50.0, rtol=1e-12)


def test_sub_beams_stay_and_missing_beams_are_added(tmp_path: Path) -> None:
    """Layers 10 and 12 and points 5 and 9 hit something: their other crossings met nothing; the rest is not known."""
    rows = [_row(10, 9, 20.0, tag=4), _row(10, 5, 20.0), _row(10, 5, 60.0, tag=2), _row(12, 5, 7.0)]
    table = read_semantic_ply(_file(tmp_path / "a.ply", rows))
    found = list(zip(*(table.columns[name].tolist() for name in ("Layer", "Point", "MaterialID")), strict=True))
    assert found == [(10, 5, 1), (10, 5, 2), (10, 9, 4), (12, 5, 1), (12, 9, 0)]
    np.testing.assert_allclose(table.columns["Distance"], [20, 60, 20, 7, 0], atol=1e-4)


def test_what_lies_outside_is_dropped_and_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rows = [
        _row(10, 5, 20.0),
        _row(10, 6, 301.0),
        "0 0 0 1 0 1",
        "-5 0 0 1 0 1",
        "5 0 50 1 0 1",
        f"{np.cos(np.deg2rad(60.05)):.6f} {np.sin(np.deg2rad(60.05)):.6f} 0 1 0 1",
    ]
    with caplog.at_level(logging.WARNING):
        table = read_semantic_ply(_file(tmp_path / "a.ply", rows))
    assert table.columns["Point"].tolist() == [5]
    assert "dropped 3 of 6 points outside the field of view" in caplog.text
    assert "dropped 2 of 6 points at 0 m or beyond 300 m" in caplog.text


def test_cosines_at_and_beyond_their_ends(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rows = [_row(10, 5, 20.0, 1.0001), _row(10, 6, 20.0, -0.0), _row(10, 7, 20.0, -0.5)]
    table = read_semantic_ply(_file(tmp_path / "a.ply", rows))
    np.testing.assert_allclose(table.columns["IncidenceAngle"], [0, 90, 90])
    assert "1 points with a negative CosAngle" in caplog.text


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (["10 0 0 1.5 0 1"], "row 1: CosAngle is 1.5; it must lie in -1 ... 1"),
        (["10 0 0 1 0 1", "10 0 0 1 4000000000 1"], "row 2: ObjIdx is 4e+09"),
        (["10 0 0 nan 0 1"], "row 1: CosAngle is nan; it must lie in -1 ... 1"),
        (["10 0 0 1 0 -1"], ":11: 'ObjTag' is -1, not a whole number from 0"),
        (["-10 0 0 1 0 1"], "none of the 1 points lies on a beam within 300 m"),
    ],
)
def test_faults(rows: list[str], said: str, tmp_path: Path) -> None:
    path = _file(tmp_path / "a.ply", rows)
    with pytest.raises(InputError) as caught:
        read_semantic_ply(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)


def test_other_plys_are_told_apart(tmp_path: Path) -> None:
    columns = {name: np.ones(2) for name in ("X", "Y", "Z", "Layer", "Point")}
    write_ply(Table(columns), tmp_path / "a.ply")
    assert not is_semantic(Table(columns))
    with pytest.raises(InputError, match="no column CosAngle, ObjIdx, ObjTag"):
        read_semantic_ply(tmp_path / "a.ply")


def test_load_ideal_converts_it(tmp_path: Path) -> None:
    ideal = load_ideal(_file(tmp_path / "a.ply", [_row(100, 200, 12.5, 0.5, 7, 14)]))
    assert ideal.material_id.tolist() == [14]


def test_an_unknown_column_is_dropped_and_said(caplog: pytest.LogCaptureFixture) -> None:
    columns = dict.fromkeys(("x", "CosAngle", "ObjIdx", "ObjTag", "weather"), np.ones(1)) | dict.fromkeys(
        "yz", np.zeros(1)
    )
    assert "weather" not in ideal_table(Table(columns)).names
    assert "dropped: weather" in caplog.text
