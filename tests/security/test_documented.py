"""docs/security.md names a test for each line, and each of them is there."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"


def test_every_test_that_the_page_names_is_there():
    text = (ROOT / "docs/security.md").read_text(encoding="utf-8")
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", text)
    assert len(named) > 25
    for file, test in named:
        assert any(f"def {test}(" in path.read_text(encoding="utf-8") for path in TESTS.rglob(file)), f"{file}::{test}"


def test_every_line_of_its_tables_of_attempts_names_one():
    text = (ROOT / "docs/security.md").read_text(encoding="utf-8")
    tables = re.findall(r"^\|[^\n]*\| test \|\n\|[-|]+\|\n((?:\|[^\n]*\n)+)", text, re.MULTILINE)
    assert len(tables) == 5
    for row in "".join(tables).splitlines():
        assert re.search(r"\| (?:`test_\w+\.py::test_\w+`(?:, )?)+ \|$", row), row
