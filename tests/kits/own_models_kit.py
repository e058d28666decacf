"""The sensor models of `examples/` that are not ours, each in a folder of its own, built where that is needed."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COMPILED, FUNCTION = "own_model_c", "own_model_python"


def own_model(name: str, place: Path) -> Path:
    """A copy of an example's folder, ready to run; the test is skipped where no compiler can build it."""
    skip = shutil.ignore_patterns("waveform", ".lidarcheck", "__pycache__")
    folder = Path(shutil.copytree(ROOT / "examples" / name, place / name, ignore=skip))
    if name == COMPILED:
        if shutil.which("cc") is None:
            pytest.skip("there is no C compiler cc on this machine")
        source, program = folder / "waveform.c", folder / "waveform"
        subprocess.run(["cc", "-std=c11", "-O2", "-Wall", "-Werror", "-o", program, source, "-lm"], check=True)
    return folder
