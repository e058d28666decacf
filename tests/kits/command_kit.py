"""A directory in which commands are tried."""

from pathlib import Path

import pytest

from lidarcheck.cli import main

MODEL = 'variant = "SMART"\n[materials.1]\nname = "panel"\nreflectance = 0.5\n'


@pytest.fixture
def bench_dir(tmp_path, monkeypatch):
    """A directory with an ideal scan of 40 beams at 30 m and a model, made current."""
    monkeypatch.chdir(tmp_path)
    rows = [f"{layer} {point} 30.0 1 0.0" for layer in range(250, 254) for point in range(470, 480)]
    Path("ideal.txt").write_text("Layer Point Distance MaterialID IncidenceAngle\n" + "\n".join(rows) + "\n")
    Path("model.toml").write_text(MODEL)
    return tmp_path


def simulate(out, *more):
    return main(["simulate", "ideal.txt", "--model", "model.toml", "--out", str(out), *more])
