"""What is in a project's directory, and what is wrong there."""

import os
from pathlib import Path

import pytest

from lidarcheck.errors import InputError
from lidarcheck.session.own_files import make_own_directory
from lidarcheck.session.project import read_project
from lidarcheck.session.state import State, save_state
from lidarcheck.tui.jobs.profiles import datasets_of
from tui_kit import make_project


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return make_project(tmp_path_factory.mktemp("tui") / "project")


def test_a_project_names_what_is_there_and_what_is_wrong(project):
    found = read_project(project)
    assert found.in_words() == "3 scenarios, 2 goldens, 3 models, 3 luts, 2 profiles, 1 scan"
    faults = {entry.name: entry.fault for entry in found.faults}
    assert set(faults) == {"scenarios/broken.toml", "bad_lut.ini", "measured/empty.txt"}
    assert "bad_lut.ini:2: number 2 of PostPro.LUT_blooming_Y is" in faults["bad_lut.ini"]
    assert "not valid TOML" in faults["scenarios/broken.toml"]
    assert "the file is empty" in faults["measured/empty.txt"]
    assert [dataset.name for dataset in datasets_of(found, "vertical")] == [
        "measured/sign_69m.csv",
        "measured/sign_157m.csv",
    ]
    assert datasets_of(found, "horizontal") == []


def test_scans_find_their_ideal_scan_by_name(tmp_path):
    head = "Layer Point Distance MaterialID IncidenceAngle\n1 1 20.0 1 0.0\n"
    for name in ("ideal_sign_69m.txt", "sign_156.6m_ideal.txt"):
        (tmp_path / name).write_text(head)
    for name in ("real_sign_69m.txt", "sign_156.6m.txt", "lonely.txt"):
        (tmp_path / name).write_text("X Y Z Point Layer EchoNumber WIDTH AREA PEAK\n1 2 3 1 1 1 5 6 7\n")
    pairs = {d.name: d.ideal and d.ideal.name for d in datasets_of(read_project(tmp_path), "vertical")}
    assert pairs == {
        "lonely.txt": None,
        "real_sign_69m.txt": "ideal_sign_69m.txt",
        "sign_156.6m.txt": "sign_156.6m_ideal.txt",
    }


def test_no_file_keeps_the_others_from_being_used(project, monkeypatch):
    (project / "models/deep.toml").write_text(f"a = {'[' * 5000}{']' * 5000}")
    (project / "models/empty.toml").write_text("")
    os.mkfifo(project / "models/pipe.toml")
    (project / "models/again.toml").symlink_to("again.toml")
    monkeypatch.setattr("lidarcheck.formats.lut.load_lut", lambda _path: 1 / 0)
    found = read_project(project)
    faults = {entry.name: entry.fault for entry in found.faults}
    assert "nested too deeply" in faults["models/deep.toml"]
    assert "is empty" in faults["models/empty.toml"]
    assert "not a regular file" in faults["models/pipe.toml"]
    assert "symbolic links" in faults["models/again.toml"]
    assert faults["a_lut.ini"] == f"{project / 'a_lut.ini'}: cannot be looked at, ZeroDivisionError: division by zero"
    assert len(found.of("model")) == 3


def test_a_directory_that_cannot_be_read_is_said(project, monkeypatch):
    scandir = os.scandir

    def refusing(path):
        if Path(path).name == "measured":
            raise PermissionError(13, "Permission denied", str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refusing)
    found = {entry.name: entry.fault for entry in read_project(project).faults}
    assert "the directory cannot be read: Permission denied; check its permissions" in found["measured"]
    assert "measured/empty.txt" not in found


def test_a_project_that_was_removed_is_not_made_again(tmp_path):
    save_state(State(screen="noise"), tmp_path / "gone")
    assert not (tmp_path / "gone").exists()
    with pytest.raises(InputError, match="cannot make the directory"):
        make_own_directory(tmp_path / "gone")


def test_no_directory_is_a_project(tmp_path):
    (tmp_path / "file").write_text("x")
    for name, what in (("file", "is not a directory"), ("none", "there is no such directory")):
        with pytest.raises(InputError, match=what):
            read_project(tmp_path / name)
