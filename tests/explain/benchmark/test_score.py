"""The benchmark: what an answer is worth, by hand-counted examples; and running cases, going on, and the seal."""

import json
import math
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import explain_report_kit as kit
from lidarcheck.cli import main
from lidarcheck.errors import InputError, UsageError
from lidarcheck.explain.benchmark.run import _told_apart, find_generator, load_generator, run_benchmark
from lidarcheck.explain.benchmark.score import Answer, Share, score
from lidarcheck.explain.benchmark.text import figures, gate_counts, table_markdown, table_text
from lidarcheck.inference.intervals import ClassifierGap


def said(name, confidence=0.95, equivalent=(), **parameters):
    intervals = {key: {"value": v, "low": v - 1.0, "high": v + 1.0} for key, v in parameters.items()}
    return {"name": name, "confidence": confidence, "equivalent_to": list(equivalent), "parameters": intervals}


def answer(kind, effects=(), found=(), verdict="explained", *, shows=True, strength="strong", **more):
    parts = {"comparable": {}, "closed": 0.97, "seconds": 10.0} | more
    return Answer(
        number=0,
        kind=kind,
        strength=strength,
        variant="SMART",
        scene="lab",
        effects=tuple(effects),
        observable=dict.fromkeys(effects, shows),
        verdict=verdict,
        found=tuple(found),
        **parts,
    )


def counts(answers, name, which="shares"):
    share = getattr(score(answers), which)[name]
    return share.hits, share.of


def test_singles_by_name_and_strength():
    answers = [
        answer("single", ["fog"], [said("fog")]),
        answer("single", ["fog"], [said("rain")], strength="weak"),
        answer("single", ["fog"], [said("fog"), said("rain")], strength="weak"),
        answer("single", ["fog"], [said("fog")], strength="weak"),
        answer("single", ["fog"], [said("fog")], verdict="unknown", strength="medium"),
        answer("single", ["fog"], [], verdict="no_gap", shows=False, strength="weak"),
    ]
    assert counts(answers, "singles named exactly") == (2, 5)
    assert counts(answers, "  weak") == (1, 3)
    assert counts(answers, "  medium") == (0, 1)
    assert counts(answers, "  strong") == (1, 1)
    assert counts(answers, "  weak", "all_shares") == (1, 4)
    assert counts(answers, "wrong abstentions") == (1, 5)
    assert counts(answers, "wrong abstentions", "all_shares") == (2, 6)


SETS = {
    "itself": ([said("fog")], True),
    "the other": ([said("rain", equivalent=["fog"])], True),
    "one of three": ([said("rain", equivalent=["dropout", "fog"])], True),
    "one of four": ([said("rain", equivalent=["dropout", "blockage", "fog"])], False),
    "one of four, and itself": ([said("fog", equivalent=["a", "b", "c"])], False),
    "none": ([said("rain", equivalent=["dropout"])], False),
    "one too many": ([said("fog"), said("rain")], False),
    "nothing": ([], False),
}


@pytest.mark.parametrize(("found", "right"), SETS.values(), ids=SETS)
def test_a_set_of_three(found, right):
    assert counts([answer("single", ["fog"], found)], "singles within a set of three") == (right, 1)


def test_pairs():
    fog, rain = said("fog"), said("rain")
    answers = [
        answer("pair", ["fog", "rain"], [rain, fog]),
        answer("pair", ["fog", "rain"], [fog]),
        answer("pair", ["fog", "rain"], [fog, said("dropout", equivalent=["rain"])]),
        answer("pair", ["fog", "rain"], [said("dropout", equivalent=["fog"]), said("boresight", equivalent=["fog"])]),
        answer("pair", ["fog", "rain"], [said("rain", equivalent=["fog"]), fog]),
    ]
    assert counts(answers, "pairs complete") == (2, 5)
    assert counts(answers, "pairs within sets of three") == (3, 5)


def test_several():
    fog, rain, walk, gain = (said(name) for name in ("fog", "rain", "walk_error", "signal_gain"))
    hidden = ["fog", "rain", "walk_error"]
    answers = [
        answer("several", hidden, [walk, fog, rain]),
        answer("several", hidden, [fog, gain]),
        answer("several", hidden, [said("unknown")], verdict="unknown"),
    ]
    assert counts(answers, "three or four complete") == (1, 3)
    assert counts(answers, "  of their effects, named") == (4, 9)
    assert counts(answers, "  of their names, hidden") == (4, 5)
    assert counts(answers, "wrong abstentions") == (1, 3)
    assert counts(answers, "pairs complete") == (0, 0)


def test_a_pair_shows_when_both_do():
    half = replace(answer("pair", ["fog", "rain"], [said("fog")]), observable={"fog": True, "rain": False})
    assert counts([half], "pairs complete") == (0, 0)
    assert counts([half], "pairs complete", "all_shares") == (0, 1)


def test_false_alarms():
    answers = [
        answer("null", verdict="no_gap"),
        answer("null", found=[said("fog")]),
        answer("null_nuisance", verdict="unknown", found=[said("unknown")]),
        answer("null_nuisance", verdict="no_gap"),
        answer("null_nuisance", verdict="no_gap"),
    ]
    assert counts(answers, "false alarms on nulls") == (2, 5)
    assert counts(answers, "  without nuisances") == (1, 2)
    assert counts(answers, "  with nuisances") == (1, 3)


def test_unknowns():
    answers = [
        answer("alien", ["ripple"], [said("unknown")], verdict="unknown"),
        answer("alien", ["ripple"], [said("unknown"), said("fog", 0.9)], verdict="unknown"),
        answer("alien", ["ripple"], [said("unknown"), said("fog", 0.2)], verdict="unknown"),
        answer("alien", ["ripple"], [said("fog", 0.9)]),
        answer("alien", ["ripple"], [], verdict="no_gap"),
        answer("alien", ["ripple"], [], verdict="no_gap", shows=False),
        answer("left_out", ["fog"], [said("unknown")], verdict="unknown", exclude=("fog",)),
    ]
    assert counts(answers, "unknowns recognised") == (3, 6)
    assert counts(answers, "  of no catalogue") == (2, 5)
    assert counts(answers, "  left out of the catalogue") == (1, 1)
    assert counts(answers, "unknowns confidently misnamed") == (2, 6)


def test_coverage_of_the_parameters_that_can_be_compared():
    truth = {"fog.extinction": 5.0, "fog.backscatter": 1.0, "rain.rate": 3.0}
    answers = [
        answer("pair", ["fog", "rain"], [said("fog", extinction=5.5, backscatter=9.0, other=1.0)], comparable=truth),
        answer("single", ["rain"], [said("dropout", rate=3.0)], comparable={"rain.rate": 3.0}),
        answer("single", ["rain"], [said("rain", rate=4.0)], comparable={"rain.rate": 3.0}),
    ]
    assert counts(answers, "90 % intervals cover the truth") == (2, 3)


def test_calibration_and_brier():
    answers = [
        answer("single", ["fog"], [said("fog", 0.92)]),
        answer("single", ["fog"], [said("rain", 0.94)]),
        answer("single", ["fog"], [said("fog", 1.0)]),
        answer("null", [], [said("rain", 0.3)]),
        answer("alien", ["x"], [said("unknown", 0.9)], verdict="unknown"),
    ]
    found = score(answers)
    table = [(b.low, b.high, round(b.confidence, 3), b.right.hits, b.right.of) for b in found.calibration]
    assert table == [(0.0, 0.5, 0.3, 0, 1), (0.9, 0.95, 0.93, 1, 2), (0.95, 1.0, 1.0, 1, 1)]
    assert found.brier == pytest.approx((0.08**2 + 0.94**2 + 0.0 + 0.3**2) / 4)


def test_the_gap_and_the_time():
    answers = [
        answer("single", ["fog"], closed=c, seconds=s)
        for c, s in ((0.9, 1.0), (0.99, 2.0), (0.96, 30.0), (math.nan, 3.0))
    ]
    answers.append(answer("null", verdict="no_gap", closed=-3.0, seconds=4.0))
    found = score(answers)
    assert found.closed == pytest.approx(0.96)
    assert found.seconds[0] == pytest.approx(3.0)
    assert found.seconds[1] == pytest.approx(4.0 + 0.6 * 26.0)


def test_what_a_classifier_tells_apart_is_of_cases_that_hide_something():
    told = [(0.8, 0.5), (0.9, 0.6), (0.6, 0.52), (math.nan, math.nan)]
    answers = [answer("single", ["fog"], told_before=before, told_after=after) for before, after in told]
    answers.append(answer("single", ["fog"], shows=False, told_before=0.5, told_after=0.5))
    answers += 2 * [answer("alien", ["x"], verdict="unknown", told_before=0.99, told_after=0.99)]
    found = score(answers)
    assert found.told == pytest.approx((0.8, 0.52))
    assert found.to_dict()["told_apart"] == {"before": pytest.approx(0.8), "after": pytest.approx(0.52)}
    assert score(answers[3:4]).to_dict()["told_apart"] == {"before": None, "after": None}


def test_what_closes_outside_of_the_catalogue_is_told_apart_from_what_names_close() -> None:
    unknown = {"verdict": "unknown", "told_before": 0.9}
    answers = [
        answer("single", ["fog"], closed=0.97, told_before=0.7, told_after=0.5),
        *(answer(kind, ["fog"], closed=c, told_after=c, **unknown) for kind, c in (("alien", 0.5), ("left_out", 0.6))),
        answer("alien", ["fog"], closed=0.1, shows=False, **unknown),
    ]
    found = score(answers).to_dict()
    assert found["closed"] == pytest.approx(0.97)
    assert found["described"] == {
        "closed": pytest.approx(0.55), "told_apart": {"before": pytest.approx(0.9), "after": pytest.approx(0.55)}
    }  # fmt: skip
    assert score(answers[:1]).to_dict()["described"]["closed"] is None


def test_an_error_is_wrong_everywhere():
    broken = [
        replace(answer(kind, effects, verdict="error"), number=i, error="broke", closed=math.nan)
        for i, (kind, effects) in enumerate((("single", ["fog"]), ("null", []), ("alien", ["x"])))
    ]
    assert counts(broken, "singles named exactly") == (0, 1)
    assert counts(broken, "wrong abstentions") == (1, 1)
    assert counts(broken, "false alarms on nulls") == (1, 1)
    assert counts(broken, "unknowns recognised") == (0, 1)
    found = score(broken)
    assert found.errors == {0: "broke", 1: "broke", 2: "broke"}
    assert math.isnan(found.closed)


def test_wilson_interval():
    # R: binom::binom.wilson(48, 50)
    assert Share(48, 50).interval == pytest.approx((0.865403, 0.988955), abs=1e-5)
    assert Share(0, 0).interval == (0.0, 1.0)
    assert Share(0, 0).to_dict()["share"] is None


def test_an_answer_survives_json():
    one = answer("pair", ["fog", "rain"], [said("fog", extinction=0.1)], comparable={"fog.x": 0.1}, closed=math.nan)
    assert one.to_dict()["told_after"] is None
    assert Answer.of(json.loads(json.dumps(one.to_dict()))).to_dict() == one.to_dict()
    assert math.isnan(Answer.of(one.to_dict()).closed)


def test_nothing_at_all():
    found = score([])
    assert found.cases == 0
    json.dumps(found.to_dict(), allow_nan=False)


GENERATOR = """
import dataclasses

@dataclasses.dataclass(frozen=True)
class CaseOrder:
    number: int
    kind: str
    seed: int
    effects: tuple
    strength: str
    variant: str
    scene: str
    exclude: tuple = ()

@dataclasses.dataclass
class Truth:
    effects: tuple
    observable: dict
    comparable: dict
    z: dict

class Sealed:
    def __init__(self, truth):
        self.truth = truth
    def open(self, report):
        assert report["verdict"] in ("no_gap", "explained", "unknown")
        return self.truth

def plan(n, seed, only=None):
    kinds = [only] if only else ["single", "null", "alien"]
    names = {"single": ("fog",), "alien": ("ripple",)}
    return [CaseOrder(i, k, seed, names.get(k, ()), "weak", "SMART", "lab")
            for i, k in ((i, kinds[i % len(kinds)]) for i in range(n))]

def write_case(order, directory):
    directory.mkdir()
    (directory / "model.toml").write_text(
        'variant = "SMART"\\n[materials.1]\\nname = "%s"\\nreflectance = 0.5\\n' % (order.kind + str(order.number)))
    text = 'model = "model.toml"\\n'
    for k in range(3):
        (directory / f"i{k}.txt").write_text(
            "Layer Point Distance MaterialID IncidenceAngle\\n" + "".join(f"250 {p} 20 1 0\\n" for p in range(20)))
        (directory / f"m{k}.txt").write_text(
            "Layer Point RANGE PEAK AREA WIDTH\\n" + "".join(f"250 {p} 20.0{k} 50 300 9\\n" for p in range(20)))
        text += f'[[frames]]\\nideal = "i{k}.txt"\\nmeasured = "m{k}.txt"\\ntime = {k}.0\\n'
    (directory / "case.toml").write_text(text)
    shows = dict.fromkeys(order.effects, True)
    return Sealed(Truth(order.effects, shows, {"fog.x": 1.0}, dict.fromkeys(order.effects, 9.0)))
"""

EXPLAINER = """
import pathlib, types
CALLS = pathlib.Path(__file__).with_name("calls")

def explain(case, *, exclude, jobs):
    name = case.model.materials[1].name
    with CALLS.open("a") as file:
        file.write(name + "\\n")
    assert len(case.frames) == 3 and jobs == 1
    if name == "null4":
        raise ValueError("four is too many")
    x = {"value": 1, "low": 0, "high": 2}
    fog = {"name": "fog", "confidence": 0.9, "equivalent_to": [], "parameters": {"x": x}}
    report = {"verdict": "explained", "effects": [fog], "gap": {"closed": 0.98}}
    if not name.startswith("single"):
        report = {"verdict": "no_gap", "effects": [], "gap": {"closed": float("nan")}}
    report["steps"] = [{"step": "split", "found": "2 to fit, 1 to select"}]
    return types.SimpleNamespace(to_dict=lambda: report)
"""


@pytest.fixture
def bench(tmp_path, monkeypatch):
    (tmp_path / "made").mkdir()
    (tmp_path / "made/__init__.py").write_text(textwrap.dedent(GENERATOR))
    (tmp_path / "stand_in.py").write_text(textwrap.dedent(EXPLAINER))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "stand_in", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(n, **more):
    return run_benchmark(n, **{"generator": Path("made"), "explain": "stand_in:explain"} | more)


def calls(bench):
    file = bench / "calls"
    return sorted(file.read_text().split()) if file.exists() else []


def test_cases_are_run_and_judged(bench):
    told = []
    result = run(6, on_progress=lambda *what: told.append(what))
    assert calls(bench) == ["alien2", "alien5", "null1", "null4", "single0", "single3"]
    assert told[-1] == (6, 6, "case 5, alien")
    share = {name: (s.hits, s.of) for name, s in result.score.shares.items()}
    assert share["singles named exactly"] == (2, 2)
    assert share["false alarms on nulls"] == (1, 2)
    assert share["unknowns recognised"] == (0, 2)
    assert share["90 % intervals cover the truth"] == (2, 2)
    assert result.score.errors == {4: "ValueError: four is too many"}
    assert result.score.closed == pytest.approx(0.98)


def test_processes_give_the_same(bench):
    one, two = (run(4, jobs=jobs) for jobs in (1, 2))
    assert len(calls(bench)) == 8
    assert [replace(a, seconds=0.0).to_dict() for a in one.answers] == [
        replace(a, seconds=0.0).to_dict() for a in two.answers
    ]


def test_what_a_classifier_tells_is_that_of_the_answer():
    figure = ClassifierGap(0.6, -0.01, 0.03)
    found = kit.explanation()
    assert _told_apart(replace(found, gap=replace(found.gap, classifier=figure))) == (0.6, -0.01)
    for nothing in (found, None, "an answer of another kind"):
        assert np.isnan(_told_apart(nothing)).all()


def test_an_interrupted_benchmark_goes_on(bench):
    def stop(done, of, words):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(5, out=bench / "out", on_progress=stop)
    file = bench / "out/cases.jsonl"
    file.write_bytes(file.read_bytes() + b'{"number": 2, "ki')
    told = []
    result = run(5, out=bench / "out", on_progress=lambda *what: told.append(what))
    assert told[0] == (2, 5, "kept by an earlier run")
    assert calls(bench) == ["alien2", "null1", "null4", "single0", "single3"]
    assert len(result.answers) == 5
    again = run(3, out=bench / "out")
    assert len(calls(bench)) == 5
    assert [(a.gap["closed"], a.steps[0]["found"]) for a in again.answers[:2]] == [
        (0.98, "2 to fit, 1 to select"),
        (None, "2 to fit, 1 to select"),
    ]
    assert [a.number for a in again.answers] == [0, 1, 2]


def test_another_benchmark_starts_afresh(bench, caplog):
    run(2, out=bench / "out")
    run(2, out=bench / "out", seed=1)
    assert len(calls(bench)) == 4
    assert "cases.jsonl.old" in caplog.text
    assert (bench / "out/cases.jsonl.old").is_file()


def test_one_kind_only(bench):
    assert [a.kind for a in run(2, only="single").answers] == ["single", "single"]
    with pytest.raises(UsageError, match="there is no kind of case 'singel'; use one of null, "):
        run(2, only="singel")


def test_generators_that_are_none(bench, monkeypatch):
    (bench / "bad").mkdir()
    with pytest.raises(InputError, match="is not a Python package"):
        load_generator(bench / "bad")
    (bench / "bad/__init__.py").write_text("import nothing_of_that_name")
    with pytest.raises(InputError, match="cannot be imported: No module named 'nothing_of_that_name'"):
        load_generator(bench / "bad")
    (bench / "bad/__init__.py").write_text("plan = 1")
    with pytest.raises(InputError, match="has no write_case, CaseOrder"):
        load_generator(bench / "bad")
    with pytest.raises(UsageError, match="there is no tests/hidden"):
        find_generator(bench)
    (bench / "tests/hidden/deep").mkdir(parents=True)
    (bench / "tests/hidden/__init__.py").write_text("")
    monkeypatch.chdir(bench / "tests/hidden/deep")
    assert find_generator() == bench / "tests/hidden"


def test_gates_are_counted_by_the_cases_in_which_they_acted():
    def took(right, *steps):
        found = (said("fog"),)
        return answer(
            "single", ("fog",) if right else ("rain",), found, steps=tuple({"step": s, "found": ""} for s in steps)
        )

    answers = [took(True, "fit", "idle"), took(False, "fit", "withdrawn", "withdrawn"), took(True, "fit", "withdrawn")]
    assert gate_counts(answers) == {"idle": (1, 1), "withdrawn": (2, 1)}
    assert gate_counts([]) == {}


def test_tables(bench):
    result = run(6)
    text = table_text(result)
    assert max(map(len, text.splitlines())) <= 80
    assert "case 4, null, SMART, lab: hides nothing; no answer: ValueError: four is" in text
    assert "case 2, alien, SMART, lab: hides weak ripple (z 9); no_gap" in text
    assert "case 0" not in text
    assert "singles named exactly" in text
    assert "100 % (2/2)" in text
    page = table_markdown(result)
    assert "| singles named exactly | 100 % (2/2) | 34 … 100 % | 100 % (2/2) | ≥ 95 % |" in page
    assert len({line.count("|") for line in page.split("\n\n")[0].splitlines()}) == 1
    assert len(figures(result)) > 15


def test_the_command(bench, monkeypatch, capsys):
    monkeypatch.setattr(
        "lidarcheck.explain.benchmark.run.run_benchmark", lambda n, **more: run(n, **{**more, "jobs": 1})
    )
    argv = ["explain", "--benchmark", "2", "--generator", "made", "--json", "b.json", "--out", "kept"]
    assert main(argv) == 0
    out, err = capsys.readouterr()
    assert "singles named exactly" in out
    assert "2 of 2 cases, case 1, null" in err
    content = json.loads(Path("b.json").read_text())
    assert content["score"]["observable"]["singles named exactly"]["hits"] == 1
    assert len(content["cases"]) == 2
    assert Path("kept/cases.jsonl").is_file()
    assert main(["explain", "--benchmark", "2", "--generator", "made", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["score"]["cases"] == 2
