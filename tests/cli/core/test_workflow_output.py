"""What workflows print and write: all of it, or nothing."""

import errno
import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli.core.command import ARGUMENTS
from lidarcheck.cli.core.workflow_output import PLOTS, Folder, check_out_dir, finish
from lidarcheck.errors import InputError
from lidarcheck.figures.axes import KINDS, VIEWS
from lidarcheck.figures.data import Distribution, Page, Section, Table

FIGURE = Distribution("Range / residual", "residual", "m", {"real": np.arange(9.0), "simulated": np.arange(7.0)})
TABLE = Table("KPIs", ("panel", "bias"), (("one", "0.1"),), ("bias",))
PAGE = Page("Panels", "All hold.", (Section("Ranges", ("Some words.",), (TABLE,), (FIGURE,)),), {"seed": "1"})


def test_the_plots_that_can_be_asked_for_are_those_that_there_are():
    assert (*KINDS, *VIEWS, "all") == PLOTS


def test_a_result_is_printed_and_written(tmp_path, capsys):
    out, copy = tmp_path / "out", tmp_path / "copy.json"
    finish(PAGE, {"bias": np.float64(0.5), "none": float("nan")}, out=out, json=str(copy), plot="violin")
    printed = capsys.readouterr().out
    for words in ("All hold.", "Ranges", "Some words.", "panel  bias", "one     0.1", "quartiles, median"):
        assert words in printed
    written = json.loads((out / "result.json").read_text())
    assert written["workflow"] == "Panels"
    assert written["summary"] == "All hold."
    assert written["result"] == {"bias": 0.5, "none": None}
    assert written["provenance"] == {"seed": "1"}
    assert copy.read_text() == (out / "result.json").read_text()
    assert "All hold." in (out / "report.html").read_text()
    assert [path.name for path in (out / "pictures").iterdir()] == ["01-range-residual-violin.png"]


def test_the_result_says_which_command_made_it(tmp_path, capsys):
    for given, name in ((("explain", "a"), "explain"), (("--quiet", "simulate"), "simulate"), (("no",), "Panels")):
        token = ARGUMENTS.set(given)
        finish(PAGE, {}, out=None, json="-", plot=None)
        ARGUMENTS.reset(token)
        assert json.loads(capsys.readouterr().out)["workflow"] == name


def test_the_page_of_a_result_is_known_by_its_hash(tmp_path, capsys):
    finish(PAGE, {}, out=tmp_path, json=None, plot=None)
    record = json.loads((tmp_path / "result.json").read_text())["page"]
    assert record["sha256"] == hashlib.sha256((tmp_path / record["file"]).read_bytes()).hexdigest()


def test_all_kinds_are_printed_and_drawn(tmp_path, capsys):
    finish(PAGE, {}, out=tmp_path, json=None, plot="all")
    assert capsys.readouterr().out.count("Range / residual\n") == len(KINDS)
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert names == {f"01-range-residual-{kind}.png" for kind in KINDS}


def test_without_plot_no_figure_is_printed_and_without_out_nothing_is_written(tmp_path, capsys):
    finish(PAGE, {}, out=None, json="-", plot=None)
    assert json.loads(capsys.readouterr().out)["result"] == {}
    finish(PAGE, {}, out=None, json=None, plot=None)
    assert "┌" not in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def test_a_second_run_leaves_no_picture_of_the_first(tmp_path, capsys):
    (tmp_path / "pictures").mkdir()
    for name in ("07-old.png", "mine.png"):
        (tmp_path / "pictures" / name).write_bytes(b"x")
    finish(PAGE, {}, out=tmp_path, json=None, plot=None)
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == [
        "01-range-residual-histogram.png",
        "mine.png",
    ]


def test_a_fault_leaves_everything_as_it_was(tmp_path, monkeypatch, capsys):
    (tmp_path / "report.html").write_text("old")
    monkeypatch.setattr("lidarcheck.figures.html.page.page_html", lambda _page: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        finish(PAGE, {}, out=tmp_path, json=None, plot=None)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text() == "old"


class Gone:
    """An output whose reader has gone."""

    def write(self, _text):
        raise BrokenPipeError

    def isatty(self):
        return False


def test_all_is_written_before_anything_is_shown(tmp_path, monkeypatch):
    """`| head` ends a command while it prints; what it has found must be there."""
    monkeypatch.setattr("sys.stdout", Gone())
    files = {"model.toml": lambda place: place.write_text("model")}
    folders = {"panels": Folder(lambda place: (place / "panel_1_real.pcd").write_text("a"), re.compile("panel_.*"))}
    with pytest.raises(BrokenPipeError):
        finish(PAGE, {}, out=tmp_path / "out", json=None, plot=None, files=files, folders=folders)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "model.toml",
        "panels",
        "pictures",
        "report.html",
        "result.json",
    }
    assert (tmp_path / "out/panels/panel_1_real.pcd").read_text() == "a"


@pytest.mark.parametrize("before", [True, False])
def test_on_an_interrupt_the_files_of_a_workflow_are_as_they_were(tmp_path, before):
    out = tmp_path / "out"
    if before:
        (out / "panels").mkdir(parents=True)
        (out / "model.toml").write_text("old")
        (out / "panels" / "panel_1_real.pcd").write_text("old")

    def interrupted(place):
        (place / "panel_1_real.pcd").write_text("new")
        raise KeyboardInterrupt

    files = {"model.toml": lambda place: place.write_text("new"), "more.ini": lambda place: place.write_text("new")}
    folders = {"panels": Folder(interrupted, re.compile("panel_.*"))}
    with pytest.raises(KeyboardInterrupt):
        finish(PAGE, {}, out=out, json=None, plot=None, files=files, folders=folders)
    if not before:
        assert not out.exists()
        return
    assert {path.name for path in out.rglob("*")} == {"model.toml", "panels", "panel_1_real.pcd"}
    assert {path.read_text() for path in out.rglob("*") if path.is_file()} == {"old"}


def test_a_full_disk_is_said_of_the_place_that_a_picture_was_to_take(tmp_path, monkeypatch):
    def full(descriptor):
        if Path(f"/dev/fd/{descriptor}").resolve().parent.name == "pictures":
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError) as caught:
        finish(PAGE, {}, out=tmp_path / "out", json=None, plot=None)
    (line,) = caught.value.lines()
    assert line == (
        f"error: {tmp_path}/out/pictures/01-range-residual-histogram.png: cannot write: No space left on device; "
        "nothing was changed; free some space"
    )
    assert not (tmp_path / "out").exists()


def test_a_directory_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="is not a directory"):
        check_out_dir(tmp_path / "file")
    with pytest.raises(InputError, match="its directory does not exist"):
        check_out_dir(tmp_path / "a" / "b")
    (tmp_path / "report.html").mkdir()
    with pytest.raises(InputError, match="is a directory"):
        check_out_dir(tmp_path)
    (tmp_path / "report.html").rmdir()
    with pytest.raises(InputError, match="would replace another file"):
        check_out_dir(tmp_path, besides=(tmp_path / "result.json",))
    (tmp_path / "pictures").write_text("x")
    with pytest.raises(InputError, match="cannot be replaced"):
        check_out_dir(tmp_path)
    check_out_dir(tmp_path / "new")
    (tmp_path / "pictures").unlink()
    with pytest.raises(InputError, match="would replace a file of this command"):
        check_out_dir(tmp_path, besides=(tmp_path / "model.toml",), files=["model.toml"])
    (tmp_path / "model.toml").mkdir()
    with pytest.raises(InputError, match="cannot be replaced"):
        check_out_dir(tmp_path, files=["model.toml"])
