"""Names and words from files drive no terminal, no page and no CI server, whatever is in them."""

import hashlib
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from harness_fakes import SPECS, Project
from lidarcheck.cli import main
from lidarcheck.cli.core import terminal
from lidarcheck.cli.harness.check_text import report_text
from lidarcheck.errors import InputError
from lidarcheck.figures.data import Distribution
from lidarcheck.figures.files.outputs import json_text
from lidarcheck.figures.html.check import report_html
from lidarcheck.figures.html.environment import breakable
from lidarcheck.figures.svg.figure import svg_file
from lidarcheck.figures.svg.shapes import svg, text
from lidarcheck.harness.check import check
from lidarcheck.harness.reports.annotations import annotations
from lidarcheck.harness.reports.junit import junit_text
from lidarcheck.harness.review.accept import accept
from lidarcheck.harness.review.review import review
from lidarcheck.printable import printable, printable_json, printable_lines

HOSTILE = "\x1b]0;pwned\x07\n::error::x%0A\x9b2J<script>alert(1)</script>]]>[bold]\u202egnp.\u2028&amp;"
FIRST = f"::error::{HOSTILE}"


def harmless(said):
    """No character drives a terminal, and no line is a command to a CI server."""
    assert said.replace("\n", "").replace("\t", "").isprintable(), ascii(said)
    assert not [line for line in said.splitlines() if line.lstrip().startswith(("::", "##["))]
    return said


@pytest.mark.parametrize(
    "character", ["\x00", "\x07", "\x08", "\r", "\x1b", "\x7f", "\x85", "\x9b", "\u200e", "\u2066", "\ufeff"]
)
def test_what_does_not_show_itself_is_spelled_out(character):
    assert printable(f"a{character}b") == f"a{ascii(character)[1:-1]}b"
    assert printable(printable(character)) == printable(character)
    assert json.loads(printable_json(f'"{json.dumps(character, ensure_ascii=False)[1:-1]}"')) == character
    harmless(printable_lines(f"::a{character}b\n ##[x]\nc"))


def test_plain_words_of_any_language_stay(capsys):
    for words in ("Größe 5 µm², 測定", "a\nb\tc"):
        assert printable_lines(words) == words
    terminal.emit("Größe\n")
    assert capsys.readouterr().out == "Größe\n"


def test_an_error_is_one_line_that_shows_itself():
    [line] = InputError(f"column {HOSTILE}", file=f"a{HOSTILE}.txt", fix=HOSTILE).lines()
    assert "\n" not in harmless(line)
    assert line.startswith("error: a\\x1b]0;pwned\\x07 ::error::x")


def test_what_commands_print(capsys):
    terminal.emit(f"{FIRST} is what a file is called")
    terminal.emit(terminal.table([terminal.Column("name"), terminal.Column("value")], [[FIRST, "1"], ["b", HOSTILE]]))
    terminal.note(FIRST)
    out, err = capsys.readouterr()
    harmless(out)
    harmless(err)
    assert len(out.splitlines()) == 2 + 3  # a line end in a text is one, in a cell of a table it is none
    assert "\\x1b]0;pwned\\x07" in out


def test_a_terminal_gets_its_colours_and_nothing_else(capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    rows = [[HOSTILE, "1"]]
    drawn = terminal.table([terminal.Column("name"), terminal.Column("value")], rows, styles=["bold red"])
    terminal.emit(drawn)
    terminal.emit(f"\x1b[31mred\x1b[0m\x1b[2J{HOSTILE}")
    out = capsys.readouterr().out
    assert "\x1b[31mred\x1b[0m\\x1b[2J" in out
    harmless(re.sub("\x1b\\[[0-9;]*m", "", out))


def test_json_holds_what_the_name_is_and_drives_nothing():
    said = json_text({"name": HOSTILE})
    assert json.loads(said) == {"name": HOSTILE}
    harmless(said)


@pytest.fixture
def report(tmp_path):
    """A check of a scenario whose file, KPI, unit and reason are hostile."""
    project = Project(tmp_path / "p", names=(FIRST.replace("/", "|"),))
    specs = (replace(SPECS[0], name=FIRST, unit=HOSTILE), *SPECS[1:])

    def load(path):
        return SimpleNamespace(**{**vars(project.load(path)), "kpis": specs})

    def measure(*asked):
        found = project.measure(*asked)
        return replace(found, values={**found.values, FIRST: found.values[SPECS[0].name]})

    accept(review([project.root], measure=measure, load=load), ["all"], reason=HOSTILE)
    project.shift = 30.0
    return check([project.root], measure=measure, load=load)


def test_the_text_of_a_check(report, capsys):
    terminal.emit(report_text(report))
    said = harmless(capsys.readouterr().out)
    assert "error" in said


def test_the_annotations_of_a_check(report):
    lines = annotations(report, {"GITHUB_ACTIONS": "true"})
    assert lines
    for line in lines:
        assert re.fullmatch(r"::(error|notice) [^:]*::[^\n]*", line), line
        harmless(line.removeprefix("::"))
        assert not re.search(r"%(?!25|0A|0D|3A|2C)", line)


def test_the_junit_report_of_a_check(report):
    said = junit_text(report)
    root = ET.fromstring(said)
    words = [value for one in root.iter() for value in (*one.attrib.values(), one.text or "")]
    assert any("\\x1b]0;pwned" in value for value in words)
    for value in words:
        harmless(value)
    assert "<script" not in said
    harmless(junit_text(InputError(HOSTILE)))


class Page(HTMLParser):
    """What a browser would make of a page."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.policies = [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        assert not [name for name, _ in attrs if name.startswith("on")]
        given = dict(attrs)
        if given.get("http-equiv") == "Content-Security-Policy":
            self.policies.append(given["content"])


def test_the_page_of_a_check(report):
    said = harmless(report_html(report))
    page = Page(said)
    assert "script" not in page.tags
    assert page.policies == ["default-src 'none'; style-src 'unsafe-inline'; form-action 'none'; base-uri 'none'"]
    assert "pwned" in said


def test_every_page_has_the_policy():
    import lidarcheck.figures

    templates = Path(lidarcheck.figures.__file__).parent / "templates"
    pages = [file for file in templates.glob("*.jinja") if "<html" in file.read_text()]
    assert len(pages) >= 4
    for file in pages:
        assert "default-src 'none'; style-src 'unsafe-inline'; form-action 'none'; base-uri 'none'" in file.read_text()
    assert "<script" not in breakable(HOSTILE)


def test_a_picture():
    figure = Distribution(HOSTILE, HOSTILE, HOSTILE, {FIRST: np.array([1.0, 2.0]), "b": np.array([1.0, 3.0])})
    for picture in (svg_file(figure), svg(HOSTILE, text(1.0, 2.0, HOSTILE))):
        harmless(picture)
        assert not [one for one in ET.fromstring(picture).iter() if one.tag.rpartition("}")[2] == "script"]


def test_files_of_hostile_names_and_columns(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    name = FIRST.replace("/", "|")
    Path(f"{name}.txt").write_text("Layer Point Distance MaterialID IncidenceAngle\n1 2 3 4\n")
    Path("columns.csv").write_text('X,Y,Z,"a\x1b[2J",b\u202e\n1,2,3,4,5\n')
    Path("model.toml").write_text(f"variant = {json.dumps('SMART' + HOSTILE)}\n")
    Path("keys.toml").write_text(f'variant = "SMART"\n{json.dumps(HOSTILE)} = 1\n')
    for file in (f"{name}.txt", "columns.csv", "model.toml", "keys.toml", f"{name}.nowhere"):
        main(["info", f"./{file}"])
        main(["info", f"./{file}", "--json"])
        main(["compare", f"./{file}", f"./{file}"])
    main(["check", name])
    main([name])
    main(["simulate", name, f"--{name}"])
    out, err = capfd.readouterr()
    harmless(out)
    harmless(err)
    assert err.count("\\x1b") > 10


def test_pytest_says_what_a_check_says(tmp_path):
    """The plugin's failures, of a scenario whose name begins as a command to a CI server does."""
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "goldens").mkdir()
    (tmp_path / "scenarios" / "::error::x\x1b[2J\u202e.toml").write_text(f"{json.dumps(HOSTILE)} = 1\n")
    (tmp_path / "goldens" / "\n::error::gone\x1b[2J.toml").write_text("")
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = -p no:cacheprovider --color=no\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-W", "ignore", "--continue-on-collection-errors", "scenarios"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    own = [line for line in done.stdout.splitlines() if "has no scenario" in line or "unknown key" in line]
    assert own
    for line in own:
        harmless(line.removeprefix("E   "))
    assert not [line for line in done.stdout.splitlines() if line.startswith("::error::gone")]


@pytest.mark.parametrize(
    "content",
    ["<script>x</script>", '<p onclick="x">', '<meta http-equiv="refresh" content="0; url=//x">', '<a href="//x">x</a>',
     "<form action='//x'>", "<iframe>", "<svg><image href='//x'/>", "<ScRiPt>"],
)  # fmt: skip
def test_a_page_that_reaches_out_is_not_put_onto_another(content, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = f"<html><header></header><main><p>pwned</p>{content}</main></html>"
    Path("report.html").write_text(page)
    result = {"workflow": "panels", "title": "t", "summary": "s", "lidarcheck": "0.1", "provenance": {}}
    result["page"] = {"sha256": hashlib.sha256(page.encode()).hexdigest()}
    Path("result.json").write_text(json.dumps(result))
    main(["report", ".", "--out", "release.html", "-q"])
    shown = Path("release.html").read_text()
    assert "which lidarcheck does not write" in shown
    assert "<p>pwned</p>" not in shown
