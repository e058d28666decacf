"""How fast afterpulses are simulated: counted, each detector followed, and without them, side by side in one process.

Not part of ci/test. Run from the repository's root: .venv/bin/python ci/afterpulses_speed.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lidarcheck.model import streams
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.detectors.array import detectors_of
from lidarcheck.model.detectors.simulate import simulate_chunk
from lidarcheck.model.exact.echoes import new_echoes
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.scan import Light
from lidarcheck.sensor import NonIdeal, Sensor, SpadArray

BEAMS = 8192
CHANCES = (0.03, 0.15)
SIGNALS = (0.02, 0.5, 20.0)


def light_of(signal: float) -> Light:
    """Beams with one pulse each, from 5 to 100 m."""
    layer, point = np.divmod(np.arange(BEAMS), 960)
    return Light(
        layer=layer,
        point=point,
        background_per_ns=np.full(BEAMS, 3e-4),
        first_pulse=np.arange(BEAMS + 1),
        pulse_range_m=np.random.default_rng(1).uniform(5.0, 100.0, BEAMS),
        pulse_signal=np.full(BEAMS, signal),
    )


def followed(light: Light, sensor: SpadArray) -> None:
    """The same with every detector followed."""
    numbers = numbers_of(sensor)
    keys, per_bin = streams.beam_keys(light.layer, light.point), light.background_per_ns * sensor.bin_ns
    pulses, echoes = pulses_of(light, sensor, numbers), new_echoes(BEAMS, sensor.max_echoes)
    stream, detectors = streams.new_stream(0, "spads"), detectors_of(sensor, numbers)
    simulate_chunk(detectors, numbers, stream, keys, per_bin, pulses, np.arange(BEAMS), echoes)


def best_us(run: Callable[[], object], times: int = 3) -> float:
    """Microseconds of processor time a beam, the first call left out."""
    run()
    took = []
    for _ in range(times):
        start = time.process_time()
        run()
        took.append(time.process_time() - start)
    return 1e6 * min(took) / BEAMS


def main() -> None:
    """Print a row of the table for each variant, strength and brightness."""
    print("| variant | probability | S | followed | counted | ratio | without |\n|---|---|---|---|---|---|---|")
    for variant in ("SMART", "SLIM"):
        plain = SpadArray.narrow(Sensor.of(variant))
        for chance in CHANCES:
            sensor = replace(plain, nonideal=NonIdeal(0.0, 0.0, chance, 5.0, 0.3, 30.0))
            for signal in SIGNALS:
                light = light_of(signal)
                old = best_us(lambda light=light, sensor=sensor: followed(light, sensor))  # type: ignore[misc]
                new, bare = (
                    best_us(lambda light=light, one=one: chain_echoes(light, one, threads=1))  # type: ignore[misc]
                    for one in (sensor, plain)
                )
                row = f"{old:.2f} | {new:.2f} | {old / new:.1f} | {bare:.2f}"
                print(f"| {variant} | {chance} | {signal} | {row} |")


if __name__ == "__main__":
    main()
