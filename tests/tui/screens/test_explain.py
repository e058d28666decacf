"""The screen Explain: cases, a run in a process of its own, its answer again later, accepting and taking back."""

import dataclasses
import json
import os
import shutil
import signal
import sys
import threading
import time

import pytest

from explain_kit import explanation, ideal_scan, write_case
from lidarcheck.cases.case import load_case
from lidarcheck.effects import catalogue, make
from lidarcheck.explain.report.model_diff import write_model
from lidarcheck.formats import save_scan
from lidarcheck.inference.intervals import Interval
from lidarcheck.model import load_model, simulate
from lidarcheck.tui.jobs.explain_cases import results_directory
from lidarcheck.tui.jobs.explain_process import ExplainProcess, ExplainProgress, command_of
from lidarcheck.tui.screens.explain.lines import found_lines, step_lines
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from lidarcheck.tui.widgets.themes import THEMES
from tui_kit import app_on, as_stored, done, drive, says, sees, status, text_of, until

PROGRAM = """
import json, pathlib, shutil, signal, sys, time
mode, left, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[sys.argv.index("--out") + 1])
def say(**what):
    print(json.dumps(what), file=sys.stderr, flush=True)
def stop(*_):
    print("interrupted: what was done is kept", file=sys.stderr)
    sys.exit(130)
signal.signal(signal.SIGINT, signal.SIG_IGN if mode == "deaf" else stop)
out.mkdir(exist_ok=True)
(out / "argv.json").write_text(json.dumps(sys.argv[3:]))
say(steps=["candidates", "fit", "verification"])
if mode == "refuses":
    sys.exit("warning: frame 2 is left out\\nerror: case.toml:3: m1.txt fits i2.txt better; were files swapped?")
say(step="where", found="24 summaries stand out")
say(step="candidates", done=87, of=87, part=0.3, elapsed_s=20.0, left_s=None)
say(step="fit", done=20, of=100, part=0.42, elapsed_s=61.0, left_s=84.2)
say(step="gap", found="12.500 before")
say(step="gap", found="1.400 with fog")
if mode in ("waits", "deaf"):
    (out / ".explain").mkdir(exist_ok=True)
    while True:
        time.sleep(0.05)
for file in left.iterdir():
    shutil.copy(file, out / file.name)
shutil.rmtree(out / ".explain", ignore_errors=True)
say(step="verification", done=3, of=3, part=1.0, elapsed_s=90.0, left_s=0.0)
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two cases, one that has a fault, and the answer that a run leaves for the first."""
    root = tmp_path_factory.mktemp("explain")
    case = load_case(write_case(root / "project/fog"))
    write_case(root / "project/more/two")
    (root / "project/broken").mkdir()
    (root / "project/broken/case.toml").write_text(
        'model = "model.toml"\n[[frames]]\nideal = "i"\nmeasured = "i"\ntime = 0\n'
    )
    (root / "project/bad").mkdir()
    (root / "project/bad/case.toml").write_text("model = [\n")
    for verdict in ("explained", "no_gap", "unknown"):
        leave(root / verdict, case, verdict)
    (root / "program.py").write_text(PROGRAM)
    return root


def leave(directory, case, verdict):
    directory.mkdir()
    found = explanation(case, verdict, ("unknown",) if verdict == "unknown" else ("fog",))
    fitted = {"mor_m": Interval(812.0, 790.0, 840.0, "m")}
    shown = [dataclasses.replace(one, parameters=fitted if one.name == "fog" else {}) for one in found.findings]
    found = dataclasses.replace(found, findings=tuple(shown))
    (directory / "report.json").write_text(json.dumps(found.to_dict()))
    write_model(case.model_file, found.model, directory / "model.toml")
    (directory / "report.html").write_text("<p>")


@pytest.fixture
def project(made, tmp_path):
    shutil.copytree(made / "project", tmp_path / "bench")
    return tmp_path / "bench"


@pytest.fixture
def explained(made, project):
    """The project after a run."""
    out = results_directory(project, project / "fog/case.toml")
    shutil.copytree(made / "explained", out)
    return project


def screen(app):
    return next(view for view in app.views() if view.NAME == "explain")


async def on_explain(app, pilot, made=None, mode="well", left="explained"):
    view = screen(app)
    if made is not None:
        view.program = (sys.executable, str(made / "program.py"), mode, str(made / left))
    await pilot.press("f8")
    await until(pilot, lambda: app.view is view and view.looks)
    return view


async def choose(view, pilot, name):
    await pilot.press("home", *("down",) * [case.name for case in view.cases].index(name))
    assert view.chosen.name == name


async def asked(app, pilot, kind):
    await until(pilot, lambda: isinstance(app.asking, kind), lambda: text_of(app))


def out_of(project):
    return results_directory(project, project / "fog/case.toml")


def test_cases_are_listed_and_faults_are_one_line(project):
    async def do(app, pilot):
        view = await on_explain(app, pilot)
        assert [case.name for case in view.cases] == ["bad", "broken", "fog", "more/two"]
        await sees(app, pilot, "FAULT, see below")
        await sees(app, pilot, "bad/case.toml:1: not valid TOML")
        await pilot.press("down", "r")
        await says(app, pilot, "broken cannot be explained: broken/case.toml:")
        await choose(view, pilot, "fog")
        await sees(app, pilot, "not explained yet: r does it")
        await pilot.press("a")
        await says(app, pilot, "fog has not been explained")
        await pilot.press("x")
        await says(app, pilot, "nothing runs")
        assert app.state.selected["explain"] == "fog"

    drive(app_on(project), do)


def test_a_project_without_a_case_says_what_one_is(tmp_path):
    async def do(app, pilot):
        await on_explain(app, pilot)
        await sees(app, pilot, "no case in this project")
        await pilot.press("r")
        await says(app, pilot, "there is no case here")
        await pilot.press("a")
        await says(app, pilot, "no case to accept a model of")
        await pilot.press("u", "v", "left", "ctrl+r", "down")
        await says(app, pilot, "there is no case")

    drive(app_on(tmp_path), do)


def test_a_run_is_shown_while_it_goes_on_and_its_answer_after(made, project):
    async def do(app, pilot):
        view = await on_explain(app, pilot, made, "waits")
        await choose(view, pilot, "fog")
        await pilot.press("r")
        await sees(app, pilot, "42 %, 1:01 so far, about 1:24 left")
        await sees(app, pilot, "done   candidates")
        await sees(app, pilot, ">  20 %  fit")
        await sees(app, pilot, "24 summaries stand out")
        await sees(app, pilot, "1.400 with fog")
        await sees(app, pilot, "running, 42 %")
        await pilot.press("r")
        await says(app, pilot, "a run is going on; x stops it")
        await pilot.press("x")
        await until(pilot, lambda: not view.running)
        await says(app, pilot, "fog: stopped; what was done is kept, and r goes on from there")
        await sees(app, pilot, "stopped, r goes on")
        view.program = (*view.program[:2], "well", *view.program[3:])
        await pilot.press("r")
        await says(app, pilot, "fog: explained")
        await sees(app, pilot, "explained: fog")
        await sees(app, pilot, "EXPLAINED: one effect is missing from the model: fog")

    drive(app_on(project), do)


def test_the_answer_part_by_part(explained):
    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        titles = list(view.parts())
        assert titles[:3] == ["all of it", "What is missing", "Gap on frames that no fit has seen"]
        await sees(app, pilot, f"Answer 1/{len(titles)}: all of it")
        await pilot.press("v")
        await sees(app, pilot, "mor_m  812  (790 ... 840)  m")
        await sees(app, pilot, "cannot be told apart from: rain")
        await pilot.press("v")
        await sees(app, pilot, "by feature")
        texts = ["".join(text for text, _ in row) for row in view.parts()["Gap on frames that no fit has seen"]]
        before, after = texts[-2:]
        assert (before.split()[:2], after.split()[0]) == (["range", "before"], "after")
        assert before.count("#") > 5 * after.count("#") > 0
        await sees(app, pilot, "##########")
        for words in ("AREA is 20 % lower than modelled", "accepted (like rain)", "no retro-reflector", 'name = "fog"'):
            await pilot.press("v")
            await sees(app, pilot, words)
        await pilot.press(*("left",) * 6)
        assert view.part == 0
        await pilot.press("tab", "end")
        await sees(app, pilot, "with pictures: .lidarcheck/tui/explain/")
        await pilot.press("home")
        await sees(app, pilot, "EXPLAINED: one effect")

    drive(app_on(explained), do)


def test_an_earlier_answer_is_there_at_the_next_start_and_says_what_changed(explained):
    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await sees(app, pilot, "EXPLAINED")
        with (explained / "fog/m1.txt").open("a") as stream:
            stream.write("\n")
        looks = view.looks
        await pilot.press("ctrl+r")
        await until(pilot, lambda: view.looks > looks)
        await sees(app, pilot, "explained: fog  OLD, ")
        await sees(app, pilot, "m1.txt changed since")

    drive(app_on(explained), do)


def test_an_answer_that_cannot_be_read_is_one_line(explained):
    (out_of(explained) / "report.json").write_text("{}")

    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await sees(app, pilot, "explain the case again")

    drive(app_on(explained), do)


def test_what_a_run_refuses_stays_with_the_case(made, project):
    async def do(app, pilot):
        view = await on_explain(app, pilot, made, "refuses")
        await choose(view, pilot, "fog")
        await pilot.press("r")
        await says(app, pilot, "fog: case.toml:3: m1.txt fits i2.txt better; were files swapped?")
        await sees(app, pilot, "FAULT, see below")
        assert any("frame 2 is left out" in said for said, _ in app.bars.said)
        view.program = (*view.program[:2], "well", *view.program[3:])
        await pilot.press("r")
        await says(app, pilot, "fog: explained")
        await until(pilot, lambda: not view.chosen.fault)

    drive(app_on(project), do)


def test_a_program_that_is_not_there_is_one_line(project):
    async def do(app, pilot):
        view = await on_explain(app, pilot)
        view.program = ("/nowhere/python",)
        await choose(view, pilot, "fog")
        await pilot.press("r")
        await says(app, pilot, "/nowhere/python: cannot be started: No such file or directory")
        assert not view.running

    drive(app_on(project), do)


def test_seed_and_exclusions_go_to_the_run(made, project):
    async def do(app, pilot):
        view = await on_explain(app, pilot, made)
        await choose(view, pilot, "fog")
        for key, text, words in (
            ("seed", "one", "one is no seed"),
            ("seed", "7", "the next run has the seed 7"),
            ("exclude", "fgo", "did you mean fog?"),
            ("exclude", "rain, fog", "does not name 2 effects"),
        ):
            await done(app, key)
            await asked(app, pilot, AskText)
            await pilot.press(*("space" if letter == " " else "comma" if letter == "," else letter for letter in text))
            await pilot.press("enter")
            await says(app, pilot, words)
        await sees(app, pilot, "seed 7, never rain,fog")
        await pilot.press("r")
        await says(app, pilot, "fog: explained")
        given = json.loads((out_of(project) / "argv.json").read_text())
        case = str(project / "fog/case.toml")
        assert given == command_of(project / "fog/case.toml", out_of(project), seed="7", exclude="rain,fog", program=())
        assert given[:2] == ["explain", case]
        await done(app, "exclude")
        await asked(app, pilot, AskText)
        await pilot.press(*("backspace",) * 8, "minus", "enter")
        await says(app, pilot, "all effects may be named")

    drive(app_on(project), do)


def test_the_model_is_accepted_as_an_edit_and_taken_back(explained):
    model = explained / "fog/model.toml"
    before = model.read_bytes()

    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await sees(app, pilot, "Accept: how fog/model.toml changes")
        await sees(app, pilot, '+name = "fog"')
        await pilot.press("escape")
        await says(app, pilot, "not accepted: nothing was written")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await pilot.press("y")
        await says(app, pilot, "fog/model.toml: taken over, not saved yet; u takes it back")
        # The session shows the new model to all that computes, and the disk has the old one.
        (shown,) = app.session.inputs().edited.values()
        assert shown.startswith(before.rstrip()), "all else stays byte for byte"
        assert b'name = "fog"' in shown
        assert model.read_bytes() == before
        assert app.choice.of("model") == "fog/model.toml"
        await sees(app, pilot, "saved model")
        await pilot.press("a")
        await says(app, pilot, "fog/model.toml: has changed since it was read for this")
        await pilot.press("u")
        await says(app, pilot, "fog/model.toml: as it was before")
        assert not app.session.inputs().edited
        await pilot.press("u")
        await says(app, pilot, "nothing was accepted here")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await pilot.press("y", "S")
        await sees(app, pilot, "Save ")
        await pilot.press("enter")
        await says(app, pilot, "model.toml: saved")
        assert [effect.name for effect in load_model(model).effects] == ["fog"]

    drive(app_on(explained), do)

    async def later(app, pilot):
        """After a restart it is taken back as another edit."""
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await pilot.press("u")
        await says(app, pilot, "fog/model.toml: as it was before, not saved yet")
        await pilot.press("S")
        await sees(app, pilot, "Save ")
        await pilot.press("enter")
        await says(app, pilot, "model.toml: saved")
        assert model.read_bytes() == before

    drive(app_on(explained), later)


def test_the_model_is_accepted_into_a_new_file(explained):
    model, new = explained / "fog/model.toml", explained / "fog_explained.toml"
    before = model.read_bytes()

    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        for name in ("", "x/y.toml", "fog/m1.txt"):
            await pilot.press("a")
            await asked(app, pilot, Ask)
            await pilot.press("n")
            await asked(app, pilot, AskText)
            if name:
                await pilot.press(
                    *("backspace",) * 20, *("slash" if c == "/" else "full_stop" if c == "." else c for c in name)
                )
            await pilot.press("enter")
            if not name:
                await sees(app, pilot, "Accept: fog_explained.toml, beside the case's")
                await pilot.press("enter")
            words = {"": "fog_explained.toml: written", "x/y.toml": "its directory does not exist"}
            await says(app, pilot, words.get(name, "fog/m1.txt is there already"))
        assert [effect.name for effect in load_model(new).effects] == ["fog"]
        assert model.read_bytes() == before
        await pilot.press("u")
        await asked(app, pilot, Ask)
        await pilot.press("enter")
        await says(app, pilot, "fog_explained.toml: as it was before")
        assert not new.exists()

    drive(app_on(explained), do)


def test_what_changed_meanwhile_is_not_overwritten(explained):
    model = explained / "fog/model.toml"

    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        model.write_text(model.read_text() + "# mine\n")
        mine = model.read_bytes()
        await pilot.press("y")
        await says(app, pilot, "has changed meanwhile")
        assert model.read_bytes() == mine

    drive(app_on(explained), do)


def test_an_edit_after_accepting_is_not_taken_back(explained):
    model = explained / "fog/model.toml"

    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await pilot.press("y", "S", "enter")
        await says(app, pilot, "saved")
        model.write_text(model.read_text() + "# mine\n")
        await pilot.press("u")
        await says(app, pilot, "has changed since it was accepted")
        await sees(app, pilot, "model.toml has changed on the disk")
        await pilot.press("r")
        await says(app, pilot, "read again")
        assert model.read_text().endswith("# mine\n")

    drive(app_on(explained), do)


@pytest.mark.parametrize(
    ("left", "words"),
    [("no_gap", "no gap was found, so that the model stays as it is"), ("unknown", "")],
)
def test_other_verdicts(made, project, left, words):
    shutil.copytree(made / left, out_of(project))

    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await sees(app, pilot, {"no_gap": "NO GAP: ", "unknown": "UNKNOWN: "}[left])
        await pilot.press("a")
        if words:
            await says(app, pilot, words)
        else:
            await sees(app, pilot, "describe what is missing and do not explain it")

    drive(app_on(project), do)


def test_a_process_that_does_not_listen_is_ended_at_once(made, project):
    async def do(app, pilot):
        view = await on_explain(app, pilot, made, "deaf")
        await choose(view, pilot, "fog")
        await pilot.press("r")
        await sees(app, pilot, "running, 42 %")
        await pilot.press("x")
        await says(app, pilot, "stopping; x once more ends it at once")
        assert view.running
        await pilot.press("x")
        await until(pilot, lambda: not view.running)
        await says(app, pilot, "what was done is kept")

    drive(app_on(project), do)


def test_leaving_stops_the_run(made, project):
    runs = []

    async def do(app, pilot):
        view = await on_explain(app, pilot, made, "waits")
        await choose(view, pilot, "fog")
        await pilot.press("r")
        await sees(app, pilot, "running, 42 %")
        runs.append(view.run)

    drive(app_on(project), do)
    assert runs[0]._process.wait(timeout=60) == 130


@pytest.fixture(scope="module")
def offset(tmp_path_factory):
    """A case whose ranges are 12 cm too long, and every effect but that one."""
    case = write_case(tmp_path_factory.mktemp("offset") / "bench/offset")
    sensor = load_model(case / "model.toml").with_(make("range_offset", {"offset_m": 0.12}))
    for k in range(4):
        save_scan(simulate(ideal_scan(k), sensor, seed=5, frame=k), case / f"m{k}.txt")
    return case.parent, ",".join(name for name in catalogue() if name != "range_offset")


def hold_when_noted(process, out):
    """Hold a run as soon as it keeps something: on a slow machine it might end before a key is heard."""
    notebook = out / ".explain/notebook.jsonl"
    end = time.monotonic() + 60.0
    while not (notebook.is_file() and notebook.stat().st_size) and time.monotonic() < end:
        time.sleep(0.005)
    os.kill(process, signal.SIGSTOP)


@pytest.mark.long
def test_a_real_run_is_cancelled_and_goes_on_to_name_what_is_missing(offset):
    project, others = offset

    async def do(app, pilot):
        app.state.selected["explain exclude"] = others
        view = await on_explain(app, pilot)
        await pilot.press("r")
        await until(pilot, lambda: view.run)
        held = threading.Thread(target=hold_when_noted, args=(view.run._process.pid, view.chosen.out))
        held.start()
        await until(pilot, lambda: not held.is_alive(), lambda: text_of(app))
        await pilot.press("x")
        os.kill(view.run._process.pid, signal.SIGCONT)
        await until(pilot, lambda: not view.running, lambda: text_of(app))
        await says(app, pilot, "stopped; what was done is kept, and r goes on from there")
        await sees(app, pilot, "stopped, r goes on")
        assert (view.chosen.out / ".explain/notebook.jsonl").stat().st_size
        await pilot.press("r")
        await sees(app, pilot, "ranges are longer")
        await until(pilot, lambda: not view.running, lambda: text_of(app), 300.0)
        assert "explained" in status(app), app.bars.said
        await sees(app, pilot, "explained: range_offset")
        assert view.chosen.found.findings[0].parameters["offset_m"].value == pytest.approx(0.12, abs=0.02)
        assert view.chosen.page is not None
        await pilot.press("a")
        await asked(app, pilot, Ask)
        await pilot.press("y", "S", "enter")
        await says(app, pilot, "model.toml: saved")

    drive(app_on(project), do)
    assert [effect.name for effect in load_model(project / "offset/model.toml").effects] == ["range_offset"]


def test_lines_that_are_no_progress_are_kept_apart():
    progress = ExplainProgress()
    assert progress.take('{"steps": ["a", "b"]}')
    for line in ("warning: x", "[1]", "7", "{}", '{"step": "a", "done": "x"}', "error: no", "error: more"):
        assert not progress.take(line)
    assert progress.fault == "no"
    assert progress.take('{"step": "b", "done": 1, "of": 4, "part": 0.5, "elapsed_s": 1.0, "left_s": null}')
    assert progress.steps == {"a": (1, 1), "b": (1, 4)}
    texts = ["".join(text for text, _ in line) for line in step_lines(progress)]
    assert texts[0].split() == ["done", "a"]
    assert texts[1].startswith(">  25 %  b")
    assert texts[1].count("#") == 5


def test_the_gap_shrinks_in_bars():
    progress = ExplainProgress(found=[("gap", "2.0 before"), ("gap", "0.5 with fog"), ("gap", "strange")])
    bars = ["".join(text for text, _ in line).count("#") for line in found_lines(progress, 96)]
    assert bars == [40, 10, 0]


def test_the_process_has_a_session_of_its_own(made, tmp_path):
    ended = []
    run = ExplainProcess(
        [sys.executable, str(made / "program.py"), "waits", str(made), "--out", str(tmp_path / "o")],
        on_progress=lambda: None, on_line=lambda _text: None, on_end=ended.append,
    )  # fmt: skip
    assert os.getsid(run._process.pid) != os.getsid(0)
    os.killpg(run._process.pid, signal.SIGKILL)
    run._process.wait(timeout=60)
    assert not run.running
    assert not run.stop()


def test_any_size_down_to_one_by_one(explained):
    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        for size in ((1, 1), (5, 3), (40, 10), (200, 60), (3, 40), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.press("v", "tab", "down", "f1", "escape", "left")
        await sees(app, pilot, "? Help")
        await sees(app, pilot, "explained: fog")

    drive(app_on(explained), do)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_snapshots(explained, size):
    async def do(app, pilot):
        view = await on_explain(app, pilot)
        await choose(view, pilot, "fog")
        await sees(app, pilot, "EXPLAINED")
        await as_stored(app, pilot, f"explain_{size[0]}x{size[1]}")

    drive(app_on(explained, theme=THEMES[0]), do, size)


def test_a_run_from_the_background_can_be_stopped():
    """A job that a shell has started with & ignores interrupts, and what it starts would too."""
    ended = threading.Event()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        sleeps = [sys.executable, "-c", "import sys, time; print('up', file=sys.stderr, flush=True); time.sleep(300)"]
        said = threading.Event()
        run = ExplainProcess(sleeps, on_progress=said.set, on_line=lambda _text: None, on_end=lambda _code: ended.set())
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
        assert said.wait(60)
        run.stop()
        assert ended.wait(60)
    finally:
        signal.signal(signal.SIGINT, before)
