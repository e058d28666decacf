"""The kernels' cache: a changed source must never meet a compiled kernel of the old one."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from lidarcheck import jit_parts

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "lidarcheck"
ASK = """
import importlib, sys
import numpy as np
found = np.zeros(1)
getattr(importlib.import_module(sys.argv[1]), "normals")(np.array([0.01]), 1, found)
print(found[0])
"""
CALLER = """
from lidarcheck.jit import kernel
from lidarcheck.model import normal

_normals = normal.normals

@kernel
def normals(uniform, count, found):
    _normals(uniform, count, found)
"""


def answer(source: Path, cache: Path, module: str = "lidarcheck.model.normal") -> float:
    environment = {**os.environ, "PYTHONPATH": str(source), "LIDARCHECK_CACHE": str(cache)}
    run = subprocess.run(
        [sys.executable, "-c", ASK, module], env=environment, capture_output=True, text=True, check=True
    )
    return float(run.stdout)


def kept(cache: Path) -> dict[Path, int]:
    """The files of the cache, and when each was written."""
    return {path: path.stat().st_mtime_ns for path in cache.rglob("*") if path.is_file()}


def test_a_change_in_a_called_module_reaches_its_callers(tmp_path: Path) -> None:
    """A kernel calls one from another file, whose change numba's own cache would not see."""
    shutil.copytree(PACKAGE, tmp_path / "src" / "lidarcheck", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "src" / "lidarcheck" / "model" / "caller.py").write_text(CALLER)
    cache, caller = tmp_path / "cache", "lidarcheck.model.caller"
    before = answer(tmp_path / "src", cache, caller)
    assert before == pytest.approx(-2.326, abs=1e-3)
    assert answer(tmp_path / "src", cache, caller) == before
    assert len(list((cache / "kernels").iterdir())) == 1, "the same source uses the same cache"
    compiled = kept(cache)
    shutil.move(tmp_path / "src", tmp_path / "elsewhere")
    assert answer(tmp_path / "elsewhere", cache, caller) == before
    assert kept(cache) == compiled, "the same source in another place is not compiled anew"
    shutil.move(tmp_path / "elsewhere", tmp_path / "src")
    changed = tmp_path / "src" / "lidarcheck" / "model" / "normal.py"
    text = changed.read_text()
    changed.write_text(text.replace("            found[i] = normal(uniform[i])\n", "            found[i] = 7.0\n"))
    assert changed.read_text() != text
    os.utime(changed, ns=(PACKAGE.stat().st_atime_ns, PACKAGE.stat().st_mtime_ns))
    assert answer(tmp_path / "src", cache, caller) == 7.0
    assert len(list((cache / "kernels").iterdir())) == 2


def test_a_cache_that_cannot_be_written_is_no_reason_to_stop(tmp_path: Path) -> None:
    nowhere = tmp_path / "file"
    nowhere.write_text("")
    assert answer(PACKAGE.parent, nowhere) == pytest.approx(-2.326, abs=1e-3)


@pytest.mark.parametrize("changed", ["elementary/exponentials.py", "model/lane_math.py", "effects/fog.py"])
def test_whatever_numbers_come_from_names_the_cache(tmp_path: Path, changed: str) -> None:
    """The library of echoes is filled with the elementary functions: a change of theirs must not meet the old one."""
    package = tmp_path / "lidarcheck"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    before = hash_of(tmp_path)
    (package / changed).write_text((package / changed).read_text() + "\n")
    assert hash_of(tmp_path) != before


def hash_of(source: Path) -> str:
    ask = "from lidarcheck.jit import source_hash; print(source_hash())"
    environment = {**os.environ, "PYTHONPATH": str(source)}
    return subprocess.run(
        [sys.executable, "-c", ask], env=environment, capture_output=True, text=True, check=True
    ).stdout


PARTS = """
import sys
from lidarcheck import jit_parts
if sys.argv[1] == "apart":
    jit_parts.are_possible = lambda: False
import numpy as np
from levels import lowest, middle, outermost
found = np.array([0.1, 0.7, 2.5])
print(outermost(found, 0.3).hex(), found.tobytes().hex())
try:
    outermost(np.array([-1.0, 0.2, 0.3]), 0.3)
except ValueError as error:
    print(error)
print(sorted(k.__name__ for k in (lowest, middle, outermost) if sum(k.stats.cache_misses.values())))
"""
LEVELS = """
from lidarcheck.jit import inlined, kernel
from lidarcheck.model.lane_math import log1p

@inlined
def lowest(number, factor):
    if number < 0.0:
        raise ValueError("below zero")
    return min(log1p(number) * factor, 0.9) + number / 3.0

@kernel
def middle(numbers, first, factor):
    total = 0.0
    for k in range(first, len(numbers)):
        numbers[k] = lowest(numbers[k], factor) + factor * numbers[k - 1] ** 2
        total += numbers[k]
    return total

@kernel
def outermost(numbers, factor):
    return middle(numbers, 0, factor) + lowest(numbers[0], 2.0) * middle(numbers, 1, factor)
"""


def levels(tmp_path: Path, cache: str, way: str = "parts") -> "subprocess.Popen[str]":
    """Run kernels of three levels; it says what they found, and which of them were compiled for Python."""
    (tmp_path / "levels.py").write_text(LEVELS)
    environment = {
        **os.environ, "LIDARCHECK_CACHE": str(tmp_path / cache), "PYTHONPATH": f"{tmp_path}:{PACKAGE.parent}",
    }  # fmt: skip
    return subprocess.Popen([sys.executable, "-c", PARTS, way], env=environment, stdout=subprocess.PIPE, text=True)


def said(run: "subprocess.Popen[str]") -> list[str]:
    output, _ = run.communicate()
    assert run.returncode == 0
    return output.splitlines()


def test_kernels_in_parts_give_the_bits_of_those_compiled_each_on_its_own(tmp_path: Path) -> None:
    *found, compiled = said(levels(tmp_path, "parts"))
    *apart, compiled_apart = said(levels(tmp_path, "apart", "apart"))
    assert found == apart
    assert found[1] == "below zero"
    assert compiled == "['outermost']", "numba's own way is taken"
    assert compiled_apart == "['middle', 'outermost']"


@pytest.mark.parametrize("way", ["parts", "apart"])
def test_processes_side_by_side_keep_what_the_next_one_finds(tmp_path: Path, way: str) -> None:
    both = [levels(tmp_path, "cache", way) for _ in range(2)]
    first, second = [said(run) for run in both]
    assert first[:2] == second[:2]
    before = kept(tmp_path / "cache")
    *found, compiled = said(levels(tmp_path, "cache", way))
    assert (found, compiled) == (first[:2], "[]")
    assert kept(tmp_path / "cache") == before


def test_numba_of_another_version_is_left_to_its_own_way(monkeypatch: pytest.MonkeyPatch) -> None:
    assert jit_parts.are_possible(), "the version in requirements.lock must be among those that are tested"
    monkeypatch.setattr(numba, "__version__", "0.999.0")
    assert not jit_parts.are_possible()
