"""What a run has found in the place of what a file says: what changes, as one edit, and what is refused."""

import pytest

from lidarcheck.calibration.blooming.lut_edit import set_rows
from lidarcheck.errors import UsageError
from lidarcheck.formats.lut import load_lut, save_lut
from lidarcheck.model import load_model
from lidarcheck.model.files.write import write_model
from lidarcheck.session.edited_lut import EditedLut
from lidarcheck.session.edited_model import EditedModel
from lidarcheck.session.own_files import content_hash
from lidarcheck.session.runs import Plan, RunBook
from lidarcheck.session.takeover import fitted_table, run_takeover, table_takeover
from tui_kit import LUT

MODEL = """# ours
variant = "SLIM"
[sensor]
signal_at_1m = 40000.0  # measured in May
[[effects]]
name = "blooming_vertical"
lut = "a_lut.ini"
"""


@pytest.fixture
def root(tmp_path):
    (tmp_path / "a_lut.ini").write_bytes(LUT.encode())
    (tmp_path / "SLIM.toml").write_text(MODEL)
    return tmp_path


def run_of(root, takes):
    book = RunBook(root)
    run = book.begin(Plan("bloom fit", (("bloom", "fit"),), "x", takes))
    (book.directory(run) / "out").mkdir()
    return run, book.directory(run) / "out"


def test_a_fitted_table_goes_to_the_rows_that_it_has(root):
    run, out = run_of(
        root, {"table": "a_lut.ini", "axis": "vertical", "fitted": ".lidarcheck/tui/runs/1/out/a_lut.ini"}
    )
    save_lut(set_rows(load_lut(root / "a_lut.ini"), "vertical", range(1, 6), "512"), out / "a_lut.ini")
    file = EditedLut(root / "a_lut.ini", root)
    assert [row.scaled for row in fitted_table(run, root).rows()][:7] == [429, 512, 512, 512, 512, 512, 429]
    # Edits since then: a row more, one less, and one at another value.
    file.insert("vertical", 2)
    file.remove("vertical", [1])
    file.set("vertical", [8], "300")
    before = file.content
    change = table_takeover(file, run, root)
    assert change.missing == 1
    assert [(c.row, c.scaled[1]) for c in change.diff] == [(1, 512), (3, 512), (4, 512), (5, 512), (8, 429)]
    assert change.make()
    assert [row.scaled for row in file.current.tables["vertical"].rows()][:7] == [429, 512, 429, 512, 512, 512, 429]
    assert file.undo() == "take over bloom fit, run 1"
    assert file.content == before
    file.close()


def test_only_the_rows_that_were_marked(root):
    takes = {"table": "a_lut.ini", "axis": "vertical", "rows": "2,4", "fitted": ".lidarcheck/tui/runs/1/out/a_lut.ini"}
    run, out = run_of(root, takes)
    save_lut(set_rows(load_lut(root / "a_lut.ini"), "vertical", range(1, 6), "512"), out / "a_lut.ini")
    file = EditedLut(root / "a_lut.ini", root)
    assert table_takeover(file, run, root).make()
    assert [row.scaled for row in file.current.tables["vertical"].rows()][:6] == [429, 429, 512, 429, 512, 429]
    file.undo()
    file.close()


def test_a_fitted_model_keeps_the_text_and_its_names(root):
    fitted = load_model(root / "SLIM.toml").with_sensor(signal_at_1m=41234.5)
    takes = {"model": "SLIM.toml", "fitted": ".lidarcheck/tui/runs/1/out/model.toml"}
    takes["before"] = content_hash(MODEL.encode())
    run, out = run_of(root, takes)
    write_model(root / "SLIM.toml", fitted, out / "model.toml")
    file = EditedModel(root / "SLIM.toml", root)
    change = run_takeover(file, run, root)
    assert [(c.before, c.after) for c in change.diff] == [
        ("signal_at_1m = 40000.0  # measured in May", "signal_at_1m = 41234.5  # measured in May")
    ]
    assert not change.rewritten
    assert change.make()
    assert file.content == MODEL.replace("40000.0", "41234.5").encode()
    with pytest.raises(UsageError, match="has changed since it was read for this"):
        run_takeover(file, run, root)
    file.undo()
    assert file.content == MODEL.encode()
    (root / "SLIM.toml").write_text(MODEL + "# more\n")
    file.reload()
    with pytest.raises(UsageError, match="has changed since it was read for this"):
        run_takeover(file, run, root)
    file.close()


def test_a_record_that_leads_out_of_the_project_is_refused(root):
    (root / "bench").mkdir()
    run, _ = run_of(root / "bench", {"table": "x", "fitted": "../a_lut.ini"})
    with pytest.raises(UsageError, match="is not in"):
        table_takeover(EditedLut(root / "a_lut.ini", root), run, root / "bench")
