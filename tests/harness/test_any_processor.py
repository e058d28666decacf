"""The same bytes on any x86-64 processor: one without AVX and fused multiply-add is put on, in every library.

Compiled kernels are of the processor that compiled them, and to compile those of a scenario anew takes most of a
minute. So a scenario is run with the libraries of the old processor alone, and its kernels' arithmetic is compiled for
the old one by itself; both together are a test for before a release.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__ as OPTIONAL

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = ("effect_fog_SMART", "effect_blooming_vertical_SLIM")
OLD_LIBRARIES = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2_Usable,-AVX2,-FMA,-AVX512F",
    "NPY_DISABLE_CPU_FEATURES": " ".join(OPTIONAL),
    "OPENBLAS_CORETYPE": "Prescott",
}
OLD_KERNELS = {"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}
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


ARITHMETIC = """
import json
import numpy as np
from lidarcheck.model import lane_math
from lidarcheck.model.jit import kernel

@kernel
def work(x, y, found):
    total = 0.0
    for i in range(len(x)):
        found[0, i] = lane_math.exp(x[i]) * y[i] + x[i]
        found[1, i] = lane_math.log(y[i]) - x[i] * y[i]
        found[2, i] = lane_math.fired(y[i])
        found[3, i] = lane_math.log1m(0.5 * y[i])
        total += x[i] * y[i]
    found[4, 0] = total

x, y = np.random.default_rng(1).uniform(-9.0, 9.0, 3000), np.random.default_rng(2).uniform(1e-6, 1.0, 3000)
found = np.zeros((5, 3000))
work(x, y, found)
print(json.dumps([x.hex() for x in found.ravel().tolist()]))
"""


def test_echoes_and_kpis_are_the_same_with_the_libraries_of_an_old_processor() -> None:
    here, there = measured({}), measured(OLD_LIBRARIES)
    assert here.pop("exp") != there.pop("exp"), "the other processor was not put on: numpy's own exp is the same"
    assert here == there
    assert len(here) == len(SCENARIOS)


def test_kernels_compute_the_same_compiled_for_an_old_processor(tmp_path: Path) -> None:
    """Nothing is fused, reordered or taken from a library of the processor's."""
    script = tmp_path / "arithmetic.py"
    script.write_text(ARITHMETIC)
    assert run(["arithmetic.py"], {}, tmp_path) == run(["arithmetic.py"], OLD_KERNELS, tmp_path)
    assert len([*tmp_path.rglob("*.nbc")]) == 2, "both are compiled, each for its processor"


@pytest.mark.long
def test_echoes_and_kpis_are_the_same_to_the_last_bit(tmp_path: Path) -> None:
    here, there = measured({}), measured({**OLD_LIBRARIES, **OLD_KERNELS, "LIDARCHECK_CACHE": str(tmp_path)})
    assert here.pop("exp") != there.pop("exp"), "the other processor was not put on: numpy's own exp is the same"
    assert here == there


def measured(environment: dict[str, str]) -> dict[str, object]:
    files = [str(ROOT / "scenarios" / f"{name}.toml") for name in SCENARIOS]
    found: dict[str, object] = run(["-c", MEASURE, *files], environment)
    return found


def run(arguments: list[str], environment: dict[str, str], here: Path | None = None) -> Any:
    """What a process prints; kernels are kept in `here`, where given, which it runs in."""
    own = {"LIDARCHECK_CACHE": str(here)} if here else {}
    command = [sys.executable, *arguments]
    done = subprocess.run(
        command, env={**os.environ, **environment, **own}, cwd=here, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
