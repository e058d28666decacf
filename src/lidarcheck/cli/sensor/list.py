"""`lidarcheck sensor list`: the sensors that come with lidarcheck."""

from __future__ import annotations

from lidarcheck.cli.core.options import JsonFlag, Quiet
from lidarcheck.cli.core.outputs import json_text
from lidarcheck.cli.core.terminal import columns, emit, hush, table

__all__ = ["list"]

_HEAD = columns("name", "sensor", "detector", "layers", "beams/s", "to [m]", right=("layers", "beams/s", "to [m]"))


def list(*, json: JsonFlag = False, quiet: Quiet = False) -> int:
    """List the sensors that come with lidarcheck."""
    hush(quiet)
    from lidarcheck.figures.pages.sensor import rate
    from lidarcheck.sensor import shipped, shipped_names

    sensors = [shipped(name) for name in shipped_names()]
    if json:
        facts = [
            {
                "name": sensor.variant,
                "sensor": sensor.name,
                "detector": sensor.detector,
                "layers": sensor.beams.layers,
                "points": sensor.beams.points,
                "beams_a_second": rate(sensor)[1],
                "max_range_m": sensor.max_range_m,
                "source": [*sensor.source],
            }
            for sensor in sensors
        ]
        emit(json_text(facts))
        return 0
    rows = [
        (s.variant, s.name, s.detector, str(s.beams.layers), f"{rate(s)[1]:,.0f}", f"{s.max_range_m:g}")
        for s in sensors
    ]
    emit(table(_HEAD, rows))
    return 0
