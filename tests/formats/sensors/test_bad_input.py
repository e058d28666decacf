"""Files that are no calibration, bombs, and words of the user's that a format does not read."""

import json
import re

import pytest

from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.sensors import document_text
from sensor_import_kit import (
    carla,
    helios,
    hesai,
    imported,
    isaac,
    osi,
    ouster,
    sdf,
    sensor,
    usda,
    velodyne,
    veloview,
    written,
)

ALL = {
    "ouster.json": ouster,
    "velodyne.yaml": velodyne,
    "db.xml": veloview,
    "hesai.csv": hesai,
    "isaac.json": isaac,
    "isaac.usda": usda,
    "lidar.sdf": sdf,
    "carla.json": carla,
    "osi.json": osi,
}


@pytest.mark.parametrize("name", ALL)
def test_the_name_of_a_file_says_nothing(tmp_path, name):
    found = imported(written(tmp_path, "a.bin", ALL[name]()))
    assert found.document["beams"]["kind"] in ("grid", "channels", "table")
    sensor(found)


@pytest.mark.parametrize("name", ALL)
def test_every_key_behind_a_hash_is_one_of_the_schema(tmp_path, name):
    """Taking all hashes away, with the values of the examples, gives a sensor that lacks nothing."""
    found = imported(written(tmp_path, name, ALL[name]()))
    text = re.sub(r"^# (?=[A-Za-z0-9_]+ = )", "", document_text(found, table_file="b.csv"), flags=re.MULTILINE)
    import tomllib

    from lidarcheck.formats.sensors import Imported, sensor_of_import

    whole = Imported(tomllib.loads(text), table=found.table)
    assert sensor_of_import(whole, tmp_path).missing == ()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{}", "not a calibration that lidarcheck knows: use one of"),
        ("[1, 2]", "not a calibration that lidarcheck knows"),
        ("[]", "not a calibration that lidarcheck knows"),
        ("<a/>", "not a calibration that lidarcheck knows"),
        ("X Y Z\n1 2 3\n", "not a calibration that lidarcheck knows"),
        ("{", "not valid JSON"),
        ('{"profile": {"scanType": 1}}', "profile.emitterStates is missing"),
        ("<a>", "not valid XML: no element found"),
        ("<a></b>", ":1: not valid XML: mismatched tag"),
        ("lasers: [", "not valid YAML"),
        ("lasers:\n\t- a", "not valid YAML"),
        ("lasers: 3\nnum_lasers: 1", "lasers is a whole number, not a list"),
        ("lasers: [3]\nnum_lasers: 1", "lasers[0] is no table of a laser"),
        ("[" * 10_000 + "]" * 10_000, "nested too deeply"),
        ('{"a":' * 10_000 + "1" + "}" * 10_000, "nested too deeply"),
        ("<a>" * 10_000 + "</a>" * 10_000, "nested too deeply"),
        ('{"beam_intrinsics": 1, "beam_intrinsics": 2}', '"beam_intrinsics" stands twice in one object'),
        ('{"beam_altitude_angles": NaN}', "NaN is not a number"),
        (
            '{"beam_altitude_angles": [1], "beam_azimuth_angles": 7}',
            "beam_azimuth_angles is a whole number, not a list",
        ),
        ('{"beam_intrinsics": []}', "beam_azimuth_angles is missing"),
        ("#usda 1.0\nfloat omni:sensor:Core:farRangeM = @a@\n", ":2: omni:sensor:Core:farRangeM is no number"),
        ("#usda 1.0\n", "profile.emitterStates is missing"),
        (" ", "the file is empty"),
    ],
)
def test_what_is_no_calibration_is_refused_in_one_line(tmp_path, content, said):
    pytest.importorskip("yaml")
    file = written(tmp_path, "f.json", content)
    with pytest.raises(InputError) as caught:
        imported(file)
    [line] = caught.value.lines()
    assert line.startswith(f"error: {file}")
    assert said.replace(": use", "; use") in line


ENTITIES = '<!DOCTYPE a [<!ENTITY x "lol"><!ENTITY y "&x;&x;&x;&x;&x;&x;&x;&x;&x;&x;">]>'


@pytest.mark.parametrize("text", [veloview(), helios(), sdf()])
@pytest.mark.parametrize(
    "head", [ENTITIES, '<!DOCTYPE a SYSTEM "file:///etc/passwd">', '<!DOCTYPE a [<!ENTITY % p SYSTEM "x"> %p;]>']
)
def test_entities_are_never_expanded(tmp_path, text, head):
    declaration, _, rest = text.partition("\n")
    file = written(tmp_path, "f.xml", f"{declaration}\n{head}\n{rest.replace('0.02', '&y;', 1)}")
    with pytest.raises(
        InputError, match=rf"{re.escape(str(file))}:2: the XML has a DOCTYPE: entities are not expanded"
    ):
        imported(file)


def test_a_document_is_utf_8_whatever_it_says_of_itself(tmp_path):
    for encoding in ("UTF-1", "latin-1", "UTF-16"):
        text = veloview().replace("UTF-8", encoding)
        assert imported(written(tmp_path, "f.xml", text)) == imported(written(tmp_path, "f.xml", veloview()))


def test_broken_json_in_which_a_key_stands_twice(tmp_path):
    text = json.dumps(osi(), indent=1).replace('"numOfPixels"', '"directions": 1, "numOfPixels"')
    with pytest.raises(InputError, match=r':[0-9]+: "directions" stands twice in one object; remove one'):
        imported(written(tmp_path, "o.json", text))
    with pytest.raises(InputError, match="not valid JSON: expecting"):
        imported(written(tmp_path, "o.json", text[:-3]))


def test_sizes_are_limited(tmp_path):
    file = tmp_path / "a.json"
    with file.open("wb") as stream:
        stream.write(b"{")
        stream.truncate(20 << 20)
    with pytest.raises(InputError, match="the file has 20971520 bytes; the limit is 8388608 bytes"):
        imported(file)
    pytest.importorskip("yaml")
    with pytest.raises(InputError, match="the limit is 262144 bytes"):
        imported(written(tmp_path, "a.yaml", "lasers:\n" + "- {a: 1}\n" * 200_000))
    many = json.dumps(isaac()).replace('"numberOfEmitters": 8', '"numberOfEmitters": 8e9')
    with pytest.raises(InputError, match="is out of range"):
        imported(written(tmp_path, "i.json", many))


def test_a_turn_of_many_firings_takes_no_memory(tmp_path):
    document = isaac(2)
    document["profile"]["reportRateBaseHz"] = 1e9
    with pytest.raises(InputError, match="beams, a table has at most 1000000"):
        imported(written(tmp_path, "i.json", document))


@pytest.mark.parametrize(
    ("name", "given"),
    [("ouster.json", {"rate_hz": 10.0}), ("carla.json", {"model": "x"}), ("velodyne.yaml", {"state": "even"}),
     ("lidar.sdf", {"azimuth_step_deg": 0.2}), ("hesai.csv", {"pattern": "x"}), ("isaac.usda", {"model": "x"})],
)  # fmt: skip
def test_a_word_that_the_format_does_not_read_is_refused(tmp_path, name, given):
    with pytest.raises(UsageError, match="means nothing for"):
        imported(written(tmp_path, name, ALL[name]()), **given)


def test_a_state_needs_fire_times(tmp_path):
    with pytest.raises(UsageError, match="--state is of a table of fire times"):
        imported(written(tmp_path, "a.csv", hesai()), state="even")


def test_words_from_the_file_drive_nothing(tmp_path):
    meta = ouster()
    meta["sensor_info"] |= {"prod_sn": '\x1b[2J\u202e"\n[x]', "build_rev": "v3.0.1\n\x07"}
    found = imported(written(tmp_path, "m.json", meta))
    text = document_text(found)
    assert text.replace("\n", "").isprintable()
    assert "\n[x]" not in text
