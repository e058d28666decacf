"""The blooming datasets of a project, what was measured in each, and what a table is expected to show there."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarcheck.errors import InputError, LidarcheckError
from lidarcheck.session.pairing import ideal_of, numbers_in
from lidarcheck.session.project import Project

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.cells import Cells, Profile
    from lidarcheck.calibration.blooming.response import Response
    from lidarcheck.calibration.blooming.workflow import ModelSide
    from lidarcheck.formats.lut import Axis, LutTable
    from lidarcheck.formats.settings import Settings

__all__ = [
    "Choice",
    "Dataset",
    "Key",
    "ProfileData",
    "Profiles",
    "compile_aside",
    "datasets_of",
    "first_time",
    "retros_of",
    "variant_of",
]

Key = tuple[Any, ...]

_KEPT = 64


@dataclass(frozen=True)
class Dataset:
    """A measured scan or profile, and the ideal scan that belongs to it by its name; None where there is none."""

    name: str
    path: Path
    ideal: Path | None
    is_profile: bool = False

    @property
    def by_settings(self) -> bool:
        """Whether settings say where its target stands: an ideal scan or a profile tells that by itself."""
        return self.ideal is None and not self.is_profile


@dataclass(frozen=True)
class Choice:
    """What a dataset is looked at with; `material`: the target's, None for the only retro-reflector there is.

    `settings`: None for the defaults.
    """

    dataset: Dataset
    model: Path
    axis: Axis
    settings: Settings | None
    material: int | None = None

    @property
    def key(self) -> Key:
        """All that a result depends on; a file that was written anew has another key."""
        dataset, settings = self.dataset, self.settings
        files = tuple(_stamp(file) for file in (dataset.path, dataset.ideal, self.model))
        held = None if settings is None or not dataset.by_settings else (settings.entries, settings.content is None)
        return (*files, held, self.axis, self.material)


@dataclass(frozen=True)
class ProfileData:
    """A dataset that was read: its cells and the measured profile."""

    cells: Cells
    real: Profile


def datasets_of(project: Project, axis: Axis) -> list[Dataset]:
    """The measurements that may show blooming along an axis: profiles of it, and all scans."""
    from lidarcheck.calibration.blooming.csv import profile_axis

    ideals = project.of("ideal")
    found = [Dataset(e.name, e.path, None, True) for e in project.of("profile") if profile_axis(e.path) == axis]
    found += [Dataset(entry.name, entry.path, ideal_of(entry, ideals)) for entry in project.of("scan")]
    return sorted(found, key=lambda dataset: numbers_in(dataset.name))


def retros_of(model: Path) -> list[int]:
    """The retro-reflecting materials of a model, any of which may be the target."""
    from lidarcheck.model import load_model

    return sorted(number for number, m in load_model(model).materials.items() if m.kind == "retro")


class Profiles:
    """Reads datasets and keeps what was read and computed: switching between them computes nothing. For any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._shown: dict[Key, ProfileData | LidarcheckError] = {}
        self._expected: dict[tuple[Key, bytes], Profile] = {}
        self._benches: dict[Key, ModelSide] = {}
        self._responses: dict[Key, Response] = {}

    def known(self, choice: Choice) -> ProfileData | LidarcheckError | None:
        """What was read before of unchanged files, or what is wrong with them; None if they must be read."""
        return self._shown.get(choice.key)

    def known_expected(self, choice: Choice, table: LutTable) -> Profile | None:
        """The expectation, if it was computed before."""
        return self._expected.get((choice.key, _table_key(table)))

    def load(self, choice: Choice) -> ProfileData | LidarcheckError:
        """The dataset, read now if it was not yet; an error of it where it shows no blooming target."""
        with self._lock:
            key = choice.key
            if key not in self._shown:
                try:
                    _keep(self._shown, key, self._read(choice))
                except LidarcheckError as error:
                    _keep(self._shown, key, error)
            return self._shown[key]

    def _read(self, choice: Choice) -> ProfileData:
        from lidarcheck.calibration.blooming.cells import profile_of
        from lidarcheck.calibration.blooming.workflow import BloomingMeasurement, gather

        dataset = choice.dataset
        cells = gather([BloomingMeasurement(dataset.path, None, dataset.ideal)], self._bench(choice))[0]
        return ProfileData(cells, profile_of(cells))

    def expected(self, choice: Choice, shown: ProfileData, table: LutTable) -> Profile:
        """What is expected to be seen of a dataset with a table, without noise; computed once."""
        from lidarcheck.calibration.blooming.operator import nodes_of
        from lidarcheck.calibration.blooming.workflow import expected_profile

        with self._lock:
            key = (choice.key, _table_key(table))
            if key not in self._expected:
                response = self._response(choice)
                found = expected_profile(shown.cells, nodes_of(table, shown.cells.axis), response)
                _keep(self._expected, key, found)
            return self._expected[key]

    def _response(self, choice: Choice) -> Response:
        """How the sensor answers to light. The first one on a machine compiles the model's kernels."""
        from lidarcheck.calibration.blooming.response import response_of

        of = (_stamp(choice.model), choice.axis)
        if of not in self._responses:
            bench = self._bench(choice)
            self._responses[of] = response_of(bench.sensor, bench.shape)
        return self._responses[of]

    def _bench(self, choice: Choice) -> ModelSide:
        from lidarcheck.calibration.blooming.workflow import model_side_of
        from lidarcheck.model import load_model

        key = choice.key[2:]
        if key not in self._benches:
            model = load_model(choice.model)
            retros = sorted(number for number, m in model.materials.items() if m.kind == "retro")
            if model.external is None and not retros:
                what = "the model has no retro-reflector, so nothing that blooms"
                raise InputError(what, file=choice.model, fix="choose another model")
            material = choice.material if choice.material in retros else None
            if material is None and len(retros) > 1:
                material = retros[0]
            settings = choice.settings if choice.dataset.by_settings else None
            _keep(self._benches, key, model_side_of(model, choice.axis, settings=settings, material=material))
        return self._benches[key]


def variant_of(model: Path) -> str:
    """The sensor variant that a model is of; errors name what is wrong with it."""
    from lidarcheck.model import load_model

    return str(load_model(model).sensor.variant)


def first_time() -> bool:
    """Whether no kernel of the sensor model was compiled on this machine yet."""
    from lidarcheck.model.jit import cache_directory

    return not any(cache_directory().iterdir())


_COMPILE = """from lidarcheck.calibration.blooming.response import response_of
from lidarcheck.sensor import Sensor
response_of(Sensor.of("SLIM"))"""


def compile_aside() -> None:
    """Compile the model's kernels in a process of their own, whose cache this one reads: in a thread of this process
    it would hold the interpreter's lock, and keys would wait. Where that fails this process compiles them itself.
    """
    quiet = subprocess.DEVNULL
    with contextlib.suppress(OSError):
        command = [sys.executable, "-c", _COMPILE]
        subprocess.run(command, check=False, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)


def _keep(kept: dict[Any, Any], key: Any, value: Any) -> None:
    """Keep a result, and no more than some of them: the oldest goes."""
    while len(kept) >= _KEPT:
        kept.pop(next(iter(kept)))
    kept[key] = value


def _table_key(table: LutTable) -> bytes:
    return table.x.tobytes() + table.y.tobytes()


def _stamp(path: Path | None) -> tuple[str, int, int]:
    """A file and its state: a file that was written anew is read anew."""
    if path is None:
        return "", 0, 0
    try:
        stat = path.stat()
    except OSError:
        return str(path), 0, 0
    return str(path), stat.st_mtime_ns, stat.st_size
