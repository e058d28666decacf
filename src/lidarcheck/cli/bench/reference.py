"""What a user would write in plain numpy: the sensor of the reference, with nothing compiled.

Both follow the rule of the model as far as the trace, from rested SPADs: the steady state and the echoes come on top.
"""

from __future__ import annotations

import time

import numpy as np
import numpy.typing as npt

from lidarcheck.arrays import FloatArray
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan
from lidarcheck.sensor import LIGHT_SPEED_M_PER_NS, SpadArray

__all__ = ["count_chain", "every_detector", "rates", "sim_sipm_seconds"]


def rates(ideal: IdealScan, model: Model) -> FloatArray:
    """Avalanches per bin of an armed SPAD, shape (bins, beams)."""
    from scipy.special import ndtr

    sensor = SpadArray.narrow(model.sensor)
    reflectance = np.array([model.materials[int(i)].reflectance for i in ideal.material_id])
    signal = sensor.signal_at_1m * reflectance * np.cos(np.deg2rad(ideal.incidence_deg)) / ideal.distance_m**2
    arrival = 2.0 * ideal.distance_m / LIGHT_SPEED_M_PER_NS
    edges = np.arange(sensor.bins + 1)[:, None] * sensor.bin_ns
    share: FloatArray = np.diff(ndtr((edges - arrival) / sensor.sigma_ns), axis=0)
    return sensor.background_per_ns * sensor.bin_ns + signal * share


def every_detector(rate: FloatArray, sensor: SpadArray, draw: np.random.Generator) -> npt.NDArray[np.int64]:
    """The trace, shape (bins, beams), from a coin for every armed detector in every bin."""
    bins, beams = rate.shape
    probability = -np.expm1(-rate)
    last = np.full((beams, sensor.detectors), -10_000)
    trace = np.empty((bins, beams), dtype=np.int64)
    for k in range(bins):
        armed = k - last >= sensor.dead_bins
        fires = armed & (draw.random(last.shape) < probability[k][:, None])
        last[fires] = k
        trace[k] = np.count_nonzero(k - last < sensor.on_bins, axis=1)
    return trace


def count_chain(rate: FloatArray, sensor: SpadArray, draw: np.random.Generator) -> npt.NDArray[np.int64]:
    """The trace, shape (bins, beams), from one binomial number a bin: the detectors are exchangeable."""
    bins, beams = rate.shape
    probability = -np.expm1(-rate)
    fired = np.zeros((bins + sensor.dead_bins, beams), dtype=np.int64)
    trace = np.empty((bins, beams), dtype=np.int64)
    dead = np.zeros(beams, dtype=np.int64)
    on = np.zeros(beams, dtype=np.int64)
    for k in range(bins):
        now = k + sensor.dead_bins
        dead -= fired[now - sensor.dead_bins]
        on -= fired[now - sensor.on_bins]
        fired[now] = draw.binomial(sensor.detectors - dead, probability[k])
        dead += fired[now]
        on += fired[now]
        trace[k] = on
    return trace


def sim_sipm_seconds(sensor: SpadArray, waveforms: int) -> float | None:
    """Seconds that SimSiPM (`pip install sipm`) takes for a beam's waveform; None where it is not installed.

    Its sensor has no shots to be summed and no threshold on counts: a waveform of the trace's length in the same bins,
    with as many primary photons as all shots of a beam on a bright wall have.
    """
    try:
        import SiPM
    except ImportError:
        return None
    settings = SiPM.SiPMProperties()
    settings.setSampling(sensor.bin_ns)
    settings.setSignalLength(sensor.bins * sensor.bin_ns)
    simulated = SiPM.SiPMSensor(settings)
    photons = np.random.Generator(np.random.Philox(1)).normal(300.0, sensor.sigma_ns, (waveforms, sensor.detectors))
    start = time.perf_counter()
    for times_ns in photons:
        simulated.resetState()
        simulated.addPhotons(times_ns)
        simulated.runEvent()
        simulated.signal()
    return (time.perf_counter() - start) / waveforms
