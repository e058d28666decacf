"""Echoes that background alone makes where SPADs disturb each other or themselves: as the chain shows them.

No sum over a law gives their rate, as it does for independent detectors (`alarms.py`), so beams without any light are
simulated until there are enough echoes, or until these are seen to be so rare that hardly any frame has one.
"""

from __future__ import annotations

import numpy as np

from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.exact.echoes import EchoArrays
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.fast import store
from lidarcheck.model.fast.alarms import Alarms, alarms_of
from lidarcheck.model.fast.fill import Source
from lidarcheck.scan import Light
from lidarcheck.sensor import NonIdeal

__all__ = ["alarms_by"]

_FIRST_LAYER = 1 << 21
_POINTS = 1 << 16
"""Beams that no sensor and no block of a library has."""
_BEAMS = 1 << 17
"""That are simulated at a time."""
_ENOUGH = 2000
"""Clumps that tell their rate to 2 %."""
_LEAST_BEAMS, _MOST_BEAMS = 1 << 19, 1 << 20
_FEW = 10
"""Clumps among the fewest beams below which one in fifty thousand beams has any: no more are looked for."""
_DEAD_TIMES = 4
"""Between two echoes of one clump at most, as in `alarms.py`."""


def alarms_by(source: Source) -> Alarms:
    """The clumps of a source's background: by the law of independent detectors, else simulated, and kept on disk."""
    numbers = numbers_of(source.sensor)
    if source.sensor.nonideal == NonIdeal() or source.background_per_ns <= 0.0:
        return alarms_of(numbers, source.background_per_ns * source.sensor.bin_ns)
    path = store.path_of((*source[:3], source.seed), "alarms")
    stored = store.load(path)
    if stored is not None and set(stored) == set(Alarms._fields):
        rate = float(stored.pop("rate"))
        return Alarms(rate, **stored)
    found = _simulated(source)
    store.save(path, {name: np.asarray(column) for name, column in found._asdict().items()})
    return found


def _simulated(source: Source) -> Alarms:
    parts: list[Alarms] = []
    beams = clumps = 0
    while beams < _LEAST_BEAMS or (_FEW <= clumps < _ENOUGH and beams < _MOST_BEAMS):
        parts.append(_clumps(source, chain_echoes(_dark(source, len(parts)), source.sensor, seed=source.seed)))
        beams += _BEAMS
        clumps = sum(len(part.first) - 1 for part in parts)
        if clumps >= _ENOUGH:
            break
    sizes = np.concatenate([np.diff(part.first) for part in parts])
    columns = [np.concatenate(column) for column in list(zip(*parts, strict=True))[2:]]
    rate = clumps / (beams * numbers_of(source.sensor).bins)
    return Alarms(rate, np.concatenate([[0], np.cumsum(sizes)]), *columns)


def _dark(source: Source, part: int) -> Light:
    """Beams that nothing but background comes back to."""
    layer, point = np.divmod(np.arange(_BEAMS), _POINTS)
    return Light(
        layer=layer + _FIRST_LAYER + part * (_BEAMS // _POINTS),
        point=point,
        background_per_ns=np.full(_BEAMS, source.background_per_ns),
        first_pulse=np.zeros(_BEAMS + 1, dtype=np.int64),
        pulse_range_m=np.empty(0),
        pulse_signal=np.empty(0),
        shape=source.shape,
    )


def _clumps(source: Source, echoes: EchoArrays) -> Alarms:
    """The echoes of dark beams in clumps, centres as seen from the bin of each clump's first."""
    used = np.arange(echoes.centre.shape[1]) < echoes.held[:, None]
    beam = np.repeat(np.arange(len(echoes.held)), echoes.held)
    centre = echoes.centre[used]
    apart = _DEAD_TIMES * source.sensor.dead_bins
    begins = np.ones(len(centre), dtype=np.bool_)
    begins[1:] = (np.diff(beam) > 0) | (np.diff(centre) > apart)
    first = np.append(np.flatnonzero(begins), len(centre))
    origin = np.floor(np.repeat(centre[begins], np.diff(first)))
    return Alarms(0.0, first, centre - origin, echoes.width[used], echoes.area[used], echoes.peak[used])
