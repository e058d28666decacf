"""How fast SPADs that disturb each other or themselves are simulated: counted, each of them followed, and undisturbed,
side by side in one process.

Not part of ci/test. Run from the repository's root: .venv/bin/python ci/detectors_speed.py [crosstalk | afterpulsing]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lidarcheck.model import streams
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.detectors.simulate import way
from lidarcheck.model.exact.echoes import new_echoes
from lidarcheck.model.exact.numbers import numbers_of
from lidarcheck.model.exact.pulses import pulses_of
from lidarcheck.model.way import Spaces
from lidarcheck.scan import Light
from lidarcheck.sensor import NonIdeal, Sensor, SpadArray

BEAMS = 8192
STRENGTHS = (1, 5)
"""Times typical."""
KINDS = {
    "crosstalk": lambda times: NonIdeal(0.035 * times, 0.017 * times),
    "afterpulsing": lambda times: NonIdeal(0.0, 0.0, 0.03 * times, 5.0, 0.3, 30.0),
}
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
    every = Spaces(way(sensor, numbers))
    every.simulate(numbers, streams.new_stream(0, "spads"), keys, per_bin, pulses, np.arange(BEAMS), echoes)


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
    """Print a row of the table for each effect, variant, strength and brightness."""
    print("| effect | variant | strength | S | followed | counted | ratio | without |", "|---" * 8 + "|", sep="\n")
    for kind in sys.argv[1:] or KINDS:
        for variant in ("SMART", "SLIM"):
            plain = SpadArray.narrow(Sensor.of(variant))
            for times in STRENGTHS:
                sensor = replace(plain, nonideal=KINDS[kind](times))
                for signal in SIGNALS:
                    print(f"| {kind} | {variant} | {times} | {signal} | {row(light_of(signal), sensor, plain)} |")


def row(light: Light, sensor: SpadArray, plain: SpadArray) -> str:
    """What a beam takes each way [us]."""
    old = best_us(lambda: followed(light, sensor))
    new = best_us(lambda: chain_echoes(light, sensor, threads=1))
    return f"{old:.2f} | {new:.2f} | {old / new:.1f} | {best_us(lambda: chain_echoes(light, plain, threads=1)):.2f}"


if __name__ == "__main__":
    main()
