"""What the tests of single detectors share: beams, and their echoes chunk by chunk."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from scipy import stats

from lidarcheck.model import streams
from lidarcheck.model.detectors.simulate import way
from lidarcheck.model.exact.echoes import EchoArrays, new_echoes
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.model.way import Spaces
from lidarcheck.scan import Light
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, NonIdeal, Sensor

NOWHERE_M = 5.0


def sensor_of(variant: str, real: NonIdeal, **overrides: float) -> Sensor:
    return replace(Sensor.of(variant, **overrides), nonideal=real)


def light(signal: float, n: int, *, range_m: float | np.ndarray = NOWHERE_M, background: float = 3e-4) -> Light:
    """`n` beams with one pulse each."""
    layer, point = np.divmod(np.arange(n), 960)
    return Light(
        layer=layer,
        point=point,
        background_per_ns=np.full(n, background),
        first_pulse=np.arange(n + 1),
        pulse_range_m=np.broadcast_to(range_m, n),
        pulse_signal=np.full(n, signal),
    )


def dark_flash(n: int) -> Light:
    """No background; all SPADs of all beams fire at once, in the bin that `NOWHERE_M` lies in."""
    return light(1e9, n, background=0.0)


def follow(
    beams: Light, sensor: Sensor, *, seed: int = 1, frame: int = 0, chunk: int = 512, threads: int = 1
) -> EchoArrays:
    """The echoes of all beams, chunk by chunk."""
    numbers = numbers_of(sensor)
    spaces, pulses = Spaces(way(sensor, numbers)), pulses_of(beams, sensor, numbers)
    echoes = new_echoes(len(beams), sensor.max_echoes)
    keys, per_bin = streams.beam_keys(beams.layer, beams.point), beams.background_per_ns * sensor.bin_ns

    def run(start: int) -> None:
        stream = streams.new_stream(seed, "spads", frame)
        order = np.arange(start, min(start + chunk, len(beams)))
        spaces.simulate(numbers, stream, keys, per_bin, pulses, order, echoes)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(run, range(0, len(beams), chunk)))
    return echoes


def features(echoes: EchoArrays, sensor: Sensor) -> np.ndarray:
    """A row for each echo: beam, range [m], width [ns], area, peak."""
    beam, slot = np.nonzero(np.arange(echoes.area.shape[1]) < echoes.held[:, None])
    time_ns = echoes.centre[beam, slot] * sensor.bin_ns - sensor.time_offset_ns
    range_m = np.round(0.5 * LIGHT_SPEED_M_PER_NS * time_ns, 2)
    peak = np.minimum(echoes.peak[beam, slot], sensor.peak_saturation)
    return np.stack([beam, range_m, echoes.width[beam, slot] * sensor.bin_ns, echoes.area[beam, slot], peak], axis=1)


def same(one: EchoArrays, other: EchoArrays) -> bool:
    held = np.arange(one.area.shape[1]) < one.held[:, None]
    return np.array_equal(one.held, other.held) and all(
        np.array_equal(getattr(one, name)[held], getattr(other, name)[held]) for name in one._fields[1:]
    )


def unlikely(counted: EchoArrays, followed: EchoArrays, sensor: Sensor) -> dict[str, float]:
    """p-values that two samples of as many beams are of one law: of means, and of the features of all echoes."""
    one, other = features(counted, sensor), features(followed, sensor)
    beams = len(counted.held)
    sums = [np.bincount(found[:, 0].astype(int), found[:, 3], beams) for found in (one, other)]
    pairs = {
        "echoes": (counted.held, followed.held),
        "detection": (counted.held > 0, followed.held > 0),
        "further echoes": (counted.held > 1, followed.held > 1),
        "area of all": sums,
    }
    p_values = {}
    for name, (mine, theirs) in pairs.items():
        error = np.sqrt((np.var(mine) + np.var(theirs)) / beams)
        p_values[name] = 2 * stats.norm.sf(abs(np.mean(mine) - np.mean(theirs)) / max(error, 1e-9))
    if min(len(one), len(other)) > 50:
        for column, name in enumerate(("range", "width", "area", "peak"), start=1):
            mine, theirs = one[:, column].round(3), other[:, column].round(3)
            p_values[f"mean of {name}"] = float(stats.ttest_ind(mine, theirs, equal_var=False).pvalue)
            p_values[name] = float(stats.ks_2samp(mine, theirs).pvalue)
    return {name: p for name, p in p_values.items() if not np.isnan(p)}
