"""A model's file being edited: its text as a whole, undo, the journal, and what is no model."""

import pytest

from lidarcheck.errors import ConfigError, LidarcheckError
from lidarcheck.model import load_model
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.edited_model import EditedModel
from lidarcheck.session.session import Session
from tui_kit import LUT

TEXT = """# ours
variant = "SLIM"  # the long one

[sensor]
signal_at_1m = 40000.0

[[effects]]
name = "blooming_vertical"
lut = "a_lut.ini"
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "SLIM.toml"
    path.write_text(TEXT)
    (tmp_path / "a_lut.ini").write_bytes(LUT.encode())
    return path


@pytest.fixture
def file(model):
    file = EditedModel(model, model.parent)
    yield file
    file.close()


def test_a_text_is_taken_as_one_edit_and_back(file, model):
    new = TEXT.replace("40000.0", "41234.5").replace("# ours\n", "") + "\n# the end\n"
    assert file.take(new.encode(), "calibrate")
    assert [(c.number, c.before, c.after) for c in file.diff()] == [
        (1, "# ours", None), (4, "signal_at_1m = 40000.0", "signal_at_1m = 41234.5"),
        (9, None, ""), (10, None, "# the end"),
    ]  # fmt: skip
    assert not file.take(new.encode(), "calibrate")
    session = Session()
    session.hold(file)
    assert load_model(model).sensor.signal_at_1m == 40000.0
    assert session.inputs().edited == {str(model): new.encode()}
    assert file.undo() == "calibrate"
    assert file.content == TEXT.encode()
    assert not session.inputs().edited
    assert file.redo() == "calibrate"
    assert file.save() == 4
    assert model.read_text() == new
    assert file.undo() == "calibrate"  # also beyond a save
    assert file.content == TEXT.encode()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "SLIM.toml: the file is empty"),
        ("variant = \n", "SLIM.toml:1: not valid TOML"),
        (TEXT.replace("SLIM", "SLIMM"), "SLIM.toml:2"),
        (TEXT.replace("40000.0", "-1.0"), "SLIM.toml:5"),
        (TEXT.replace("a_lut", "b_lut"), "b_lut.ini"),
        ("\xff", "SLIM.toml:1: byte 0xFF is not UTF-8"),
    ],
)
def test_what_is_no_model_changes_nothing(file, text, words):
    with pytest.raises(LidarcheckError) as error:
        file.take(text.encode("latin-1"), "edit")
    assert words in str(error.value)
    assert not file.dirty
    assert not file.history.done


def test_a_crash_brings_the_text_back_with_its_undo(file, model):
    file.take(TEXT.replace("40000", "41000").encode(), "explain")
    file.take(TEXT.replace("40000", "42000").encode(), "calibrate")
    file._journal.close()
    file._lock.drop()
    again = EditedModel(model, model.parent)
    assert "SLIM.toml: an earlier session ended with 1 line not saved" in again.found_in_words()
    again.bring_back()
    assert b"42000" in again.content
    assert (again.undo(), again.undo()) == ("calibrate", "explain")
    assert again.content == TEXT.encode()
    again.close()


def test_a_model_that_is_at_fault_is_no_file_to_edit(model):
    model.write_text("variant = 3\n")
    with pytest.raises(ConfigError, match="variant"):
        EditedModel(model, model.parent)


def test_a_model_and_its_table_are_edited_side_by_side(file, model):
    table = EditedLut(model.parent / "a_lut.ini", model.parent)
    session = Session()
    session.hold(table)
    session.hold(file)
    table.set("vertical", [3], "500")
    assert len(session.inputs().edited) == 1
    assert file.take(TEXT.replace("40000", "41000").encode(), "fit")
    assert sorted(session.inputs().edited) == [str(model), str(table.path)]
    assert session.unsaved() == 2
    table.undo()
    table.close()
