"""Commands that the interface starts: their forms, the run, stopping it, and taking over what it has found."""

import json
import shlex
import sys

import pytest

from lidarcheck.session.runs import RunBook
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.form import Form, Pick
from tui_kit import LUT, app_on, drive, make_project, misses, on_blooming, says, sees, text_of, until

PROGRAM = """
import json, pathlib, signal, sys, time
here, words = pathlib.Path(__file__).parent, sys.argv[1:]
def say(**what):
    print(json.dumps(what), file=sys.stderr, flush=True)
def value(name):
    return words[words.index(name) + 1] if name in words else ""
with (here / "argv.jsonl").open("a") as stream:
    stream.write(json.dumps(words) + "\\n")
signal.signal(signal.SIGINT, lambda *_: sys.exit("interrupted"))
say(now="fitting", done=3, of=8)
while (here / "waits").exists():
    time.sleep(0.02)
if (here / "fails").exists():
    sys.exit("error: a_lut.ini:3: no target is seen; name another scan")
print("fitted 26 rows")
if words[0] == "simulate":
    pathlib.Path(value("--out")).write_text("X Y Z\\n")
    sys.exit()
if words[:2] == ["case", "make"]:
    out = pathlib.Path(value("--out"))
    out.mkdir(parents=True)
    model = pathlib.Path(value("--model"))
    (out / model.name).write_bytes(model.read_bytes())
    sys.exit()
out = pathlib.Path(value("--out") or pathlib.Path(value("--json")).parent)
out.mkdir(exist_ok=True)
if "--lut" in words:
    from lidarcheck.calibration.blooming.lut_edit import set_rows
    from lidarcheck.formats.lut import load_lut, save_lut
    save_lut(set_rows(load_lut(value("--lut")), "vertical", [2, 3, 4], "700"), out / pathlib.Path(value("--lut")).name)
if words[0] == "calibrate":
    from lidarcheck.model import load_model
    from lidarcheck.model.files.write import write_model
    source = next(pathlib.Path(words[1]).glob("*.toml"))
    write_model(source, load_model(source).with_sensor(signal_at_1m=41234.5), out / "model.toml")
(out / "result.json").write_text("{}")
"""


@pytest.fixture
def project(tmp_path):
    (tmp_path / "program").mkdir()
    (tmp_path / "program/run.py").write_text(PROGRAM)
    return make_project(tmp_path / "project")


def prepared(app, project):
    app.commands.runs.program = (sys.executable, str(project.parent / "program/run.py"))


def told(project):
    """What the program was given, by its calls."""
    return [json.loads(line) for line in (project.parent / "program/argv.jsonl").read_text().splitlines()]


def scaled(view):
    return [row.scaled for row in view.file.current.tables["vertical"].rows()]


async def asked(app, pilot, kind):
    await until(pilot, lambda: isinstance(app.asking, kind), lambda: text_of(app))


def test_a_fit_shows_its_table_and_is_taken_over_as_one_edit(project):
    waits = project.parent / "program/waits"
    waits.touch()

    async def do(app, pilot):
        prepared(app, project)
        view = await on_blooming(app, pilot)
        before = scaled(view)
        await pilot.press("home", "i", "F")  # with an edit that is not saved
        edited = view.file.content
        await asked(app, pilot, Form)
        await sees(app, pilot, "Fit the table")
        line = app.asking.form.line(app.asking.directory)[0]
        assert line.startswith("lidarcheck bloom fit ")
        assert line.endswith("--out .lidarcheck/tui/runs/1/out")
        await sees(app, pilot, "> lidarcheck bloom fit")
        # Another value changes the command.
        await pilot.press("up", "up", "enter")
        await pilot.press(*"0.3", "enter", "end")
        await sees(app, pilot, "--smoothness 0.3")
        await pilot.press("enter")
        await says(app, pilot, "bloom fit runs; x stops it")
        await until(pilot, lambda: "fitting 3/8" in app.bars._progress.get("blooming", ""))
        await pilot.press("F")
        await says(app, pilot, "a command is running; x stops it")
        waits.unlink()
        await asked(app, pilot, Ask)
        await sees(app, pilot, "Take it over: 3 rows of a_lut.ini?")
        assert view.table.wanted() is not None
        await sees(app, pilot, "wanted")
        await pilot.press("y")
        await says(app, pilot, "a_lut.ini: taken over, not saved yet; u takes it back")
        await misses(app, pilot, "wanted")
        assert scaled(view)[2:5] == [700, 700, 700]
        await pilot.press("u")
        assert view.file.content == edited
        await pilot.press("u")
        assert scaled(view) == before
        # The run read the table with the edit, and stays in the journal of runs.
        (words,) = told(project)
        assert shlex.join(["lidarcheck", *words]) == line.replace(" --out", " --smoothness 0.3 --out")
        lut = words[words.index("--lut") + 1]
        assert (project / lut).read_bytes() == edited
        assert (project / "a_lut.ini").read_bytes() == LUT.encode()
        (run,) = RunBook(project).runs
        assert (run.name, run.state, run.taken) == ("bloom fit", "done", True)
        app.action_runs()
        await asked(app, pilot, Pick)
        await pilot.press("enter")
        await sees(app, pilot, "fitted 26 rows")
        await pilot.press("t")
        await sees(app, pilot, "Take it over: 3 rows")
        await pilot.press("escape")
        await says(app, pilot, "not taken over: nothing has changed")

    drive(app_on(project), do)


def test_a_run_is_stopped_and_a_failed_one_says_why(project):
    waits, fails = (project.parent / f"program/{name}" for name in ("waits", "fails"))
    waits.touch()

    async def do(app, pilot):
        prepared(app, project)
        await on_blooming(app, pilot)
        await pilot.press("x")
        await says(app, pilot, "nothing runs")
        await pilot.press("F", "enter")
        await until(pilot, lambda: "fitting" in app.bars._progress.get("blooming", ""))
        await pilot.press("x")
        await says(app, pilot, "bloom fit: stopped")
        assert app.asking is None
        waits.unlink()
        fails.touch()
        await pilot.press("F", "enter")
        await says(app, pilot, "bloom fit: failed: a_lut.ini:3: no target is seen")
        assert [run.state.partition(":")[0] for run in app.commands.runs.book.runs] == ["failed", "stopped"]
        app.commands.runs.program = ("/nowhere/python",)
        await pilot.press("F", "enter")
        await says(app, pilot, "/nowhere/python: cannot be started: No such file or directory")
        assert not app.commands.runs.running

    drive(app_on(project), do)


def test_a_hang_up_leaves_the_run_and_the_next_start_finds_its_end(project):
    waits = project.parent / "program/waits"
    waits.touch()

    async def start(app, pilot):
        prepared(app, project)
        await on_blooming(app, pilot)
        await pilot.press("F", "enter")
        await until(pilot, lambda: "fitting" in app.bars._progress.get("blooming", ""))
        app.commands.runs._process = None  # as a process that is gone: nobody stops the run

    drive(app_on(project), start)
    assert RunBook(project).runs[0].state == "running"
    waits.unlink()

    async def later(app, pilot):
        await until(pilot, lambda: not app.commands.runs.book.look() and app.commands.runs.book.runs[0].ended)
        assert app.commands.runs.book.runs[0].state == "done"

    drive(app_on(project), later)


async def find(app, pilot, words):
    """An action by a part of its name, as a user finds it."""
    await pilot.press("ctrl+p", *("space" if letter == " " else letter for letter in words), "enter")
    await asked(app, pilot, Form)


def test_simulate_and_calibrate_start_from_the_palette(project):
    (project / "measured/car_25m_real.txt").write_text("X Y Z Layer Point AREA\n25 0 0 250 470 300\n")
    (project / "measured/car_25m_ideal.txt").write_text("Layer Point Distance MaterialID\n250 470 25 1\n")
    waits = project.parent / "program/waits"
    model = project / "models/SLIM.toml"
    before = model.read_bytes()

    async def do(app, pilot):
        prepared(app, project)
        app.choice.choose("model", "models/SLIM.toml")
        app.choice.choose("measurement", "measured/car_25m_real.txt")
        await find(app, pilot, "simulate to a file")
        line = "lidarcheck simulate measured/car_25m_ideal.txt --model models/SLIM.toml --out car_25m_real_sim.parquet"
        assert app.asking.form.line(app.asking.directory) == (line, True)
        await pilot.press("up", "enter", "ctrl+u", *"car.txt", "enter", "end", "enter")
        await until(pilot, lambda: (project / "car.txt").exists() and not app.commands.runs.running and app.reads > 1)
        assert any("car.txt: written" in said for said, _ in app.bars.said)
        await find(app, pilot, "simulate to a file")
        await pilot.press("up", "enter", "ctrl+u", *"car.txt", "enter", "end", "enter")
        await sees(app, pilot, "not yet: car.txt is there already")
        await pilot.press("escape")
        waits.touch()
        await find(app, pilot, "calibrate")
        await sees(app, pilot, "this measurement: measured/car_25m_real.txt")
        await pilot.press("enter")
        await until(pilot, lambda: "fitting 3/8" in app.bars._progress.get("overview", ""))
        await pilot.press("x")
        await says(app, pilot, "calibrate: stopped")
        waits.unlink()
        await find(app, pilot, "calibrate")
        await pilot.press("enter")
        await asked(app, pilot, Ask)
        await sees(app, pilot, "Take it over: 3 lines of models/SLIM.toml?")
        await sees(app, pilot, "signal_at_1m = 41234.5")
        await pilot.press("y")
        await says(app, pilot, "models/SLIM.toml: taken over, not saved yet")
        assert b"41234.5" in app.session.inputs().edited[str(model.resolve())]
        assert model.read_bytes() == before
        # What reads the disk says so of a model with edits.
        await find(app, pilot, "calibrate")
        await pilot.press("enter")
        await says(app, pilot, "models/SLIM.toml has edits that are not saved, and the command reads the disk")

    drive(app_on(project), do)
    make, calibrate = told(project)[-2:]
    run = ".lidarcheck/tui/runs/3"
    assert make == [
        *("case", "make", "--measured", "measured/car_25m_real.txt", "--ideal", "measured/car_25m_ideal.txt"),
        *("--model", "models/SLIM.toml", "--out", f"{run}/case"),
    ]
    assert calibrate == ["calibrate", f"{run}/case", "--free", "signal_at_1m,pulse_fwhm_ns", "--out", f"{run}/out"]

    async def again(app, pilot):
        """The edit of the model is offered at the next start, with its undo."""
        await sees(app, pilot, "SLIM.toml: an earlier session ended with 3 lines not saved")
        await pilot.press("b")
        await says(app, pilot, "3 lines brought back")
        (editor,) = app.commands.models.editors()
        assert editor.file.undo() == "take over calibrate, run 3"
        assert editor.file.content == before

    drive(app_on(project), again)


@pytest.mark.long
def test_a_real_fit_is_taken_over(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)
        await pilot.press("F", "enter")
        await until(pilot, lambda: isinstance(app.asking, Ask), lambda: text_of(app), 300.0)
        assert app.commands.runs.book.runs[0].state == "done"
        wanted = view.table.wanted()
        await pilot.press("y")
        await says(app, pilot, "a_lut.ini: taken over, not saved yet")
        assert view.file.current.tables["vertical"].y.tolist() == wanted.y.tolist()
        assert view.file.dirty
        await pilot.press("u")
        assert view.file.content == LUT.encode()

    drive(app_on(project), do)
