"""Hesai's angle and fire-time tables: returns lie where the vendor's own conversion puts them."""

import math

import numpy as np
import pytest

from lidarcheck.errors import InputError, UsageError
from sensor_import_kit import hesai, imported, positions, sensor, written

PLAIN = "Channel,fire time(us)\n" + "".join(f"{n},{6 + 1.512 * n}\n" for n in (3, 1, 2, 8, 7, 6, 5, 4))

AT128 = "Channel,Elevation,Azimuth\n" + "".join(f"{n},{13 - 0.2 * n:.2f},2.4\n" for n in range(1, 129))


def vendor_xyz(row, azimuth_deg, range_m):
    """x to the right angle of y: y looks along azimuth 0, and azimuths turn clockwise."""
    elevation, own = math.radians(row[0]), math.radians(azimuth_deg + row[1])
    flat = range_m * math.cos(elevation)
    return [flat * math.sin(own), flat * math.cos(own), range_m * math.sin(elevation)]


def test_returns_lie_where_the_vendor_puts_them(tmp_path):
    own = sensor(imported(written(tmp_path, "XT8.csv", hesai()), rate_hz=10.0, azimuth_step_deg=0.18))
    rows = [tuple(map(float, line.split(",")[1:])) for line in hesai().splitlines()[1:]]
    layer, point = (axis.ravel() for axis in np.meshgrid(range(8), [0, 1, 700, 1999], indexing="ij"))
    range_m = np.linspace(0.5, 120, len(layer))
    expected = [vendor_xyz(rows[n], 0.18 * c, r) for n, c, r in zip(layer, point, range_m, strict=True)]
    assert np.abs(positions(own, layer, point, range_m) - expected).max() < 1e-9
    assert not own.sweep.fire_time_in_azimuth


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + hesai().replace("\n", "\r\n"),
        hesai() + "9f86d081884c7d659a2feaa0c55ad015\n",
        hesai() + "4711\n\n",
        hesai().replace("Channel", "Laser id"),
        hesai().replace("Channel,Elevation,Azimuth", "LaserID, Elevation, Azimuth"),
        "\n".join([*hesai().splitlines()[:1], *reversed(hesai().splitlines()[1:])]) + "\n",
    ],
    ids=["BOM and CRLF", "hash", "number", "Laser id", "LaserID", "other order"],
)
def test_all_spellings_of_a_table_are_one(tmp_path, text):
    file = written(tmp_path, "a.csv", text)
    assert imported(file) == imported(written(tmp_path, "a.csv", hesai()))


def test_the_law_of_intensity_is_the_models(tmp_path):
    [feature] = sensor(imported(written(tmp_path, "PandarXT-8.csv", hesai()))).features
    assert feature.numbers == {"knee": 100, "above": "linear"}
    found = imported(written(tmp_path, "Pandar40P.csv", hesai()))
    assert "features" not in found.document
    assert "features.INTENSITY" in {entry.key for entry in found.lacking}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.replace("\n3,", "\n9,"), "channel 3 is missing"),
        (lambda t: t.replace("\n3,", "\n2,"), ":4: channel 2 stands twice"),
        (lambda t: t.replace("\n3,3.250", "\n3,"), ":4: the elevation is"),
        (lambda t: t.replace("\n3,3.250", "\n3,nan"), ":4: the elevation is"),
        (lambda t: t.replace("\n3,3.250", "\n3,1_0"), ":4: the elevation is"),
        (lambda t: t.replace("\n3,3.250", "\nx,3.25"), ":4: the channel is"),
        (lambda t: t.replace("\n3,3.250", "\n3,93.25"), "beyond 90"),
        (lambda t: t.partition("\n")[0] + "\n", "the table has 0 channels"),
        (lambda t: "\n".join(f"{n},{0.1 * n},0" if n else t.split("\n")[0] for n in range(9)), "look like radians"),
    ],
)
def test_a_damaged_table_is_refused_with_its_line(tmp_path, change, said):
    file = written(tmp_path, "a.csv", change(hesai()))
    with pytest.raises(InputError) as caught:
        imported(file)
    [line] = caught.value.lines()
    assert line.startswith(f"error: {file}")
    assert said in line


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("AT128E2X.dat", b"\xee\xff\x01\x05" + bytes(200), "Hesai AT128"),
        ("calibration.dat", b"\xee\xff\x01\x05" + bytes(200), "AT128, ATX, ET25 or FT120"),
        ("ATX.csv", b"EEFF,1,1\nChannel,Elevation,Azimuth\n1,2,3\n", "Hesai ATX"),
        ("PandarAT128.csv", hesai().encode(), "Hesai AT128"),
        ("any.csv", AT128.encode(), "AT128"),
    ],
)  # fmt: skip
def test_models_without_a_turning_head_are_refused_by_name(tmp_path, name, content, said):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(InputError, match="export a point cloud and use `lidarcheck sensor guess`") as caught:
        imported(file)
    assert said in str(caught.value)


def times(tmp_path, text, state=None, channels=8):
    angles = written(tmp_path, "a.csv", hesai(channels))
    found = imported(angles, firetimes=written(tmp_path, "t.csv", text), state=state)
    return found, sensor(found).beams.channels


def test_rows_in_the_order_of_firing_are_keyed_by_channel(tmp_path):
    _, channels = times(tmp_path, PLAIN)
    assert channels.fire_time_us == tuple(round(6 + 1.512 * n, 9) for n in range(1, 9))


@pytest.mark.parametrize(("header", "factor"), [("fire time(us)", 1), ("fire time(\u03bcs)", 1), ("firetime/us", 1),
                                                ("fire time(ns)", 1e-3)])  # fmt: skip
def test_the_header_says_the_unit(tmp_path, header, factor):
    _, channels = times(tmp_path, PLAIN.replace("fire time(us)", header))
    assert channels.fire_time_us[0] == pytest.approx(7.512 * factor)


EVEN_ODD = "Channel,Even_fire time(ns),Odd_fire time(ns)\n"
EVEN_ODD += "".join(f"{n},{520 * n},{540 * n}\n" for n in range(1, 9))
LOOPS = "laser_id,loop0_firetime,loop1_firetime\n" + "".join(f"{n},{2.5 * n},{3.5 * n}\n" for n in range(1, 9))
STATES = "Operational State,0,0,2\nAzimuth State,0,1,0\n" + "".join(
    f"{n},{'-' if n % 2 else n},{n + 0.5},{n + 9}\n" for n in range(1, 9)
)
PAIRS = "Channel,Distance 1 (ns),Distance 2 (ns)\n" + "".join(f"{n},{500 * n},{500 * n + 8}\n" for n in range(1, 9))


@pytest.mark.parametrize(
    ("text", "state", "first"),
    [
        (EVEN_ODD, "even", 0.52),
        (EVEN_ODD, "Odd", 0.54),
        (LOOPS, "loop1", 3.5),
        (STATES, "0,1", 1.5),
        (STATES, "2,0", 10),
        (PAIRS, "distance 2", 0.508),
    ],
)
def test_a_state_is_named_as_its_header_names_it(tmp_path, text, state, first):
    assert times(tmp_path, text, state)[1].fire_time_us[0] == pytest.approx(first)


@pytest.mark.parametrize(
    ("text", "known"),
    [
        (EVEN_ODD, "Even | Odd"),
        (LOOPS, "loop0 | loop1"),
        (STATES, "0,0 | 0,1 | 2,0"),
        (PAIRS, "Distance 1 | Distance 2"),
    ],
)
def test_without_a_state_the_known_ones_are_listed(tmp_path, text, known):
    with pytest.raises(UsageError) as caught:
        times(tmp_path, text)
    assert f"give --state, one of {known}" in str(caught.value)
    with pytest.raises(UsageError, match="--state 7 is none of the file"):
        times(tmp_path, text, "7")


def test_states_that_agree_need_no_name(tmp_path):
    same = "laser_id,loop0_firetime,loop1_firetime\n" + "".join(f"{n},{2.5 * n},{2.5 * n}\n" for n in range(1, 9))
    assert times(tmp_path, same)[1].fire_time_us[1] == 5.0


def test_channels_that_do_not_fire_are_left_out_and_keep_their_rings(tmp_path):
    found, channels = times(tmp_path, STATES, "0,0")
    assert channels.ring == (1, 3, 5, 7)
    assert channels.fire_time_us == (2, 4, 6, 8)
    assert any("4 of 8 channels do not fire" in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PLAIN.replace("\n3,", "\n9,"), "channel 3 of the angle table has no fire time"),
        (PLAIN + "9,20\n", "it has 9 channels, the angle table 8"),
        (PLAIN.replace("\n3,", "\n1,"), "channel 1 stands twice"),
        (PLAIN.replace("7.512", "x"), "the fire time is"),
        (PLAIN.replace("7.512", "9997.512"), "a fire time of 9997.51 us"),
        ("a,b\nc,d\n", "not a table of fire times"),
        (LOOPS.replace("\n3,7.5,10.5", "\n3,7.5"), "the row has 2 cells, the first has 3"),
    ],
)
def test_a_damaged_table_of_times_is_refused(tmp_path, text, said):
    with pytest.raises(InputError) as caught:
        times(tmp_path, text)
    [line] = caught.value.lines()
    assert line.startswith(f"error: {tmp_path / 't.csv'}")
    assert said in line


def test_times_alone_are_no_sensor(tmp_path):
    with pytest.raises(InputError, match="a table of fire times, without angles; name the angle table"):
        imported(written(tmp_path, "t.csv", PLAIN))
