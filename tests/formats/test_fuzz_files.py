"""Malformed files of every format: each is read, or refused in one line's words, in little time and memory."""

import sys
from collections import Counter
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("the fuzz of files needs /proc", allow_module_level=True)

from file_fuzz import fuzzed

COUNT = 500
BAD = """
import os, sys
sys.path.insert(0, {kits!r})
from lidarcheck.errors import InputError
GOOD = b"1 2 3\\n" * 20
class Seed:
    def __init__(self, name, fault):
        self.name, self.content, self.fault = name, GOOD, fault
    def read(self, path):
        if path.read_bytes() != GOOD:
            self.fault()
def refuse(what): raise InputError(what)
def endless():
    while True: pass
def hidden():
    try: bytearray(1 << 40)
    except MemoryError as error: raise InputError("damaged") from error
def seeds(directory):
    faults = [lambda: {{}}["key"], lambda: os._exit(7), lambda: bytearray(1 << 40), hidden, endless]
    faults += [lambda: refuse("x" * 3000), lambda: refuse("is wrong")]
    return [Seed(str(number), fault) for number, fault in enumerate(faults)]
"""


def test_malformed_files_are_refused_and_nothing_else() -> None:
    outcomes: Counter[str] = Counter()
    failures = [f"{one.how}, ci/fuzz --only {one.number}: {one.words}" for one in fuzzed(0, range(COUNT), 1, outcomes)]
    assert not failures
    assert sum(outcomes.values()) == COUNT
    read = sum(count for name, count in outcomes.items() if name.endswith(" read"))
    assert 20 < read < COUNT / 2  # harmless faults are rare, and what is read on has got through


def test_whatever_else_a_reader_does_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kits = Path(__file__).resolve().parents[1] / "kits"
    (tmp_path / "bad_seeds.py").write_text(BAD.format(kits=str(kits)))
    monkeypatch.syspath_prepend(tmp_path)
    outcomes: Counter[str] = Counter()
    found = {one.name: one.how for one in fuzzed(1, range(7), 1, outcomes, made_by="bad_seeds", most_s=0.5)}
    assert found == {"0": "traceback", "1": "crash", "2": "memory", "3": "memory", "4": "hang", "5": "traceback"}
    assert outcomes["6 refused"] == 1
