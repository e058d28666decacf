"""The blooming datasets of a project, what was measured in each, and what a table is expected to show there."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import InputError, LidarcheckError, NotThereError
from lidarcheck.reading import apart, reading
from lidarcheck.session.node import Node
from lidarcheck.session.pairing import ideal_of, numbers_in
from lidarcheck.session.project import Project
from lidarcheck.session.session import Session

if TYPE_CHECKING:
    from lidarcheck.calibration.blooming.beside import BesideTarget
    from lidarcheck.calibration.blooming.cells import Cells, Profile
    from lidarcheck.calibration.blooming.response import Response
    from lidarcheck.calibration.blooming.workflow import ModelSide
    from lidarcheck.formats.lut import Axis, LutTable
    from lidarcheck.formats.settings import Setting, Settings
    from lidarcheck.model import Model
    from lidarcheck.sensor import Sensor

    Shown = Profile | BesideTarget
    """What is seen over the offset: of a SPAD array, or of any other sensor."""

__all__ = [
    "Choice",
    "Dataset",
    "ProfileData",
    "Profiles",
    "Shown",
    "compile_aside",
    "datasets_of",
    "first_time",
    "retros_of",
    "sensor_of",
]


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
    def about(self) -> tuple[str, str, str, int | None]:
        """Which of the datasets it is, and with what it is looked at."""
        return self.dataset.name, str(self.model), self.axis, self.material


@dataclass(frozen=True)
class ProfileData:
    """A dataset that was read: the measured profile, and its cells, None of a sensor that is no SPAD array."""

    real: Shown
    distance_m: float
    cells: Cells | None = None

    @property
    def setting(self) -> Setting | None:
        """The setting that said where its target is; None where none did."""
        return None if self.cells is None else self.cells.setting

    def has(self, feature: str) -> bool:
        """Whether a feature was measured."""
        return feature in ("range", *getattr(self.real, "features", (feature,)))


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
    """What of datasets is read and computed, as nodes of the session, which keeps it. For any thread.

    A model counts here without its own blooming tables, by its numbers: the table is handed in as it is shown.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self._responses: dict[tuple[str, Axis, tuple[float, ...]], Response] = {}

    def measured(self, choice: Choice) -> Node:
        """The dataset as it was read: `ProfileData`."""
        dataset = choice.dataset
        files = tuple(path for path in (dataset.path, dataset.ideal) if path is not None)
        settings = choice.settings if dataset.by_settings else None
        held = None if settings is None else (settings.entries, settings.content is None)
        bare = self._bare(choice)
        part = (choice.about, dataset.is_profile, held, bare)
        return Node("measured profile", 2, choice.about, files, lambda _told: self._read(choice, bare), part)

    def expected(self, choice: Choice, table: LutTable) -> Node:
        """What is expected to be seen of a dataset with a table, without noise: `Profile`. Of a sensor that is no SPAD
        array, whose mean echo is not known, what is simulated with a seed: `BesideTarget`.
        """
        of = self.measured(choice)
        part = (of.choices, table.x, table.y)
        return Node("expected profile", 1, choice.about, of.files, lambda _told: self._expect(of, choice, table), part)

    def _bare(self, choice: Choice) -> str:
        """The hash of what a model is without its own table; of one that cannot be read, why."""
        from lidarcheck.calibration.blooming.workflow import bare_of
        from lidarcheck.harness.goldens.provenance import parameters_hash

        try:
            bare, bright = bare_of(self._model(choice), choice.axis)
            return f"{parameters_hash(bare)} {bright!r}"
        except LidarcheckError as error:
            return "; ".join(error.lines())

    def _model(self, choice: Choice) -> Model:
        from lidarcheck.model import load_model

        with apart(), reading(self.session.inputs().edited):
            return load_model(choice.model)

    def _read(self, choice: Choice, bare: str) -> ProfileData:
        from lidarcheck.calibration.blooming.beside import beside_target
        from lidarcheck.calibration.blooming.cells import profile_of
        from lidarcheck.calibration.blooming.workflow import BloomingMeasurement, gather

        dataset, model = choice.dataset, self._model(choice)
        measured = BloomingMeasurement(dataset.path, None, dataset.ideal)
        if _counts(model):
            cells = gather([measured], self._bench(choice))[0]
            found = ProfileData(profile_of(cells), cells.distance_m, cells)
        else:
            beside = beside_target(measured, model, choice.axis)
            found = ProfileData(beside, beside.distance_m)
        if self._bare(choice) != bare:
            raise InputError("was changed while it was read", file=choice.model, fix="look again")
        return found

    def _expect(self, measured: Node, choice: Choice, table: LutTable) -> Shown:
        from lidarcheck.calibration.blooming.operator import nodes_of
        from lidarcheck.calibration.blooming.workflow import expected_profile

        shown: ProfileData = self.session.compute(measured).value
        if shown.cells is None:
            return self._simulated(choice, table)
        response = self._response(choice, shown.cells.within)
        return expected_profile(shown.cells, nodes_of(table, shown.cells.axis), response)

    def _simulated(self, choice: Choice, table: LutTable) -> BesideTarget:
        """The profile of what the model makes of the ideal scan with the table, which takes the place of its own."""
        from lidarcheck.calibration.blooming.beside import beside_target_of
        from lidarcheck.calibration.number.models import check_blooms, with_table
        from lidarcheck.cases.source import ideal_of as read_ideal
        from lidarcheck.effects.base import Curve
        from lidarcheck.model import simulate

        model, dataset = self._model(choice), choice.dataset
        if dataset.ideal is None:
            raise NotThereError("has no ideal scan to simulate", file=dataset.path, fix="name one like it")
        check_blooms(model, choice.axis)
        ideal = read_ideal(dataset.ideal, model.sensor)
        model = with_table(model, choice.axis, Curve(tuple(table.x.tolist()), tuple(table.y.tolist()), ""))
        return beside_target_of(simulate(ideal, model), ideal, model, choice.axis, str(dataset.ideal))

    def _response(self, choice: Choice, within: tuple[float, ...]) -> Response:
        """How the sensor answers to light. The first one on a machine compiles the model's kernels."""
        from lidarcheck.calibration.blooming.response import response_of

        of = (self._bare(choice), choice.axis, within)
        if of not in self._responses:
            bench = self._bench(choice)
            self._responses[of] = response_of(bench.sensor, bench.shape, within=within)
        return self._responses[of]

    def _bench(self, choice: Choice) -> ModelSide:
        from lidarcheck.calibration.blooming.workflow import model_side_of

        model = self._model(choice)
        retros = sorted(number for number, m in model.materials.items() if m.kind == "retro")
        if not retros:
            what = "the model has no retro-reflector, so nothing that blooms"
            raise NotThereError(what, file=choice.model, fix="choose another model")
        material = choice.material if choice.material in retros else None
        if material is None and len(retros) > 1:
            material = retros[0]
        settings = choice.settings if choice.dataset.by_settings else None
        return model_side_of(model, choice.axis, settings=settings, material=material)


def _counts(model: Model) -> bool:
    """Whether it is a SPAD array that counts PEAK, AREA and WIDTH, whose mean echo is known."""
    from lidarcheck.sensor import SpadArray

    return isinstance(model.sensor.nominal, SpadArray)


def sensor_of(model: Path) -> Sensor:
    """The sensor that a model is of; errors name what is wrong with it."""
    from lidarcheck.model import load_model

    return load_model(model).sensor


def first_time() -> bool:
    """Whether no kernel of the sensor model was compiled on this machine yet."""
    from lidarcheck.jit import cache_directory

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
