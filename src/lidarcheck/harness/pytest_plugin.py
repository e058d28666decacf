"""Scenarios as pytest tests, in any repository: a file for each scenario, a test for each KPI.

A scenario file is a `*.toml` directly inside a directory `scenarios` that has a directory `goldens` beside it or a file
that asks for KPIs, or one that the option `lidarcheck_scenarios` or `--lidarcheck-scenarios` names, as a file or by its
directory. Nothing else is collected. A scenario is simulated once, with the first of its KPIs; goldens are never
written. Where `testpaths` names scenarios that are not there the run is refused: pytest itself would say nothing.

pytest loads this module in every run on a machine where lidarcheck is installed: nothing heavy is imported here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from lidarcheck import __version__
from lidarcheck.errors import LidarcheckError
from lidarcheck.printable import printable, printable_lines

if TYPE_CHECKING:
    from lidarcheck.harness.reports.results import KpiResult, ScenarioResult

__all__ = ["GoldensItem", "KpiItem", "ScenarioDirectory", "ScenarioFile"]

_INI = "lidarcheck_scenarios"
_SCENARIOS = "scenarios"
_MARK = "lidarcheck"
"""The property, with the version as value, that tells this plugin's results from others in a report."""
_NAMED = pytest.StashKey[frozenset[Path]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options."""
    group = parser.getgroup("lidarcheck", "lidarcheck: sensor model scenarios against their goldens")
    group.addoption(
        "--lidarcheck-seed", type=_seed, metavar="N", help="also run fresh seeds, drawn from this one, 0 to 2^64 - 1"
    )
    group.addoption(
        "--lidarcheck-model", type=Path, metavar="FILE", help="a model to ask in the place of the scenarios' own"
    )
    group.addoption(
        "--lidarcheck-scenarios",
        type=Path,
        action="append",
        default=[],
        metavar="PATH",
        help="a scenario file, or a directory of them, beside those in a scenarios/ with a goldens/ next to it",
    )
    parser.addini(_INI, "scenario files, or directories of them, from this file's directory", type="paths", default=[])


def pytest_configure(config: pytest.Config) -> None:
    """Refuse now what could not be collected; watch that a run compares something."""
    given = [config.invocation_params.dir / path for path in config.getoption("--lidarcheck-scenarios")]
    named = frozenset(path.resolve() for path in [*config.getini(_INI), *given])
    for path in sorted(named):
        if not path.exists():
            raise pytest.UsageError(f"{_INI}: {path} does not exist; give a scenario file or a directory of them")
    config.stash[_NAMED] = named
    _refuse_lost_scenarios(config)
    if not hasattr(config, "workerinput"):  # under xdist the controller sees the reports of all workers
        config.pluginmanager.register(_Watch(), "lidarcheck-watch")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
    """A collector for a scenario file, None for any other."""
    if file_path.suffix != ".toml" or file_path.name.startswith("."):
        return None
    named = parent.config.stash[_NAMED]
    if file_path.resolve() in named or _holds_scenarios(file_path.parent, named):
        return ScenarioFile.from_parent(parent, path=file_path)
    return None


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> ScenarioDirectory | None:
    """A collector for a directory of scenarios that is no Python package, None for any other."""
    if _holds_scenarios(path, parent.config.stash[_NAMED]) and not (path / "__init__.py").exists():
        return ScenarioDirectory.from_parent(parent, path=path)
    return None


class ScenarioDirectory(pytest.Directory):
    """A directory of scenarios. Whoever runs all of it also learns of goldens without a scenario."""

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        """The test of the goldens, then what pytest finds in any directory: scenarios, and other tests."""
        yield GoldensItem.from_parent(self, name="goldens")
        hooks = self.session.gethookproxy(self.path)
        for path in sorted(self.path.iterdir()):
            asked = self.session.isinitpath(path, with_parents=path.is_dir())
            if not asked and hooks.pytest_ignore_collect(collection_path=path, config=self.config):
                continue
            if path.is_dir():
                inner = hooks.pytest_collect_directory(path=path, parent=self)
                yield from [] if inner is None else [inner]
            elif path.is_file():
                yield from hooks.pytest_collect_file(file_path=path, parent=self)


class GoldensItem(pytest.Item):
    """Every golden of the project has a scenario."""

    def runtest(self) -> None:
        """Fail, naming the goldens that have none."""
        from lidarcheck.harness.layout import layout_of

        layout = layout_of(self.path / "any.toml")
        names = [path.relative_to(layout.root).as_posix() for path in layout.orphans()]
        if names:
            lines = [f"{printable(name)} has no scenario: restore the scenario, or delete the golden" for name in names]
            pytest.fail("\n".join(lines), pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where it stands."""
        return self.path, None, f"{self.path.parent.name} {self.name}"


class ScenarioFile(pytest.File):
    """A scenario file; its KPIs are the tests."""

    _found: ScenarioResult | LidarcheckError | None = None

    def collect(self) -> Iterator[pytest.Item]:
        """A test that the golden is of this scenario, and one for each KPI of the scenario or of its golden."""
        from lidarcheck.harness.reports.annotations import scenario_lines
        from lidarcheck.harness.reports.junit import GOLDEN_CASE
        from lidarcheck.harness.scenario_run import open_run

        try:
            case = open_run(self.path.resolve(), self._model())
        except LidarcheckError as error:
            raise self.CollectError(str(error)) from None
        if self.config.pluginmanager.hasplugin("xdist"):
            self.add_marker(pytest.mark.xdist_group(self.nodeid))
        names = dict.fromkeys([spec.name for spec in case.scenario.kpis] + [*(case.golden.kpis if case.golden else ())])
        lines = scenario_lines(self.path)
        yield KpiItem.from_parent(self, name=GOLDEN_CASE, kpi=None, line=1)
        for index, name in enumerate(names):
            yield KpiItem.from_parent(self, name=name, kpi=name, line=lines.get(index, 1))

    def result(self) -> ScenarioResult:
        """What the check found, run when first asked for; `LidarcheckError` each time if it could not be made."""
        if self._found is None:
            from lidarcheck.harness.check import check

            try:
                options = {"seed": self.config.getoption("--lidarcheck-seed"), "model": self._model()}
                self._found = check([self.path.resolve()], **options, jobs=self._jobs()).scenarios[0]
            except LidarcheckError as error:
                self._found = error
        if isinstance(self._found, LidarcheckError):
            raise self._found
        return self._found

    def _model(self) -> Path | None:
        given: Path | None = self.config.getoption("--lidarcheck-model")
        return None if given is None else self.config.invocation_params.dir / given

    def _jobs(self) -> int | None:
        """This process's part of the cores, where pytest-xdist runs several."""
        from lidarcheck.workers.cores import usable_cores

        workers = getattr(self.config, "workerinput", {}).get("workercount", 1)
        return max(1, usable_cores() // int(workers))


class KpiItem(pytest.Item):
    """One KPI of a scenario; without a KPI, what holds for the scenario as a whole."""

    def __init__(self, *, kpi: str | None, line: int, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._kpi, self._line = kpi, line
        self._found: KpiResult | None = None

    @property
    def _scenario(self) -> ScenarioResult:
        assert isinstance(self.parent, ScenarioFile)
        return self.parent.result()

    def setup(self) -> None:
        """Run the scenario, if no KPI of it has yet: what goes wrong here is an error, no failure."""
        self.user_properties.append((_MARK, __version__))
        try:
            scenario = self._scenario
        except LidarcheckError as error:
            pytest.fail(str(error), pytrace=False)
        if not scenario.kpis:
            self.user_properties.extend([("scenario", scenario.name), ("verdict", "not run")])
            pytest.skip(printable("; ".join(scenario.notes)) or "not run")
        if self._kpi is not None:
            self._found = next((kpi for kpi in scenario.kpis if kpi.name == self._kpi), None)
            if self._found is None:
                pytest.fail(f"{self._kpi} is no longer in the scenario: run pytest again", pytrace=False)

    def runtest(self) -> None:
        """Fail with the KPI's numbers in words, or with what is wrong with the scenario's golden."""
        from lidarcheck.harness.reports.annotations import explanation
        from lidarcheck.harness.reports.junit import properties, scenario_problems

        scenario, kpi = self._scenario, self._found
        if kpi is not None:
            self.user_properties.extend(properties(scenario, kpi))
            if kpi.fails:
                pytest.fail(explanation(scenario, kpi), pytrace=False)
            return
        if scenario.notes:
            self.add_report_section("call", "notes", printable_lines("\n".join(scenario.notes)))
        problems = scenario_problems(scenario)
        if problems:
            said = (printable(f"{scenario.name}: {problem}") for problem in problems)
            pytest.fail(printable_lines("\n".join(said)), pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """The KPI's line in the scenario file, counted from 0."""
        return self.path, self._line - 1, f"{self.path.stem} {self.name}"


class _Watch:
    """Fails a run whose scenarios compared nothing: every one of them was for another model."""

    def __init__(self) -> None:
        self._reports, self._skipped = 0, 0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count what this plugin's tests came to."""
        names = dict(report.user_properties)
        if _MARK in names and (report.when == "call" or (report.when == "setup" and not report.passed)):
            self._reports += 1
            self._skipped += names.get("verdict") == "not run"

    @property
    def proves_nothing(self) -> bool:
        """Whether there were KPIs, and none was run."""
        return 0 < self._reports == self._skipped

    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """A run that compares nothing is no success."""
        if self.proves_nothing and exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say so."""
        if self.proves_nothing:
            terminalreporter.section("lidarcheck", red=True)
            terminalreporter.line("no KPI was compared with a golden: a run that compares nothing proves nothing")


def _holds_scenarios(directory: Path, named: frozenset[Path]) -> bool:
    if directory.resolve() in named:
        return True
    # Goldens that are gone must not take their scenarios with them.
    return directory.name == _SCENARIOS and ((directory.parent / "goldens").is_dir() or _asks_for_kpis(directory))


def _asks_for_kpis(directory: Path) -> bool:
    """Whether one of the directory's files is a scenario by what it says."""
    return any(re.search(rb"^[ \t]*\[\[ *kpis *\]\]", _head(file), re.MULTILINE) for file in directory.glob("*.toml"))


def _head(file: Path) -> bytes:
    try:
        with file.open("rb") as opened:
            return opened.read(1 << 20)
    except OSError:
        return b""


def _refuse_lost_scenarios(config: pytest.Config) -> None:
    """`UsageError` where `testpaths` names scenarios and there is none, in a run without paths of its own."""
    if config.args_source is config.ArgsSource.ARGS or config.invocation_params.dir != config.rootpath:
        return
    for entry in config.getini("testpaths"):
        if Path(entry).name != _SCENARIOS:
            continue
        places = [Path(entry)] if Path(entry).is_absolute() else config.rootpath.glob(entry)
        found = [path for place in places for path in place.glob("*.toml")]
        if not found:
            what = f"testpaths: there is no scenario in {entry}, so that no KPI would be compared"
            raise pytest.UsageError(f"{what}; restore {entry} from version control, or take it out of testpaths")


def _seed(text: str) -> int:
    """A seed as `lidarcheck check --seed` takes it; a `ValueError` becomes the option's error."""
    if not (text.isascii() and text.isdecimal()) or int(text) >= 1 << 64:
        raise ValueError(text)
    return int(text)
