"""The documentation as a whole: links lead somewhere, pictures are small, and what a script writes is up to date."""

import importlib
import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)")
MOST_BYTES = 150_000
"""A picture that is larger takes longer to load than it is worth."""


def without_code(text: str) -> str:
    return re.sub(r"^```.*?^```$|`[^`\n]*`", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors_of(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    lines = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE).splitlines()
    headings = [re.sub(r"^#+\s+", "", line).strip().lower() for line in lines if re.match(r"#{1,6}\s", line)]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page):
    for target, anchor in LINK.findall(without_code(page.read_text(encoding="utf-8"))):
        place = (page.parent / target).resolve() if target else page
        assert place.exists(), f"{target} is not there"
        assert not anchor or anchor in anchors_of(place), f"{target} has no heading {anchor}"


def test_tests_that_notes_name_are_there():
    for page in (ROOT / "docs/research").glob("*.md"):
        for file, name in re.findall(r"`([\w/]+\.py)::(\w+)`", page.read_text(encoding="utf-8")):
            text = (ROOT / "tests" / file.removeprefix("tests/")).read_text(encoding="utf-8")
            assert f"def {name}(" in text, f"{page.name}: {file} has no {name}"


def test_every_picture_is_shown_and_is_small():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for picture in (ROOT / "docs/images").iterdir():
        assert f"images/{picture.name})" in text, f"no page shows {picture.name}"
        assert picture.stat().st_size < MOST_BYTES, f"{picture.name} is too large"


def test_every_page_is_in_the_index():
    index = (ROOT / "docs/README.md").read_text(encoding="utf-8")
    pages = [page for page in (ROOT / "docs").glob("*.md") if page.name != "README.md"]
    assert [page.name for page in pages if page.name not in index] == []


@pytest.fixture(scope="module")
def rooms():
    spec = importlib.util.spec_from_file_location("rooms", ROOT / "ci/rooms.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_list_of_rooms_is_what_the_packages_say(rooms):
    assert rooms.PAGE.read_text(encoding="utf-8") == rooms.page(), "docs/architecture.md is out of date: run ci/rooms"
    assert rooms.PICTURE.read_text(encoding="utf-8") == rooms.picture(), "the picture is out of date: run ci/rooms"


def test_every_function_on_the_way_of_a_scan_is_there():
    """Names as `model.chain.simulate` in docs/architecture.md."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8").partition("## The way of a scan")[2]
    names = re.findall(r"`((?:[a-z_]+\.)+[A-Za-z_]+)`", text)
    lost = []
    for name in names:
        if name.endswith((".py", ".toml", ".json", ".html", ".md")):
            continue
        if importlib.util.find_spec(f"lidarcheck.{name}".rpartition(".")[0]) is None:
            lost.append(name)
            continue
        home, _, last = f"lidarcheck.{name}".rpartition(".")
        if not hasattr(importlib.import_module(home), last) and importlib.util.find_spec(f"{home}.{last}") is None:
            lost.append(name)
    assert len(names) > 15
    assert lost == []


def test_the_glossary_is_in_order_and_has_its_terms_once():
    text = (ROOT / "docs/glossary.md").read_text(encoding="utf-8")
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        terms = [term.lower() for term in re.findall(r"^\*\*(.+?)\*\*", part, re.MULTILINE)]
        assert terms == sorted(set(terms))
