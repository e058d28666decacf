"""Where a project keeps its scenarios, goldens, release goldens and proposals.

A scenario `scenarios/NAME.toml` has its golden in `goldens/NAME.toml`, its release golden in
`goldens/release/NAME.toml` and its proposal in `.lidarcheck/proposals/NAME.toml`, all beside `scenarios/`. A scenario
file in a directory of another name has them beside the file itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lidarcheck.config.words import nearest
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.atomic import write_text
from lidarcheck.trust.places import check_place, own_place

__all__ = ["Layout", "ScenarioSelection", "layout_of", "make_directory", "select", "toml_files"]

_SCENARIOS = "scenarios"


@dataclass(frozen=True, slots=True)
class Layout:
    """The directories of one project: `root` holds the others, `scenarios` the scenario files."""

    root: Path
    scenarios: Path

    @property
    def goldens(self) -> Path:
        """The last goldens."""
        return self.root / "goldens"

    @property
    def releases(self) -> Path:
        """The goldens of the last release."""
        return self.goldens / "release"

    @property
    def proposals(self) -> Path:
        """What runs would write to `goldens`, for review."""
        return self.root / ".lidarcheck" / "proposals"

    def private(self) -> Path:
        """`.lidarcheck/`, made if need be, with a `.gitignore` that keeps it out of version control."""
        directory = make_directory(own_place(self.root / ".lidarcheck", self.root))
        ignore = own_place(directory / ".gitignore", self.root)
        if not ignore.exists():
            write_text(ignore, "*\n")
        return directory

    def own(self, path: Path) -> Path:
        """The path of a golden or a proposal that is to be written or removed; `InputError` where a link leads on."""
        return own_place(path, self.root)

    def golden(self, name: str) -> Path:
        """The golden of the scenario NAME."""
        return self.goldens / f"{name}.toml"

    def release(self, name: str) -> Path:
        """The release golden of the scenario NAME."""
        return self.releases / f"{name}.toml"

    def proposal(self, name: str) -> Path:
        """The proposal for the scenario NAME."""
        return self.proposals / f"{name}.toml"

    def scenario(self, name: str) -> Path:
        """The scenario file NAME."""
        return self.scenarios / f"{name}.toml"

    def orphans(self) -> list[Path]:
        """Goldens and release goldens without a scenario, in the order of their paths."""
        found = [*toml_files(self.goldens), *toml_files(self.releases)]
        return [path for path in found if not self.scenario(path.stem).is_file()]

    def orphans_in_words(self) -> list[str]:
        """What each of `orphans` is, and what to do about it."""
        names = [(path, path.relative_to(self.root).as_posix()) for path in self.orphans()]
        return [f"{name} has no scenario: restore scenarios/{path.name}, or delete the golden" for path, name in names]


@dataclass(frozen=True, slots=True)
class ScenarioSelection:
    """The scenario files of a run, in order, and the projects of which every scenario was asked for."""

    files: tuple[Path, ...]
    whole: tuple[Layout, ...]


def make_directory(path: Path) -> Path:
    """Make the directory if it is not there; `InputError` if that fails."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fix = "check the directory's permissions"
        raise InputError(f"cannot make the directory: {error.strerror}", file=path, fix=fix) from error
    return path


def layout_of(scenario: Path) -> Layout:
    """The layout that a scenario file belongs to."""
    directory = scenario.resolve().parent
    return Layout(directory.parent if directory.name == _SCENARIOS else directory, directory)


def select(paths: Sequence[Path | str]) -> ScenarioSelection:
    """The scenario files that `paths` mean: files, directories of them, or names in `scenarios/`.

    Without paths: `scenarios/` of the current directory or of the nearest above that has one. `InputError` for a path
    that is not there, `UsageError` when there is no `scenarios/`.
    """
    files: dict[Path, None] = {}
    whole: dict[Layout, None] = {}
    for path in [Path(path) for path in paths] or [_scenarios_from(Path.cwd())]:
        if path.is_dir():
            directory = path / _SCENARIOS if (path / _SCENARIOS).is_dir() else path
            for file in toml_files(directory):
                check_place(file, file)  # it may be a link that somebody has committed
                files[file.resolve()] = None
            whole[layout_of(directory / "any.toml")] = None
        else:
            files[_scenario_file(path)] = None
    return ScenarioSelection(tuple(files), tuple(whole))


def _scenario_file(path: Path) -> Path:
    if path.is_file():
        return path.resolve()
    if path.parent == Path() and not path.suffix:
        named = Path(_SCENARIOS) / f"{path.name}.toml"
        if named.is_file():
            return named.resolve()
    beside = Path(_SCENARIOS) if path.parent == Path() and not path.suffix else path.parent
    near = nearest(path.stem, [file.stem for file in toml_files(beside)])
    fix = f"did you mean {path.with_stem(near)}?" if near else "give a scenario file, or a directory of them"
    raise InputError("there is no such scenario", file=path, fix=fix)


def _scenarios_from(start: Path) -> Path:
    for directory in (start, *start.parents):
        if (directory / _SCENARIOS).is_dir():
            return directory / _SCENARIOS
    raise UsageError(
        "no scenario was given and there is no scenarios/ here or above",
        fix="give scenario files or a directory of them",
    )


def toml_files(directory: Path) -> list[Path]:
    """The TOML files of a directory, in order, without hidden ones."""
    return sorted(path for path in directory.glob("*.toml") if path.is_file() and not path.name.startswith("."))
