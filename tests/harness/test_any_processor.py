"""The same bytes on any x86-64 processor: one without AVX and fused multiply-add is put on, in every library.

It has a kernel cache of its own, since compiled kernels are of the processor that compiled them.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__ as OPTIONAL

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ("effect_blooming_vertical_SLIM",)
OLD = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2_Usable,-AVX2,-FMA,-AVX512F",
    "NPY_DISABLE_CPU_FEATURES": " ".join(OPTIONAL),
    "OPENBLAS_CORETYPE": "Prescott",
    "NUMBA_CPU_NAME": "x86-64",
    "NUMBA_CPU_FEATURES": "",
}
MEASURE = """
import hashlib, json, sys
import numpy as np
from lidarcheck.harness.scenario.measure import measure
from lidarcheck.harness.scenario.scenario import load_scenario

found = {"exp": [float(x).hex() for x in np.exp(np.linspace(-3.0, 3.0, 2000))]}
for file in sys.argv[1:]:
    scenario = load_scenario(file)
    measured = measure(scenario, scenario.model, 0, threads=1)
    columns = scenario.ideal.distance_m, scenario.ideal.incidence_deg
    ideal = hashlib.sha256(b"".join(column.tobytes() for column in columns)).hexdigest()
    values = {name: float(value).hex() for name, value in measured.values.items()}
    found[scenario.name] = [ideal, measured.digest, values]
print(json.dumps(found))
"""


@pytest.mark.long  # all kernels are compiled anew for the other processor
def test_echoes_and_kpis_are_the_same_to_the_last_bit(tmp_path: Path) -> None:
    here, there = measured({}), measured({**OLD, "LIDARCHECK_CACHE": str(tmp_path)})
    assert here.pop("exp") != there.pop("exp"), "the other processor was not put on: numpy's own exp is the same"
    assert here == there
    assert len(here) == len(SCENARIOS)


def measured(environment: dict[str, str]) -> dict[str, object]:
    files = [str(ROOT / "scenarios" / f"{name}.toml") for name in SCENARIOS]
    command = [sys.executable, "-c", MEASURE, *files]
    run = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    found: dict[str, object] = json.loads(run.stdout)
    return found
