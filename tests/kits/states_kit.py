"""A project in which every screen has something that depends on one blooming table, and computations that cost nothing:
each shows the table's Y that it was computed with, as a reader of the model finds it.
"""

import json

from blooming_kit import sign_model
from explain_kit import explanation, write_case
from lidarcheck.cases.case import load_case
from lidarcheck.explain.report.model_diff import write_model
from lidarcheck.figures.data import Page
from lidarcheck.harness import check as check_module
from lidarcheck.harness.gate.evidence import KpiEvidence, KpiVerdict
from lidarcheck.harness.kpis.spec import KpiSpec, SeedMeasurement
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult
from lidarcheck.model import load_model
from lidarcheck.model.files.model_file import save_model
from lidarcheck.session.own_files import content_hash
from lidarcheck.tui.jobs import clouds, ghosts, noise, scenes, vehicles
from lidarcheck.tui.jobs.explain_cases import results_directory
from lidarcheck.tui.jobs.job import Computed
from scenario_texts import surface
from tui_kit import LUT, profile_text

ROW = 3
LOOK = '\n[[effects]]\nname = "blooming_vertical"\nlut = "{}"\n'
SCAN = "X Y Z Layer Point EchoNumber PEAK AREA WIDTH\n1 2 3 4 5 1 6 7 8\n"
IDEAL = "X Y Z Layer Point Range MaterialID\n1 2 3 4 5 6 7\n"
SCENARIO = """description = "a surface"
model = "../models/SLIM.toml"

{}[[kpis]]
name = "area_mean"
kpi = "area_mean"
tolerance = 1.0
"""


def make_stateful(root):
    """The project, with an answer of explain, a proposal, and all else to be computed."""
    for name in ("models", "hall_SLIM", "signs_SLIM", "scenarios", "measured"):
        (root / name).mkdir(parents=True)
    (root / "a_lut.ini").write_bytes(LUT.encode())
    save_model(sign_model("SLIM"), root / "models/SLIM.toml")
    with (root / "models/SLIM.toml").open("a") as stream:
        stream.write(LOOK.format("../a_lut.ini"))
    (root / "car_20m_SLIM_real.txt").write_text(SCAN)
    (root / "car_20m_SLIM_ideal.txt").write_text(IDEAL)
    for name in ("frame_00.txt", "frame_01.txt"):
        (root / "hall_SLIM" / name).write_text(SCAN)
    (root / "hall_SLIM/ideal.txt").write_text(IDEAL)
    (root / "signs_SLIM/1_25m.txt").write_text(SCAN)
    (root / "signs_SLIM/1_25m_ideal.txt").write_text(IDEAL)
    (root / "measured/sign_69m.csv").write_text(profile_text())
    (root / "scenarios/one.toml").write_text(SCENARIO.format(surface((240, 241), (0, 9), (50, 51))))
    _explained(root)
    check_module.check([root / "scenarios"], measure=measure)
    return root


def _explained(root):
    """A case whose model names the same table, and what a run has left."""
    directory = write_case(root / "case", frames=3)
    with (directory / "model.toml").open("a") as stream:
        stream.write(LOOK.format("../a_lut.ini"))
    case = load_case(directory)
    out = results_directory(root, directory / "case.toml")
    out.mkdir(parents=True)
    found = explanation(case)
    (out / "report.json").write_text(json.dumps(found.to_dict()))
    write_model(case.model_file, found.model, out / "model.toml")


def y_of(model):
    """The table's Y that a model has."""
    return next(effect.lut.y[ROW] for effect in model.effects if effect.name == "blooming_vertical")


def measure(scenario, model, seed, **_):
    """What a seed of the scenario finds: the table's Y."""
    found = {"area_mean": y_of(model) + 1e-9 * seed}
    return SeedMeasurement(found, {}, {}, content_hash(repr(found).encode())[:16])


def check(paths, progress):
    """A run of the gate that reads the scenario's model as it is on the disk, and finds the table's Y."""
    progress(0, 1, "")
    now = y_of(load_model(paths[0].parent / "../models/SLIM.toml"))
    spec = KpiSpec("area_mean", "mean", "1", "target", 0.1, high=3.0)
    evidence = KpiEvidence(KpiVerdict.EQUIVALENT, 0.0, 0.01, 0.02, 16)
    kpi = KpiResult(spec, KpiVerdict.EQUIVALENT, 1.0, now, evidence, note="", fresh=(now,))
    return CheckReport((ScenarioResult("one", paths[0], "", (kpi,)),), (), None, "", 1, 1e-3, 0.1, {})


def cheap(monkeypatch, runs):
    """Have the screens of pages compute nothing but the table's Y, by the model's own reader; `runs` counts."""

    def page(name, model, kind=Page):
        runs[name] = runs.get(name, 0) + 1
        return Computed(kind(f"Y {y_of(load_model(model)):.7f}", "done", ()), {})

    def one(name, kind=Page):
        return lambda _what, given, *_more, **_: page(name, getattr(given, "model", given), kind)

    monkeypatch.setattr(vehicles, "_compare", lambda _labels, _used, _files, model, *_: page("histograms", model))
    monkeypatch.setattr(scenes, "_compare", lambda _m, _ideal, model, *_, **__: page("cloud", model))
    monkeypatch.setattr(clouds, "_clouds", lambda _entry, source, _told: page("points", source.model))
    monkeypatch.setattr(noise, "_page", one("noise", noise.NoisePage))
    monkeypatch.setattr(ghosts, "_find_page", one("ghosts", ghosts.GhostPage))
    monkeypatch.setattr(ghosts, "_fit_page", one("ghosts", ghosts.GhostPage))
