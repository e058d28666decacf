"""What the number of each measurement of a project is asked of: with which model, tables and settings, and which."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.measurements import Measurement, measurements
from lidarcheck.session.model_choice import NONE, chosen_model, which_model
from lidarcheck.session.pairing import labels_of
from lidarcheck.session.project import Entry, Project

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Kind
    from lidarcheck.calibration.number.request import Request
    from lidarcheck.formats.lut import Axis
    from lidarcheck.session.choice import Choice

__all__ = ["Measured", "bloom_model", "model_beside"]

_TARGETS = ("profile", "sign")


class Measured:
    """The measurements of a project, as screens show them. `all`: sets that belong together beside each other."""

    def __init__(self, project: Project) -> None:
        from lidarcheck.tui.jobs.ghosts import sign_scans

        self.project = project
        self._signs = {scan.path for scan in sign_scans(project)}
        self._bloom: list[Entry | None] = []
        found = measurements(project)
        order = list(dict.fromkeys([*_TARGETS, *(self.kind(one) for one in found)]))
        self.all = sorted(found, key=lambda one: (order.index(self.kind(one)), one.distance_m or 0.0))

    def kind(self, one: Measurement) -> str:
        """What a measurement is called; a sign, by its name or that of its folder, is a scan for the session."""
        return "sign" if one.kind in ("scan", "frames") and self._signs & set(one.files) else one.kind

    def words(self, one: Measurement) -> str:
        """What it is called where there is little room: `sign 69 m`."""
        return f"{self.kind(one)} {self.where(one)}"

    def where(self, one: Measurement) -> str:
        """Its distance, or its name where nothing says that."""
        return Path(one.name).stem if one.distance_m is None else f"{one.distance_m:g} m"

    def set_of(self, one: Measurement) -> list[Measurement]:
        """Those of its kind and variant, at other distances."""
        return [other for other in self.all if self._set(other) == self._set(one)]

    def _set(self, one: Measurement) -> tuple[str, str]:
        return self.kind(one), self._variant(one)

    def _variant(self, one: Measurement) -> str:
        return _variant_of(one.files[0], one.name)

    # Numbers

    def number_kind(self, one: Measurement, *, tables: bool) -> Kind:
        """Which of the two numbers it has; `tables`: the last edit was one of blooming tables."""
        if one.why_none("gap") and not one.why_none("misfit"):
            return "misfit"
        return "misfit" if self.kind(one) in _TARGETS and tables else "gap"

    def request(self, one: Measurement, choice: Choice, *, tables: bool) -> Request | str:
        """What its number is asked of, or why there is none."""
        kind = self.number_kind(one, tables=tables)
        if why := one.why_none(kind):
            return why
        if kind == "misfit" and self.kind(one) not in _TARGETS:
            return one.why_none("gap")
        model = model_beside(self.project, choice, one.files[0], one.name)
        model = model or (self._bloom_model() if kind == "misfit" else None)
        if model is None:
            return which_model(self.project.of("model"))
        try:
            return self._request(one, choice, kind, model.path)
        except LidarcheckError as error:
            return self.project.inside("; ".join(error.lines()).removeprefix("error: "))

    def _bloom_model(self) -> Entry | None:
        if not self._bloom:
            self._bloom = [bloom_model(self.project)]
        return self._bloom[0]

    def _request(self, one: Measurement, choice: Choice, kind: Kind, model: Path) -> Request:
        if kind == "gap":
            return one.request(kind, model)
        from lidarcheck.session.edited_settings import settings_path
        from lidarcheck.tui.jobs.profiles import sensor_of

        axis: Axis = "horizontal" if choice.of("axis") == "horizontal" else "vertical"
        lut = next((entry.path for entry in self.project.of("lut") if entry.name == choice.of("lut")), None)
        settings = None if one.ideal else settings_path(self.project, axis, str(sensor_of(model).variant))
        if settings is not None and not settings.exists():
            settings = None
        return one.request(kind, model, axis=axis, lut=lut, settings=settings, target=choice.target)


def _variant_of(file: Path, name: str) -> str:
    return labels_of(Entry(file, "scan", name)).variant


def model_beside(project: Project, choice: Choice, file: Path, name: str) -> Entry | None:
    """The model that a measurement is looked at with: the one that is chosen, else the one that can be meant."""
    wanted = choice.of("model")
    beside = file if file.is_dir() else file.parent
    return chosen_model(project, "" if wanted == NONE else wanted, beside, _variant_of(file, name))


def bloom_model(project: Project) -> Entry | None:
    """Of the models that have a retro-reflector the one whose variant the settings are for, else the first."""
    from lidarcheck.tui.jobs.profiles import retros_of

    def able(model: Entry) -> bool:
        try:
            return bool(retros_of(model.path))
        except LidarcheckError:
            return False

    names = " ".join(entry.name.upper() for entry in project.of("settings"))
    could = [model for model in project.of("model") if able(model)]
    alike = [m for m in could if any(v in names and v in m.name.upper() for v in ("SLIM", "SMART"))]
    return next(iter([*alike, *could, *project.of("model")]), None)
