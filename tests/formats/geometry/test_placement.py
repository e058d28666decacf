"""What a user declares of a file: its unit, a mirrored axis, a pose; on the command line and in a case."""

from pathlib import Path

import numpy as np
import pytest

from geometry_kit import moved, positions, right_table
from lidarcheck import read_scan
from lidarcheck.cli import main
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats import load_scan
from lidarcheck.formats.geometry import Placement, parse_pose
from lidarcheck.formats.geometry.placement import rotation
from lidarcheck.formats.recognise import read_table, write_table
from lidarcheck.formats.scans import scan_from_table
from lidarcheck.formats.table import Table

TURN = rotation(1.0, -2.0, 30.0)
MOVE = np.array([0.5, -0.2, 1.6])
POSE = (0.5, -0.2, 1.6, 1.0, -2.0, 30.0)


def test_a_pose_takes_the_files_frame_into_the_sensors() -> None:
    table = right_table()
    file = moved(table, (positions(table) - MOVE) @ TURN)
    scan = scan_from_table(file, Placement(pose=POSE))
    assert np.allclose(np.stack([scan.x_m, scan.y_m, scan.z_m], axis=-1), positions(table), atol=2e-4)


def test_the_unit_comes_first_then_the_mirror_then_the_pose() -> None:
    table = right_table()
    file = moved(table, ((positions(table) - MOVE) @ TURN) * [1.0, -1.0, 1.0] / 0.0254, decimals=3)
    scan = scan_from_table(file, Placement("in", "y", POSE))
    assert scan.geometry.verdict == "ok"
    assert np.allclose(scan.y_m, table.columns["Y"], atol=1e-3)


def test_rotation_is_yaw_after_pitch_after_roll() -> None:
    assert np.allclose(rotation(0, 0, 90) @ [1, 0, 0], [0, 1, 0])
    assert np.allclose(rotation(0, 90, 0) @ [1, 0, 0], [0, 0, -1])
    assert np.allclose(rotation(90, 0, 0) @ [0, 1, 0], [0, 0, 1])
    assert np.allclose(rotation(90, 90, 0), rotation(0, 90, 0) @ rotation(90, 0, 0))


def test_a_range_in_the_unit_of_x_y_z_is_converted_with_them() -> None:
    table = right_table()
    ranges = np.linalg.norm(positions(table), axis=1)
    file = moved(table, positions(table) * 1000.0, decimals=1).with_column("RANGE", ranges * 1000.0)
    assert np.allclose(scan_from_table(file, Placement("mm")).extra["RANGE"], ranges)
    metres = file.with_column("RANGE", ranges)
    assert np.array_equal(scan_from_table(metres, Placement("mm")).extra["RANGE"], ranges)
    only = Table({"Layer": table.columns["Layer"], "Point": table.columns["Point"], "RANGE": ranges * 1000.0})
    assert np.allclose(scan_from_table(only, Placement("mm")).range_m, ranges)
    with pytest.raises(InputError, match="a mirror is declared of a file without X, Y, Z"):
        scan_from_table(only, Placement(mirror="y"))


@pytest.mark.parametrize("text", ["1,2,3", "a,b,c,d,e,f", "1,2,3,4,5,nan", "0,0,0,0,0,361", "1e9,0,0,0,0,0"])
def test_a_pose_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(UsageError):
        parse_pose(text)


def test_a_wrong_declaration_is_named_as_such(tmp_path: Path) -> None:
    write_table(right_table(), tmp_path / "right.txt")
    with pytest.raises(InputError, match=r"with y mirrored as declared, .* as they are in the file, they do; declare"):
        load_scan(tmp_path / "right.txt", Placement(mirror="y"))


def test_the_python_interface_declares_the_same(tmp_path: Path) -> None:
    table = right_table()
    write_table(moved(table, positions(table) * [1, -1, 1]), tmp_path / "wrong.txt")
    assert read_scan(tmp_path / "wrong.txt", mirror="y").geometry.verdict == "ok"
    with pytest.raises(InputError, match="Y is mirrored"):
        read_scan(tmp_path / "wrong.txt")


def test_convert_writes_what_is_declared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = right_table()
    write_table(moved(table, positions(table) * [1, -1, 1]), tmp_path / "wrong.txt")
    names = [str(tmp_path / "wrong.txt"), str(tmp_path / "right.pcd")]
    assert main(["convert", *names]) == 2
    assert "give --mirror y" in capsys.readouterr().err
    assert main(["convert", *names, "--mirror", "y"]) == 0
    assert np.array_equal(read_table(names[1]).columns["Y"], table.columns["Y"])
    assert main(["info", names[1]]) == 0
    assert "geometry         checked: 100.0 % of 3000 judged rows" in capsys.readouterr().out


def test_commands_read_measured_scans_as_declared_and_simulated_ones_as_they_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = right_table()
    write_table(moved(table, positions(table) * [1, -1, 1]), tmp_path / "wrong.txt")
    write_table(table, tmp_path / "right.txt")
    wrong, right = (str(tmp_path / name) for name in ("wrong.txt", "right.txt"))
    assert main(["compare", wrong, right, "--quiet"]) == 2
    assert main(["compare", wrong, right, "--mirror", "y", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["compare", right, wrong, "--mirror", "y", "--quiet"]) == 2
    assert main(["compare", right, right, "--pose=-1,0,0,0,0", "--quiet"]) == 2
    assert "is not six numbers" in capsys.readouterr().err


def test_every_command_that_reads_measured_scans_takes_the_options(capsys: pytest.CaptureFixture[str]) -> None:
    commands = ("compare", "convert", "info", "bloom show", "bloom fit", "ghosts find", "ghosts fit", "panels",
                "scenes compare", "vehicles compare", "vehicles merge")  # fmt: skip
    for command in commands:
        main([*command.split(), "--help"])
        shown = capsys.readouterr().out
        assert all(option in shown for option in ("--mirror", "--unit", "--pose")), command
