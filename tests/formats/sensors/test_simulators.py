"""What simulators' files say of their lidars: Isaac, HELIOS++, SDF, CARLA, OSI."""

import copy
import json
import math
import re

import numpy as np
import pytest

from lidarcheck.errors import InputError, UsageError
from sensor_import_kit import ALTITUDES, carla, helios, imported, isaac, osi, positions, sdf, sensor, usda, written


def refusal(tmp_path, name, content, kind=InputError, **given):
    file = written(tmp_path, name, content)
    with pytest.raises(kind) as caught:
        imported(file, **given)
    [line] = caught.value.lines()
    assert line.startswith(f"error: {file}")
    return line


def test_isaac_rotary(tmp_path):
    found = imported(written(tmp_path, "i.json", isaac()))
    own = sensor(found)
    assert (own.name, own.frame_rate_hz, own.max_echoes, own.beams.points) == ("Rotary", 10, 2, 720)
    assert own.beams.channels.elevation_deg == tuple(reversed(ALTITUDES))  # by channelId
    assert own.beams.channels.fire_time_us[0] == pytest.approx(7 * 1.512)
    assert own.beams.channels.side_m[0] == 0.02
    assert (own.min_range_m, own.max_range_m, own.range_resolution_m, own.min_separation_m) == (0.3, 120, 0.004, 0.4)
    assert (own.range_floor_m, own.pulse_fwhm_ns) == (0.02, 6)
    # S - 1.2816 sigma = 5.5 sigma at 80 m of 10 %
    assert own.signal_at_1m == pytest.approx((5.5 + 1.28155) * 80**2 / 0.1, rel=1e-5)
    assert any("azimuthErrorStd = 0.025" in remark for remark in found.remarks)
    assert own.sweep.direction == "right"


@pytest.mark.parametrize(("sense", "direction"), [("CW", "right"), ("CCW", "left"), (None, "right")])
def test_isaac_turns_as_it_says(tmp_path, sense, direction):
    document = isaac()
    document["profile"]["rotationDirection"] = sense
    found = imported(written(tmp_path, "i.json", document))
    assert sensor(found).sweep.direction == direction
    assert any("no rotationDirection" in remark for remark in found.remarks) == (sense is None)


def test_isaac_of_several_states_is_a_table_of_the_same_beams(tmp_path):
    document = isaac()
    del document["profile"]["emitterStates"][0]["channelId"]
    one = sensor(imported(written(tmp_path, "one.json", document)))
    document["profile"]["emitterStates"] *= 3
    two = sensor(imported(written(tmp_path, "two.json", document)))
    layer, point, range_m = [0, 3, 7, 7], [0, 100, 500, 719], [5.0, 10.0, 50.0, 99.0]
    off = one.beams.channels.fire_time_us  # a table has no fire time in its azimuth
    turned = [math.radians(-3600 * off[at] * 1e-6) for at in layer]
    a, b = positions(one, layer, point, range_m), positions(two, layer, point, range_m)
    cos, sin = np.cos(turned), np.sin(turned)
    b = np.stack([b[:, 0] * cos - b[:, 1] * sin, b[:, 0] * sin + b[:, 1] * cos, b[:, 2]], axis=-1)
    assert np.abs(a - b).max() < 1e-9
    assert np.allclose(one.beams.fire_time_s(np.array(layer), np.array(point)),
                       two.beams.fire_time_s(np.array(layer), np.array(point)), atol=1e-12)  # fmt: skip


def test_isaac_solid_state_fills_its_lines(tmp_path):
    document = isaac()
    document["profile"] |= {"scanType": "solidState", "numRaysPerLine": [5, 3]}
    document["profile"]["emitterStates"] *= 2
    own = sensor(imported(written(tmp_path, "i.json", document)))
    assert (own.beams.layers, own.beams.points) == (2, 10)
    assert own.beams.angles_deg([0, 1, 1], [5, 0, 3])[0].tolist() == [ALTITUDES[0], ALTITUDES[5], ALTITUDES[5]]
    document["profile"]["numRaysPerLine"] = [5, 4]
    assert "numRaysPerLine says 9 rays" in refusal(tmp_path, "i.json", document)


def test_isaac_of_usd_is_that_of_json(tmp_path):
    text, attributes = usda(), {}
    for name, value in re.findall(r"(omni:sensor:\S+) = (.*)", text):
        attributes[name] = json.loads(value)
    by_text = imported(written(tmp_path, "f.json", text))
    by_json = imported(written(tmp_path, "f.json", {"name": "Rotary", **attributes}))
    assert by_text == by_json == imported(written(tmp_path, "f.json", isaac()))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: p.pop("emitterStates"), "profile.emitterStates is missing"),
        (lambda p: p["emitterStates"][0].pop("elevationDeg"), "elevationDeg is missing"),
        (lambda p: p["emitterStates"][0]["azimuthDeg"].pop(), "has 7 numbers, 8 are needed"),
        (lambda p: p["emitterStates"][0].update(elevationDeg=[a / 57.3 for a in ALTITUDES]), "look like radians"),
        (lambda p: p["emitterStates"][0].update(channelId=[1] * 8), "names a channel twice"),
        (lambda p: p.update(scanType="mirror"), "neither rotary nor solidState"),
        (lambda p: p.pop("scanRateBaseHz"), "scanRateBaseHz is missing"),
        (lambda p: p.update(rotationDirection="up"), "neither CW nor CCW"),
        (lambda p: p.update(farRangeM="far"), "not a number"),
    ],
)
def test_isaac_that_is_damaged(tmp_path, change, said):
    document = copy.deepcopy(isaac())
    change(document["profile"])
    assert said in refusal(tmp_path, "i.json", document)


def test_helios_channels(tmp_path):
    own = sensor(imported(written(tmp_path, "h.xml", helios()), model="turning"))
    assert own.beams.channels.elevation_deg == tuple(ALTITUDES)
    assert (own.frame_rate_hz, own.beams.points, own.max_echoes) == (20, 900, 2)
    assert (own.range_floor_m, own.pulse_fwhm_ns, own.max_range_m) == (0.03, 4, 100)
    assert own.footprint_deg == pytest.approx((math.degrees(0.0007),) * 2)
    # HELIOS looks along Y with X to the right: (x, y, z) is (y, -x, z) here
    xyz = positions(own, [4], [0], [10.0])[0]
    elevation = math.radians(ALTITUDES[4])
    assert xyz == pytest.approx([0.02 + 10 * math.cos(elevation), -0.01, 0.03 + 10 * math.sin(elevation)], abs=1e-9)


def test_helios_of_another_rate_has_other_columns(tmp_path):
    own = sensor(imported(written(tmp_path, "h.xml", helios()), model="turning", rate_hz=7.0))
    assert own.beams.step_deg == pytest.approx(360 * 7 / 18000)
    assert not own.beams.repeats


def test_helios_asks_which_scanner_and_for_a_pattern(tmp_path):
    assert "choose one: --model turning | risley" in refusal(tmp_path, "h.xml", helios(), UsageError)
    assert "use turning" in refusal(tmp_path, "h.xml", helios(), UsageError, model="turnig")
    line = refusal(tmp_path, "h.xml", helios(), model="risley")
    assert "the beams of Risley (risley optics) follow from a survey's settings" in line
    assert "--pattern FILE" in line


def test_helios_takes_a_pattern(tmp_path):
    pattern = written(tmp_path, "p.csv", "Layer,Point,elevation_deg,azimuth_deg,time_s\n0,0,1,2,0\n0,1,3,4,0.001\n")
    own = sensor(imported(written(tmp_path, "h.xml", helios()), model="risley", pattern=pattern, rate_hz=10.0))
    assert own.beams.angles_deg([0, 0], [0, 1])[1].tolist() == [2, 4]
    for text, said in (("Layer,Point,elevation_deg\n0,0,1\n", "the column azimuth_deg is missing"),
                       ("Layer,Point,elevation_deg,azimuth_deg\n0,0,1,2\n0,0,1,3\n", "stands twice"),
                       ("Layer,Point,elevation_deg,azimuth_deg\n0,0,99,2\n", "beyond 90 deg")):  # fmt: skip
        bad = written(tmp_path, "bad.csv", text)
        with pytest.raises(InputError, match=said) as caught:
            imported(tmp_path / "h.xml", model="risley", pattern=bad)
        assert str(caught.value).startswith(f"error: {bad}")


def test_sdf_is_a_grid_with_both_ends(tmp_path):
    own = sensor(imported(written(tmp_path, "l.sdf", sdf())))
    assert (own.name, own.beams.layers, own.beams.points, own.frame_rate_hz) == ("front", 16, 640, 10)
    elevation, azimuth = own.beams.angles_deg([0, 15], [0, 639])
    assert azimuth == pytest.approx([math.degrees(-1.2), math.degrees(1.2)])
    assert elevation == pytest.approx([math.degrees(-0.26), math.degrees(0.26)])
    assert (own.range_floor_m, own.range_offset_m, own.noise, own.range_resolution_m) == (0.02, 0.01, 0, 0.01)


def test_sdf_of_one_row_and_as_urdf(tmp_path):
    text = re.sub("<vertical>.*</vertical>", "", sdf()).replace("lidar>", "ray>").replace("sdf", "robot")
    own = sensor(imported(written(tmp_path, "l.urdf", text)))
    assert (own.beams.layers, own.beams.points) == (1, 640)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<resolution>1</resolution><min_angle>-1.2", "<resolution>2</resolution><min_angle>-1.2", "interpolates"),
        ("-1.2", "-60", "look like degrees"),
        ("<max_angle>1.2", "<max_angle>${pi/2}", "expand the macros first"),
        ("<max_angle>1.2", "<max_angle>-2", "put the smaller one first"),
        ("<samples>640</samples>", "", "<horizontal/samples> is missing"),
        ("640", "6.5", "is no whole number"),
        ("640", "99999999", "is out of range"),
        ("</sensor>", "</sensor><sensor name='b'><ray><scan/></ray></sensor>", "choose one: --model front | b"),
        ("10</update_rate>", "nan</update_rate>", "is no number"),
    ],
)
def test_sdf_that_is_damaged(tmp_path, old, new, said):
    assert said in refusal(tmp_path, "l.sdf", sdf().replace(old, new), (InputError, UsageError))


def test_carla_is_the_worked_example(tmp_path):
    found = imported(written(tmp_path, "c.json", carla()))
    own = sensor(found)
    assert (own.handedness, own.sweep.order, own.beams.layers, own.beams.points) == ("left", "flash", 32, 175)
    elevation, azimuth = own.beams.angles_deg([0, 31], [0, 1])
    assert elevation == pytest.approx([10, -30])
    assert azimuth == pytest.approx([0, -360 / 175])
    assert (own.max_range_m, own.range_floor_m, own.noise, own.threshold, own.edge_factor) == (10, 0.02, 0, 0, 0)
    assert own.features[0].numbers["per_m"] == 0.004
    assert sum("effect dropout" in remark for remark in found.remarks) == 3


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"range": 5000.0}, "looks like centimetres"),
        ({"upper_fov": -40}, "is not above lower_fov"),
        ({"channels": None}, "channels is missing"),
        ({"channels": 1.5}, "no whole number"),
        ({"points_per_second": 10}, "points a turn and channel"),
    ],
)
def test_carla_that_is_damaged(tmp_path, change, said):
    document = carla()["attributes"] | change  # also without the blueprint around it
    assert said in refusal(tmp_path, "c.json", document)


def test_osi_directions_are_rows_of_a_table(tmp_path):
    for document in (osi(), {"lidarSensorViewConfiguration": [osi()]}):
        own = sensor(imported(written(tmp_path, "o.json", document)))
        assert own.frame_rate_hz == pytest.approx(20)
        elevation, azimuth = own.beams.angles_deg([0] * 3, [0, 5, 11])
        assert elevation == pytest.approx([-5, 0, 5])
        assert azimuth == pytest.approx([10, 5, -5])
        assert own.beams.fire_time_s([0], [3]) == pytest.approx([0.0003])


def test_osi_without_directions_is_a_grid(tmp_path):
    document = osi() | {"number_of_rays_horizontal": "8", "number_of_rays_vertical": 5, "field_of_view_vertical": 0.2}
    del document["directions"], document["timings"], document["fieldOfViewVertical"]
    own = sensor(imported(written(tmp_path, "o.json", document)))
    assert (own.beams.layers, own.beams.points) == (5, 8)
    elevation, azimuth = own.beams.angles_deg([0, 4], [0, 7])
    assert elevation == pytest.approx([math.degrees(-0.1), math.degrees(0.1)])
    assert azimuth == pytest.approx([math.degrees(-0.175), math.degrees(0.175)])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["directions"].pop(), "num_of_pixels = 12, there are 11 directions"),
        (lambda d: d["timings"].pop(), "timings has 11 numbers, 12 are needed"),
        (lambda d: d["directions"][4].update(x=0.5), "directions[4] has the length"),
        (lambda d: d["directions"].__setitem__(2, "up"), "directions[2] has the length 0"),
        (lambda d: d.update(directions=[], numberOfRaysHorizontal=4, numberOfRaysVertical=4, fieldOfViewHorizontal=60),
         "look like degrees"),
        (lambda d: d.update(timings=[1e9] * 12), "timings of 1e+09 to 1e+09 us"),
    ],
)  # fmt: skip
def test_osi_that_is_damaged(tmp_path, change, said):
    document = osi()
    change(document)
    said_line = refusal(tmp_path, "o.json", document)
    assert said in said_line or said.replace("look like", "looks like") in said_line
