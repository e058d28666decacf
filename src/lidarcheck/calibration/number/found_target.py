"""What the beams of a scan meet as far as its misfit takes it, where no ideal scan says so: the target that saturates.

As `bloom show` and `bloom fit` find it: where the settings, or the distance, say. All else is taken for nothing: beams
that see another surface near the target's range are not left out.
"""

from __future__ import annotations

import numpy as np

from lidarcheck.calibration.blooming.target import lines_and_places, target_in_scan
from lidarcheck.calibration.blooming.workflow import ModelSide, model_side_of
from lidarcheck.calibration.number.request import Request
from lidarcheck.errors import NotThereError
from lidarcheck.formats.settings import Settings, default_settings, find_settings, load_settings
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan

__all__ = ["bench_of", "ideal_of_target"]


def ideal_of_target(scan: Scan, model: Model, request: Request, name: str) -> IdealScan:
    """The target's beams, and those beside it on its lines, within the scan's bounds.

    `NotThereError` where nothing saturates, or the model does not say which retro-reflector the target is.
    """
    bench = bench_of(model, request, name)
    assert bench.material is not None
    assert bench.signal_at_1m is not None
    target = target_in_scan(
        scan, bench.counts, request.axis, signal_at_1m=bench.signal_at_1m, settings=bench.settings,
        distance_m=request.distance_m, name=name,
    )  # fmt: skip
    lines = np.unique(target.line)
    _, places = lines_and_places(scan, request.axis)
    low, high = int(places.min()), int(places.max())
    line = np.repeat(lines, high - low + 1)
    place = np.tile(np.arange(low, high + 1, dtype=np.int32), len(lines))
    distance, material = np.zeros(len(line)), np.full(len(line), bench.material, dtype=np.int32)
    distance[np.searchsorted(lines, target.line) * (high - low + 1) + target.place - low] = target.distance_m
    layer, point = (place, line) if request.axis == "vertical" else (line, place)
    order = np.lexsort((point, layer))
    nothing = np.zeros(len(line))
    return IdealScan(layer[order], point[order], distance[order], material, nothing, beams=scan.beams, file=name)


def bench_of(model: Model, request: Request, name: str) -> ModelSide:
    """What a scan or profile of a target that nobody else describes is held against."""
    bench = model_side_of(model, request.axis, settings=_settings(request, model), material=request.material)
    if bench.material is None or bench.signal_at_1m is None:
        what = "has no ideal scan, and the model does not say which retro-reflector its target is"
        raise NotThereError(what, file=name, fix="say which with --target, or give its ideal scan")
    return bench


def _settings(request: Request, model: Model) -> Settings:
    path = request.settings
    if path is None:
        return default_settings(request.axis)
    if path.is_dir():
        return find_settings(path, request.axis, "SMART" if model.sensor.variant == "SMART" else "SLIM")
    return load_settings(path, request.axis)
