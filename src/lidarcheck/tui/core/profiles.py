"""The blooming datasets of a project, what was measured in each, and what a table is expected to show there."""

from __future__ import annotations

import re
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import InputError
from lidarcheck.tui.core.project import Entry, Project

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming import Bench
    from lidarcheck.calibration.blooming_cells import Cells, Profile
    from lidarcheck.calibration.blooming_response import Response
    from lidarcheck.formats.lut import Axis, LutTable

__all__ = ["Choice", "Dataset", "Profiles", "Shown", "datasets_of", "ideal_of", "numbers_in", "retros_of"]

_WORDS = re.compile(r"ideal|postpro|scan|measured|real|at|[^a-z0-9.]+")
_KEPT = 32


@dataclass(frozen=True)
class Dataset:
    """A measured scan or profile, and the ideal scan that belongs to it by its name; None where there is none."""

    name: str
    path: Path
    ideal: Path | None


@dataclass(frozen=True)
class Choice:
    """What a dataset is looked at with; `material`: the target's, None for the only retro-reflector there is."""

    dataset: Dataset
    model: Path
    axis: Axis
    settings: Path | None
    material: int | None = None


@dataclass(frozen=True)
class Shown:
    """A dataset that was read: its cells, the measured profile, and how the sensor answers to light."""

    cells: Cells
    real: Profile
    response: Response


def datasets_of(project: Project, axis: Axis) -> list[Dataset]:
    """The measurements that may show blooming along an axis: profiles of it, and all scans."""
    from lidarcheck.calibration.blooming_csv import profile_axis

    ideals = project.of("ideal")
    found = [Dataset(e.name, e.path, None) for e in project.of("profile") if profile_axis(e.path) == axis]
    found += [Dataset(entry.name, entry.path, ideal_of(entry, ideals)) for entry in project.of("scan")]
    return sorted(found, key=lambda dataset: numbers_in(dataset.name))


def numbers_in(name: str) -> tuple[list[float], str]:
    """Names in the order of the numbers in them: 69 m before 157 m."""
    return [float(text) for text in re.findall(r"\d+(?:\.\d+)?", Path(name).stem)], name


def ideal_of(scan: Entry, ideals: Sequence[Entry]) -> Path | None:
    """The ideal scan whose name differs by such words only: `real_69.txt` and `ideal_69.txt`."""
    key = _WORDS.sub("", scan.path.stem.lower())
    alike = [entry for entry in ideals if key and _WORDS.sub("", entry.path.stem.lower()) == key]
    alike.sort(key=lambda entry: entry.path.parent != scan.path.parent)
    return alike[0].path if alike else None


def retros_of(model: Path) -> list[int]:
    """The retro-reflecting materials of a model, any of which may be the target."""
    from lidarcheck.model import load_model

    return sorted(number for number, m in load_model(model).materials.items() if m.kind == "retro")


class Profiles:
    """Reads datasets and keeps what it read, so that switching between them computes nothing. For any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._shown: dict[tuple[Any, ...], Shown] = {}
        self._benches: dict[tuple[Any, ...], Bench] = {}
        self._responses: dict[tuple[Any, ...], Response] = {}

    def known(self, choice: Choice) -> Shown | None:
        """What was read before of unchanged files; None if it must be read."""
        return self._shown.get(_key(choice))

    def load(self, choice: Choice) -> Shown:
        """The dataset, read now if it was not yet. `InputError` and its like where it shows no blooming target."""
        with self._lock:
            key = _key(choice)
            if key not in self._shown:
                while len(self._shown) >= _KEPT:
                    self._shown.pop(next(iter(self._shown)))
                self._shown[key] = self._read(choice)
            return self._shown[key]

    def _read(self, choice: Choice) -> Shown:
        from lidarcheck.calibration.blooming import Measured, gather
        from lidarcheck.calibration.blooming_cells import profile_of
        from lidarcheck.calibration.blooming_response import response_of

        bench = self._bench(choice)
        dataset = choice.dataset
        cells = gather([Measured(dataset.path, None, dataset.ideal)], bench)[0]
        of = (_stamp(choice.model), choice.axis)
        if of not in self._responses:
            self._responses[of] = response_of(bench.sensor, bench.shape)
        return Shown(cells, profile_of(cells), self._responses[of])

    def _bench(self, choice: Choice) -> Bench:
        from lidarcheck.calibration.blooming import bench_of
        from lidarcheck.formats.settings import load_settings
        from lidarcheck.model import load_model

        key = (_stamp(choice.model), choice.axis, _stamp(choice.settings), choice.material)
        if key not in self._benches:
            model = load_model(choice.model)
            retros = sorted(number for number, m in model.materials.items() if m.kind == "retro")
            if model.external is None and not retros:
                what = "the model has no retro-reflector, so nothing that blooms"
                raise InputError(what, file=choice.model, fix="choose another model")
            settings = load_settings(choice.settings, choice.axis) if choice.settings else None
            material = choice.material if choice.material in retros else None
            if material is None and len(retros) > 1:
                material = retros[0]
            self._benches[key] = bench_of(model, choice.axis, settings=settings, material=material)
        return self._benches[key]

    def expected(self, shown: Shown, table: LutTable) -> Profile:
        """What is expected to be seen of a dataset with a table, without noise."""
        from lidarcheck.calibration.blooming import expected_profile
        from lidarcheck.calibration.blooming_operator import nodes_of

        return expected_profile(shown.cells, nodes_of(table, shown.cells.axis), shown.response)


def settings_for(project: Project, model: Path, axis: Axis) -> Path | None:
    """The project's settings of a model's variant along an axis; None for the defaults."""
    from lidarcheck.formats.settings import settings_name
    from lidarcheck.model import load_model

    wanted = settings_name(axis, load_model(model).sensor.variant).lower()
    return next((e.path for e in project.of("settings") if e.path.name.lower() == wanted), None)


def _key(choice: Choice) -> tuple[Any, ...]:
    dataset = choice.dataset
    files = (dataset.path, dataset.ideal, choice.model, choice.settings)
    return (*(_stamp(file) for file in files), choice.axis, choice.material)


def _stamp(path: Path | None) -> tuple[str, int, int]:
    """A file and its state: a file that was written anew is read anew."""
    if path is None:
        return "", 0, 0
    try:
        stat = path.stat()
    except OSError:
        return str(path), 0, 0
    return str(path), stat.st_mtime_ns, stat.st_size
