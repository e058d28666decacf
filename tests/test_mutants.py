"""The errors that `ci/mutants` puts into the source, and what it keeps of a run."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from places import ROOT

PACKAGE = ROOT / "src/lidarcheck"

SOURCE = b'''"""A text: 1 + 1."""

from __future__ import annotations

LIMIT: int = 4
SCALE = 2.0


class Thing:
    """Another text."""

    gain: float = parameter("1", low=0.0, high=9.0, meaning="how strong")

    def __repr__(self) -> str:
        return f"{1 + self.gain}"

    def light(self, near_m: float, far_m: float = 5.0, progress: object = None) -> float:
        """Its law."""
        if near_m < 0.0:
            raise ValueError(f"{near_m + 1.0} is below 0")
        _log.info("at %s", near_m + 3.0)
        progress(7, 8)
        value: float = -near_m * SCALE
        value += interpolated(near_m, far_m)
        if value > 6.5 and not far_m:
            value = minimum(value, far_m)
        return value
'''


@pytest.fixture(scope="module")
def tools() -> Iterator[tuple[ModuleType, ModuleType]]:
    """`ci/mutants_sites.py` and `ci/mutants.py`."""
    sys.path.insert(0, str(ROOT / "ci"))
    try:
        import mutants
        import mutants_sites

        yield mutants_sites, mutants
    finally:
        sys.path.remove(str(ROOT / "ci"))


def test_every_kind_is_python_that_differs(tools: tuple[ModuleType, ModuleType]) -> None:
    sites, _ = tools
    found = sites.sites("thing.py", SOURCE)
    assert {mutant.kind for mutant in found} == set(sites.KINDS)
    right = ast.dump(ast.parse(SOURCE))
    for mutant in found:
        assert ast.dump(ast.parse(mutant.applied(SOURCE))) != right, mutant


def test_what_stands_there_then(tools: tuple[ModuleType, ModuleType]) -> None:
    sites, _ = tools
    changes = {(mutant.kind, mutant.was, mutant.now) for mutant in sites.sites("thing.py", SOURCE)}
    assert changes == {
        ("constant", "2.0", "(2.2)"),
        ("constant", "2.0", "(4.0)"),
        ("arithmetic", "-near_m * SCALE", "(-near_m / SCALE)"),
        ("arithmetic", "-near_m", "near_m"),
        ("arithmetic", "value += interpolated(near_m, far_m)", "value -= interpolated(near_m, far_m)"),
        ("dropped", "value += interpolated(near_m, far_m)", "pass"),
        ("swapped", "interpolated(near_m, far_m)", "(interpolated(far_m, near_m))"),
        ("comparison", "value > 6.5 and not far_m", "(value > 6.5 or not far_m)"),
        ("comparison", "value > 6.5", "(value <= 6.5)"),
        ("comparison", "not far_m", "far_m"),
        ("constant", "6.5", "(7.15)"),
        ("constant", "6.5", "(13.0)"),
        ("dropped", "value = minimum(value, far_m)", "pass"),
    }


@pytest.mark.parametrize(
    ("line", "changes"),
    [
        ("near = range_m <= longest", ["(range_m > longest)"]),
        ("near = draws[at] < chance", ["(draws[at] >= chance)"]),
        ("near = distance_m > 0.0", ["(distance_m >= 0.0)", "(distance_m <= 0.0)"]),
        ("near = layer <= last", ["(layer < last)", "(layer > last)"]),
        ("near = k < len(range_m)", ["(k <= len(range_m))", "(k >= len(range_m))"]),
    ],
)
def test_real_numbers_are_never_equal(tools: tuple[ModuleType, ModuleType], line: str, changes: list[str]) -> None:
    sites, _ = tools
    found = sites.sites("thing.py", f"def law():\n    {line}\n".encode())
    assert [mutant.now for mutant in found if mutant.kind == "comparison"] == changes


@pytest.mark.parametrize(
    "line",
    [
        "_CHUNK = 4096",
        "least = 1e-9",
        "most = count.max(initial=0)",
        "check_interval(first, last)",
        "return run_external(ideal, seed)",
        "if isinstance(sensor, Program):\n        return read_out_program(scan, run, 2)",
    ],
)
def test_what_gives_no_result_is_left_alone(tools: tuple[ModuleType, ModuleType], line: str) -> None:
    sites, _ = tools
    assert sites.sites("thing.py", f"def law():\n    {line}\n".encode()) == []


def test_any_shift_makes_a_key_of_beams(tools: tuple[ModuleType, ModuleType]) -> None:
    sites, _ = tools
    found = sites.sites("thing.py", b"def law():\n    key = layer << 32 | point\n")
    assert {mutant.kind for mutant in found} == {"arithmetic"}


def test_the_same_seed_draws_the_same(tools: tuple[ModuleType, ModuleType]) -> None:
    sites, _ = tools
    first, again, other = (sites.drawn(PACKAGE, seed, 150) for seed in (3, 3, 4))
    assert first == again
    assert len(first) == len(set(first)) == 150
    assert len(set(first) & set(other)) < 30
    assert {kind: sum(mutant.kind == kind for mutant in first) for kind in sites.KINDS} == dict.fromkeys(
        sites.KINDS, 30
    )


def test_drawn_from_the_real_source(tools: tuple[ModuleType, ModuleType]) -> None:
    sites, _ = tools
    for mutant in sites.drawn(PACKAGE, 5, 150):
        source = (PACKAGE / mutant.file).read_bytes()
        changed = mutant.applied(source)
        assert not mutant.file.startswith(sites.SKIPPED)
        assert changed != source
        ast.parse(changed)
        assert " ".join(source.decode().splitlines()[mutant.row - 1].split()) in mutant.line
        assert mutant.lines[0] <= mutant.row <= mutant.lines[1]


def test_a_kernel_is_stale_where_the_error_is_in_what_it_calls(tools: tuple[ModuleType, ModuleType]) -> None:
    import mutants_scenarios

    from lidarcheck.model.exact import single

    (group,) = (
        line["spans"]
        for line in mutants_scenarios.kernels([{"name": "lidarcheck.model.exact.group"}])
        if ".simulate_group-" in line["name"]
    )

    def holds(function: Any) -> bool:
        row = function.py_func.__code__.co_firstlineno + 1
        return any(file == "model/exact/single.py" and first <= row <= last for file, first, last in group)

    assert holds(single.place_dead), "what is pasted into a kernel by way of another"
    assert not holds(single.simulate_alone)


def test_which_lines_run(tools: tuple[ModuleType, ModuleType]) -> None:
    import mutants_scenarios

    from lidarcheck.effects.shared import draws

    with mutants_scenarios.Lines() as lines:
        exec(compile((PACKAGE / "effects/shared/draws.py").read_bytes(), draws.__file__, "exec"), {"__name__": "again"})
        draws.normals(np.array([0.5]))
    (file,) = lines.found()
    rows = (PACKAGE / file).read_text(encoding="utf-8").splitlines()
    ran = "\n".join(rows[number - 1] for number in sorted(lines.found()[file]))
    assert file == "effects/shared/draws.py"
    assert "ndtri(np.maximum" in ran
    assert "pdtr" not in ran, "of a function that is not called"


KERNEL = """from __future__ import annotations

from lidarcheck.jit import inlined, kernel


@inlined
def half(n: int) -> int:
    if n % 2:
        return -1
    return n // 2


@kernel
def steps(n: int) -> int:
    found = 0
    while n > 1:
        if n > 100:
            found += 1000
        elif n == 6:
            n = half(n)
            continue
        n -= 1
        found += 1
    return found
"""


def test_which_lines_of_kernels_run(tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "model/thing.py").write_text(KERNEL, encoding="utf-8")
    code = f"""
import sys
sys.path[:0] = {[str(ROOT / "ci"), str(tmp_path / "model")]}
import pathlib, mutants_marks
mutants_marks.put(pathlib.Path({str(tmp_path)!r}))
import thing
for n in (1, 8):
    mutants_marks.clear()
    steps = thing.steps(n)
    print(steps, sorted(mutants_marks.found()[{str(tmp_path / "model/thing.py")!r}]))
"""
    environment = {**os.environ, "LIDARCHECK_CACHE": str(tmp_path / "cache")}
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    rows = KERNEL.splitlines()
    first, second = ran.stdout.splitlines()
    assert first.split(maxsplit=1)[0] == "0"
    assert [rows[n - 1].strip() for n in ast.literal_eval(first.split(maxsplit=1)[1])] == [
        "found = 0",
        "while n > 1:",
        "return found",
    ]
    assert second.split(maxsplit=1)[0] == "4"
    missed = set(range(7, len(rows) + 1)) - set(ast.literal_eval(second.split(maxsplit=1)[1]))
    assert {rows[n - 1].strip() for n in missed} == {
        "def half(n: int) -> int:",
        "return -1",
        "",
        "@kernel",
        "def steps(n: int) -> int:",
        "found += 1000",
    }


class Place:
    """A source that no error changes the echoes of, and how often it was asked."""

    def __init__(self, root: Path) -> None:
        self.root, self.source, self.asked = root, root / "src", []
        file = self.source / "lidarcheck/effects/thing.py"
        file.parent.mkdir(parents=True)
        file.write_bytes(SOURCE)
        (self.source / "lidarcheck/scan.py").write_bytes(b"")

    def work(self, what: str, mutant: Any, tasks: Any, limit_s: float) -> tuple[int, list[dict[str, Any]], str]:
        names = [task["name"] for task in tasks]
        self.asked.append(names)
        found = {"strict": "red"}
        return 0, [{"name": name, "found": found.get(name, "identical"), "kpi": "area"} for name in names], ""


class Runs:
    def __init__(self, **digests: str) -> None:
        self.digests = digests

    def of(self, mutant: Any) -> list[tuple[str, str]]:
        return [(name, "exact") for name in self.digests]

    def tasks(self, pairs: Any, compiling: bool) -> list[dict[str, Any]]:
        return [{"name": name, "limit_s": 1.0} for name, _ in pairs]


def test_a_run_goes_on_where_it_ended(tools: tuple[ModuleType, ModuleType], tmp_path: Path) -> None:
    sites, mutants = tools
    place, file = Place(tmp_path), tmp_path / "kept.json"
    mutant = sites.sites("effects/thing.py", SOURCE)[0]

    def verdict(**digests: str) -> str:
        return str(mutants.judged(mutant, place, Runs(**digests), mutants.Kept(file))["verdict"])

    assert verdict(plain="1") == "identical"
    assert verdict(plain="1") == "identical"
    assert place.asked == [["plain"]], "what is known is not asked again"
    assert verdict(plain="1", strict="1") == "killed"
    assert place.asked[1:] == [["strict"]], "a new scenario alone is asked"
    assert verdict(plain="2", strict="1") == "killed"
    assert len(place.asked) == 2, "what has turned red still does"
    assert verdict(plain="2", strict="2") == "killed"
    assert place.asked[2:] == [["plain", "strict"]], "another golden is asked"


def test_an_equivalent_is_known_although_lines_move(tools: tuple[ModuleType, ModuleType]) -> None:
    sites, mutants = tools
    moved = sites.sites("thing.py", b"\n\n" + SOURCE)
    for mutant, other in zip(sites.sites("thing.py", SOURCE), moved, strict=True):
        exact, line = {("thing.py", mutant.line, mutant.then)}, {("thing.py", mutant.line, "")}
        assert mutants.is_excused(other, exact), "that error"
        assert mutants.is_excused(other, line), "any error of the line"
        assert not mutants.is_excused(other, {("thing.py", mutant.line, "pass pass")})


def test_every_equivalent_is_an_error_that_can_be_drawn(tools: tuple[ModuleType, ModuleType]) -> None:
    sites, mutants = tools
    for name, line, then in mutants.equivalents(ROOT / "ci/mutants.toml"):
        drawn = sites.sites(name, (PACKAGE / name).read_bytes())
        known = {(mutant.line, mutant.then) for mutant in drawn} | {(mutant.line, "") for mutant in drawn}
        assert (line, then) in known, f"ci/mutants.toml: {name}: there is no such error: {line} {then}"
