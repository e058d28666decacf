"""`check`: every verdict, every way in which a run can fail without a KPI, and that it leaves goldens alone."""

import dataclasses
import json
import logging
import threading
from pathlib import Path

import pytest

import lidarcheck.harness.check as check_module
from budget import examples
from harness_fakes import SPECS, Project
from lidarcheck import effects
from lidarcheck.errors import GoldenError, InputError, UsageError
from lidarcheck.harness import scenario_run
from lidarcheck.harness.check import check
from lidarcheck.harness.gate import evidence, seeds
from lidarcheck.harness.gate.evidence import KpiVerdict
from lidarcheck.harness.goldens.file import load_golden, load_proposal, save_golden
from lidarcheck.harness.layout import select
from lidarcheck.harness.reports.results import CheckReport
from lidarcheck.harness.review import review as review_module
from lidarcheck.harness.review.accept import ALL, accept, release
from lidarcheck.harness.review.review import review
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Material, Sensor


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A project with accepted goldens."""
    monkeypatch.setattr(review_module, "uncommitted", lambda scenario: ("", ""))
    made = Project(tmp_path / "project")
    accept(review([made.root], **made.stand_ins), [ALL])
    made.seeds.clear()
    return made


def run(project: Project, **more: object) -> CheckReport:
    return check([project.root], **project.stand_ins, **more)  # type: ignore[arg-type]


def verdicts(report: CheckReport, name: str) -> set[KpiVerdict]:
    return {kpi.verdict for scenario in report.scenarios for kpi in scenario.kpis if kpi.name == name}


def files(project: Project) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in sorted(project.root.rglob("*.toml")) if ".lidarcheck" not in path.parts}


def test_unchanged_is_identical_after_the_paired_seeds(project: Project) -> None:
    report = run(project)
    assert report.exit_code == 0
    assert report.counts == {verdict.value: 6 * (verdict is KpiVerdict.IDENTICAL) for verdict in KpiVerdict}
    assert sorted(project.seeds) == sorted([*range(8)] * 2)
    assert not list(project.root.glob(".lidarcheck/proposals/*"))


def test_a_golden_that_a_larger_suite_has_made_too_coarse_is_named(
    project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not any(scenario.notes for scenario in run(project).scenarios)
    monkeypatch.setattr(check_module, "suite_size", lambda cases: 10**9)
    report = run(project)
    notes = [note for scenario in report.scenarios for note in scenario.notes]
    assert report.exit_code == 0
    assert notes
    assert all("too coarse as the suite has grown: chance alone explains" in note for note in notes)


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 2**70, -1])
def test_unchanged_holds_for_any_seed(project: Project, seed: int) -> None:
    report = run(project, seed=seed)
    assert report.exit_code == 0
    assert not {*range(96)} & {number for number in project.seeds if number >= 8}
    assert all(result.seeds in (24, 72) for result in report.scenarios)
    assert all(kpi.fresh for result in report.scenarios for kpi in result.kpis)


def test_aa_runs_stay_green(project: Project) -> None:
    # A changed stream: other random numbers, the same model, so that paired and fresh seeds are all judged.
    for stream in range(1, 1 + examples(30)):
        project.stream = stream
        report = run(project)
        assert report.exit_code == 0, [kpi for result in report.scenarios for kpi in result.kpis if kpi.fails]
        assert report.counts["identical"] == 0


def test_a_real_change_regresses(project: Project) -> None:
    project.shift = 3.0
    before = files(project)
    report = run(project)
    assert report.exit_code == 1
    assert verdicts(report, "area_mean") == {KpiVerdict.REGRESSED}
    assert verdicts(report, "area_distance") == {KpiVerdict.REGRESSED}
    assert not any(verdict.fails for verdict in verdicts(report, "detection"))
    assert {result.seeds for result in report.scenarios} == {72}
    assert files(project) == before, "check has written a golden"
    kpi = report.scenarios[0].kpis[0]
    assert kpi.golden is not None
    assert kpi.golden.delta == pytest.approx(3.0, abs=0.3)
    assert 1.0 < kpi.smallest < 3.0


def test_a_small_change_is_changed(project: Project) -> None:
    project.shift = 0.9
    report = run(project)
    assert report.exit_code == 0
    assert KpiVerdict.CHANGED in verdicts(report, "area_mean")


def test_better_is_improved(project: Project) -> None:
    project.lost = -0.04
    report = run(project)
    assert report.exit_code == 0
    assert verdicts(report, "detection") == {KpiVerdict.IMPROVED}


def test_results_do_not_depend_on_jobs(project: Project) -> None:
    project.shift = 0.5

    def numbers(jobs: int) -> object:
        table = run(project, jobs=jobs, seed=4).to_dict()
        return table["scenarios"]

    assert numbers(1) == numbers(2) == numbers(7)


def test_another_model(project: Project) -> None:
    same = run(project, model=Model(Sensor.of("SMART")))
    stronger = run(project, model=Model(Sensor.of("SMART", signal_at_1m=6180.0)))
    assert (same.exit_code, stronger.exit_code) == (0, 1)
    assert not list(project.root.glob(".lidarcheck/proposals/*")), "another model's run is nothing to accept"


def test_a_model_of_another_variant_is_not_asked(project: Project) -> None:
    report = run(project, model=Model(Sensor.of("SLIM")))
    assert report.exit_code == 1
    assert "compared" in report.problems[0]
    assert all("not run" in result.notes[0] for result in report.scenarios)
    assert project.seeds == []


def test_a_limit_holds_besides(project: Project) -> None:
    project.specs = (SPECS[0], dataclasses.replace(SPECS[1], tolerance=0.5, low=0.8), SPECS[2])
    accept(review([project.root], **project.stand_ins), [ALL])
    assert run(project).exit_code == 0
    project.lost = 0.2
    report = run(project)
    assert verdicts(report, "detection") == {KpiVerdict.REGRESSED}
    kpi = report.scenarios[0].kpis[1]
    assert "below the limit 0.8" in kpi.limit
    assert "limit" in kpi.note


def test_without_goldens_everything_is_missing(tmp_path: Path) -> None:
    project = Project(tmp_path / "project")
    report = run(project)
    assert report.exit_code == 1
    assert {kpi.verdict for result in report.scenarios for kpi in result.kpis} == {KpiVerdict.MISSING}
    assert "lidarcheck review one" in report.scenarios[0].kpis[0].note
    assert "compared" in report.problems[0]
    assert project.proposal("one").is_file()
    assert not (project.root / "goldens").exists()


def test_a_new_scenario_without_golden_fails(project: Project) -> None:
    project.file("three").write_text("#\n", encoding="utf-8")
    report = run(project)
    assert report.exit_code == 1
    assert [result.failed for result in report.scenarios] == [False, True, False]


@pytest.mark.parametrize("where", ["goldens", "goldens/release"])
def test_a_golden_without_scenario_fails(project: Project, where: str) -> None:
    (project.root / where).mkdir(exist_ok=True)
    (project.root / where / "gone.toml").write_bytes(project.golden("one").read_bytes())
    report = run(project)
    assert report.exit_code == 1
    assert f"{where}/gone.toml has no scenario" in report.problems[0]
    assert check([project.file("one")], **project.stand_ins).exit_code == 0, "other scenarios are not its business"


def test_kpis_that_come_and_go_are_missing(project: Project) -> None:
    project.specs = (SPECS[0], dataclasses.replace(SPECS[0], name="new"))
    report = run(project)
    found = {kpi.name: kpi for kpi in report.scenarios[0].kpis}
    assert found["area_mean"].verdict is KpiVerdict.IDENTICAL
    assert {found[name].verdict for name in ("new", "detection", "area_distance")} == {KpiVerdict.MISSING}
    assert "golden does not have it" in found["new"].note
    assert "no longer asks" in found["detection"].note
    assert report.exit_code == 1


def test_a_kpi_that_is_asked_but_not_measured_is_missing(project: Project) -> None:
    measured = project.measure
    project.measure = lambda *given: dataclasses.replace(measured(*given), samples={})  # type: ignore[method-assign]
    found = {kpi.name: kpi for kpi in run(project).scenarios[0].kpis}
    assert found["area_distance"].verdict is KpiVerdict.MISSING
    assert "did not measure" in found["area_distance"].note


def test_a_changed_scenario_fails_and_says_what(project: Project) -> None:
    project.version = "v2"
    report = run(project)
    assert report.exit_code == 1
    assert "has changed since its golden" in report.scenarios[0].problems[0]
    project.specs = (dataclasses.replace(SPECS[0], tolerance=50.0), *SPECS[1:])
    assert "area_mean: tolerance 1 is now 50" in run(project).scenarios[0].problems[0]


def test_values_that_vanish_are_indeterminate(project: Project) -> None:
    measured = project.measure
    nan = {"area_mean": float("nan"), "detection": 0.95}
    project.measure = lambda *given: dataclasses.replace(measured(*given), values=nan)  # type: ignore[method-assign]
    report = run(project)
    assert verdicts(report, "area_mean") == {KpiVerdict.INDETERMINATE}
    json.dumps(report.to_dict(), allow_nan=False)


def test_an_edited_golden_cannot_be_run(project: Project) -> None:
    path = project.golden("two")
    path.write_text(path.read_text(encoding="utf-8").replace("tolerance = 1.0", "tolerance = 9.0"), encoding="utf-8")
    with pytest.raises(GoldenError, match="edited by hand"):
        run(project)


def test_a_broken_release_golden_is_made_anew_by_a_release(project: Project) -> None:
    (broken,) = (path for path in release([project.root]) if path.name == "one.toml")
    broken.write_text("x", encoding="utf-8")
    with pytest.raises(GoldenError, match="lidarcheck review --release"):
        run(project)
    release([project.root])
    assert run(project).exit_code == 0


def test_a_golden_of_another_scenario_fails(project: Project) -> None:
    project.golden("two").write_bytes(project.golden("one").read_bytes())
    report = run(project)
    assert report.exit_code == 1
    assert "golden is of the scenario one" in report.scenarios[1].problems[0]


def test_slow_drift_is_seen_against_the_release(project: Project) -> None:
    release([project.root])
    for step in (0.9, 1.8, 2.7):
        project.shift = step
        report = run(project)
        if report.exit_code:
            break
        accept(review([project.root], **project.stand_ins), [ALL])
    assert report.exit_code == 1
    failed = [kpi for result in report.scenarios for kpi in result.kpis if kpi.fails]
    assert all(kpi.golden is not None and not kpi.golden.verdict.fails for kpi in failed)
    assert "drifted" in failed[0].note


def test_what_the_golden_knows_is_held_against_the_release_without_fresh_seeds(project: Project) -> None:
    for name in ("one", "two"):
        project.specs = tuple(spec for spec in project.specs if spec.kind != "distance")
        project.golden(name).unlink()
    accept(review([project.root], **project.stand_ins), [ALL], reason="no distances")
    release([project.root])
    project.shift = 0.9
    accept(review([project.root], **project.stand_ins), [ALL], reason="a stronger laser")
    project.seeds.clear()
    known = run(project)
    assert sorted(project.seeds) == sorted([*range(8)] * 2)
    fresh = run(project, seed=3)
    for one, other in zip(known.scenarios, fresh.scenarios, strict=True):
        for kpi, again in zip(one.kpis, other.kpis, strict=True):
            assert kpi.release is not None
            assert again.release is not None
            assert kpi.golden is not None
            assert kpi.golden.verdict is KpiVerdict.IDENTICAL
            assert kpi.release.verdict is again.release.verdict
            assert kpi.release.seeds == 64
    moved = known.scenarios[0].kpis[0].release
    assert moved is not None
    assert moved.delta == pytest.approx(0.9, abs=0.1)
    assert moved.verdict is not KpiVerdict.EQUIVALENT


def test_distances_from_the_release_want_fresh_seeds(project: Project) -> None:
    release([project.root])
    project.shift = 0.9
    accept(review([project.root], **project.stand_ins), [ALL], reason="a stronger laser")
    project.seeds.clear()
    report = run(project)
    assert len(set(project.seeds)) > 8
    assert all(kpi.release is not None for result in report.scenarios for kpi in result.kpis)


def test_a_change_accepted_with_a_reason_is_no_drift(project: Project) -> None:
    release([project.root])
    project.shift = 5.0
    accept(review([project.root], **project.stand_ins), [ALL], reason="a stronger laser")
    report = run(project)
    assert report.exit_code == 0
    kpi = report.scenarios[0].kpis[0]
    assert kpi.release is not None
    assert kpi.release.verdict is KpiVerdict.REGRESSED
    assert "a stronger laser" in kpi.note
    release([project.root])
    assert run(project).scenarios[0].kpis[0].verdict is KpiVerdict.IDENTICAL


def test_a_reason_that_the_release_has_excuses_no_drift(project: Project) -> None:
    project.shift = 5.0
    accept(review([project.root], **project.stand_ins), [ALL], reason="a stronger laser")
    release([project.root])
    for step in (5.9, 6.8, 7.7):
        project.shift = step
        report = run(project)
        if report.exit_code:
            break
        accept(review([project.root], **project.stand_ins), [ALL])
    failed = [kpi for result in report.scenarios for kpi in result.kpis if kpi.fails]
    assert failed
    assert all(kpi.reason == "a stronger laser" for kpi in failed)
    assert "drifted" in failed[0].note


def test_a_fresh_change_is_not_called_drift(project: Project) -> None:
    release([project.root])
    project.shift = 5.0
    kpi = run(project).scenarios[0].kpis[0]
    assert kpi.golden is not None
    assert kpi.release is not None
    assert kpi.golden.verdict is kpi.release.verdict is KpiVerdict.REGRESSED
    assert "since the last release" not in kpi.note


def test_a_release_of_another_scenario_is_not_compared(project: Project) -> None:
    release([project.root])
    project.version = "v2"
    accept(review([project.root], **project.stand_ins), [ALL])
    report = run(project)
    assert report.exit_code == 0
    assert "last release measured another version" in report.scenarios[0].notes[0]


def test_same_source_other_echoes_is_noted(project: Project) -> None:
    project.stream = 1
    assert "another machine or library" in run(project).scenarios[0].notes[0]


def test_a_proposal_is_left_and_removed(project: Project) -> None:
    project.shift = 3.0
    run(project)
    proposal = load_proposal(project.proposal("one"))
    assert not proposal.complete
    assert proposal.kpis["area_mean"].verdict == "regressed"
    assert (project.root / ".lidarcheck" / ".gitignore").read_text(encoding="utf-8") == "*\n"
    project.shift = 0.0
    run(project)
    assert not project.proposal("one").exists()


def test_a_project_that_cannot_be_written_is_checked(project: Project, caplog: pytest.LogCaptureFixture) -> None:
    project.shift = 3.0
    (project.root / ".lidarcheck" / "proposals").rmdir()
    (project.root / ".lidarcheck" / "proposals").write_text("in the way", encoding="utf-8")
    with caplog.at_level(logging.WARNING, logger="lidarcheck"):
        assert run(project).exit_code == 1
    assert "no proposal was left" in caplog.text


def test_progress_counts_up(project: Project) -> None:
    project.shift = 3.0
    calls: list[tuple[int, int, str]] = []
    run(project, progress=lambda *call: calls.append(call))
    assert calls[-1][:2] == (144, 144)
    assert [done for done, _, _ in calls] == sorted(done for done, _, _ in calls)
    assert {label for _, _, label in calls} == {"one", "two"}


def test_an_interrupt_stops_and_writes_nothing(project: Project) -> None:
    project.shift = 3.0

    def interrupt(done: int, total: int, label: str) -> None:
        if done == 20:
            raise KeyboardInterrupt

    before = files(project)
    with pytest.raises(KeyboardInterrupt):
        run(project, progress=interrupt)
    assert not list(project.root.glob(".lidarcheck/proposals/*.toml"))
    assert files(project) == before
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("lidarcheck")]


def test_an_error_of_the_model_ends_the_run(project: Project) -> None:
    def fails(*given: object) -> object:
        raise InputError("no such material", file="ideal.txt", line=3)

    project.measure = fails  # type: ignore[method-assign, assignment]
    with pytest.raises(InputError, match="no such material"):
        run(project)


def test_the_suite_counts_even_if_one_scenario_is_run(project: Project) -> None:
    alone = check([project.file("one")], **project.stand_ins)
    assert alone.kpis_in_suite == run(project).kpis_in_suite == 6
    assert evidence.error_share(6) == pytest.approx(alone.error_budget / (6 * 2 * 4))


def test_to_dict_is_json(project: Project) -> None:
    project.shift = 3.0
    table = json.loads(json.dumps(run(project, seed=1).to_dict(), allow_nan=False))
    assert (table["verdict"], table["exit_code"], table["seed"]) == ("failed", 1, 1)
    kpi = table["scenarios"][0]["kpis"][0]
    assert (kpi["name"], kpi["verdict"], kpi["spec"]["tolerance"]) == ("area_mean", "regressed", 1.0)
    assert len(kpi["fresh"]) == 64
    assert len(table["scenarios"][0]["kpis"][2]["new_quantiles"]) == seeds.QUANTILE_LEVELS


def test_selection(project: Project, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(project.root)
    assert [result.name for result in check(**project.stand_ins).scenarios] == ["one", "two"]
    assert [result.name for result in check(["two"], **project.stand_ins).scenarios] == ["two"]
    assert [result.name for result in check(["scenarios", "two"], **project.stand_ins).scenarios] == ["one", "two"]
    monkeypatch.chdir(project.root / "scenarios")
    assert len(check(**project.stand_ins).scenarios) == 2
    with pytest.raises(InputError, match="no such scenario"):
        check(["three.toml"], **project.stand_ins)
    with pytest.raises(InputError, match=r"did you mean one\.toml\?"):
        check(["ome.toml"], **project.stand_ins)
    monkeypatch.chdir(project.root)
    with pytest.raises(InputError, match=r"did you mean two\?"):
        check(["tow"], **project.stand_ins)
    empty = tmp_path / "empty"
    empty.mkdir()
    assert check([empty], **project.stand_ins).exit_code == 1
    monkeypatch.chdir(empty)
    with pytest.raises(UsageError, match="no scenarios/"):
        check(**project.stand_ins)


def test_a_scenario_outside_scenarios_has_its_golden_beside_it(project: Project, tmp_path: Path) -> None:
    lone = tmp_path / "anywhere" / "mine.toml"
    lone.parent.mkdir()
    lone.write_text("#\n", encoding="utf-8")
    accept(review([lone], **project.stand_ins), [ALL])
    assert (tmp_path / "anywhere" / "goldens" / "mine.toml").is_file()
    assert check([lone], **project.stand_ins).exit_code == 0


def test_a_given_model_keeps_the_scenarios_conditions(project: Project) -> None:
    own = Sensor.of("SMART", background_per_ns=0.002, threshold=10)
    project.model = Model(own, {1: Material("panel", 0.1), 2: Material("road", 0.2)})

    def asked(sensor: Sensor) -> Model:
        given = Model(sensor, {1: Material("panel", 0.5)})
        return scenario_run.open_run(project.file("one"), given, **project.stand_ins).model

    plain = asked(Sensor.of("SMART"))
    assert plain.sensor == own
    assert {number: material.reflectance for number, material in plain.materials.items()} == {1: 0.1, 2: 0.2}
    changed = asked(Sensor.of("SMART", signal_at_1m=6180.0, threshold=12)).sensor
    assert (changed.signal_at_1m, changed.threshold, changed.background_per_ns) == (6180.0, 12, 0.002)


def test_a_given_model_keeps_the_scenarios_effects_unless_it_has_its_own(project: Project) -> None:
    own, others = ((effects.make(name, {}),) for name in sorted(effects.catalogue())[:2])
    project.model = Model(Sensor.of("SMART"), effects=own)

    def asked(given: Model) -> Model:
        return scenario_run.open_run(project.file("one"), given, **project.stand_ins).model

    assert asked(Model(Sensor.of("SMART"))).effects == own
    assert asked(Model(Sensor.of("SMART"), effects=others)).effects == others


def test_hidden_files_are_no_scenarios_and_no_goldens(project: Project) -> None:
    for directory in ("scenarios", "goldens"):
        (project.root / directory / ".x.toml").write_text("half-written", encoding="utf-8")
    assert [file.name for file in select([project.root]).files] == ["one.toml", "two.toml"]
    assert run(project).exit_code == 0


def test_golden_with_too_few_seeds_is_indeterminate(project: Project) -> None:
    golden = load_golden(project.golden("one"))
    kpi = golden.kpis["area_mean"]
    broken = dataclasses.replace(kpi, reference=dataclasses.replace(kpi.reference, seeds=1, sd=0.0))
    save_golden(dataclasses.replace(golden, kpis={**golden.kpis, "area_mean": broken}), project.golden("one"))
    assert KpiVerdict.INDETERMINATE in verdicts(run(project, seed=1), "area_mean")
