"""What all screens of pages share, on a fake whose jobs are quick: computed, stopped, late, at fault, kept, written."""

import asyncio
import threading

import pytest

from lidarcheck.cli.core.command import ARGUMENTS
from lidarcheck.cli.core.workflow_output import finish
from lidarcheck.session.own_files import content_hash
from lidarcheck.session.session import Session
from lidarcheck.session.state import load_state
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.screens.pages.lines import word_lines
from lidarcheck.tui.widgets.lines import Lines
from page_kit import FakeView, page_of, put_in
from tui_kit import apart_from_key, as_stored, drive, says, sees, text_of, until

SIZES = ((1, 1), (5, 3), (40, 10), (200, 60), (3, 40), (129, 24), (130, 24), (80, 24))


@pytest.fixture
def project(tmp_path, monkeypatch):
    put_in(monkeypatch)
    root = tmp_path / "bench"
    root.mkdir()
    for name in ("one", "two", "bad", "worse"):
        (root / f"{name}.txt").write_text(name)
    return root


def fakes(project, do, size=(80, 24)):
    """Run the app on the fake screen; `do` gets the app, its pilot and the screen."""

    async def on_fakes(app, pilot):
        await until(pilot, lambda: isinstance(app.view, FakeView))
        await do(app, pilot, app.view)

    drive(LidarcheckApp(project, screen="fake"), on_fakes, size)


async def computed(pilot, view, key="r"):
    await pilot.press(key)
    await until(pilot, lambda: view.running is None and view.state == "current", lambda: view.state)


def shown(view, pane):
    return view.query_one(f"#{pane}", Lines).text


def test_a_page_is_computed_once_and_kept(project):
    async def do(app, pilot, view):
        await sees(app, pilot, "not computed yet: r computes it")
        await computed(pilot, view)
        await says(app, pilot, "one: All is well with one.")
        await until(pilot, lambda: "1/4 one" in text_of(app) and "one, PEAK" in text_of(app))
        assert "current" in shown(view, "jobs")
        await until(pilot, lambda: "current" in text_of(app).splitlines()[7], lambda: text_of(app))
        await pilot.press("down")
        await sees(app, pilot, "what two is")
        await until(pilot, lambda: "two_b.txt: left out" in shown(view, "figures"))
        await pilot.press("up")
        await sees(app, pilot, "one, PEAK")
        await pilot.press("r")
        await says(app, pilot, "one is current: computed from what is set now")
        assert view.runs == {"one": 1}
        (project / "one.txt").write_text("measured again")
        await until(pilot, lambda: view.runs == {"one": 2} and view.state == "current")  # by itself: it takes no time
        await pilot.press("r")
        await says(app, pilot, "one is current")

    fakes(project, do)


def test_what_is_dear_stays_old_and_says_so_until_it_is_asked_for(project, monkeypatch):
    monkeypatch.setattr(Session, "is_cheap", lambda _session, _derived: False)

    async def do(app, pilot, view):
        await computed(pilot, view)
        (project / "one.txt").write_text("measured again")
        await until(pilot, lambda: view.state == "OLD, one.txt changed", lambda: view.state, seconds=2.0)
        await sees(app, pilot, "OLD, one.txt changed")
        assert view.page is not None  # it is shown, and says what it is
        await pilot.press("e")
        await sees(app, pilot, "which are OLD, one.txt")
        await pilot.press("escape")
        await computed(pilot, view)
        assert view.runs == {"one": 2}
        (project / "one.txt").write_text("one")
        await until(pilot, lambda: view.state == "current")  # the same content: the same key
        assert view.runs == {"one": 2}

    fakes(project, do)


def test_figures_are_turned_and_drawn_in_other_ways(project):
    async def do(app, pilot, view):
        await computed(pilot, view)
        for kind, words in (
            ("qq", "quantiles of real"),
            ("kde", "density"),
            ("cdf", "share below"),
            ("violin", "quart"),
        ):
            await pilot.press("v")
            await says(app, pilot, f"drawn as: {kind}")
            await sees(app, pilot, words)
        await pilot.press("v", "f", "l")
        await sees(app, pilot, "3/4 ")
        await pilot.press("f")
        await sees(app, pilot, "points: from above")
        await pilot.press("v")
        await sees(app, pilot, "points: from the side")
        await pilot.press("left", "h")
        await sees(app, pilot, "2/4 ")
        await sees(app, pilot, "one, AREA")

    fakes(project, do)


def test_words_and_tables_or_figures_and_both_where_there_is_room(project):
    async def do(app, pilot, view):
        await computed(pilot, view)
        await pilot.press("t")
        await sees(app, pilot, "All is well with one.")
        assert app.focused.id == "words"
        assert not view.board.display
        await pilot.resize_terminal(160, 50)
        await until(pilot, lambda: view.board.display)
        await sees(app, pilot, "one, PEAK")
        await sees(app, pilot, "a long column 7")
        await pilot.resize_terminal(80, 24)
        await until(pilot, lambda: not view.board.display)
        await pilot.press("t")
        await sees(app, pilot, "one, PEAK")
        assert app.focused.id == "figures"
        await pilot.resize_terminal(160, 50)
        await until(pilot, lambda: view.query_one("#words").display)
        view.query_one("#words", Lines).focus()
        await pilot.resize_terminal(80, 24)
        await until(pilot, lambda: not view.query_one("#words").display)
        await until(pilot, lambda: app.focused is not None and app.focused.display, lambda: repr(app.focused))
        await pilot.press("tab", "shift+tab", "down")

    fakes(project, do)


def test_a_fault_is_said_where_the_user_looks(project):
    async def do(app, pilot, view):
        await pilot.press("down", "down", "r")
        await says(app, pilot, "bad.txt: holds no echoes; measure again")
        await sees(app, pilot, "bad cannot be computed: bad.txt: holds no echoes; measure again")
        await until(pilot, lambda: "cannot    bad.txt: holds no echoes" in shown(view, "jobs"))
        await pilot.press("down", "r")
        await says(app, pilot, "internal error, ZeroDivisionError: by nothing")
        await sees(app, pilot, "worse cannot be computed")
        await pilot.press("end", "r")
        await says(app, pilot, "there is no model")
        await sees(app, pilot, "cannot cannot be computed: there is no model")
        await pilot.press("e")
        await says(app, pilot, "nothing is computed here yet")
        assert view.running is None

    fakes(project, do)


def test_a_computation_is_stopped_and_answers_keys_meanwhile(project):
    async def do(app, pilot, view):
        await pilot.press("x")
        await says(app, pilot, "nothing is computed")
        view.gate.clear()
        await pilot.press("r")
        await until(pilot, view.begun.is_set)
        await sees(app, pilot, "computing ...")
        await pilot.press("down", "r")
        await says(app, pilot, "one is being computed; x stops it")
        await pilot.press("ctrl+r")
        await until(pilot, lambda: app.reads == 2)
        await until(pilot, lambda: "computing" in shown(view, "jobs").splitlines()[0])
        await pilot.press("x")
        await sees(app, pilot, "one: stopping after the step that runs now")
        await pilot.press("r")
        await says(app, pilot, "one is being stopped; wait a moment")
        view.gate.set()
        await until(pilot, lambda: view.running is None)
        await says(app, pilot, "one: stopped")
        assert view.known(view.listed[0]) == ("", None)
        await computed(pilot, view)
        await says(app, pilot, "two: All is well")

    fakes(project, do)


def test_a_late_answer_after_the_end_harms_nothing(project):
    async def session():
        app = LidarcheckApp(project, screen="fake")
        async with app.run_test(size=(80, 24)) as pilot:
            await until(pilot, lambda: isinstance(app.view, FakeView))
            view = app.view
            view.gate.clear()
            await pilot.press("r")
            await until(pilot, view.begun.is_set)
            thread = view.worker
        assert thread.is_alive()
        view.gate.set()
        await asyncio.to_thread(thread.join, 60.0)
        assert not thread.is_alive()

    asyncio.run(session())
    assert load_state(project).screen == "fake"


def test_a_job_that_is_gone_when_it_is_ready(project):
    async def do(app, pilot, view):
        view.gate.clear()
        await pilot.press("r")
        await until(pilot, view.begun.is_set)
        for name in ("one", "two", "bad", "worse"):
            (project / f"{name}.txt").unlink()
        await pilot.press("ctrl+r")
        await sees(app, pilot, "no fake here")
        view.gate.set()
        await says(app, pilot, "one.txt: was changed while this was computed")
        await pilot.press("r", "down", "f", "v", "t", "e")
        await says(app, pilot, "nothing is computed here yet")

    fakes(project, do)


def test_the_export_is_what_the_command_writes(project, tmp_path, capsys):
    async def do(app, pilot, view):
        await computed(pilot, view)
        await pilot.press("v", "e")
        await sees(app, pilot, "to which directory")
        await pilot.press("enter")
        await says(app, pilot, "one_out: report.html, result.json, pictures/")
        await pilot.press("e")
        await sees(app, pilot, "to which directory")
        await pilot.press("enter")
        await sees(app, pilot, "result.json is there already")
        (project / "one_out/result.json").write_text("mine")
        while app.asking is not None:  # a question that comes by itself takes no key at first
            await pilot.press("escape")
            await pilot.pause(0.1)
        await pilot.press("e")
        await sees(app, pilot, "to which directory")
        await pilot.press("enter")
        await sees(app, pilot, "y replace it")
        assert (project / "one_out/result.json").read_text() == "mine"
        while app.asking is not None:
            await pilot.press("y")
            await pilot.pause(0.1)
        await until(pilot, lambda: not view.exports.writing)
        assert (project / "one_out/result.json").read_text() != "mine"

    fakes(project, do)
    token = ARGUMENTS.set(("vehicles", "compare"))
    finish(page_of("one"), {"echoes": 7}, out=tmp_path / "command", json=None, plot="qq")
    ARGUMENTS.reset(token)
    (mine, read), (command, _) = map(apart_from_key, (project / "one_out", tmp_path / "command"))
    assert mine == command
    assert list(read.values()) == [content_hash(b"one")]


def test_what_is_being_written_is_written_to_its_end(project, monkeypatch):
    go_on, begun, left = threading.Event(), threading.Event(), []
    monkeypatch.setattr(LidarcheckApp, "exit", lambda _app, *_, message=None: left.append(message))

    def slowly(place):
        begun.set()
        go_on.wait(60.0)
        place.write_text("done")

    monkeypatch.setattr(FakeView, "more_files", lambda *_: {"more.txt": slowly})

    async def do(app, pilot, view):
        await computed(pilot, view)
        await pilot.press("e")
        await sees(app, pilot, "to which directory")
        await pilot.press("enter")
        await until(pilot, begun.is_set)
        await pilot.press("e")
        await says(app, pilot, "one_out is being written")
        await pilot.press("q")
        await until(pilot, lambda: left == ["one_out: still being written ..."], lambda: repr(left))
        go_on.set()
        await says(app, pilot, "one_out: report.html, result.json, pictures/, more.txt")
        await pilot.press("q")
        await until(pilot, lambda: left[1:] == [None], lambda: repr(left))

    fakes(project, do)
    assert (project / "one_out/more.txt").read_text() == "done"


def test_an_export_that_cannot_be_written_says_so(project):
    (project / "file_out").write_text("x")

    async def do(app, pilot, view):
        await computed(pilot, view)
        for name, said in (
            ("file_out", "file_out: is not a directory; name a directory for the page"),
            ("a/b", "a/b: its directory does not exist"),
        ):
            await pilot.press("e")
            await sees(app, pilot, "to which directory")
            await pilot.press("ctrl+u", *name, "enter")
            await says(app, pilot, said)
        await pilot.press("e")
        await sees(app, pilot, "to which directory")
        await pilot.press("escape")
        assert not view.exports.writing

    fakes(project, do)


def test_what_was_chosen_is_there_at_the_next_start(project):
    async def do(app, pilot, view):
        await pilot.press("down", "down")

    async def again(app, pilot, view):
        assert view.job.name == "bad"

    fakes(project, do)
    fakes(project, again)


def test_any_size_down_to_one_by_one(project):
    async def do(app, pilot, view):
        await computed(pilot, view)
        for size in SIZES:
            await pilot.resize_terminal(*size)
            await pilot.press("t", "f", "v", "down", "up", "tab")
            await pilot.pause()
        await sees(app, pilot, "? Help")

    fakes(project, do)


@pytest.mark.parametrize(("size", "most"), [((80, 24), 2), ((160, 50), 3)])
def test_groups_are_packed_side_by_side(project, size, most):
    async def do(app, pilot, view):
        view.together = most
        await computed(pilot, view)
        await sees(app, pilot, "one, AREA")
        await as_stored(app, pilot, f"pages_{size[0]}x{size[1]}")

    fakes(project, do, size)


def test_a_wide_table_goes_on_below():
    texts = ["".join(text for text, _ in parts) for parts in word_lines(page_of("one"), 60)]
    assert max(map(len, texts)) <= 60
    head = [text for text in texts if text.startswith("distance [m]")]
    assert len(head) > 1
    assert (
        " ".join(head).replace("distance [m]", "").split() == " ".join(f"a long column {i}" for i in range(8)).split()
    )
