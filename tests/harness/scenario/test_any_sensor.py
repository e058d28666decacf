"""Shapes of scenarios before other sensors: planes are met from where beams begin, and spans are the sensor's own."""

import numpy as np
import pytest

from lidarcheck.errors import ConfigError
from lidarcheck.harness.scenario.scenario import load_scenario
from lidarcheck.harness.scenario.shapes import Ground, Panels, Surface, Wall, lay_beams
from lidarcheck.sensor import sensor_of, shipped

HEAD = 'description = "d"\n[model]\nvariant = "{}"\n[model.materials.1]\nreflectance = 0.5\n'
BEAMS = '[[beams]]\nshape = "{}"\nlayers = [{}]\npoints = [{}]\nmaterial = 1\n{}\n'
KPIS = '[[kpis]]\nkpi = "detection_probability"\ntolerance = 0.01\n'
AHEAD = (500, 520)
"""Columns of an OS1-128 that look ahead."""


def places(ideal):
    origin = ideal.beams.origins_m(ideal.layer, ideal.point)
    u = ideal.beams.directions(ideal.layer, ideal.point)
    return (0.0 if origin is None else origin) + u * ideal.distance_m[:, None], u


@pytest.mark.parametrize("name", ["OS1-128", "XT32", "HDL-32E"])
def test_planes_are_met_from_where_the_beams_begin(name):
    beams = shipped(name).beams
    points = {"OS1-128": AHEAD, "XT32": (490, 510), "HDL-32E": (0, 20)}[name]
    panels = Panels(shape="panels", layers=(0, 31), points=points, material=1, x_m=(5.0, 8.0))
    at, u = places(lay_beams([panels], beams)[0])
    ideal, _ = lay_beams([panels], beams)
    assert np.abs(at[:, 0] - np.where(ideal.layer < 16, 5.0, 8.0)).max() < 1e-9
    assert np.abs(np.cos(np.deg2rad(ideal.incidence_deg)) - u[:, 0]).max() < 1e-9
    wall = Wall(shape="wall", layers=(0, 31), points=points, material=1, x_m=20.0, turn_deg=30.0)
    at, _ = places(lay_beams([wall], beams)[0])
    assert np.abs(at[:, 0] + np.tan(np.pi / 6) * at[:, 1] - 20.0).max() < 1e-9
    down = {"OS1-128": (80, 127), "XT32": (16, 31), "HDL-32E": (0, 22)}[name]
    ground = Ground(shape="ground", layers=down, points=points, material=1, height_m=1.8)
    ideal, _ = lay_beams([ground], beams)
    at, u = places(ideal)
    assert np.abs(at[:, 2] + 1.8).max() < 1e-9
    assert np.abs(np.cos(np.deg2rad(ideal.incidence_deg)) + u[:, 2]).max() < 1e-9
    assert ideal.beams == beams
    assert set(ideal.extra) == ({"X", "Y", "Z", "Azimuth0"} if name == "HDL-32E" else set())


def test_what_does_not_repeat_brings_its_surface_points():
    beams = shipped("VLP-16").beams
    ideal, _ = lay_beams(
        [Surface(shape="surface", layers=(0, 3), points=(7, 9), material=1, range_m=(4.0, 9.0))], beams
    )
    at, _ = places(ideal)
    assert np.abs(np.column_stack([ideal.extra[name] for name in "XYZ"]) - at).max() < 1e-12
    assert set(ideal.extra["Azimuth0"]) == {0.0}


def faults(tmp_path, text):
    file = tmp_path / "one.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_scenario(file)
    return [(fault.line, fault.what, fault.fix) for fault in caught.value.faults]


@pytest.mark.parametrize(
    ("variant", "beams", "line", "says"),
    [
        ("VLP-16", ("surface", "0, 16", "0, 9", "range_m = [5, 9]"), 8, "layers = [0, 16] is out of range"),
        ("VLP-16", ("surface", "0, 9", "0, 1809", "range_m = [5, 9]"), 9, "points = [0, 1809] is out of range"),
        (
            "XT32",
            ("panels", "0, 9", "1500, 1509", "x_m = [5]"),
            6,
            "beams[0]: some of these beams look past the panels",
        ),
        ("XT32", ("ground", "14, 20", "0, 9", "height_m = 2"), 6, "layer 15 looks above the horizon"),
        ("SLIM", ("surface", "0, 520", "0, 9", "range_m = [5, 9]"), 8, "layers = [0, 520] is out of range"),
    ],
)
def test_a_shape_that_the_sensor_cannot_see_is_refused_with_its_line(tmp_path, variant, beams, line, says):
    ((at, what, fix),) = faults(tmp_path, HEAD.format(variant) + BEAMS.format(*beams) + KPIS)
    assert at == line
    assert says in what
    assert fix


def test_a_kpi_of_layers_that_the_sensor_lacks_is_refused_with_its_line(tmp_path):
    text = HEAD.format("VLP-16") + BEAMS.format("surface", "0, 9", "0, 9", "range_m = [5, 9]") + KPIS
    found = faults(tmp_path, text + "layers = [3, 40]\n")
    assert [(line, what) for line, what, _ in found] == [(15, "layers = [3, 40] is out of range")]


def test_a_table_with_lines_of_unequal_length_has_no_beam_beyond_their_ends():
    document = {
        "name": "t", "detector": "linear", "frame_rate_hz": 10, "linear": {"signal_at_1m": 1e5},
        "beams": {"kind": "table", "file": "t.csv"}, "sweep": {"order": "table"},
    }  # fmt: skip
    rows = {"Layer": [0, 0, 1], "Point": [0, 1, 0], "elevation_deg": [1.0, 1.0, 2.0], "azimuth_deg": [0.0, 1.0, 0.0]}
    beams = sensor_of(document, columns=lambda _name: {k: np.asarray(v) for k, v in rows.items()}).beams
    shape = Surface(shape="surface", layers=(0, 1), points=(0, 1), material=1, range_m=(4.0, 9.0))
    assert shape.fault(beams).startswith("the sensor has no beam of Layer 1, Point 1; ")
    assert not Surface(shape="surface", layers=(0, 1), points=(0, 0), material=1, range_m=(4.0, 9.0)).fault(beams)


def test_a_scene_is_cast_along_the_models_beams(tmp_path):
    scene = (
        '[[scene.objects]]\nshape = "panel"\nposition_m = [9.0, 0.0, 0.0]\nwidth_m = 4\nheight_m = 2\nmaterial = 1\n'
        "[sampling]\npoints = [500, 520]\n"
    )
    file = tmp_path / "one.toml"
    file.write_text(HEAD.format("OS1-128") + scene + KPIS, encoding="utf-8")
    first = load_scenario(file)
    assert first.ideal.beams == shipped("OS1-128").beams
    assert len(first.ideal) == 128 * 21
    met = first.ideal.distance_m > 0.0
    assert np.abs(places(first.ideal)[0][met, 0] - 9.0).max() < 1e-9
    # A model that reaches less far is held against the same scene, and what it misses shows.
    shorter = HEAD.format("OS1-128").replace("[model.mat", "[model.sensor]\nrange = {max_m = 8}\n[model.mat")
    file.write_text(shorter + scene + KPIS, encoding="utf-8")
    second = load_scenario(file)
    assert second.content_hash == first.content_hash
    assert np.array_equal(second.ideal.distance_m, first.ideal.distance_m)
    assert second.model.sensor.max_range_m == 8.0
