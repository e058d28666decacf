"""The number follows each edit by itself, says what it is of, and is never called current when it is not."""

import json
import re

import pytest

from blooming_kit import sign_model
from fake_worker import ROW, FakeWorker, second_line
from lidarcheck.cli import main
from lidarcheck.model.files.model_file import save_model
from lidarcheck.session.worker_process import COMPILES
from lidarcheck.tui.app import LidarcheckApp
from states_kit import IDEAL, SCAN
from tui_kit import drive, fake_check, make_project, misses, on_blooming, sees, status, text_of, until

AT_ROW = ("home", *["down"] * ROW)


@pytest.fixture
def project(tmp_path):
    root = make_project(tmp_path / "project")
    for distance in ("69m", "157m"):
        (root / f"measured/sign_{distance}.csv").unlink()
        (root / f"measured/sign_{distance}.txt").write_text(SCAN)
        (root / f"measured/sign_{distance}_ideal.txt").write_text(IDEAL)
    return root


def run(project, do, size=(80, 24), seconds=0.1):
    worker = FakeWorker()
    worker.seconds = seconds

    async def on_it(app, pilot):
        app.choice.choose("lut", "a_lut.ini")
        app.choice.choose("measurement", "measured/sign_69m.txt")
        view = await on_blooming(app, pilot)
        await until(pilot, lambda: len(worker.samples()) == 2, lambda: text_of(app))
        worker.answer()
        await sees(app, pilot, "misfit")
        await do(app, pilot, view, worker)

    drive(LidarcheckApp(project, check=fake_check, worker=worker), on_it, size)
    assert worker.closed


def line_of(app):
    return second_line(text_of(app))


def test_a_number_follows_an_edit_and_its_undo(project, capsys):
    async def do(app, pilot, view, worker):
        number, line = line_of(app)
        assert line.startswith("a_lut.ini SLIM | sign 69 m 1/2 | misfit ")
        await pilot.press("right", *AT_ROW, *"600", "enter")
        # At once what is expected, with a tilde; the old number is not called current.
        await until(pilot, lambda: ("expected", "sign_69m.txt", 0) in worker.asked)
        assert "current" not in line_of(app)[1]
        worker.answer(how="expected")
        await until(pilot, lambda: line_of(app)[0] == "~2.60", lambda: text_of(app))
        await until(pilot, lambda: worker.samples())
        worker.tell(5, 8)
        await sees(app, pilot, "computing 5/8 seeds")
        worker.answer("69m")
        await until(pilot, lambda: line_of(app)[0] == "2.60", lambda: text_of(app))
        line = line_of(app)[1]
        assert "*1" in line
        assert "better" in line
        assert "start" in line
        assert "not yet known at 157 m" in status(app)
        worker.answer("157m")
        await until(pilot, lambda: "better at 69 m, worse at 157 m" in status(app), lambda: status(app))
        # What is only looked at changes nothing that it is compared with.
        await pilot.press("f2", "f5", "n", "p", "down", "up")
        assert line_of(app)[1] == line
        # Undo finds the number again, without a simulation.
        asked = len(worker.asked)
        await pilot.press("u")
        await until(pilot, lambda: line_of(app)[0] == number, lambda: text_of(app))
        await pilot.pause(0.3)
        assert len(worker.asked) == asked

    run(project, do)
    # What was found stays, for the command too.
    assert main(["gap", str(project), "--history", "--json", "-"]) == 0
    start, edit = json.loads(capsys.readouterr().out)["edits"]
    assert (start["what"], edit["file"], edit["undone"]) == ("as read", "a_lut.ini", True)
    words = {one["measurement"]: one["word"] for one in edit["numbers"]}
    assert words == {"measured/sign_69m.txt": "better", "measured/sign_157m.txt": "worse"}
    assert main(["gap", str(project), "--history"]) == 0
    assert re.search(r"1 +a_lut.ini +vertical X -50: set 600, taken back .*better", capsys.readouterr().out)
    assert main(["gap", str(project), "--history", "--whole"]) == 2
    assert main(["gap", str(project / "models"), "--history"]) == 2


def test_a_newer_edit_takes_the_place_of_an_older_one(project):
    async def do(app, pilot, view, worker):
        await pilot.press("right", *AT_ROW, "right_square_bracket")
        await until(pilot, lambda: len(worker.samples()) == 2)
        first = list(worker.waiting)
        await pilot.press("right_square_bracket")
        await until(pilot, lambda: all(ticket not in worker.waiting for ticket in first))
        await until(pilot, lambda: len(worker.samples()) == 2)
        worker.answer()
        await until(pilot, lambda: "better" in line_of(app)[1], lambda: text_of(app))
        # Both nudges are one step: the number before is that of the start.
        known = app.numbers.known(app.numbers.seen)
        assert known.before == known.start
        assert known.step == known.since_start
        # A baseline is what is compared with until it is taken away.
        await pilot.press("B")
        await until(pilot, lambda: "better" not in line_of(app)[1], lambda: text_of(app))
        await pilot.press("left_square_bracket")
        await until(pilot, lambda: worker.waiting)
        await pilot.pause(0.2)
        worker.answer()
        await until(pilot, lambda: "worse" in line_of(app)[1], lambda: text_of(app))
        assert app.numbers.known(app.numbers.seen).before == known.number
        # It can be seen in the place of what is set now: number, curve and profile; nothing is simulated for that.
        now, asked = line_of(app), len(worker.asked)
        await pilot.press("apostrophe")
        await until(pilot, lambda: line_of(app)[1].startswith("BASELINE | "), lambda: text_of(app))
        assert line_of(app)[0] == f"{known.number.value:.2f}" != now[0]
        await sees(app, pilot, " baseline")
        await pilot.press("apostrophe")
        await until(pilot, lambda: line_of(app) == now, lambda: text_of(app))
        assert len(worker.asked) == asked
        # What it is computed from: the table as it is shown, and the command that makes the same once that is saved.
        await pilot.press("I")
        await sees(app, pilot, "Inputs")
        said = app.asking.text
        assert "\n state    current\n" in said
        assert re.search(r" a_lut\.ini  [0-9a-f]{12}  edited, not saved\n", said)
        assert "\n sample   7 200 beams x 8\n" in said
        assert "command  lidarcheck gap " in said
        assert "save first" in said

    run(project, do, (120, 36))


def test_what_is_dear_or_fails_says_so_and_r_renews_it(project):
    async def do(app, pilot, view, worker):
        # The first one has read and prepared besides: it is computed once more, and was no quicker.
        await pilot.press("right", *AT_ROW, "right_square_bracket")
        await until(pilot, lambda: worker.samples())
        worker.answer()
        await until(pilot, lambda: not app.numbers.engine.busy and "better" in line_of(app)[1], lambda: text_of(app))
        edit = app.session.edits
        await pilot.press("right_square_bracket")
        worker.answer(how="expected")
        await until(pilot, lambda: f"OLD, of edit {edit}" in line_of(app)[1], lambda: text_of(app))
        await pilot.pause(0.2)
        assert not worker.samples()
        await pilot.press("f2", "r")
        await until(pilot, lambda: worker.samples())
        # What keeps it waiting is said while it is so, and no longer.
        before = status(app)
        worker.tell(0, 1, COMPILES)
        await sees(app, pilot, f"numbers wait: {COMPILES}")
        worker.tell(0, 1, "")
        await misses(app, pilot, "numbers wait")
        assert status(app) == before
        worker.answer(how="sample", failed="the disk is full")
        await until(pilot, lambda: "failed: the disk is full" in line_of(app)[1], lambda: text_of(app))

    run(project, do, (120, 36), seconds=3.0)


def test_a_distance_chosen_on_one_screen_is_chosen_on_all(project):
    save_model(sign_model("SLIM"), project / "measured/near.toml")

    async def do(app, pilot, view, worker):
        # Blooming looks at it with the model that the number is computed with.
        assert view.selection.model == app.numbers.asked(app.numbers.seen).request.model
        assert view.selection.model.name == "near.toml"
        await pilot.press("n")
        await sees(app, pilot, "157 m 2/2")
        assert app.choice.of("measurement") == "measured/sign_157m.txt"
        await pilot.press("f2")
        await sees(app, pilot, "> sign    sign_157m ")
        await pilot.press("p")
        await sees(app, pilot, "> sign    measured/sign_69m ")
        await pilot.press("f5")
        await until(pilot, lambda: view.selection.current.name == "measured/sign_69m.txt")

    run(project, do)
