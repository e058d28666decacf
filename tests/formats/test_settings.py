import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from budget import examples
from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.formats.json_lines import locate_json
from lidarcheck.formats.settings import (
    Setting,
    Settings,
    default_settings,
    find_settings,
    load_settings,
    save_settings,
    settings_name,
)
from places import shared_path

GOOD = """[
  {
    "Distance": 69.0,
    "IndexVerMin": 777,
    "IndexVerMax": 873,
    "SegVerCenter": 264,
    "SegHor": 440,
    "Comment": "Schild grün"
  }
]
"""
HORIZONTAL = {"Distance": 20, "IndexHorMin": 0, "IndexHorMax": 2399, "SegHorCenter": 959, "SegVer": 519}


def faults(tmp_path: Path, text: str | bytes, name: str = "s.json") -> list[str]:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    with pytest.raises(LidarcheckError) as caught:
        load_settings(path)
    return [line.removeprefix(f"error: {path}") for line in caught.value.lines()]


def test_the_sample_is_the_default_and_keeps_its_bytes(tmp_path: Path) -> None:
    source = shared_path("samples/Blooming_Calibration_V_SLIM.json")
    loaded = load_settings(source)
    assert loaded == default_settings("vertical")
    for settings_ in (loaded, default_settings("vertical")):
        save_settings(settings_, tmp_path / "out.json")
        assert (tmp_path / "out.json").read_bytes() == source.read_bytes()


def test_defaults() -> None:
    assert load_settings(None) == default_settings("vertical")
    horizontal = load_settings(None, "horizontal")
    assert horizontal == default_settings("horizontal")
    assert horizontal.entries == (Setting(20.0, 1140, 1260, 480, 260),)


def test_a_directory_without_the_file_gives_the_defaults(tmp_path: Path) -> None:
    assert find_settings(tmp_path, "vertical", "SLIM") == default_settings("vertical")
    (tmp_path / "Blooming_Calibration_H_SMART.json").write_text(json.dumps([HORIZONTAL]))
    assert find_settings(tmp_path, "horizontal", "SMART").entries == (Setting(20.0, 0, 2399, 959, 519),)
    assert find_settings(tmp_path, "horizontal", "SLIM") == default_settings("horizontal")


def test_names() -> None:
    assert settings_name("vertical", "SLIM") == "Blooming_Calibration_V_SLIM.json"
    assert settings_name("horizontal", "SMART") == "Blooming_Calibration_H_SMART.json"
    with pytest.raises(UsageError):
        settings_name("vertical", "FAT")  # type: ignore[arg-type]


def test_unknown_keys_their_order_and_untouched_spelling_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    path.write_text(GOOD, encoding="utf-8")
    loaded = load_settings(path, "vertical")
    edited = replace(loaded, entries=(replace(loaded.entries[0], index_max=900),))
    save_settings(edited, path)
    assert path.read_text(encoding="utf-8") == GOOD.replace("873", "900")
    path.write_text(GOOD.replace("69.0", "69"), encoding="utf-8")
    loaded = load_settings(path)
    save_settings(replace(loaded, entries=(replace(loaded.entries[0], across=441),)), path)
    assert '"Distance": 69,' in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "text", [GOOD.replace("\n", "\r\n"), "\ufeff" + GOOD, json.dumps(json.loads(GOOD)), GOOD + "\n\n"]
)
def test_an_untouched_file_keeps_its_bytes_in_any_layout(tmp_path: Path, text: str) -> None:
    path, out = tmp_path / "s.json", tmp_path / "o.json"
    path.write_bytes(text.encode())
    save_settings(load_settings(path), out)
    assert out.read_bytes() == path.read_bytes()


def test_the_axis_is_told_by_the_keys(tmp_path: Path) -> None:
    path = tmp_path / "Blooming_Calibration_V_SMART.json"
    path.write_text(json.dumps([HORIZONTAL]))
    assert load_settings(path).axis == "horizontal"
    with pytest.raises(InputError, match="these are horizontal settings; name a file of vertical ones"):
        load_settings(path, "vertical")
    path.write_text("[]")
    assert load_settings(path) == Settings("vertical", ())
    other = tmp_path / "s.json"
    other.write_text("[]")
    assert load_settings(other, "horizontal").axis == "horizontal"


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("", [": the file is empty; was it written completely?"]),
        (
            "[]",
            [
                ":1: neither vertical nor horizontal settings; "
                "use the keys Distance, IndexVerMin, IndexVerMax, SegVerCenter, SegHor"
            ],
        ),
        ("{}", [":1: the file holds a table; use a list [...] of objects {...}"]),
        ("null", [":1: the file holds nothing; use a list [...] of objects {...}"]),
        ("[\n{]", [":2: not valid JSON: expecting property name enclosed in double quotes; correct the line"]),
        (
            GOOD.replace("69.0", "NaN"),
            [":3: not valid JSON: NaN is not a number; use plain numbers and text"],
        ),
        (
            GOOD.replace("69.0", '"NaN"').replace("440", "-Infinity"),
            [":7: not valid JSON: -Infinity is not a number; use plain numbers and text"],
        ),
        (
            GOOD.replace("IndexVerMin", "IndexVrMin"),
            [
                ':2: settings[0].IndexVerMin is missing; rename "IndexVrMin", '
                "or add it: a whole number from 0 to 1559 SPAD rows"
            ],
        ),
        (GOOD.replace("69.0", "1e999"), [":3: settings[0].Distance is too large a number; use a smaller one"]),
        (
            GOOD.replace("69.0", '"69"').replace("777", "874").replace("440", "960"),
            [
                ':3: settings[0].Distance = "69" is text; use a number from 0 to 300 m',
                ":7: settings[0].SegHor = 960 is out of range; use a whole number from 0 to 959 points",
            ],
        ),
        (GOOD.replace("777", "874"), [":2: IndexVerMin = 874 is above IndexVerMax = 873; swap them"]),
        (
            GOOD.replace("777", "777.0").replace("873", "1560").replace("264", "520"),
            [
                ":4: settings[0].IndexVerMin = 777.0 is a number with a fraction; "
                "use a whole number from 0 to 1559 SPAD rows",
                ":5: settings[0].IndexVerMax = 1560 is out of range; use a whole number from 0 to 1559 SPAD rows",
                ":6: settings[0].SegVerCenter = 520 is out of range; use a whole number from 0 to 519 layers",
            ],
        ),
        (
            GOOD.replace('"Comment"', '"SegHor"'),
            [':8: "SegHor" stands twice in one object; remove one'],
        ),
        (
            GOOD.replace("Schild grün", "\\ud800"),
            [":8: settings[0].Comment holds half a surrogate pair; remove the \\ud... escape"],
        ),
        (
            GOOD.replace('"SegHor": 440', '"Seg": null'),
            [':2: settings[0].SegHor is missing; rename "Seg", or add it: a whole number from 0 to 959 points'],
        ),
        (
            GOOD.replace("]", ",\n3]").replace("264", "null"),
            [
                ":6: settings[0].SegVerCenter = null is nothing; use a whole number from 0 to 519 layers",
                ":11: settings[1] = 3 is a whole number; use a table",
            ],
        ),
        (
            json.dumps([HORIZONTAL, HORIZONTAL], indent=1),
            [":10: the distance 20 m stands twice; remove one"],
        ),
        (
            json.dumps([{**HORIZONTAL, "IndexHorMax": 2400, "SegHorCenter": 960, "SegVer": 520}]),
            [
                ":1: settings[0].IndexHorMax = 2400 is out of range; "
                "use a whole number from 0 to 2399 columns of 0.05 deg",
                ":1: settings[0].SegHorCenter = 960 is out of range; use a whole number from 0 to 959 points",
                ":1: settings[0].SegVer = 520 is out of range; use a whole number from 0 to 519 layers",
            ],
        ),
        ("[" * 100_000, [": lists or objects are nested too deeply; write it flatter"]),
        ("[" + "9" * 5000 + "]", None),
        (b"[\n\xff]", [":2: byte 0xFF is not UTF-8; save it as UTF-8"]),
    ],
)
def test_faults(tmp_path: Path, text: str | bytes, messages: list[str] | None) -> None:
    found = faults(tmp_path, text)
    if messages is None:
        assert len(found) == 1
    else:
        assert found == messages


def test_what_is_out_of_range_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    with pytest.raises(LidarcheckError, match="SegVer = 600 is out of range"):
        save_settings(Settings("horizontal", (Setting(20.0, 0, 1, 2, 600),)), path)
    with pytest.raises(LidarcheckError, match="stands twice"):
        save_settings(Settings("horizontal", (Setting(20.0, 0, 1, 2, 3), Setting(20.0, 0, 1, 2, 3))), path)
    assert not path.exists()


VERTICAL_ENTRIES = st.lists(
    st.builds(
        lambda distance, rows, center, across, extra: Setting(distance, min(rows), max(rows), center, across, extra),
        st.floats(0, 300),
        st.tuples(st.integers(0, 1559), st.integers(0, 1559)),
        st.integers(0, 519),
        st.integers(0, 959),
        st.dictionaries(st.text(st.characters(codec="utf-8")), st.none() | st.floats(0, 1) | st.text(max_size=3)),
    ),
    unique_by=lambda entry: entry.distance_m,
    max_size=4,
)


@settings(max_examples=examples(80), deadline=None)
@given(entries=VERTICAL_ENTRIES)
def test_what_is_saved_loads_as_the_same_settings(
    tmp_path_factory: pytest.TempPathFactory, entries: list[Setting]
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.json"
    before = Settings("vertical", tuple(entries))
    save_settings(before, path)
    after = load_settings(path, "vertical")
    assert after == before
    for old, new in zip(before.entries, after.entries, strict=True):
        known = {"Distance", "IndexVerMin", "IndexVerMax", "SegVerCenter", "SegHor"}
        assert {k: v for k, v in new.source.items() if k not in known} == {
            k: v for k, v in old.source.items() if k not in known
        }


def all_paths(value: Any, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    entries: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, entry in entries for found in [(*path, key), *all_paths(entry, (*path, key))]]


@settings(max_examples=examples(100), deadline=None)
@given(
    document=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
        max_leaves=12,
    ),
    indent=st.sampled_from([None, 0, 2]),
)
def test_every_json_key_has_its_line(document: Any, indent: int | None) -> None:
    text = json.dumps(document, indent=indent)
    found, repeated = locate_json(text)
    assert set(found) == set(all_paths(json.loads(text)))
    assert repeated == []
    lines = text.split("\n")
    for path, line in found.items():
        if isinstance(path[-1], str):
            assert json.dumps(path[-1]) in lines[line - 1]


def test_repeated_json_keys_are_found() -> None:
    found, repeated = locate_json('{"a": 1,\n"a": {"b": 1,\n "\\u0062": 2}}')
    assert found == {("a",): 1, ("a", "b"): 2}
    assert repeated == [(("a",), 2), (("a", "b"), 3)]


@settings(max_examples=examples(250), deadline=None)
@given(
    edits=st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), max_size=3),
    cut=st.none() | st.integers(0, len(GOOD)),
)
def test_a_damaged_file_is_read_or_refused_in_single_lines(
    tmp_path_factory: pytest.TempPathFactory, edits: list[tuple[int, int]], cut: int | None
) -> None:
    content = bytearray(GOOD.encode())
    for position, byte in edits:
        content[position] = byte
    path = tmp_path_factory.getbasetemp() / "damaged.json"
    path.write_bytes(bytes(content)[:cut])
    try:
        loaded = load_settings(path)
    except LidarcheckError as error:
        for line in error.lines():
            assert re.match(rf"error: {re.escape(str(path))}(:\d+)?: .+; .+", line)
            assert line.isprintable()
    else:
        save_settings(loaded, path.with_suffix(".out"))
        assert path.with_suffix(".out").read_bytes() == path.read_bytes()
