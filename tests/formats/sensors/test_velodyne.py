"""Velodyne's YAML and db.xml: returns lie where the ROS driver's own correction puts them."""

import builtins
import math
import re

import numpy as np
import pytest

from lidarcheck.errors import InputError, UsageError
from sensor_import_kit import imported, positions, sensor, velodyne, veloview, written

yaml = pytest.importorskip("yaml")


def driver_xyz(laser, azimuth, range_m):
    """The driver's correction of one return; `azimuth` of the block, clockwise [rad]."""
    vertical, rot = laser["vert_correction"], laser["rot_correction"]
    v, h = laser["vert_offset_correction"], laser["horiz_offset_correction"]
    in_plane = range_m * math.cos(vertical) - v * math.sin(vertical)
    sin, cos = math.sin(azimuth - rot), math.cos(azimuth - rot)
    x, y = in_plane * sin - h * cos, in_plane * cos + h * sin
    return [y, -x, range_m * math.sin(vertical) + v * math.cos(vertical)]


def lasers_of(text):
    return sorted(yaml.safe_load(text)["lasers"], key=lambda laser: laser["vert_correction"])


@pytest.mark.parametrize("form", ["yaml", "xml"])
def test_returns_lie_where_the_driver_puts_them(tmp_path, form):
    content, name = (velodyne(), "v.yaml") if form == "yaml" else (veloview(), "db.xml")
    own = sensor(imported(written(tmp_path, name, content), rate_hz=10.0, azimuth_step_deg=0.2))
    lasers = lasers_of(velodyne())
    if form == "xml":
        for laser in lasers:
            laser["vert_offset_correction"] = 0.19 + 0.002 * laser["laser_id"]
    layer, point = (axis.ravel() for axis in np.meshgrid(range(8), [0, 1, 450, 1799], indexing="ij"))
    range_m = np.linspace(1.0, 200.0, len(layer))
    expected = [
        driver_xyz(lasers[ring], math.radians(0.2 * c), r) for ring, c, r in zip(layer, point, range_m, strict=True)
    ]
    assert np.abs(positions(own, layer, point, range_m) - expected).max() < 1e-9


def puck():
    """A VLP-16: laser 0 at -15 deg, 1 at 1, 2 at -13, ..."""
    rest = iter([math.radians(-15 + at // 2 * 2 + 16 * (at % 2)) for at in range(16)])
    text = velodyne(
        16, rot_correction=0.0, vert_offset_correction=0.0, horiz_offset_correction=0.0, dist_correction=0.0
    )
    return re.sub(r"vert_correction: [^,]+", lambda _: f"vert_correction: {next(rest)!r}", text)


def test_a_puck_is_told_by_its_lasers(tmp_path):
    found = imported(written(tmp_path, "v.yaml", puck()), rate_hz=20.0)
    own = sensor(found)
    assert own.name == "Velodyne VLP-16"
    assert own.beams.channels.elevation_deg == tuple(range(-15, 16, 2))
    assert own.beams.channels.fire_time_us[:3] == (0.0, 4.608, 9.216)
    assert own.beams.channels.fire_time_us[8] == 2.304
    assert own.beams.step_deg == pytest.approx(-360 * 20 * 55.296e-6)
    assert not own.beams.repeats
    assert own.sweep.fire_time_in_azimuth
    assert [(f.name, f.numbers["knee"], f.low, f.high) for f in own.features] == [("INTENSITY", 100, 5, 250)]


def test_without_a_rate_the_step_is_a_line_to_fill_in(tmp_path):
    found = imported(written(tmp_path, "v.yaml", puck()))
    needed = {entry.key: entry.example for entry in found.lacking if entry.needed}
    assert set(needed) == {"frame_rate_hz", "beams.azimuth_step_deg"}
    assert needed["beams.azimuth_step_deg"] == pytest.approx(0.1990656)
    assert "frame_rate_hz" not in found.document


def test_fire_time_turns_the_beams_of_a_puck(tmp_path):
    own = sensor(imported(written(tmp_path, "v.yaml", puck()), rate_hz=10.0))
    turned = own.beams.angles_deg([8], [0])[1][0]
    assert turned == pytest.approx(-360 * 10 * 2.304e-6)


def test_a_file_of_more_lasers_than_it_says_uses_the_first(tmp_path):
    text = velodyne(8)
    more = "".join(f"- {{laser_id: {n}, vert_correction: 0.0, rot_correction: 0.0}}\n" for n in range(8, 64))
    text = text.replace("num_lasers", more + "num_lasers")
    assert sensor(imported(written(tmp_path, "v.yaml", text))).beams.layers == 8


def test_numbers_without_a_point_are_numbers(tmp_path):
    own = sensor(imported(written(tmp_path, "v.yaml", velodyne(rot_correction="1e-3"))))
    assert own.beams.channels.azimuth_offset_deg[0] == pytest.approx(math.degrees(1e-3))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.replace("laser_id: 3", "laser_id: 2"), "laser 2 stands twice"),
        (lambda t: t.replace("num_lasers: 8", "num_lasers: 9"), "laser 8 of 9 is missing"),
        (lambda t: t.replace("num_lasers: 8", "num_lasers: 4"), "8 lasers have angles, num_lasers says 4"),
        (lambda t: re.sub("vert_correction: -?0", "vert_correction: 9", t), "look like degrees"),
        (lambda t: re.sub("vert_correction: [^,]+", "vert_correction: 0.1", t), "all lasers have the elevation 0.1"),
        (lambda t: t.replace("vert_offset_correction: 0.19,", "vert_offset_correction: 19,"), "looks like cm"),
        (lambda t: t.replace("rot_correction: 0.005", "rot_correction: .inf"), "not a number"),
        (lambda t: t.replace("rot_correction: 0.005", "rot_correction: 1e999"), "not a finite number"),
        (lambda t: t.replace("rot_correction: 0.005", "rot_correction: *a"), "not valid YAML"),
        (lambda t: t.replace("- {laser_id: 0", "- &a {laser_id: 0").replace("num_l", "- *a\nnum_l"), "aliases"),
        (lambda t: t.replace("laser_id: 0", "laser_id: 0, laser_id: 0"), "laser_id stands twice"),
        (
            lambda t: t.replace("rot_correction: 0.005", "rot_correction: !!python/object:os.x 1"),
            "the tag tag:yaml.org,2002:python/object:os.x is not read",
        ),
        (lambda t: t + "lasers: []\n", "lasers stands twice"),
        (lambda t: t + "x: " + "[" * 10_000 + "]" * 10_000, "nested too deeply"),
        (lambda t: t.replace("num_lasers: 8\n", ""), "num_lasers is missing"),
    ],
)
def test_a_damaged_file_is_refused_in_one_line(tmp_path, change, said):
    text = change(velodyne())
    assert text != velodyne()
    file = written(tmp_path, "v.yaml", text)
    with pytest.raises(InputError) as caught:
        imported(file)
    [line] = caught.value.lines()
    assert line.startswith(f"error: {file}")
    assert said in line


def test_an_xml_in_radians_or_metres_is_refused(tmp_path):
    radians = re.sub(r"(?<=<vertCorrection_>)[^<]+", lambda m: repr(math.radians(float(m[0]))), veloview())
    with pytest.raises(InputError, match="look like radians"):
        imported(written(tmp_path, "db.xml", radians))
    with pytest.raises(InputError, match="looks like metres"):
        imported(written(tmp_path, "db.xml", veloview().replace("0.2</distLSB_>", "0.002</distLSB_>")))


def test_lasers_that_are_not_enabled_are_left_out(tmp_path):
    assert sensor(imported(written(tmp_path, "db.xml", veloview(8, 64)))).beams.layers == 8


def test_an_unknown_model_is_no_guess(tmp_path):
    file = written(tmp_path, "v.yaml", velodyne())
    with pytest.raises(UsageError, match="use one of VLP-16"):
        imported(file, model="VLP-16")
    lacking = {entry.key for entry in imported(file).lacking}
    assert {"beams.fire_time_us", "sweep.fire_time_in_azimuth", "features.INTENSITY"} <= lacking


def test_without_the_package_one_line_says_what_to_install(tmp_path, monkeypatch):
    real = builtins.__import__

    def fails(name, *args, **more):
        if name == "yaml":
            raise ImportError(name)
        return real(name, *args, **more)

    monkeypatch.setattr(builtins, "__import__", fails)
    with pytest.raises(
        InputError, match=r"needs the package PyYAML; install PyYAML: pip install 'lidarcheck\[import\]'"
    ):
        imported(written(tmp_path, "v.yaml", velodyne()))
