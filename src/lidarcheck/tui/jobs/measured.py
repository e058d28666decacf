"""The measurements of a project, each at its distance, and what the number of each is asked of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.session.model_choice import NONE, chosen_model, which_model
from lidarcheck.session.pairing import ideal_of, labels_of, measured_in, numbers_in, partner_of
from lidarcheck.session.project import Entry, Project

if TYPE_CHECKING:
    from lidarcheck.calibration.number.number import Kind
    from lidarcheck.calibration.number.request import Request
    from lidarcheck.formats.lut import Axis
    from lidarcheck.session.choice import Choice

__all__ = ["Measurement", "bloom_model", "measurements", "number_kind", "request_of", "set_of"]


@dataclass(frozen=True)
class Measurement:
    """One scan, set of frames or profile at one distance.

    `name`: within the project; `kind`: profile, sign, the vehicle's, hall, scene; `distance_m`: as the name says;
    `ideal`: one for each file or one for all, empty where there is none; `none`: why there is no number of it.
    """

    name: str
    kind: str
    distance_m: float | None
    files: tuple[Path, ...]
    ideal: tuple[Path, ...] = ()
    none: str = ""

    @property
    def words(self) -> str:
        """What it is called where there is little room: `sign 69 m`."""
        where = Path(self.name).stem if self.distance_m is None else f"{self.distance_m:g} m"
        return f"{self.kind} {where}"


def measurements(project: Project) -> list[Measurement]:
    """All of them, sets that belong together beside each other, the nearest first."""
    from lidarcheck.tui.jobs.ghosts import sign_scans
    from lidarcheck.tui.jobs.noise import halls_of

    ideals, signs = project.of("ideal"), {scan.path for scan in sign_scans(project)}
    found = [_one(entry, "profile", ()) for entry in project.of("profile")]
    halls = [hall for hall in halls_of(project) if len(hall.frames) > 1 and not set(hall.frames) & signs]
    for hall in halls:
        none = "" if hall.ideals else "no ideal scan"
        found.append(Measurement(hall.name, "hall", None, hall.frames, hall.ideals, none))
    in_halls = {path for hall in halls for path in hall.frames}
    for entry in measured_in(project):
        if entry.path not in in_halls:
            ideal = ideal_of(entry, ideals) or partner_of(entry, ideals)
            kind = "sign" if entry.path in signs else labels_of(entry).vehicle or "scene"
            found.append(_one(entry, kind, () if ideal is None else (ideal,)))
    order = list(dict.fromkeys(["profile", "sign", *(one.kind for one in found)]))
    return sorted(found, key=lambda one: (order.index(one.kind), one.distance_m or 0.0, numbers_in(one.name)))


def _one(entry: Entry, kind: str, ideal: tuple[Path, ...]) -> Measurement:
    from lidarcheck.calibration.vehicles.kinds import distance_in_name

    none = "" if ideal or kind in ("profile", "sign") else "no ideal scan"
    return Measurement(entry.name, kind, distance_in_name(entry.path), (entry.path,), ideal, none)


def set_of(measured: Sequence[Measurement], one: Measurement) -> list[Measurement]:
    """Those of its kind, at other distances."""
    return [other for other in measured if other.kind == one.kind]


def request_of(project: Project, one: Measurement, choice: Choice, *, tables: bool) -> Request | str:
    """What its number is asked of, or why there is none. `tables`: the last edit was one of blooming tables, so that
    the number is the misfit where there is one.
    """
    if one.none:
        return one.none
    kind = number_kind(one, tables=tables)
    wanted, variant = choice.of("model"), labels_of(Entry(one.files[0], "scan", one.name)).variant
    wanted = "" if wanted == NONE else wanted
    model = chosen_model(project, wanted, one.files[0].parent, variant)
    if kind == "misfit" and model is None:
        model = bloom_model(project)
    if model is None:
        return which_model(project.of("model"))
    try:
        return _request(project, one, choice, kind, model.path)
    except LidarcheckError as error:
        return project.inside("; ".join(error.lines()).removeprefix("error: "))


def number_kind(one: Measurement, *, tables: bool) -> Kind:
    """Which of the two numbers a measurement has."""
    return "misfit" if one.kind == "profile" or (one.kind == "sign" and (tables or not one.ideal)) else "gap"


def _request(project: Project, one: Measurement, choice: Choice, kind: Kind, model: Path) -> Request:
    from lidarcheck.calibration.number.request import Request
    from lidarcheck.session.edited_settings import settings_path
    from lidarcheck.tui.jobs.profiles import variant_of

    axis: Axis = "horizontal" if choice.of("axis") == "horizontal" else "vertical"
    lut = next((entry.path for entry in project.of("lut") if entry.name == choice.of("lut")), None)
    settings = None
    if kind == "misfit" and not one.ideal and one.kind != "profile":
        path = settings_path(project, axis, variant_of(model))
        settings = path if path.exists() else None
    return Request(
        kind,
        model,
        one.files,
        one.ideal,
        axis=axis,
        lut=lut if kind == "misfit" else None,
        settings=settings,
        distance_m=None if one.kind == "profile" or one.ideal else one.distance_m,
        material=choice.target if kind == "misfit" else None,
    )


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
