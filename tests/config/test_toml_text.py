"""TOML from a stranger: one line says what is wrong, soon."""

from pathlib import Path

import pytest

from lidarcheck.config.toml_text import toml_of
from lidarcheck.errors import InputError

PARTS = "a." * 50_000 + "b"
NESTED = ["a = " + "[" * 200 + "]" * 200, "a = " + "[" * 50_000, "a = " + "{b = " * 200 + "1" + "}" * 200]


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        (f"x = 1\n{PARTS} = 1\n", 2, "a key of more than 100 parts"),
        (f"\n\n[{PARTS}]\n", 3, "a key of more than 100 parts"),
        (f"[[ {PARTS} ]]\n", 1, "a key of more than 100 parts"),
        ("x = {" + '"a" . ' * 500 + "'b' = 1}\n", 1, "a key of more than 100 parts"),
        *((f"x = 1\n{text}\n", None, "nested too deeply") for text in NESTED),
        ("x = 1\ny = " + "9" * 5000, 2, "not valid TOML: exceeds the limit"),
        ("x = 1\nx = 2\n", 2, "not valid TOML: cannot overwrite"),
        ("x = \0\n", 1, "not valid TOML"),
    ],
)
def test_what_is_wrong_is_one_line(text: str, line: int | None, what: str) -> None:
    with pytest.raises(InputError, match=what) as caught:
        toml_of(text, Path("x.toml"))
    assert caught.value.line == line
    assert len(caught.value.lines()) == 1
    assert len(str(caught.value)) < 200


def test_what_is_usual_is_read() -> None:
    deep = ".".join("a" * 90)
    text = f'{deep} = 1\nx = "{"1.2." * 20}"\ny = {"[" * 50}{"]" * 50}\n# {"-" * 1000}\n'
    assert toml_of(text, Path("x.toml"))["x"] == "1.2." * 20
    assert toml_of("word = '" + "a" * 1_000_000 + "'", Path("x.toml"))
