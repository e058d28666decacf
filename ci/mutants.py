"""Runs the mutants of `mutants.toml`: a line of the source replaced by another, and the tests that must turn red.

    ci/mutants              # all; what is known of the same source and tests is not run again
    ci/mutants --only fog   # those in whose file's path the word occurs

Prints a line a mutant, the survivors last; exit code 1 where one survives. Results are kept in
`.lidarcheck/mutants.json` by a hash of the mutated source and the tests, so that an interrupted run goes on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
LIMIT_S = 1200.0  # a mutant that hangs is noticed too
ASK_CACHE = "from lidarcheck.model import jit; print(jit.base_directory() / 'kernels' / jit.source_hash()[:16])"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="mutants in whose file's path this occurs")
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout whose source and tests are used")
    parser.add_argument("--list", type=Path, default=ROOT / "ci" / "mutants.toml", help="the file of mutants")
    args = parser.parse_args()
    root = args.root.resolve()
    mutants = tomllib.loads(args.list.read_text(encoding="utf-8"))["mutants"]
    mutants = [mutant for mutant in mutants if args.only in mutant["file"]]
    kept = root / ".lidarcheck" / "mutants.json"
    known: dict[str, Any] = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else {}
    place = Scratch(root)
    alive = []
    for number, mutant in enumerate(mutants, start=1):
        key = key_of(mutant, root)
        if key not in known:
            known[key] = judged(mutant, place)
            kept.write_text(json.dumps(known, indent=1), encoding="utf-8")
        found = known[key]
        print(f"{number}/{len(mutants)} {found['verdict']:8} {found['seconds']:6.1f} s  {words(mutant)}", flush=True)
        alive += [mutant] if found["verdict"] != "killed" else []
    print(f"{len(mutants) - len(alive)} of {len(mutants)} killed", *(f"survived: {words(m)}" for m in alive), sep="\n")
    return int(bool(alive))


class Scratch:
    """A copy of the source that is mutated and mended again in its place, and compiled kernels of the right one."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.place = root / ".lidarcheck" / "mutants"
        self.source = self.place / "src"
        self.kernels = self.place / "kernels"
        shutil.rmtree(self.source, ignore_errors=True)
        # With its times: compiled kernels are looked for by them.
        shutil.copytree(root / "src", self.source, ignore=shutil.ignore_patterns("__pycache__"))

    def environment(self) -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": str(self.source), "LIDARCHECK_CACHE": str(self.place / "cache")}

    def cache(self) -> Path:
        """Where the kernels of the source as it stands lie."""
        run = subprocess.run(
            [sys.executable, "-c", ASK_CACHE], env=self.environment(), capture_output=True, text=True, check=True
        )
        return Path(run.stdout.strip())


def words(mutant: dict[str, Any]) -> str:
    """Where the error is, and what stands there."""
    return f"{mutant['file']}: {mutant['instead'].strip()}"


def key_of(mutant: dict[str, Any], root: Path) -> str:
    """A hash of the source with the error, and of the tests that are asked."""
    digest = hashlib.sha256(json.dumps(mutant, sort_keys=True).encode())
    files = [path for name in (root / "src", *(root / test for test in mutant["tests"])) for path in python_files(name)]
    for path in sorted({*files, *python_files(root / "tests" / "kits")}):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def python_files(path: Path) -> list[Path]:
    return [path] if path.is_file() else sorted(path.rglob("*.py"))


def judged(mutant: dict[str, Any], place: Scratch) -> dict[str, Any]:
    """Whether the tests notice: `killed`, `survived`, or `broken` where the line is not there once."""
    start = time.monotonic()
    file = place.source / "lidarcheck" / mutant["file"]
    text, times = file.read_text(encoding="utf-8"), file.stat()
    if text.count(f"\n{mutant['line']}\n") != 1:
        return {"verdict": "broken", "seconds": 0.0}
    try:
        file.write_text(text.replace(f"\n{mutant['line']}\n", f"\n{mutant['instead']}\n"), encoding="utf-8")
        noticed = run_tests(mutant, place, compiled="@kernel" in text or "@inlined" in text)
    finally:
        file.write_text(text, encoding="utf-8")
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    return {"verdict": "killed" if noticed else "survived", "seconds": round(time.monotonic() - start, 1)}


def run_tests(mutant: dict[str, Any], place: Scratch, *, compiled: bool) -> bool:
    """Whether one of the tests fails; kernels that the error does not reach are not compiled again."""
    cache = place.cache()
    if not compiled and place.kernels.is_dir():
        shutil.copytree(place.kernels, cache, dirs_exist_ok=True)
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not long", "-p", "no:cacheprovider", *mutant["tests"]]
    try:
        run = subprocess.run(
            command, cwd=place.root, env=place.environment(), capture_output=True, timeout=LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return True
    finally:
        if not compiled and cache.is_dir():
            shutil.copytree(cache, place.kernels, dirs_exist_ok=True)
        shutil.rmtree(cache, ignore_errors=True)
    return run.returncode == 1


if __name__ == "__main__":
    sys.exit(main())
