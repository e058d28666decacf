import os
import threading
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field, model_validator

from budget import examples
from lidarcheck.config.schema import Config, PathText
from lidarcheck.config.toml_lines import locate
from lidarcheck.config.words import dotted
from lidarcheck.errors import ConfigError, InputError, LidarcheckError
from lidarcheck.formats.config import load_toml, parse_toml


class Panel(Config):
    distance_m: float = Field(ge=1.0, le=300.0, json_schema_extra={"unit": "m"})
    reflectance: float = Field(0.5, gt=0.0, le=1.0)
    name: str = Field("panel", min_length=1)


class Box(Config):
    kind: Literal["box"]
    size_m: float = Field(ge=0.1, le=10)


class Ball(Config):
    kind: Literal["ball"]
    radius_m: float = Field(ge=0.1, le=5)


class Scenario(Config):
    variant: Literal["SMART", "SLIM"] = "SMART"
    seeds: int = Field(8, ge=1, le=64)
    weights: tuple[float, ...] = ()
    golden: PathText | None = None
    noisy: bool = False
    panels: tuple[Panel, ...] = ()
    shapes: tuple[Annotated[Box | Ball, Field(discriminator="kind")], ...] = ()
    named: dict[Annotated[str, Field(pattern="^[a-z]+$")], Panel] = {}  # noqa: RUF012 - frozen model, pydantic copies

    @model_validator(mode="after")
    def _enough_seeds(self) -> "Scenario":
        if self.noisy and self.seeds < 2:
            raise ValueError("a noisy scenario has 1 seed; use at least 2")
        return self


def load(tmp_path: Path, text: str | bytes) -> Scenario:
    path = tmp_path / "s.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_toml(path, Scenario)


def faults(tmp_path: Path, text: str | bytes) -> list[str]:
    with pytest.raises(LidarcheckError) as caught:
        load(tmp_path, text)
    return [line.removeprefix(f"error: {tmp_path}/s.toml") for line in caught.value.lines()]


def test_a_good_file_becomes_frozen_values(tmp_path: Path) -> None:
    scenario = load(
        tmp_path, '\ufeffseeds = 3\r\nweights = [1, 2.5]\r\ngolden = "a/b.toml"\r\n[[panels]]\r\ndistance_m = 5'
    )
    assert scenario.seeds == 3
    assert scenario.weights == (1.0, 2.5)
    assert scenario.golden == Path("a/b.toml")
    assert scenario.panels == (Panel(distance_m=5.0),)
    with pytest.raises(ValueError):
        scenario.seeds = 4  # type: ignore[misc]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('seeds = "3"', ':1: seeds = "3" is text; use a whole number from 1 to 64'),
        ("seeds = 3.0", ":1: seeds = 3.0 is a number with a fraction; use a whole number from 1 to 64"),
        ("seeds = true", ":1: seeds = true is a truth value; use a whole number from 1 to 64"),
        ("\n\nseeds = 65", ":3: seeds = 65 is out of range; use a whole number from 1 to 64"),
        ("noisy = 1", ":1: noisy = 1 is a whole number; use true or false"),
        ("golden = 3", ":1: golden = 3 is a whole number; use a path in quotes"),
        ("weights = [\n1,\n# two\ninf]", ":4: weights[1] = inf is not a finite number; use a number"),
        ("weights = 1", ":1: weights = 1 is a whole number; use a list, each entry a number"),
        ('variant = "SLMI"', ':1: variant = "SLMI" is not a valid choice; use "SMART" or "SLIM"; did you mean "SLIM"?'),
        ("sedes = 3", ":1: unknown key sedes; did you mean seeds?"),
        (
            "zzz = 3",
            ":1: unknown key zzz; valid keys are golden, named, noisy, panels, seeds, shapes, variant, weights",
        ),
        ("[[panels]]", ":1: panels[0].distance_m is missing; add it: a number from 1 to 300 m"),
        (
            "[[panels]]\ndistance_m = 1\nreflectance = 0",
            ":3: panels[0].reflectance = 0 is out of range; use a number above 0 and at most 1",
        ),
        ('[[panels]]\ndistance_m = 1\nname = ""', ':3: panels[0].name = "" is not valid; use text, not empty'),
        ("[panels]\ndistance_m = 1", ":1: panels is a table; use a list, each entry a table"),
        ('[[shapes]]\nkind = "bal"\nradius_m = 1', ':1: shapes[0]: unknown kind "bal"; use "box" or "ball"'),
        ("[[shapes]]\nradius_m = 1", ':1: shapes[0]: kind is missing; use "box" or "ball"'),
        (
            '[[shapes]]\nkind = "ball"\nradius_m = 6',
            ":3: shapes[0].radius_m = 6 is out of range; use a number from 0.1 to 5",
        ),
        (
            '[[shapes]]\nkind = "ball"\nradius_m = 1\nradios_m = 6',
            ":4: unknown key shapes[0].radios_m; did you mean radius_m?",
        ),
        ("[named.A]\ndistance_m = 1", ':1: the key "A" in named is not valid; use text of the form ^[a-z]+$'),
        ("noisy = true\nseeds = 1", ":1: a noisy scenario has 1 seed; use at least 2"),
        ("variant = 1979-05-27", ':1: variant = 1979-05-27 is not a valid choice; use "SMART" or "SLIM"'),
        ("seeds = 1\nseeds = 2", ":2: not valid TOML: cannot overwrite a value; correct the line"),
        (
            "seeds = 1\nweights = [1,\n2\n",
            ":3: not valid TOML: unclosed array; correct the line",
        ),
        ("seeds = 0x" + "f" * 5000, ":1: seeds = a very large number is out of range; use a whole number from 1 to 64"),
        (b"variant = 'a'\n# \xe4\n", ":2: byte 0xE4 is not UTF-8; save it as UTF-8"),
        ("seeds = 1".encode("utf-16"), ":1: the text is UTF-16, not UTF-8; save it as UTF-8"),
        (b"", ": the file is empty; was it written completely?"),
        (b" \r\n\n", ": the file is empty; was it written completely?"),
        (b"seeds = 1\x00", None),
        ("weights = " + "[" * 5000, ": lists or tables are nested too deeply; write it flatter"),
        ("seeds = " + "9" * 5000, None),
    ],
)
def test_each_fault_is_one_line_with_place_and_fix(tmp_path: Path, text: str | bytes, message: str | None) -> None:
    found = faults(tmp_path, text)
    assert len(found) == 1
    if message is None:
        assert found[0].startswith((":1: not valid TOML: ", ": "))
    else:
        assert found[0] == message


def test_all_faults_come_at_once_in_the_files_order(tmp_path: Path) -> None:
    text = 'weights = ["a", 1, true]\nseeds = 0\n[[panels]]\ndistance_m = 1\n[[panels]]\ndistanc_m = 2\n'
    assert faults(tmp_path, text) == [
        ':1: weights[0] = "a" is text; use a number',
        ":1: weights[2] = true is a truth value; use a number",
        ":2: seeds = 0 is out of range; use a whole number from 1 to 64",
        ":5: panels[1].distance_m is missing; add it: a number from 1 to 300 m",
        ":6: unknown key panels[1].distanc_m; did you mean distance_m?",
    ]


def test_missing_file_and_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        load_toml(tmp_path / "none.toml", Scenario)
    with pytest.raises(InputError, match="is a directory, not a file"):
        load_toml(tmp_path, Scenario)
    with pytest.raises(InputError, match="cannot be read"):
        load_toml("a\0b", Scenario)
    with pytest.raises(InputError, match="is not a regular file"):
        load_toml("/dev/zero", Scenario)


def test_a_pipe_is_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=('variant = "SLIM"',))
    writer.start()
    assert load_toml(pipe, Scenario).variant == "SLIM"
    writer.join()


def test_faults_found_later_get_their_line(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text("[[panels]]\ndistance_m = 1\n\n[[panels]]\nname = 'x'\ndistance_m = 2\n")
    _, lines = parse_toml(path)
    fault = lines.fault(("panels", 1, "name"), "there is no panel x", fix="name another")
    assert str(fault) == f"error: {path}:5: there is no panel x; name another"
    assert lines.line(("panels", 1, "reflectance")) == 4
    assert lines.line(()) == 1


def test_locate_knows_every_way_to_write_a_key() -> None:
    text = (
        "# top\n"
        'a.b."c.d" = 1 # x\n'
        "'lit # eral' = '''\n[no.table]\nkey = 3'''\n"
        'multi = """\n[x]\\"""\n"""""\n'
        "list = [ # [\n  1, 'a,]', # ]\n  [2,\n  3], {x = 1, y.z = [\n4]} ]\n"
        "[t]\n"
        "when = 1979-05-27 07:32:00\n"
        "[ t . 'u\\' . v ]\nk=1\n"
        "[[arr]]\nn = 1\n[[arr.sub]]\nm=1\n[[arr.sub]]\n[arr.sub.deep]\nd=1\n[[arr]]\n[arr.tab]\nn=2\n"
        "[late.inner]\n[late]\n"
    )
    tomllib.loads(text)
    found = locate(text)
    expected = {
        ("a",): 2,
        ("a", "b"): 2,
        ("a", "b", "c.d"): 2,
        ("lit # eral",): 3,
        ("multi",): 6,
        ("list",): 9,
        ("list", 0): 10,
        ("list", 1): 10,
        ("list", 2): 11,
        ("list", 2, 1): 12,
        ("list", 3): 12,
        ("list", 3, "x"): 12,
        ("list", 3, "y", "z"): 12,
        ("list", 3, "y", "z", 0): 13,
        ("t",): 14,
        ("t", "when"): 15,
        ("t", "u\\"): 16,
        ("t", "u\\", "v"): 16,
        ("t", "u\\", "v", "k"): 17,
        ("arr",): 18,
        ("arr", 0): 18,
        ("arr", 0, "n"): 19,
        ("arr", 0, "sub", 0, "m"): 21,
        ("arr", 0, "sub", 1): 22,
        ("arr", 0, "sub", 1, "deep", "d"): 24,
        ("arr", 1): 25,
        ("arr", 1, "tab", "n"): 27,
        ("late",): 29,
        ("late", "inner"): 28,
    }
    assert {path: found.get(path) for path in expected} == expected


def all_paths(value: Any, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    entries: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, entry in entries for found in [(*path, key), *all_paths(entry, (*path, key))]]


KEYS = st.one_of(st.sampled_from(["a", "b", "c", "x-1", "9"]), st.text(st.characters(codec="utf-8"), max_size=5))
LEAVES = st.one_of(
    st.integers(-(10**20), 10**20),
    st.floats(),
    st.booleans(),
    st.text(st.characters(codec="utf-8"), max_size=12),
    st.sampled_from(['"""', "'''", "a\nb", "\\", "# no", "[x]", "a = 1", '"\n"']),
    st.datetimes(),
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(KEYS, inner, max_size=4)),
    max_leaves=12,
)


@settings(max_examples=examples(150), deadline=None)
@given(document=st.dictionaries(KEYS, VALUES, max_size=5), multiline=st.booleans())
def test_every_key_of_any_document_has_a_line_and_no_other(document: dict[str, Any], multiline: bool) -> None:
    text = tomli_w.dumps(document, multiline_strings=multiline)
    parsed = tomllib.loads(text)
    found = locate(text)
    assert set(found) == set(all_paths(parsed))
    assert all(1 <= line <= text.count("\n") + 1 for line in found.values())


@st.composite
def documents_with_lines(draw: st.DrawFn) -> tuple[str, dict[tuple[str | int, ...], int]]:
    """A document written line by line, with the line of each key noted while it is written."""
    lines: list[str] = []
    expected: dict[tuple[str | int, ...], int] = {}
    newline = draw(st.sampled_from(["\n", "\r\n"]))

    def write(table: tuple[str | int, ...], names: list[str]) -> None:
        for name in names:
            lines.extend(draw(st.lists(st.sampled_from(["", "# [x]", "  # y = '''"]), max_size=2)))
            expected[(*table, name)] = len(lines) + 1
            shape = draw(st.sampled_from(["one", "list", "text", "inline"]))
            if shape == "one":
                lines.append(f" {name} =  {draw(st.sampled_from(['1', 'true', '1e3', '[]', '{}']))} # c")
            elif shape == "list":
                lines.append(f"{name} = [")
                for index in range(draw(st.integers(0, 3))):
                    lines.extend(draw(st.lists(st.sampled_from(["", "# ]"]), max_size=1)))
                    expected[(*table, name, index)] = len(lines) + 1
                    lines.append("  '],',")
                lines.append("]")
            elif shape == "text":
                quotes = draw(st.sampled_from(['"""', "'''"]))
                lines.extend([f"{name} = {quotes}", "[no]", f"x = 1{quotes}"])
            else:
                expected[(*table, name, "in")] = len(lines) + 1
                expected[(*table, name, "in", "side")] = len(lines) + 1
                lines.append(f"{name} = {{ in.side = '}}' }}")

    names = st.lists(st.sampled_from(["a", "b", "c"]), unique=True, max_size=3)
    write((), draw(names))
    for index in range(draw(st.integers(0, 3))):
        expected.setdefault(("t",), len(lines) + 1)
        expected[("t", index)] = len(lines) + 1
        lines.append("[[ t ]] # x")
        write(("t", index), draw(names))
        if draw(st.booleans()):
            expected[("t", index, "u")] = len(lines) + 1
            expected[("t", index, "u", "v.w")] = len(lines) + 1
            lines.append("[t.u.'v.w']")
            write(("t", index, "u", "v.w"), draw(names))
    return newline.join(lines), expected


@settings(max_examples=examples(150), deadline=None)
@given(documents_with_lines())
def test_lines_are_those_of_the_writer(case: tuple[str, dict[tuple[str | int, ...], int]]) -> None:
    text, expected = case
    assert locate(text) == expected
    assert set(expected) == set(all_paths(tomllib.loads(text)))


GOOD = b"""# a scenario
variant = "SLIM"
seeds = 3
weights = [1.0, 2.0,
  3.0]
golden = "x/y.toml"
named.abc = { distance_m = 4, name = '''a
b''' }
[[panels]]
distance_m = 5
[[panels]]
distance_m = 6.5
name = "gr\xc3\xbcn"
[[shapes]]
kind = "ball"
radius_m = 1e0
"""


@settings(max_examples=examples(250), deadline=None)
@given(
    edits=st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), max_size=3),
    cut=st.one_of(st.none(), st.integers(0, len(GOOD))),
    inserted=st.sampled_from([b"", b"[", b"]", b"{", b'"""', b"'''", b"=", b".", b"\n[a]\n", b"\xff", b"\r", b"\\u"]),
    at=st.integers(0, len(GOOD)),
)
def test_a_damaged_file_is_read_or_refused_in_single_lines(
    tmp_path_factory: pytest.TempPathFactory,
    edits: list[tuple[int, int]],
    cut: int | None,
    inserted: bytes,
    at: int,
) -> None:
    content = bytearray(GOOD)
    for position, byte in edits:
        content[position] = byte
    damaged = bytes(content[:at] + inserted + content[at:])[:cut]
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    path.write_bytes(damaged)
    try:
        load_toml(path, Scenario)
    except LidarcheckError as error:
        for line in error.lines():
            assert line.startswith(f"error: {path}")
            assert line.isprintable()
            assert "; " in line


def test_dotted_spells_keys_as_toml_does() -> None:
    assert dotted(("effects", 1, "a b", "x")) == 'effects[1]."a b".x'


def test_config_error_holds_each_fault(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, "seeds = 0\nx = 1\n")
    assert [fault.line for fault in caught.value.faults] == [1, 2]
