"""`review` and `accept`: what is proposed, what is refused and why, what the golden then carries."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import pytest

from harness_fakes import SPECS, Project
from lidarcheck.errors import GoldenError, UsageError
from lidarcheck.harness.check import check
from lidarcheck.harness.gate import evidence, sensitivity
from lidarcheck.harness.gate.evidence import KpiVerdict
from lidarcheck.harness.gate.sensitivity import resolution
from lidarcheck.harness.goldens.file import load_golden, load_proposal
from lidarcheck.harness.review import review as review_module
from lidarcheck.harness.review.accept import ALL, accept, release
from lidarcheck.harness.review.review import ReviewReport, review
from places import ROOT


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A project with accepted goldens, everything committed."""
    monkeypatch.setattr(review_module, "uncommitted", lambda scenario: ("", ""))
    made = Project(tmp_path / "project", ("one",))
    accept(review([made.root], **made.stand_ins), [ALL])
    made.seeds.clear()
    return made


def look(project: Project, **more: object) -> ReviewReport:
    return review([project.root], **project.stand_ins, **more)  # type: ignore[arg-type]


def exit_code(project: Project) -> int:
    return check([project.root], **project.stand_ins).exit_code


def test_nothing_to_review_costs_the_paired_seeds(project: Project) -> None:
    report = look(project)
    assert report.settled
    assert sorted(project.seeds) == [*range(8)]
    assert accept(report, [ALL]) == []
    assert not project.proposal("one").exists()


def test_a_golden_from_scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(review_module, "uncommitted", lambda scenario: ("", "no git"))
    project = Project(tmp_path / "new")
    report = look(project)
    assert not report.settled
    assert sorted(project.seeds) == sorted([*range(96)] * 2)
    assert report.scenarios[0].notes == ("no git",)
    assert [kpi.verdict for kpi in report.scenarios[0].kpis] == [KpiVerdict.MISSING] * 3
    assert accept(report, [ALL]) == [project.golden("one"), project.golden("two")]
    golden = load_golden(project.golden("one"))
    assert golden.complete
    assert (golden.provenance.seeds, golden.provenance.reference_seeds) == ("0-63", "64-95")
    assert not any(kpi.reason or kpi.verdict for kpi in golden.kpis.values())
    assert exit_code(project) == 0


def test_check_then_review_then_accept(project: Project) -> None:
    project.shift = 0.9
    assert check([project.root], **project.stand_ins).exit_code == 0
    assert not load_proposal(project.proposal("one")).complete
    report = look(project)
    assert load_proposal(project.proposal("one")).complete
    row = report.scenarios[0].kpis[0]
    assert row.delta == pytest.approx(0.9, abs=0.05)
    assert row.verdict is KpiVerdict.CHANGED
    before = project.golden("one").read_bytes()
    assert accept(report, [ALL]) == [project.golden("one")]
    assert project.golden("one").read_bytes() != before
    assert not project.proposal("one").exists()
    assert exit_code(project) == 0


def test_a_complete_proposal_is_taken_as_it_is(project: Project) -> None:
    project.shift = 0.9
    first = look(project)
    project.seeds.clear()
    assert look(project) == first
    assert sorted(project.seeds) == [*range(8)]
    project.shift = 0.8
    look(project)
    assert len(project.seeds) == 8 + 96, "another model's proposal is none"


def test_a_proposal_made_beside_another_golden_is_made_anew(project: Project) -> None:
    first = project.golden("one").read_bytes()
    project.shift = -5.0
    accept(look(project), [ALL], reason="elsewhere")
    other = project.golden("one").read_bytes()
    project.golden("one").write_bytes(first)
    project.shift = 0.9
    assert look(project).scenarios[0].kpis[0].verdict is KpiVerdict.CHANGED
    project.golden("one").write_bytes(other)
    report = look(project)
    assert report.scenarios[0].kpis[0].verdict is KpiVerdict.REGRESSED
    with pytest.raises(UsageError, match="area_mean: regressed"):
        accept(report, [ALL])


def test_a_regression_needs_a_reason(project: Project) -> None:
    project.shift = 5.0
    report = look(project)
    before = project.golden("one").read_bytes()
    with pytest.raises(UsageError, match="area_mean: regressed") as caught:
        accept(report, [ALL])
    assert len(caught.value.lines()) == 1
    assert "--reason" in caught.value.fix
    with pytest.raises(UsageError):
        accept(report, [ALL], reason=" \n ")
    assert project.golden("one").read_bytes() == before
    accept(report, [ALL], reason="a stronger\nlaser")
    kpis = load_golden(project.golden("one")).kpis
    assert kpis["area_mean"].reason == "a stronger laser"
    assert kpis["area_mean"].reason_date
    assert kpis["detection"].reason == "", "it needed none"
    assert exit_code(project) == 0
    assert check([project.root], **project.stand_ins).scenarios[0].kpis[0].reason == "a stronger laser"


def test_what_the_check_saw_is_not_forgotten(project: Project) -> None:
    # The review's own seeds may just miss what the check has proven on others.
    project.shift = 0.9
    check([project.root], **project.stand_ins)
    proposal = load_proposal(project.proposal("one"))
    seen = {name: dataclasses.replace(kpi, verdict="regressed") for name, kpi in proposal.kpis.items()}
    review_module.save_golden(dataclasses.replace(proposal, kpis=seen), project.proposal("one"))
    assert {kpi.verdict for kpi in look(project).scenarios[0].kpis} >= {KpiVerdict.REGRESSED}


def test_a_dirty_tree_needs_a_reason(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(review_module, "uncommitted", lambda scenario: ("kernel.py", ""))
    project.shift = 0.5
    report = look(project)
    with pytest.raises(UsageError, match=r"uncommitted changes in kernel\.py"):
        accept(report, [ALL])
    accept(report, [ALL], reason="tried out")
    assert {kpi.reason for kpi in load_golden(project.golden("one")).kpis.values()} >= {"tried out"}


def test_a_partial_seed_set_needs_a_reason(project: Project) -> None:
    project.shift = 0.5
    report = look(project, complete=False)
    assert sorted(project.seeds) == [*range(8)]
    with pytest.raises(UsageError, match="partial seed set: 8 of 64"):
        accept(report, [ALL])


def test_a_threshold_changed_in_the_same_step_needs_a_reason(project: Project) -> None:
    project.shift = 0.9
    project.specs = (dataclasses.replace(SPECS[0], tolerance=20.0), *SPECS[1:])
    report = look(project)
    with pytest.raises(UsageError, match="tolerance 1 is now 20"):
        accept(report, ["area_mean"])
    accept(report, [ALL], reason="a coarser sensor")
    assert exit_code(project) == 0


def test_a_threshold_changed_alone_does_not(project: Project) -> None:
    project.specs = (dataclasses.replace(SPECS[0], tolerance=20.0), *SPECS[1:])
    assert exit_code(project) == 1
    project.seeds.clear()
    report = look(project)
    assert sorted(project.seeds) == [*range(8)], "nothing new to measure"
    accept(report, [ALL])
    assert load_golden(project.golden("one")).kpis["area_mean"].spec.tolerance == 20.0
    assert exit_code(project) == 0


def test_a_changed_scenario_needs_a_reason_if_its_values_moved(project: Project) -> None:
    project.version = "v2"
    accept(look(project), [ALL])
    assert exit_code(project) == 0
    project.version, project.shift = "v3", 0.2
    with pytest.raises(UsageError, match="changed in one step"):
        accept(look(project), [ALL])


def test_kpi_by_kpi(project: Project) -> None:
    project.shift = 5.0
    accept(look(project), ["area_mean"], reason="a stronger laser")
    golden = load_golden(project.golden("one"))
    assert golden.provenance.kept == ("area_distance",)
    report = check([project.root], **project.stand_ins)
    found = {kpi.name: kpi.verdict for kpi in report.scenarios[0].kpis}
    assert found["area_mean"] is KpiVerdict.IDENTICAL
    assert found["area_distance"] is KpiVerdict.REGRESSED
    project.seeds.clear()
    accept(look(project), ["area_distance"], reason="the same")
    assert load_golden(project.golden("one")).provenance.kept == ()
    assert exit_code(project) == 0


def test_after_a_partial_accept_the_proposal_still_serves(project: Project) -> None:
    project.shift = 5.0
    accept(look(project), ["area_mean"], reason="a stronger laser")
    project.seeds.clear()
    look(project)
    assert sorted(project.seeds) == [*range(8)]


def test_dropped_and_new_kpis(project: Project) -> None:
    project.specs = (*SPECS[1:], dataclasses.replace(SPECS[0], name="new"))
    report = look(project)
    rows = {kpi.name: kpi for kpi in report.scenarios[0].kpis}
    assert rows["area_mean"].needs_reason == ("the scenario no longer asks for it",)
    assert rows["new"].needs_reason == ()
    accept(report, ["new"])
    assert set(load_golden(project.golden("one")).kpis) == {"area_mean", "detection", "area_distance", "new"}
    with pytest.raises(UsageError, match="no longer asks"):
        accept(look(project), [ALL])
    accept(look(project), [ALL], reason="not needed")
    assert set(load_golden(project.golden("one")).kpis) == {"detection", "area_distance", "new"}
    assert exit_code(project) == 0


@pytest.mark.parametrize(
    ("spec", "what"),
    [
        (dataclasses.replace(SPECS[0], tolerance=0.01), "set the tolerance to"),
        (dataclasses.replace(SPECS[0], high=90.0), "above its limit 90"),
        (dataclasses.replace(SPECS[0], low=110.0), "below its limit 110"),
    ],
)
def test_some_goldens_are_never_accepted(project: Project, spec: object, what: str) -> None:
    project.specs = (spec, *SPECS[1:])  # type: ignore[assignment]
    for reason in ("", "I want it"):
        with pytest.raises(UsageError, match=what):
            accept(look(project), [ALL], reason=reason)


def test_a_golden_must_stay_fine_enough_when_the_suite_grows(project: Project) -> None:
    reference = load_golden(project.golden("one")).kpis["area_mean"].reference
    small, grown = (resolution(evidence.error_share(kpis), reference.sd) for kpis in (3, 500))
    asked = dataclasses.replace(SPECS[0], tolerance=(small + grown) / 2.0)
    assert sensitivity.too_coarse(asked, reference, evidence.error_share(3)) == ""
    project.specs = (asked, *SPECS[1:])
    with pytest.raises(UsageError, match="set the tolerance to"):
        accept(look(project), [ALL], reason="fine today")


def test_unknown_names(project: Project) -> None:
    project.shift = 0.5
    with pytest.raises(UsageError, match="area_meen") as caught:
        accept(look(project), ["area_meen"])
    assert "area_mean" in caught.value.fix


def test_a_golden_that_changed_meanwhile_is_not_overwritten(project: Project) -> None:
    project.shift = 0.5
    first, second = look(project), look(project)
    accept(first, [ALL])
    with pytest.raises(UsageError, match="changed since it was reviewed"):
        accept(second, [ALL])


def test_a_damaged_golden_can_be_made_anew(project: Project) -> None:
    project.golden("one").write_text("<<<<<<< HEAD\n", encoding="utf-8")
    report = look(project)
    with pytest.raises(UsageError, match="could not be read"):
        accept(report, [ALL])
    accept(report, [ALL], reason="merge conflict")
    assert exit_code(project) == 0


def test_a_damaged_proposal_is_made_anew(project: Project) -> None:
    project.shift = 0.5
    project.proposal("one").parent.mkdir(parents=True, exist_ok=True)
    project.proposal("one").write_text("not = [a proposal", encoding="utf-8")
    accept(look(project), [ALL])
    assert exit_code(project) == 0


def test_an_old_reason_stays(project: Project) -> None:
    project.shift = 5.0
    accept(look(project), [ALL], reason="a stronger laser")
    project.shift = 5.5
    accept(look(project), [ALL])
    assert load_golden(project.golden("one")).kpis["area_mean"].reason == "a stronger laser"


def test_a_golden_without_scenario_is_named(project: Project, caplog: pytest.LogCaptureFixture) -> None:
    project.golden("gone").write_bytes(project.golden("one").read_bytes())
    assert look(project).settled
    assert "goldens/gone.toml has no scenario" in caplog.text


def test_release_copies_goldens(project: Project) -> None:
    target = project.root / "goldens" / "release" / "one.toml"
    assert release([project.root]) == [target]
    assert target.read_bytes() == project.golden("one").read_bytes()
    (target.parent / "gone.toml").write_bytes(target.read_bytes())
    release([project.file("one")])
    assert (target.parent / "gone.toml").is_file()
    release([project.root])
    assert not (target.parent / "gone.toml").exists()
    project.file("two").write_text("#\n", encoding="utf-8")
    with pytest.raises(UsageError, match="two has no golden"):
        release([project.root])
    project.golden("one").write_text("x", encoding="utf-8")
    with pytest.raises(GoldenError):
        release([project.file("one")])


def test_to_dict_is_json(project: Project) -> None:
    project.shift = 5.0
    project.specs = (*SPECS[1:], dataclasses.replace(SPECS[0], name="new"))
    table = json.loads(json.dumps(look(project).to_dict(), allow_nan=False))
    rows = {row["name"]: row for row in table["scenarios"][0]["kpis"]}
    assert rows["area_mean"]["new"] is None
    assert rows["new"]["old"] is None
    assert rows["area_distance"]["needs_reason"] == ["regressed"]


RACE = """
import sys
from pathlib import Path

sys.path.insert(0, sys.argv[1])
from harness_fakes import Project
from lidarcheck.errors import UsageError
from lidarcheck.harness.review import review
from lidarcheck.harness.review.accept import accept

review.uncommitted = lambda scenario: ("", "")
project = Project(Path(sys.argv[2]), ("one",))
project.shift = 0.2 * (int(sys.argv[3]) + 1)
try:
    accept(review.review([project.root], **project.stand_ins), ["all"])
    print("accepted")
except UsageError as error:
    print(error.what)
"""


def test_concurrent_accepts_leave_a_whole_golden(project: Project) -> None:
    processes = []
    for index in range(3):
        command = [
            sys.executable,
            "-c",
            RACE,
            str(ROOT / "tests" / "kits"),
            str(project.root),
            str(index),
        ]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
    answers = [process.communicate(timeout=60) for process in processes]
    said = [out.strip() or err for out, err in answers]
    assert all(text == "accepted" or "changed since it was reviewed" in text for text in said), said
    assert "accepted" in said
    assert load_golden(project.golden("one")).complete
