"""Reading a measured frame with its ideal scan, and simulating it with a model whose effects are chosen."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from lidarcheck.calibration.scenes.checks import check_scene
from lidarcheck.calibration.scenes.frame import SceneFrame, simulated_frame
from lidarcheck.cases.same_scene import check_scene_of
from lidarcheck.cases.source import Named, ideal_of, scan_of, without_masked
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.kpi.variant import check_variant, check_variants
from lidarcheck.model import Model
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["provenance_of", "read_frame"]

_log = logging.getLogger(__name__)


def read_frame(
    measured: Named,
    ideal: Named,
    *,
    model: Model | None = None,
    simulated: Named | None = None,
    scene: Caster | None = None,
    scene_name: str = "",
    seed: int = 0,
    number: int = 0,
    placement: Placement = AS_IT_IS,
    sensor: Sensor | None = None,
) -> SceneFrame:
    """A frame to compare: simulated with `model`, as frame `number`, or else read from `simulated`.

    `placement`: what is declared of the measured file; `sensor`: what measured, else the model's.

    `InputError` names the file of another variant, and the ideal scan that was not cast from `scene`.
    """
    known = sensor if model is None else model.sensor
    scan, meets = scan_of(measured, placement, known), ideal_of(ideal, known)
    _belong(scan, meets, measured, str(ideal))
    if scene is not None:
        check_scene(meets, scene, scene_name, str(ideal))
    if model is not None:
        if model.external is None:
            check_variant(scan, model.sensor, str(measured))
        files = {"file": str(measured), "ideal_file": str(ideal)}
        return simulated_frame(scan, meets, model, seed=seed, number=number, scene=scene, **files)
    if simulated is None:
        raise ValueError("neither a model nor a simulated frame")
    shown = without_masked(measured, scan_of(simulated, sensor=known))
    check_variants(scan, shown, str(measured))
    return SceneFrame(scan, meets, shown, None, str(measured), str(ideal), str(simulated))


def _belong(scan: Scan, shown: IdealScan | Scan, measured: Named, name: str) -> None:
    """Refuse what does not show the same scene, and warn of what may not."""
    doubt = check_scene_of(scan, shown, str(measured), name)
    if doubt:
        _log.warning(doubt)


def provenance_of(
    frames: Sequence[tuple[Named, Named]], model: Model | None, simulated: Sequence[Named] = (), *, seed: int = 0
) -> dict[str, str]:
    """What a comparison of measured frames with their ideal scans is made from, in words."""
    files = {f"frame {i}": f"{measured}, ideal {ideal}" for i, (measured, ideal) in enumerate(frames, 1)}
    if model is not None:
        chosen = ", ".join(effect.name for effect in model.effects)
        files["model"] = f"{model.file}, effects: {chosen or 'none'}, seed {seed}"
    return files | ({"simulated": ", ".join(map(str, simulated))} if simulated else {})
