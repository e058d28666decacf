"""The exact chain on a GPU: its kernel in numba's simulator, and on a device where there is one."""

import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.errors import UsageError
from lidarcheck.model import echoes_of
from lidarcheck.model.cuda.simulate import check_cuda
from lidarcheck.model.detection import chain_echoes
from lidarcheck.model.fidelity import check_device
from lidarcheck.scan import Haze, Light
from lidarcheck.sensor import NonIdeal, Sensor

ROOT = Path(__file__).resolve().parents[3]
HERE = ROOT / "tests" / "kits"


def light(n: int, *, background: tuple[float, ...] = (3e-4,), hazy: bool = False) -> Light:
    """Beams with none to three pulses from faint to glaring; backgrounds in turns; haze before every other beam."""
    rng = np.random.default_rng(5)
    pulses = np.arange(n) % 4
    count = int(pulses.sum())
    haze = None
    if hazy:
        rows = np.cumsum([0, *(np.arange(n) % 2)])
        haze = Haze(1.0, np.full(60, 2e-3), rows, rng.uniform(5.0, 60.0, rows[-1]), np.ones(rows[-1]))
    return Light(
        layer=200 + np.arange(n) // 8,
        point=400 + np.arange(n) % 8,
        background_per_ns=np.resize(background, n),
        first_pulse=np.cumsum([0, *pulses]),
        pulse_range_m=rng.uniform(3.0, 120.0, count),
        pulse_signal=10.0 ** rng.uniform(-2.0, 2.0, count),
        haze=haze,
    )


LIGHTS = {
    "pulses": (light(24), "SMART"),
    "two backgrounds, one of them bright": (light(12, background=(1e-4, 2e-2)), "SMART"),
    "haze": (light(8, hazy=True), "SMART"),
    "more detectors": (light(8), "SLIM"),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_the_kernel_finds_what_the_processor_finds(name: str, tmp_path: Path) -> None:
    """In the simulator every sum and product is the processor's, so that the echoes are the same to the last bit."""
    shown, variant = LIGHTS[name]
    sensor = Sensor.of(variant)
    (tmp_path / "light.pickle").write_bytes(pickle.dumps((shown, sensor, 11, 3)))
    subprocess.run(
        [sys.executable, HERE / "cuda_simulated.py", tmp_path / "light.pickle", tmp_path / "echoes.npz"],
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"},
        check=True,
        timeout=300,
    )
    right = chain_echoes(shown, sensor, seed=11, frame=3)
    with np.load(tmp_path / "echoes.npz") as found:
        assert right.held.sum() > len(shown) // 3
        np.testing.assert_array_equal(found["held"], right.held)
        filled = np.arange(sensor.max_echoes) < right.held[:, None]
        for feature in ("centre", "width", "area", "peak"):
            np.testing.assert_array_equal(found[feature][filled], getattr(right, feature)[filled])


def usable() -> bool:
    try:
        check_cuda()
    except UsageError:
        return False
    return True


@pytest.mark.skipif(not usable(), reason="there is no GPU here")
@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_a_gpu_finds_the_same_echoes_in_all_but_a_few_beams(variant: str) -> None:
    """Where a logarithm's last digit decides, a beam may end otherwise: one in ten thousand, with room to spare."""
    shown, sensor = light(40_000, background=(1e-4, 3e-4, 2e-2)), Sensor.of(variant)
    right = chain_echoes(shown, sensor, seed=2)
    found = chain_echoes(shown, sensor, seed=2, device="cuda")
    assert np.mean(found.held != right.held) < 1e-4
    filled = (np.arange(sensor.max_echoes) < right.held[:, None]) & (found.held == right.held)[:, None]
    for feature in ("centre", "width", "area", "peak"):
        ours, theirs = (getattr(one, feature)[filled] for one in (found, right))
        assert np.mean(~np.isclose(ours, theirs, rtol=1e-9)) < 1e-4


@pytest.mark.skipif(usable(), reason="there is a GPU here")
def test_without_a_gpu_one_line_says_so_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scan.txt"
    told = ["simulate", str(ROOT / "examples" / "wall_ideal.txt"), "--model", str(ROOT / "scenarios/models/SMART.toml")]
    for more in (["--out", str(out)], ["--out", str(tmp_path / "frames"), "--frames", "2"]):
        assert main([*told, *more, "--device", "cuda"]) == 2
        said = capsys.readouterr().err.strip()
        assert said.startswith("error: no GPU can be used: ")
        assert "\n" not in said
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("device", "fidelity", "words"),
    [("gpu", "exact", "there is no device 'gpu'"), ("cuda", "fast", "a GPU runs the exact chain")],
)
def test_a_device_that_cannot_do_it_is_refused(device: str, fidelity: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        check_device(device, fidelity)


def test_detectors_that_disturb_each_other_are_not_followed_on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lidarcheck.model.cuda.simulate.check_cuda", lambda: None)
    sensor = replace(Sensor.of("SMART"), nonideal=NonIdeal(crosstalk_sides=0.1))
    with pytest.raises(UsageError, match="detector by detector"):
        echoes_of(light(4), sensor, device="cuda")
