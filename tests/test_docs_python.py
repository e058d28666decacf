"""docs/python.md: its examples run, one after the other, as they stand there."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lidarcheck
from lidarcheck.explain.report.explanation import Finding
from lidarcheck.formats import save_ideal

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/python.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^## (.*?)$|^```python(?: (?P<needs>.*?))?\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks() -> dict[str, str]:
    """The example of each section, by its heading."""
    found, heading = {}, ""
    for match in BLOCK.finditer(PAGE):
        heading = match[1] or heading
        if match["code"]:
            found[heading] = match["code"]
    return found


@pytest.fixture
def checkout(tmp_path):
    """A directory that looks like a checkout, to be written into."""
    for name in ("scenarios", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def run(code: str, place: Path) -> str:
    file = place / "example.py"
    file.write_text(code, encoding="utf-8")
    ended = subprocess.run([sys.executable, file.name], cwd=place, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_simulating_changing_and_comparing_runs(checkout):
    examples = blocks()
    said = run("".join(examples[name] for name in ("Simulate", "Change the model", "Compare")), checkout)
    assert "echoes; median AREA" in said
    assert "wasserstein AREA" in said
    assert (checkout / "echoes.parquet").is_file()


def test_the_example_for_pytest_passes(checkout):
    examples = blocks()
    code = "".join(examples[name] for name in ("Simulate", "Change the model", "Compare", "In pytest"))
    (checkout / "test_model.py").write_text(code, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:lidarcheck", "test_model.py"]
    ended = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
    assert "2 passed" in ended.stdout


def make_case(directory: Path) -> None:
    """Three small frames of a wall, which a brighter sensor has measured than the model says."""
    directory.mkdir()
    model = lidarcheck.read_model(ROOT / "scenarios/models/SMART.toml")
    ideal = lidarcheck.read_ideal(ROOT / "examples/wall_ideal.txt")
    lidarcheck.write_model(model, directory / "model.toml")
    said = 'model = "model.toml"\n'
    for i in range(3):
        part = ideal.take(np.arange(len(ideal)) % 3 == i)
        save_ideal(part, directory / f"ideal_{i}.txt")
        scan = lidarcheck.simulate(part, model.with_sensor(signal_at_1m=6600.0), seed=i)
        lidarcheck.write_scan(scan, directory / f"measured_{i}.txt")
        said += f'\n[[frames]]\nideal = "ideal_{i}.txt"\nmeasured = "measured_{i}.txt"\ntime = 0.0\n'
    (directory / "case.toml").write_text(said, encoding="utf-8")


def test_calibrating_runs_and_finds_the_brighter_signal(checkout):
    make_case(checkout / "case")
    said = dict(line.split()[:2] for line in run(blocks()["Calibrate"], checkout).splitlines())
    assert float(said["signal_at_1m"]) == pytest.approx(6600.0, rel=0.03)
    fitted = lidarcheck.read_model(checkout / "fitted.toml")
    assert fitted.sensor.signal_at_1m == pytest.approx(float(said["signal_at_1m"]))


def test_explaining_uses_what_an_explanation_has():
    """Tests of the workflow run it, for half a minute a case. Here: that all that the example names is there."""
    code = blocks()["Explain"]
    compile(code, "example", "exec")
    fields = set(lidarcheck.Explanation.__dataclass_fields__)
    assert set(re.findall(r"\banswer\.(\w+)", code)) <= fields
    assert set(re.findall(r"\beffect\.(\w+)", code)) <= set(Finding.__dataclass_fields__)


def test_the_table_has_every_public_name():
    table = PAGE.partition("## Simulate")[0]
    assert [name for name in lidarcheck.__all__ if name != "__version__" and f"`{name}" not in table] == []
