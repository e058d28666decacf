"""`lidarcheck explain` around its workflow, which is a stand-in here: files, refusals, interruption, progress."""

import dataclasses
import json
import re
import sys
import types
from pathlib import Path

import pytest

from explain_kit import explanation, write_case
from lidarcheck.cases.case import load_case
from lidarcheck.cli import main
from lidarcheck.cli.explain.files import write_set
from lidarcheck.cli.explain.watch import JsonLines, Pace, clock_text, watched
from lidarcheck.errors import InputError
from lidarcheck.explain.report.explanation import Calibrated, Progress, SearchStep
from lidarcheck.explain.report.text import report_text, verdict_sentence
from lidarcheck.model import load_model

FILES = ["model.toml", "report.html", "report.json"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return write_case(tmp_path_factory.mktemp("cli") / "case")


@pytest.fixture
def case(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case").symlink_to(made)
    return Path("case")


def listed(directory):
    return sorted(path.name for path in Path(directory).iterdir())


class Workflow:
    """What stands in for the workflow: takes notes of its call, tells progress, and answers what it is told to."""

    def __init__(self):
        self.calls = []
        self.answer = explanation
        self.fails = None

    def explain(
        self, case, *, seed=0, exclude=(), jobs=1, pool=None, on_progress=None, on_step=None, checkpoint=None,
        calibrate=True,
    ):  # fmt: skip
        self.calibrates = calibrate
        self.calls.append({"seed": seed, "exclude": exclude, "jobs": jobs, "kept": checkpoint.get("split")})
        on_progress("split", 1, 1)
        if on_step is not None:
            on_step(SearchStep("split", "2 frames to fit"))
        checkpoint.put("split", [0, 1])
        on_progress("fit", 0, 2)
        if self.fails:
            raise self.fails
        on_progress("fit", 2, 2)
        return self.answer(case)


@pytest.fixture
def workflow(monkeypatch):
    stand_in = Workflow()
    page = types.SimpleNamespace(write_html=lambda found, case, path: Path(path).write_text(f"<p>{found.verdict}</p>"))
    for name, module in (("lidarcheck.explain.workflow", stand_in), ("lidarcheck.figures.html.explanation", page)):
        monkeypatch.setitem(sys.modules, name, module)
        monkeypatch.setattr(name, module, raising=False)
    monkeypatch.setattr("lidarcheck.explain.progress.PROGRESS", Progress({"split": 0.2, "fit": 0.8}))
    return stand_in


def test_the_three_files_and_the_report(case, workflow, capsys):
    assert main(["explain", "case", "--out", "found", "--seed", "7", "--jobs", "3"]) == 0
    out, err = capsys.readouterr()
    assert listed("found") == FILES
    assert workflow.calls == [{"seed": 7, "exclude": (), "jobs": 3, "kept": None}]
    report = json.loads(Path("found/report.json").read_text())
    assert report["verdict"] == "explained"
    assert report["effects"][0]["parameters"]["extinction_per_m"] == {"value": 0.0123, "low": 0.0119, "high": 0.0131}
    assert load_model("found/model.toml").effects[0].name == "fog"
    assert "# the sensor on the bench" in Path("found/model.toml").read_text()
    assert Path("found/report.html").read_text() == "<p>explained</p>"
    assert out.startswith("EXPLAINED: one effect is missing from the model: fog.")
    assert '+ name = "fog"' in out
    assert err.splitlines() == ["split (0:00)", "fit (0:00)",
                                "found: report.json, model.toml, report.html"]  # fmt: skip


def test_the_same_again_gives_the_same_bytes(case, workflow):
    for name in ("a", "b", "a"):
        assert main(["explain", "case/case.toml", "--out", name, "--quiet"]) == 0
    for name in FILES:
        assert Path("a", name).read_bytes() == Path("b", name).read_bytes()


@pytest.mark.parametrize("verdict", ["no_gap", "unknown"])
def test_every_verdict_is_success(case, workflow, verdict, capsys):
    workflow.answer = lambda c: explanation(c, verdict, ("unknown",))
    assert main(["explain", "case", "--out", "found", "--quiet"]) == 0
    assert capsys.readouterr().err == ""
    assert json.loads(Path("found/report.json").read_text())["verdict"] == verdict
    if verdict == "no_gap":
        assert Path("found/model.toml").read_bytes() == Path("case/model.toml").read_bytes()


def test_json_on_standard_output_stands_alone(case, workflow, capsys):
    assert main(["explain", "case", "--out", "found", "--json", "-"]) == 0
    out = capsys.readouterr().out
    assert out == Path("found/report.json").read_text()


def test_json_into_a_file(case, workflow, capsys):
    assert main(["explain", "case", "--out", "found", "--json", "more.json"]) == 0
    assert Path("more.json").read_text() == Path("found/report.json").read_text()
    assert capsys.readouterr().out.startswith("EXPLAINED")


def test_without_a_page(case, workflow, capsys):
    assert main(["explain", "case", "--out", "found", "--no-html"]) == 0
    assert listed("found") == ["model.toml", "report.json"]
    Path("found/report.html").write_text("old")
    assert main(["explain", "case", "--out", "found", "--no-html"]) == 0
    assert "found/report.html is of an earlier run" in capsys.readouterr().err


def test_effects_are_excluded(case, workflow):
    assert main(["explain", "case", "--out", "f", "-q", "--exclude", "fog,rain", "--exclude", "fog"]) == 0
    assert workflow.calls[0]["exclude"] == ("fog", "rain")


REFUSED = {
    "explain": "lidarcheck explain needs CASE",
    "explain case": "lidarcheck explain needs --out",
    "explain nowhere --out found": "nowhere: there is no such file",
    "explain case --out case": "is the case's own directory, whose model.toml would be replaced",
    "explain case/case.toml --out case": "is the case's own directory",
    "explain case --out file": "file: is not a directory; name a directory for --out",
    "explain case --out a/b": "its directory does not exist",
    "explain case --out found --json case/m1.txt": "would replace another file of this command",
    "explain case --out there --json there/report.json": "would replace another file of this command",
    "explain case --out blocked": "blocked/report.json: cannot be replaced",
    "explain case --out found --exclude fgo": "did you mean fog?",
    "explain case --out found --jobs 0": "--jobs 0 is out of range",
    "explain case --out found --only null": "--only is for --benchmark",
    "explain case --out found --generator x": "--generator is for --benchmark",
    "explain case --benchmark 3": "CASE does not go with --benchmark",
    "explain --benchmark 3 --exclude fog": "--exclude does not go with --benchmark",
    "explain --benchmark 0": "--benchmark 0 is out of range; use a whole number from 1 to 100000",
    "explain --benchmark many": "--benchmark many is out of range",
    "explain --benchmark 1": "there is no tests/hidden, which makes the cases",
    "explain --benchmark 1 --generator there": "there: is not a Python package",
    "explain case --out found --into there.toml": "there.toml is there already",
    "explain case --out found --into known": "scenarios/known.toml is there already",
}


@pytest.mark.parametrize(("line", "says"), REFUSED.items())
def test_what_is_refused_before_the_work(case, workflow, line, says, capsys):
    Path("file").write_text("")
    Path("there").mkdir()
    Path("there.toml").write_text("")
    Path("scenarios").mkdir()
    Path("scenarios/known.toml").write_text("")
    Path("blocked/report.json").mkdir(parents=True)
    before = sorted(Path().rglob("*"))
    assert main(line.split()) == 2
    err = capsys.readouterr().err
    assert says in err
    assert len(err.splitlines()) == 1
    assert workflow.calls == []
    assert sorted(Path().rglob("*")) == before


def test_a_model_below_the_case_is_not_replaced(made, tmp_path, workflow, capsys):
    case = tmp_path / "c"
    case.mkdir()
    for file in made.iterdir():
        (case / file.name).write_bytes(file.read_bytes())
    (case / "sub").mkdir()
    (case / "model.toml").rename(case / "sub/model.toml")
    (case / "case.toml").write_text((case / "case.toml").read_text().replace("model.toml", "sub/model.toml"))
    assert main(["explain", str(case), "--out", str(case / "sub")]) == 2
    assert "sub/model.toml: would replace a file of the case" in capsys.readouterr().err
    assert main(["explain", str(case), "--out", str(case / "found"), "-q"]) == 0


def test_an_interrupted_run_goes_on(case, workflow, capsys):
    workflow.fails = KeyboardInterrupt()
    assert main(["explain", "case", "--out", "found"]) == 130
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == "interrupted: what was done is kept in found/.explain; the same command goes on from there"
    assert listed("found") == [".explain"]
    workflow.fails = None
    assert main(["explain", "case", "--out", "found"]) == 0
    assert "going on with what an interrupted run left" in capsys.readouterr().err
    assert [call["kept"] for call in workflow.calls] == [None, [0, 1]]
    assert listed("found") == FILES


def test_other_work_does_not_go_on(case, workflow):
    workflow.fails = KeyboardInterrupt()
    assert main(["explain", "case", "--out", "found", "-q"]) == 130
    assert main(["explain", "case", "--out", "found", "-q", "--seed", "1"]) == 130
    assert main(["explain", "case", "--out", "found", "-q", "--seed", "1", "--exclude", "fog"]) == 130
    assert [call["kept"] for call in workflow.calls] == [None, None, None]


def test_an_error_of_the_workflow_is_one_line(case, workflow, capsys):
    workflow.fails = InputError("does not add up", file="case/case.toml", fix="measure again")
    assert main(["explain", "case", "--out", "found", "-q"]) == 2
    assert capsys.readouterr().err == "error: case/case.toml: does not add up; measure again\n"


def test_all_three_or_none(case, workflow, monkeypatch, capsys):
    assert main(["explain", "case", "--out", "found", "-q"]) == 0
    before = {name: Path("found", name).read_bytes() for name in FILES}
    workflow.answer = lambda c: explanation(c, "explained", ("rain",))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys.modules["lidarcheck.figures.html.explanation"], "write_html", full)
    capsys.readouterr()
    assert main(["explain", "case", "--out", "found", "-q"]) == 2
    assert "found: cannot write: No space left on device; nothing was changed" in capsys.readouterr().err
    assert {name: Path("found", name).read_bytes() for name in FILES} == before
    assert listed("found") == [".explain", *FILES]


def test_the_last_file_is_put_back_when_the_others_cannot_follow(tmp_path, monkeypatch):
    (tmp_path / "c").write_text("old")
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError(5, "I/O error")))
    with pytest.raises(InputError, match="nothing was changed"):
        write_set(tmp_path, {name: lambda path: path.write_text("new") for name in "abc"})
    assert (tmp_path / "c").read_text() == "old"
    assert listed(tmp_path) == ["c"]


def test_two_runs_at_once(case, workflow, capsys):
    def second(loaded):
        assert main(["explain", "case", "--out", "found", "-q"]) == 2
        return explanation(loaded)

    workflow.answer = second
    assert main(["explain", "case", "--out", "found", "-q"]) == 0
    assert capsys.readouterr().err == (
        "error: another run works in found; wait until it has ended, or name another --out\n"
    )


def test_a_scenario_is_proposed(case, workflow, monkeypatch, capsys):
    asked = {}

    def propose(ideals, model, effects, scenario, **more):
        asked.update(ideals=ideals, effects=effects, scenario=scenario, lost=more["lost"])
        return types.SimpleNamespace(lines=lambda: ["watches fog"])

    monkeypatch.setattr("lidarcheck.harness.propose.propose.propose_scenario", propose)
    assert main(["explain", "case", "--out", "found", "--into", "watch_fog"]) == 0
    assert asked == {"ideals": [f"case/i{k}.txt" for k in range(4)], "effects": ["fog"], "scenario": "watch_fog",
                     "lost": {}}  # fmt: skip
    assert "watches fog" in capsys.readouterr().err
    workflow.answer = lambda c: explanation(c, "no_gap")
    assert main(["explain", "case", "--out", "found", "--into", "watch_fog"]) == 0
    assert "nothing is missing, so that there is no scenario to propose" in capsys.readouterr().err


@pytest.mark.parametrize("width", [60, 80, 100])
@pytest.mark.parametrize("verdict", ["no_gap", "explained", "unknown"])
def test_the_report_fits(made, width, verdict):
    names = ("fog", "walk_error", "unknown") if verdict == "unknown" else ("fog", "walk_error")
    text = report_text(explanation(load_case(made), verdict, names), width=width)
    assert max(map(len, text.splitlines())) <= width
    assert text.isascii()
    assert "retro_ghost: no retro-reflector" in text


def test_the_report_says_everything(made):
    text = report_text(explanation(load_case(made)), diff=['+ name = "fog"'])
    words = " ".join(text.split())
    for part in (
        "EXPLAINED: one effect is missing from the model: fog. The model with it closes 97 % of the gap",
        "1. fog: confidence 97 %",
        "extinction_per_m 0.0123 (0.0119 ... 0.0131) 1/m",
        "where: AREA falls with range",
        "cannot be told apart from: rain",
        "what would separate them: a frame in clear air beside one in fog",
        "AREA is 20 % lower than modelled at 60 to 80 m",
        "accepted (like rain)",
        "frames of fit: 0, 2; select: 1; verify: 3",
        "seeds: fit 0, verify 99",
        '+ name = "fog"',
    ):
        assert part in words
    bars = {line.split()[0]: line.count("#") for line in text.splitlines() if line.endswith(("|", "#"))}
    assert bars["before"] > 8 * bars["after"] > 0


def test_verdicts_in_words(made):
    case = load_case(made)
    assert verdict_sentence(explanation(case, "no_gap")).startswith("NO GAP: ")
    pair = verdict_sentence(explanation(case, "explained", ("fog", "rain")))
    assert "2 effects are missing from the model: fog and rain." in pair
    unknown = verdict_sentence(explanation(case, "unknown", ("fog", "unknown")))
    assert unknown.startswith("UNKNOWN: ")
    assert "Beside it: fog." in unknown
    found = dataclasses.replace(explanation(case, "unknown", ("fog",)), closed_seen=0.98)
    found = dataclasses.replace(found, gap=dataclasses.replace(found.gap, closed_span=(0.1, 0.35)))
    assert verdict_sentence(found) == (
        "UNKNOWN: fog was found, but less than half of the gap closes: 98 % of the gap closes on the frames "
        "that chose, 97 % (10 to 35 %) on those that nothing has seen. The rest is something else."
    )


def test_the_share_of_what_is_calibrated_is_told_apart(made):
    numbers = (Calibrated("materials.1.reflectance", 0.17, 0.16, 0.15, 0.18, 0.015),)
    found = dataclasses.replace(explanation(load_case(made)), calibrated=numbers)
    assert "of the gap on frames that no fit has seen, 2 % of it by what is calibrated besides." in verdict_sentence(
        found
    )


@pytest.mark.parametrize(("options", "calibrates"), [([], True), (["--no-nuisances"], False)])
def test_nothing_is_calibrated_where_that_is_asked(case, workflow, options, calibrates):
    assert main(["explain", "case", "--out", "found", "-q", *options]) == 0
    assert workflow.calibrates is calibrates
    assert main(["explain", "--benchmark", "2", "--no-nuisances"]) == 2


def test_pace_knows_the_rest_from_the_steps_shares():
    now = [0.0]
    pace = Pace({"a": 1.0, "b": 3.0}, clock=lambda: now[0])
    assert pace.left_s is None
    now[0] = 10.0
    pace.on_progress("a", 1, 2)
    assert pace.left_s == pytest.approx(70.0)
    pace.on_progress("b", 0, 0)
    assert pace.left_s == pytest.approx(30.0)
    pace.on_progress("a", 0, 2)
    pace.on_progress("strange", 5, 5)
    assert pace.part == 0.25
    now[0] = 40.0
    pace.on_progress("b", 7, 5)
    assert pace.left_s == 0.0


def test_what_an_earlier_run_did_says_nothing_about_the_pace():
    now = [0.1]
    pace = Pace({"a": 1.0, "b": 1.0}, clock=lambda: now[0])
    pace.on_progress("b", 0, 2)
    assert pace.left() == ""
    now[0] = 20.1
    pace.on_progress("b", 1, 2)
    assert pace.left() == "about 0:20 left"


def test_clock():
    assert [clock_text(s) for s in (0.4, 59.6, 754.0, 3723.0)] == ["0:00", "1:00", "12:34", "1:02:03"]


def test_progress_moves_on_a_terminal(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr("lidarcheck.cli.explain.watch._AT_ONCE_S", -1.0)
    with watched({"split": 0.5, "fit": 0.5}) as on_progress:
        on_progress("split", 0, 3)
        on_progress("fit", 2, 4)
    err = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", capsys.readouterr().err)
    assert "fit" in err
    assert "2/4" in err
    assert "left" in err


def test_progress_for_programs_is_a_line_of_json_each(case, workflow, capsys):
    assert main(["explain", "case", "--out", "found", "--progress", "json"]) == 0
    *lines, last = capsys.readouterr().err.splitlines()
    assert last == "found: report.json, model.toml, report.html"
    said = [json.loads(line) for line in lines]
    assert said[0] == {"steps": ["split", "fit"]}
    assert [(one["step"], one.get("done"), one.get("found")) for one in said[1:]] == [
        ("split", 1, None), ("split", None, "2 frames to fit"), ("fit", 0, None), ("fit", 2, None)]  # fmt: skip
    assert [one["part"] for one in said if "part" in one] == [0.2, 0.2, 1.0]
    assert {"of", "elapsed_s", "left_s"} <= said[1].keys()
    assert main(["explain", "case", "--out", "found", "--progress", "json", "--quiet"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["explain", "--benchmark", "3", "--progress", "json"]) == 2
    assert "--progress does not go with --benchmark" in capsys.readouterr().err


def test_a_step_tells_its_beginning_and_its_end_and_not_every_turn(capsys):
    lines = JsonLines({"fit": 1.0})
    for done in range(1001):
        lines.on_progress("fit", done, 1000)
    said = [json.loads(line) for line in capsys.readouterr().err.splitlines()][1:]
    assert (said[0]["done"], said[-1]["done"]) == (0, 1000)
    assert len(said) < 500


def test_quiet_progress_says_nothing(capsys):
    with watched({"a": 1.0}, quiet=True) as on_progress:
        on_progress("a", 0, 1)
    assert capsys.readouterr().err == ""
