"""Nothing is written or removed through a committed link, and a proposal copied among the goldens is none."""

import json
import shutil
from dataclasses import replace

import pytest

from harness_fakes import Project
from lidarcheck.cli import main
from lidarcheck.errors import GoldenError, InputError, LidarcheckError
from lidarcheck.harness.check import check
from lidarcheck.harness.goldens.file import dump_golden, load_golden, load_proposal, save_golden
from lidarcheck.harness.layout import layout_of
from lidarcheck.harness.review.accept import accept, reject, release
from lidarcheck.harness.review.review import review
from lidarcheck.harness.scenario_run import open_run
from lidarcheck.session.state import State, save_state
from lidarcheck.tui.jobs.explain_cases import make_results_directory
from lidarcheck.workers.checkpoint import Checkpoint


@pytest.fixture
def project(tmp_path):
    """A project with two scenarios and their goldens, no proposals, whose model has changed since."""
    found = Project(tmp_path / "project")
    accept(review([found.root], measure=found.measure, load=found.load), ["all"], reason="first")
    shutil.rmtree(found.root / ".lidarcheck")
    found.shift = 30.0
    return found


def checked(project):
    return check([project.root], measure=project.measure, load=project.load)


def reviewed(project):
    return review([project.root], measure=project.measure, load=project.load)


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def link(place, target):
    place.parent.mkdir(parents=True, exist_ok=True)
    place.symlink_to(target)


LINKS = {
    "the folder of proposals onto the goldens": (".lidarcheck/proposals", "../goldens"),
    "a proposal onto its golden": (".lidarcheck/proposals/one.toml", "../../goldens/one.toml"),
    "a proposal onto a file elsewhere": (".lidarcheck/proposals/one.toml", "../../../victim/one.toml"),
    "a proposal onto a file that is not there": (".lidarcheck/proposals/one.toml", "../../../victim/new.toml"),
    "the private folder onto a folder elsewhere": (".lidarcheck", "../victim"),
    "the file that keeps it out of version control": (".lidarcheck/.gitignore", "../../victim/one.toml"),
}


@pytest.mark.parametrize("what", LINKS)
def test_a_check_writes_through_no_link_and_still_judges(project, what, caplog):
    victim = project.root.parent / "victim"
    victim.mkdir()
    (victim / "one.toml").write_text("mine\n")
    link(project.root / LINKS[what][0], LINKS[what][1])
    before = contents(project.root / "goldens"), contents(victim)
    report = checked(project)
    assert report.failed
    assert (contents(project.root / "goldens"), contents(victim)) == before
    if "not there" not in what and "version control" not in what:
        assert "is a link, and nothing is written or removed through it" in caplog.text


@pytest.mark.parametrize("what", LINKS)
def test_a_check_removes_nothing_through_a_link(project, what):
    """Echoes as the goldens have them: what is settled has no proposal any more."""
    victim = project.root.parent / "victim"
    victim.mkdir()
    (victim / "one.toml").write_text("mine\n")
    link(project.root / LINKS[what][0], LINKS[what][1])
    project.shift = 0.0
    before = contents(project.root / "goldens"), contents(victim)
    assert not checked(project).failed
    assert (contents(project.root / "goldens"), contents(victim)) == before


@pytest.mark.parametrize("what", [what for what in LINKS if "version control" not in what])
def test_a_review_is_refused_at_a_link(project, what):
    victim = project.root.parent / "victim"
    victim.mkdir()
    (victim / "one.toml").write_text("mine\n")
    link(project.root / LINKS[what][0], LINKS[what][1])
    before = contents(project.root / "goldens"), contents(victim)
    with pytest.raises(LidarcheckError, match="is a link, and nothing is written or removed through it"):
        reviewed(project)
    assert (contents(project.root / "goldens"), contents(victim)) == before


def test_no_golden_is_accepted_through_a_link(project):
    victim = project.root.parent / "victim"
    found = reviewed(project)
    shutil.move(project.root / "goldens", victim)
    (project.root / "goldens").symlink_to(victim)
    before = contents(victim)
    with pytest.raises(LidarcheckError, match="is a link, and nothing is written"):
        accept(found, ["all"], reason="moved")
    assert contents(victim) == before


def test_no_release_is_written_and_no_proposal_rejected_through_a_link(project):
    victim = project.root.parent / "victim"
    victim.mkdir()
    (victim / "one.toml").write_text("mine\n")
    link(project.root / "goldens" / "release", victim)
    with pytest.raises(InputError, match="is a link"):
        release([project.root])
    link(project.root / ".lidarcheck" / "proposals", victim)
    with pytest.raises(InputError, match="is a link"):
        reject(layout_of(project.file("one")), "one")
    assert contents(victim) == {victim / "one.toml": b"mine\n"}


def test_the_terminal_writes_through_no_link(tmp_path):
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "state.json").write_text("mine")
    root = tmp_path / "project"
    link(root / ".lidarcheck" / "tui" / "state.json", victim / "state.json")
    save_state(State(screen="goldens"), root)
    other = tmp_path / "other"
    link(other / ".lidarcheck" / "tui", victim)
    save_state(State(screen="goldens"), other)
    with pytest.raises(InputError, match="is a link"):
        make_results_directory(other, other / "case")
    assert contents(victim) == {victim / "state.json": b"mine"}


def test_a_checkpoint_writes_through_no_link(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("mine")
    for name in ("notebook.jsonl", "lock"):
        place = tmp_path / name.partition(".")[0]
        link(place / name, victim)
        with pytest.raises(InputError, match="cannot keep what is done"):
            Checkpoint(place, "key")
    assert victim.read_text() == "mine"


@pytest.fixture
def proposal(project):
    """The proposal of a check."""
    checked(project)
    return project.proposal("one")


def refusal(call):
    with pytest.raises(GoldenError) as caught:
        call()
    [line] = caught.value.lines()
    return line


WORDS = "this is a proposal, not a golden: nobody has accepted it; restore the golden from version control or delete it"


def test_a_proposal_copied_as_a_golden_is_refused_by_check_and_review(project, proposal):
    shutil.copy(proposal, project.golden("one"))
    for call in (lambda: checked(project), lambda: reviewed(project), lambda: release([project.root])):
        line = refusal(call)
        assert WORDS in line
        assert str(project.golden("one")) in line


def test_a_reviewed_proposal_is_refused_too(project):
    found = reviewed(project)
    assert load_proposal(project.proposal("one")).complete
    shutil.copy(project.proposal("one"), project.golden("one"))
    assert WORDS in refusal(lambda: checked(project))
    assert found.scenarios


def test_a_proposal_copied_as_a_release_golden_is_refused(project, proposal):
    place = project.root / "goldens" / "release" / "one.toml"
    place.parent.mkdir()
    shutil.copy(proposal, place)
    assert WORDS in refusal(lambda: checked(project))


def test_a_proposal_without_its_mark_is_still_recognised(project, proposal):
    """As the version before wrote it: by its verdicts, by the golden that it was compared with, by its seeds."""
    golden = load_proposal(proposal)
    assert "proposed = true" in proposal.read_text()
    unmarked = replace(golden, proposed=False)
    wordless = replace(unmarked, kpis={name: replace(kpi, verdict="") for name, kpi in golden.kpis.items()})
    whole = replace(load_golden(project.golden("two")), scenario="one")
    based = replace(whole, provenance=replace(whole.provenance, base="0" * 64))
    for one in (unmarked, wordless, based):
        assert "proposed" not in dump_golden(one)
        save_golden(one, project.golden("one"))
        assert WORDS in refusal(lambda: load_golden(project.golden("one")))
    save_golden(whole, project.golden("one"))
    assert load_golden(project.golden("one")) == whole


def test_what_a_review_accepts_is_a_golden_that_does_not_say_otherwise(project):
    accept(
        review([project.root], complete=False, measure=project.measure, load=project.load), ["all"], reason="8 seeds"
    )
    golden = load_golden(project.golden("one"))
    assert not golden.is_proposal
    assert not golden.complete
    assert "proposed" not in project.golden("one").read_text()


def test_the_plugin_refuses_a_copied_proposal(project, proposal):
    shutil.copy(proposal, project.golden("one"))
    with pytest.raises(GoldenError, match="nobody has accepted it"):  # what the plugin collects by
        open_run(project.file("one"), None, project.measure, project.load)


def test_the_report_of_a_release_says_so(project, proposal, tmp_path, monkeypatch, capsys):
    shutil.copy(proposal, project.golden("one"))
    monkeypatch.chdir(project.root)
    main(["report", ".", "--out", str(tmp_path / "r.html"), "--json", str(tmp_path / "r.json"), "-q"])
    assert "nobody has accepted it" in (tmp_path / "r.html").read_text()
    assert json.loads((tmp_path / "r.json").read_text())
