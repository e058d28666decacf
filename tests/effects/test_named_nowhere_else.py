"""No effect is named outside `effects/`: what the rest must know of one is asked of the catalogue."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from lidarcheck.effects import catalogue

SOURCE = Path(__file__).resolve().parents[2] / "src" / "lidarcheck"
NAMES = set(catalogue())
CLASSES = {effect.__name__ for effect in catalogue().values()}
PLAIN = {name for name in NAMES if "_" not in name}
"""English words, too: a scene has motion of its own, the sensor a threshold. As text or import they name the effect."""

EXCEPTED = {
    ("sensor/spad_array.py", "threshold"): "a key of sensor files",
    ("sensor/linear.py", "threshold"): "a key of sensor files",
    ("formats/sensors/imported.py", "threshold"): "a key of sensor files",
    ("figures/pages/sensor_tables.py", "threshold"): "a key of sensor files",
    ("harness/goldens/hash_words.py", "threshold"): "a key of sensor files",
    ("calibration/parameters/parameters.py", "threshold"): "a key of sensor files",
    ("ideals/repeats/laws/work.py", "threshold"): "a key of sensor files",
    ("model/detection.py", "threshold"): "the purpose that keys a random stream: another word, other bytes",
    ("cli/simulation/effects_text.py", "crosstalk"): "a node of the effect tree",
}


def named(tree: ast.AST) -> Iterator[str]:
    """The names of effects in a module, as texts, identifiers, attributes, arguments, definitions and imports."""
    for node in ast.walk(tree):
        words: tuple[str | None, ...] = ()
        strict = False
        match node:
            case ast.Constant(value=str(word)):
                words, strict = (word,), True
            case ast.ImportFrom(module=module, names=names):
                words, strict = (*(module or "").split("."), *(one.name for one in names)), True
            case ast.Import(names=names):
                words, strict = tuple(part for one in names for part in one.name.split(".")), True
            case ast.Name(id=word) | ast.Attribute(attr=word) | ast.arg(arg=word) | ast.keyword(arg=word):
                words = (word,)
            case ast.FunctionDef(name=word) | ast.ClassDef(name=word):
                words = (word,)
        yield from (word for word in words if word in (NAMES if strict else NAMES - PLAIN) | CLASSES)


def modules() -> list[str]:
    found = (path.relative_to(SOURCE) for path in SOURCE.rglob("*.py"))
    return sorted(path.as_posix() for path in found if path.parts[0] != "effects")


def test_no_effect_is_named_outside_its_files() -> None:
    found = {(file, name) for file in modules() for name in named(ast.parse((SOURCE / file).read_text("utf-8")))}
    assert sorted(found - EXCEPTED.keys()) == []
    assert sorted(EXCEPTED.keys() - found) == [], "no exception stands for nothing"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ('names = ("fog", other)', "fog"),
        ("from lidarcheck.effects.fog import patches", "fog"),
        ("from lidarcheck.effects.search import vibration", "vibration"),
        ("import lidarcheck.effects.rain", "rain"),
        ("gain = values.signal_gain", "signal_gain"),
        ("make(retro_ghost=1)", "retro_ghost"),
        ("def dead_time(): ...", "dead_time"),
        ("law = effects.WalkError", "WalkError"),
    ],
)
def test_the_test_sees_every_way_to_name_one(text: str, name: str) -> None:
    assert name in named(ast.parse(text))


def test_plain_words_may_name_other_things() -> None:
    assert [*named(ast.parse("scene.motion = rain(threshold=fog)"))] == []
