"""What runs in the source with the error: `mutants_worker.py judge|trace|kernels|tests`, tasks on the standard input.

Brings the compiled kernels that the error does not reach, does the tasks, printing a line of JSON each, and keeps what
was compiled besides. To be traced, kernels are marked, before anything of the package is imported. Processor time and
memory beyond all need end the process.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import mutants_marks

MOST_BYTES = 8 << 30


def main() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    given, what = json.load(sys.stdin), sys.argv[1]
    if what == "trace":
        mutants_marks.put(Path(*importlib.util.find_spec("lidarcheck").submodule_search_locations))
    mutants_scenarios = importlib.import_module("mutants_scenarios")
    jit = importlib.import_module("lidarcheck.jit")
    kernels, cache, fresh = Path(given["kernels"]), jit.cache_directory(), set(given["fresh"])
    _bring(kernels, cache, fresh)
    if what == "tests":
        print(json.dumps({"red": _red([task["name"] for task in given["tasks"]])}))
    else:
        for line in getattr(mutants_scenarios, what)(given["tasks"]):
            print(json.dumps(line), flush=True)
    _bring(cache, kernels, fresh)


def _red(names: list[str]) -> str:
    """The first of these tests that fails; empty if none does."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not long", "-p", "no:cacheprovider", *names]
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    failed = [line for line in run.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return (failed[0][:160] if failed else f"{' '.join(names)}: {run.returncode}") if run.returncode else ""


def _bring(source: Path, target: Path, fresh: set[str]) -> None:
    """Link the compiled kernels that are `fresh`; numba writes beside them, never into them.

    A kernel is called by the row on which it begins: one that the error has moved is no other's.
    """
    for file in source.rglob("*.nb?"):
        place = target / file.relative_to(source)
        if file.name.partition(".py")[0] in fresh:
            place.parent.mkdir(parents=True, exist_ok=True)
            place.unlink(missing_ok=True)
            os.link(file, place)


if __name__ == "__main__":
    main()
