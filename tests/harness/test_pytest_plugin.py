"""The pytest plugin, in a repository as a stranger's would be: an external model, its scenarios, its goldens."""

import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import scipy.special  # loaded once: pytester forgets what is first imported inside a run

import lidarcheck.harness.check
import lidarcheck.harness.scenario.measure  # noqa: F401
from lidarcheck.harness.review.accept import accept
from lidarcheck.harness.review.review import review
from scenario_texts import kpis, wall_scenario

pytestmark = pytest.mark.usefixtures("trusting")

pytest_plugins = ["pytester"]

POSTPRO = """\
import random, sys
ideal, ini, scan, seed = sys.argv[1:]
gain = float(open(ini).read().split("=")[1])
draw = random.Random(int(seed))
lines = open(ideal).read().splitlines()
names = lines[0].lstrip("/").split()
out = ["RANGE Point Layer EchoNumber WIDTH AREA PEAK"]
for line in lines[1:]:
    row = dict(zip(names, line.split()))
    if len(row) > 2:
        area = gain * draw.gauss(100, 5)
        out.append(f"{row['Distance']} {row['Point']} {row['Layer']} 1 {draw.gauss(9, 0.1)} {area} 5")
open(scan, "w").write("\\n".join(out) + "\\n")
open("runs.log", "a").write("run\\n")
"""

MODEL = """\
[external]
command = ["{python}", "-S", "postpro.py", "{{ideal}}", "{{ini}}", "{{scan}}", "{{seed}}"]
ini = "gain.ini"
"""

WALL = f"""\
{wall_scenario((250, 254), (470, 489), 20.0, "models/model.toml")}{kpis(area_mean=2)}
[[kpis]]
kpi = "width_mean"
name = "width_mean.wall"
tolerance = 0.1
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A repository with two scenarios and their goldens, made once."""
    root = tmp_path_factory.mktemp("stranger")
    models = root / "scenarios" / "models"
    models.mkdir(parents=True)
    (models / "postpro.py").write_text(POSTPRO)
    (models / "gain.ini").write_text("gain = 1.0\n")
    (models / "model.toml").write_text(MODEL.format(python=sys.executable))
    (root / "scenarios" / "wall.toml").write_text(WALL)
    accept(review([root / "scenarios"]), ["all"], reason="first")
    shutil.rmtree(root / ".lidarcheck")
    (models / "runs.log").unlink()
    return root


@pytest.fixture
def repo(made, pytester):
    shutil.copytree(made, pytester.path, dirs_exist_ok=True)
    pytester.makeini("[pytest]\naddopts = -p no:cacheprovider --strict-markers\n")
    return pytester


def replace(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def contents(root: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (root / "goldens").rglob("*.toml")}


def test_each_kpi_is_a_test_and_the_scenario_runs_once(repo):
    result = repo.runpytest_inprocess("-v", "scenarios")
    result.assert_outcomes(passed=4)
    result.stdout.fnmatch_lines(
        [
            "scenarios::goldens PASSED*",
            "scenarios/wall.toml::golden fits PASSED*",
            "scenarios/wall.toml::area_mean PASSED*",
            "scenarios/wall.toml::width_mean.wall PASSED*",
        ]
    )
    log = repo.path / "scenarios" / "models" / "runs.log"
    assert len(log.read_text().splitlines()) == 8  # the paired seeds, bit-identical: no more are needed
    assert not (repo.path / ".lidarcheck" / "proposals" / "wall.toml").exists()


def test_a_failure_is_the_kpi_in_words_without_a_traceback(repo):
    (repo.path / "scenarios" / "models" / "gain.ini").write_text("gain = 1.1\n")
    before = contents(repo.path)
    result = repo.runpytest_inprocess("scenarios/wall.toml")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(
        [
            "*wall area_mean: REGRESSED, 100.* is now 1*counts",
            "*golden * counts",
            "*now * counts",
            "*change * of which chance explains *",
            "*tolerance * 2 counts",
            "*catches *changes from * counts on",
            "*what to do * `lidarcheck review wall --accept area_mean*",
            "FAILED scenarios/wall.toml::area_mean - *area_mean: REGRESSED*",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*.py:*")
    assert contents(repo.path) == before
    assert (repo.path / ".lidarcheck" / "proposals" / "wall.toml").is_file()


def test_numbers_reach_junit_as_properties(repo):
    repo.runpytest_inprocess("scenarios", "--junitxml=report.xml")
    cases = {case.get("name"): case for case in ET.parse(repo.path / "report.xml").iter("testcase")}
    assert set(cases) == {"goldens", "golden fits", "area_mean", "width_mean.wall"}
    found = {item.get("name"): item.get("value") for item in cases["width_mean.wall"].iter("property")}
    assert found["verdict"] == "identical"
    assert found["unit"] == "ns"
    assert float(found["tolerance"]) == 0.1
    assert float(found["value"]) == pytest.approx(float(found["reference"]), abs=0.1)
    assert 0.1 < float(found["smallest_change"]) < 0.2
    assert float(found["delta"]) == 0.0


def test_one_kpi_alone(repo):
    result = repo.runpytest_inprocess("scenarios/wall.toml::width_mean.wall")
    result.assert_outcomes(passed=1)


def test_other_files_are_left_alone(repo):
    for place in ("scenarios/models/more.toml", "scenarios/.hidden.toml", "plain/scenarios/x.toml", "x.toml"):
        path = repo.path / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("not = [toml")
    repo.makepyfile("def test_own(): pass")
    (repo.path / "scenarios" / "test_beside.py").write_text("def test_beside(): pass\n")
    repo.runpytest_inprocess("-v").assert_outcomes(passed=6)


def test_only_what_is_asked_for_is_collected(repo):
    (repo.path / "tests").mkdir()
    (repo.path / "tests" / "test_own.py").write_text("def test_own(): pass\n")
    repo.makeini("[pytest]\ntestpaths = tests\naddopts = -p no:cacheprovider\n")
    repo.runpytest_inprocess().assert_outcomes(passed=1)


@pytest.mark.parametrize("how", ["ini", "option", "file"])
def test_named_places_are_collected(repo, how):
    (repo.path / "scenarios").rename(repo.path / "sensor")
    (repo.path / "goldens").rename(repo.path / "sensor" / "goldens")
    arguments = {
        "ini": ["-o", "lidarcheck_scenarios=sensor"],
        "option": ["--lidarcheck-scenarios", "sensor"],
        "file": ["--lidarcheck-scenarios", "sensor/wall.toml"],
    }[how]
    passed = 3 if how == "file" else 4
    repo.runpytest_inprocess("sensor", *arguments).assert_outcomes(passed=passed)


def test_a_named_place_that_is_not_there_is_refused(repo):
    result = repo.runpytest_inprocess("--lidarcheck-scenarios", "nowhere")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*nowhere does not exist; give a scenario file*"])


@pytest.mark.parametrize(
    ("file", "old", "new", "line"),
    [
        ("scenarios/wall.toml", "tolerance = 2", "tolerence = 2", "error: *wall.toml:*tolerence*"),
        ("goldens/wall.toml", "mean = 9", "mean = 8", "error: *goldens/wall.toml: *edited by hand*"),
        ("scenarios/models/model.toml", "{seed}", "{sead}", "error: *model.toml:*sead*"),
    ],
)
def test_a_bad_file_is_an_error_of_one_line(repo, file, old, new, line):
    replace(repo.path / file, old, new)
    result = repo.runpytest_inprocess("scenarios/wall.toml")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([line])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_a_model_that_fails_is_an_error_not_a_failure(repo):
    (repo.path / "scenarios" / "models" / "postpro.py").write_text("import sys\nsys.exit('no licence')\n")
    result = repo.runpytest_inprocess("scenarios")
    result.assert_outcomes(errors=3, passed=1)
    result.stdout.fnmatch_lines(['error: *the external model *ended with exit code 1 (it said: "no licence")*'])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_what_has_no_golden_fails_and_is_not_written(repo):
    (repo.path / "goldens" / "wall.toml").unlink()
    result = repo.runpytest_inprocess("scenarios")
    result.assert_outcomes(passed=1, failed=3)
    result.stdout.fnmatch_lines(["*there is no golden: run `lidarcheck review wall*"])
    assert contents(repo.path) == {}


@pytest.mark.parametrize("how", ["gone", "a file", "partial"])
def test_goldens_that_are_not_there_are_red_where_testpaths_names_the_scenarios(repo, how):
    """Whatever else passes: without goldens pytest alone would find nothing to run, and be green."""
    repo.makeini("[pytest]\ntestpaths = tests scenarios\naddopts = -p no:cacheprovider\n")
    (repo.path / "tests").mkdir()
    (repo.path / "tests" / "test_own.py").write_text("def test_own(): pass\n")
    if how == "partial":
        shutil.copy(repo.path / "scenarios" / "wall.toml", repo.path / "scenarios" / "more.toml")
    else:
        shutil.rmtree(repo.path / "goldens")
    if how == "a file":
        (repo.path / "goldens").write_text("")
    result = repo.runpytest_inprocess()
    assert result.ret in (pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.INTERRUPTED)
    result.stdout.fnmatch_lines(["*there is no golden: run `lidar*"])
    if how == "partial":  # what was asked for alone is judged alone
        repo.runpytest_inprocess("scenarios/wall.toml").assert_outcomes(passed=3)
        repo.runpytest_inprocess("-k", "not more").assert_outcomes(passed=5, deselected=3)


@pytest.mark.parametrize(("how", "entry"), [("gone", "scenarios"), ("empty", "*/scenarios")])
def test_scenarios_that_are_not_there_are_refused_where_testpaths_names_them(repo, how, entry):
    repo.makeini(f"[pytest]\ntestpaths = tests {entry}\naddopts = -p no:cacheprovider\n")
    (repo.path / "tests").mkdir()
    (repo.path / "tests" / "test_own.py").write_text("def test_own(): pass\n")
    root = repo.path if entry == "scenarios" else repo.mkdir("sensor")
    shutil.rmtree(repo.path / "scenarios")
    if how == "empty":
        (root / "scenarios").mkdir()
    result = repo.runpytest_inprocess()
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: testpaths: there is no scenario in {entry}, *restore {entry} from version*"])
    repo.runpytest_inprocess("tests").assert_outcomes(passed=1)


def test_a_golden_without_a_scenario_fails_the_whole_and_not_a_part(repo):
    shutil.copy(repo.path / "goldens" / "wall.toml", repo.path / "goldens" / "gone.toml")
    result = repo.runpytest_inprocess("scenarios")
    result.assert_outcomes(passed=3, failed=1)
    result.stdout.fnmatch_lines(["goldens/gone.toml has no scenario: *"])
    repo.runpytest_inprocess("scenarios/wall.toml").assert_outcomes(passed=3)


def test_a_changed_scenario_fails(repo):
    replace(repo.path / "scenarios" / "wall.toml", "tolerance = 2", "tolerance = 200")
    result = repo.runpytest_inprocess("scenarios")
    result.stdout.fnmatch_lines(["wall: the scenario has changed since its golden was made*tolerance 2 is now 200*"])
    assert result.ret == pytest.ExitCode.TESTS_FAILED


def test_a_kpi_that_the_scenario_no_longer_asks_for_fails(repo):
    scenario = repo.path / "scenarios" / "wall.toml"
    scenario.write_text(scenario.read_text().split('[[kpis]]\nkpi = "width_mean"')[0])
    result = repo.runpytest_inprocess("scenarios/wall.toml::width_mean.wall")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*the scenario no longer asks for it*"])


def test_another_model_and_seed(repo):
    models = repo.path / "scenarios" / "models"
    shutil.copytree(models, repo.path / "other")
    (repo.path / "other" / "gain.ini").write_text("gain = 1.1\n")
    repo.runpytest_inprocess("scenarios", "--lidarcheck-seed", "3").assert_outcomes(passed=4)
    result = repo.runpytest_inprocess("scenarios", "--lidarcheck-model", "other/model.toml")
    result.assert_outcomes(passed=3, failed=1)
    assert not (repo.path / ".lidarcheck" / "proposals" / "wall.toml").exists()


@pytest.mark.parametrize("seed", ["-1", str(2**64), "one", "", "+3", " 3", "1_0", "٣"])
def test_a_bad_seed_is_refused(repo, seed):
    result = repo.runpytest_inprocess("scenarios", f"--lidarcheck-seed={seed}")
    assert result.ret == pytest.ExitCode.USAGE_ERROR


def test_a_run_that_compares_nothing_fails(repo):
    (repo.path / "slim.toml").write_text('variant = "SLIM"\n')
    result = repo.runpytest_inprocess("scenarios/wall.toml", "--lidarcheck-model", "slim.toml")
    result.assert_outcomes(skipped=3)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["*a run that compares nothing proves nothing"])


@pytest.mark.long
@pytest.mark.parametrize("mode", ["load", "loadgroup"])
def test_the_verdicts_are_the_same_under_xdist(repo, mode):
    (repo.path / "scenarios" / "models" / "gain.ini").write_text("gain = 1.1\n")
    result = repo.runpytest_subprocess("scenarios", "-n", "2", "--dist", mode)
    result.assert_outcomes(passed=3, failed=1)
    result.stdout.fnmatch_lines(["*wall area_mean: REGRESSED*"])


def test_loading_the_plugin_loads_nothing_heavy():
    code = "import sys, lidarcheck.harness.pytest_plugin; print(' '.join(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "numba", "scipy", "pydantic", "matplotlib", "jinja2"} & set(loaded)
    assert scipy.special is not None
