"""A measured frame and what is simulated of it as points, and the vehicle in both, where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.session.model_choice import sensor_of_models
from lidarcheck.session.node import ProgressCallback
from lidarcheck.session.pairing import Labels, labels_of
from lidarcheck.session.project import Entry
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.jobs.scenes import Effects

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.compare import AtDistance
    from lidarcheck.scan import Scan
    from lidarcheck.sensor import Sensor

__all__ = ["Clouds", "Source", "cloud_job"]

_STEPS = 3


@dataclass(frozen=True)
class Source:
    """What is shown beside a measured frame: a simulated file, or what a model makes of the ideal scan.

    `lacking`: why there is neither; `models`: those that may say what sensor measured; `placement`: what is declared
    of the measured file.
    """

    simulated: Path | None
    ideal: Path | None
    model: Path | None
    effects: Effects
    lacking: str = ""
    models: tuple[Path, ...] = ()
    placement: Placement = AS_IT_IS

    def words(self) -> str:
        """What it is, as titles have it."""
        if self.simulated is not None:
            return self.simulated.name
        return "" if self.model is None else f"{self.model.name}{self.effects.words()}"


@dataclass(frozen=True)
class Clouds:
    """Both sides of a measurement. `simulated`: None where there is none, and why in `lacking`.

    `vehicle`: its kind, `at`: the vehicle cut out of both; None where there is none, and why in `no_vehicle`.
    """

    real: Scan
    simulated: Scan | None
    lacking: str = ""
    vehicle: str = ""
    at: AtDistance | None = None
    no_vehicle: str = ""


def cloud_job(scan: Entry, source: Source) -> Job:
    """The points of a measured frame and of what is simulated of it."""
    files = (scan.path, source.simulated, None if source.simulated else source.ideal, source.model)
    return Job(
        name=scan.name,
        words=source.words() or source.lacking,
        files=tuple(path for path in files if path is not None),
        compute=lambda on_progress: _clouds(scan, source, on_progress),
        choices=("cloud", source),
        fault=scan.fault,
        kind="cloud",
    )


def _clouds(entry: Entry, source: Source, on_progress: ProgressCallback) -> Computed:
    from lidarcheck.cases.source import scan_of
    from lidarcheck.figures.data import Page

    labels = labels_of(entry)
    on_progress(0, _STEPS, "reading; steps")
    sensor = sensor_of_models(source.models)
    why = source.lacking
    clouds = None
    if not why:
        try:
            clouds = _both(entry.path, source, labels, sensor, on_progress)
        except LidarcheckError as error:  # what was measured is seen nevertheless, unless the fault is its own
            why = _words(error)
    if clouds is None:
        clouds = Clouds(scan_of(entry.path, source.placement, sensor), None, why, no_vehicle=why)
    shown = "no simulated side" if clouds.simulated is None else f"{len(clouds.simulated)} simulated"
    return Computed(Page("Cloud", f"{len(clouds.real)} echoes, {shown}", ()), None, clouds)


def _both(path: Path, source: Source, labels: Labels, sensor: Sensor | None, on_progress: ProgressCallback) -> Clouds:
    from lidarcheck.calibration.vehicles.kinds import distance_in_name
    from lidarcheck.calibration.vehicles.read import read_pair
    from lidarcheck.model import load_model

    model = None
    if source.simulated is None and source.model is not None:
        model = source.effects.applied(load_model(source.model))
    on_progress(1, _STEPS, "simulating; steps" if model is not None else "reading; steps")
    pair = read_pair(
        path,
        source.simulated,
        source.ideal,
        model,
        distance_m=distance_in_name(path),
        sensor=sensor,
        placement=source.placement,
    )
    on_progress(2, _STEPS, "looking for the vehicle; steps")
    if not labels.vehicle:
        words = "no vehicle is named by the file or its directory"
        return Clouds(pair.real, pair.simulated, no_vehicle=words)
    from lidarcheck.calibration.vehicles.compare import compare_vehicles
    from lidarcheck.calibration.vehicles.kinds import vehicle_named

    try:
        [at] = compare_vehicles(vehicle_named(labels.vehicle), [pair]).distances
    except LidarcheckError as error:
        return Clouds(pair.real, pair.simulated, vehicle=labels.vehicle, no_vehicle=_words(error))
    return Clouds(pair.real, pair.simulated, vehicle=labels.vehicle, at=at)


def _words(error: LidarcheckError) -> str:
    return "; ".join(error.lines()).removeprefix("error: ")
