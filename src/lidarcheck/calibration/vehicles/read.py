"""Reading a real and a simulated frame of a vehicle; the simulated one may be made on the spot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lidarcheck.calibration.vehicles.compare import Pair
from lidarcheck.calibration.vehicles.cut import CutBox, CutSource
from lidarcheck.cases.source import Named, ideal_of, scan_of, without_masked
from lidarcheck.errors import UsageError
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.kpi.variant import check_variant, check_variants
from lidarcheck.model import Model, simulate
from lidarcheck.sensor import Sensor

__all__ = ["check_model", "provenance_of", "read_pair"]


def check_model(model: Model | None, variant: str | None) -> None:
    """Refuse a model of another variant than the one that is asked for."""
    if model is not None and variant is not None and model.external is None and model.sensor.variant != variant:
        what = f"the model is of {model.sensor.variant}, not {variant}"
        raise UsageError(what, file=model.file, fix="name the model of the variant, or leave out --variant")


def read_pair(
    real: Named,
    simulated: Named | None,
    ideal: Named | None,
    model: Model | None,
    *,
    distance_m: float | None = None,
    variant: str | None = None,
    object_id: int | None = None,
    box: CutBox | None = None,
    seed: int = 0,
    number: int = 0,
    placement: Placement = AS_IT_IS,
    sensor: Sensor | None = None,
) -> Pair:
    """A pair to compare: `simulated` is read, or `ideal` simulated with `model`, as frame `number`.

    `variant`: what both must have been measured with. `distance_m`, `object_id`, `box`: what the vehicle is cut out by.
    `placement`: what is declared of the real frame's file; `sensor`: what measured, else the model's, or the variant.
    `InputError` names the file that another variant has measured.
    """
    named = None if variant is None else Sensor.of(variant)
    own = (sensor or named) if model is None else model.sensor
    scan = scan_of(real, placement, own)
    meets = ideal_of(ideal, own) if ideal is not None else None
    other = str(simulated) if simulated is not None else str(model.file if model is not None else "")
    if simulated is not None:
        shown = without_masked(real, scan_of(simulated, sensor=own))
    elif model is not None and meets is not None:
        if model.external is None:
            check_variant(scan, model.sensor, str(real))
        shown = simulate(meets, model, seed=seed, frame=number)
    else:
        raise UsageError(f"{real} has nothing to be compared with", fix="give a simulated frame, or an ideal scan")
    if named is not None:
        for side, file in ((scan, str(real)), (shown, other)):
            check_variant(side, named, file, "variant")
    check_variants(scan, shown, str(real))
    sources = [CutSource(meets, object_id, box, distance_m, file) for file in (str(real), other)]
    return Pair(scan, shown, sources[0], sources[1], meets, own)


def provenance_of(
    real: Sequence[Named], simulated: Sequence[Named], ideal: Sequence[Named], model: Path | None, *, seed: int = 0
) -> dict[str, str]:
    """What a comparison is made from, in words."""
    files = {"real": _listed(real), "simulated": _listed(simulated) if simulated else f"{model}, seed {seed}"}
    return files | ({"ideal": _listed(ideal)} if ideal else {})


def _listed(files: Sequence[Named]) -> str:
    return ", ".join(map(str, files))
