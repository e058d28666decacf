"""From a detector's echoes to the scan that the sensor reports, and its features anew where ranges have changed."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from lidarcheck.beams import BeamHistograms, Fired
from lidarcheck.effects.shared.ranges import reported
from lidarcheck.model.detector_echoes import DetectorEchoes, features_of
from lidarcheck.model.placing import placed
from lidarcheck.scan import COUNTED, Light, Scan
from lidarcheck.sensor import Sensor
from lidarcheck.sensor.laws import EchoNumbers

__all__ = ["as_reported", "scan_of_detector"]

_NUMBER_AS_MADE = "EchoNumberRaw"


def scan_of_detector(echoes: DetectorEchoes, light: Light, sensor: Sensor) -> Scan:
    """The table of a detector's echoes; what its features follow from stays in `made` until they are reported."""
    layer, point = light.layer[echoes.beam], light.point[echoes.beam]
    made = {"amplitude": echoes.numbers.amplitude}
    for field in fields(EchoNumbers):
        value: Any = getattr(echoes.numbers, field.name)
        if value is not None and field.name != "range_m":
            made[field.name] = np.broadcast_to(np.asarray(value, dtype=np.float64), len(echoes))
    others = bool((echoes.made_number != echoes.echo_number).any())
    zeros = np.zeros(len(echoes))
    return Scan(
        *placed(light.beams, layer, point, echoes.range_m - light.beams.range_offset_m(layer)),
        layer=layer,
        point=point,
        echo_number=echoes.echo_number,
        width_ns=zeros,
        area=zeros,
        peak=zeros,
        features=echoes.features,
        beams=light.beams,
        defaulted=tuple(COUNTED),
        extra={_NUMBER_AS_MADE: echoes.made_number} if others else {},
        made=made,
        histograms=None if echoes.histogram is None else _histograms(light, echoes.histogram),
        fired=None if echoes.histogram is None else Fired(light.layer, light.point),
    )


def as_reported(scan: Scan, sensor: Sensor) -> Scan:
    """The echoes at ranges as the sensor reports them, with the features that follow from these."""
    found = reported(scan, sensor)
    if not scan.made:
        return found
    made: dict[str, Any] = {**found.made}
    shape = made.pop("fwhm_ns", None)
    fwhm_ns = None if shape is None or not len(shape) else float(shape[0])
    range_m = found.range_m - found.beams.range_offset_m(found.layer)
    return replace(found, features=features_of(EchoNumbers(range_m=range_m, fwhm_ns=fwhm_ns, **made), sensor))


def _histograms(light: Light, counts: npt.NDArray[np.uint32]) -> BeamHistograms:
    return BeamHistograms(light.layer, light.point, counts.astype(np.float64))
