"""How often fitted parameters lie within their intervals, on cases of the independent simulator: no test, a study.

python tests/kits/calibrate_coverage.py FIRST COUNT: cases of these numbers, a line a parameter, and the share at last.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from calibrate_kit import Truth, write_case
from lidarcheck.calibration.parameters.workflow import Request, calibrate
from lidarcheck.cases.case import load_case

KINDS = (
    {"signal_at_1m": (4000, 9000), "pulse_fwhm_ns": (4.0, 6.5), "background_per_ns": (1e-4, 8e-4)},
    {
        "threshold": (6, 14),
        "effects.range_offset.offset_m": (-0.2, 0.2),
        "effects.walk_error.per_decade_m": (-0.15, 0.15),
    },
    {"effects.fog.mor_m": (150, 2000), "signal_at_1m": (5000, 7000)},
    {
        "materials.1.reflectance": (0.08, 0.2),
        "materials.6.reflectance": (0.2, 0.45),
        "effects.dark_counts.rate_per_ns": (1e-4, 8e-4),
    },
    {
        "effects.dropout.share": (0.01, 0.1),
        "effects.timing_jitter.sigma_ns": (0.2, 1.5),
        "effects.range_scale.fraction": (-0.004, 0.004),
    },
    {"dead_bins": (10, 16), "background_per_ns": (1e-4, 6e-4), "materials.7.retro_gain": (500, 1500)},
)


def truth_of(number: int) -> Truth:
    """The case of a number: kinds in turn, values drawn evenly, of what is positive in its logarithm."""
    rng = np.random.default_rng([number, 99])
    values = {}
    for name, (low, high) in KINDS[number % len(KINDS)].items():
        u = rng.uniform()
        value = np.exp(np.log(low) + u * np.log(high / low)) if low > 0 else low + u * (high - low)
        values[name] = float(round(value)) if name in ("threshold", "dead_bins") else float(f"{value:.4g}")
    return Truth(values, seed=1000 + number, frames=4, layers=range(210, 306, 2), points=range(430, 526))


def main() -> None:
    first, count = (int(text) for text in sys.argv[1:])
    inside = fitted = 0
    for number in range(first, first + count):
        truth = truth_of(number)
        with tempfile.TemporaryDirectory() as place:
            case = load_case(write_case(truth, Path(place)), fewest=1)
            found = calibrate(case, Request(tuple(truth.values)), seed=number)
        for p in found.parameters:
            holds = p.low <= truth.values[p.name] <= p.high
            print(number, p.name, truth.values[p.name], p.value, p.low, p.high, p.status, holds, flush=True)
            fitted += p.status == "fitted"
            inside += p.status == "fitted" and holds
    print(f"{inside} of {fitted} within their intervals")


if __name__ == "__main__":
    main()
