"""Scenario files: the geometry of their shapes, what they refuse, and the ones that the project ships."""

from pathlib import Path

import numpy as np
import pytest

from lidarcheck.errors import ConfigError, InputError, LidarcheckError
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.harness.beams import Incidence, Nothing, Panels, Surface, lay_beams
from lidarcheck.harness.kpi_kinds import KINDS
from lidarcheck.harness.scenario import Scenario, load_scenario
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import azimuth_deg, beam_directions, elevation_deg

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
SHIPPED = sorted(SCENARIOS.glob("*.toml"))

HEAD = """\
description = "a small one"

[model]
variant = "SMART"

[model.materials.1]
reflectance = 0.5
"""
BEAMS = """
[[beams]]
shape = "surface"
layers = [10, 12]
points = [100, 109]
material = 1
range_m = [20.0, 29.0]
"""
KPIS = """
[[kpis]]
kpi = "area_mean"
tolerance = 1.0
"""


def load(directory: Path, text: str) -> Scenario:
    file = directory / "small.toml"
    file.write_text(text, encoding="utf-8")
    return load_scenario(file)


def faults(directory: Path, text: str) -> list[tuple[int | None, str]]:
    with pytest.raises(ConfigError) as caught:
        load(directory, text)
    assert len(caught.value.lines()) == len(caught.value.faults)
    return [(fault.line, fault.what) for fault in caught.value.faults]


def line_of(text: str, part: str) -> int:
    """The line, from 1, where `part` stands last."""
    return text[: text.rindex(part)].count("\n") + 1


# Shapes


def test_surface_sweeps_its_range_over_the_points():
    shape = Surface(shape="surface", layers=(3, 4), points=(7, 11), material=2, range_m=(10.0, 50.0))
    ideal, of_shape = lay_beams([shape])
    assert ideal.layer.tolist() == [3] * 5 + [4] * 5
    assert ideal.point.tolist() == [7, 8, 9, 10, 11] * 2
    np.testing.assert_allclose(ideal.distance_m, [10, 20, 30, 40, 50] * 2)
    assert not ideal.incidence_deg.any()
    assert set(ideal.material_id) == {2}
    assert not of_shape.any()


def test_one_point_takes_the_first_range():
    shape = Surface(shape="surface", layers=(3, 3), points=(7, 7), material=2, range_m=(10.0, 50.0))
    assert lay_beams([shape])[0].distance_m.tolist() == [10.0]


def test_panels_lie_on_their_planes_and_share_the_layers():
    shape = Panels(shape="panels", layers=(0, 519), points=(0, 959), material=1, x_m=(5.0, 40.0))
    ideal, _ = lay_beams([shape])
    x_m = (beam_directions(ideal.layer, ideal.point) * ideal.distance_m[:, None])[:, 0]
    np.testing.assert_allclose(x_m, np.where(ideal.layer < 260, 5.0, 40.0))
    assert ideal.object_id.tolist() == np.where(ideal.layer < 260, 1, 2).tolist()
    theta, phi = np.deg2rad(azimuth_deg(ideal.point)), np.deg2rad(elevation_deg(ideal.layer))
    np.testing.assert_allclose(np.cos(np.deg2rad(ideal.incidence_deg)), np.cos(theta) * np.cos(phi))


def test_incidence_is_swept_at_one_range():
    shape = Incidence(
        shape="incidence", layers=(0, 0), points=(0, 4), material=1, range_m=30.0, incidence_deg=(0.0, 80.0)
    )
    ideal, _ = lay_beams([shape])
    assert set(ideal.distance_m) == {30.0}
    np.testing.assert_allclose(ideal.incidence_deg, [0, 20, 40, 60, 80])


def test_objects_are_numbered_over_all_shapes_and_can_be_set():
    nothing = Nothing(shape="nothing", layers=(0, 0), points=(0, 0))
    panels = Panels(shape="panels", layers=(1, 2), points=(0, 0), material=1, x_m=(5.0, 6.0))
    own = Nothing(shape="nothing", layers=(3, 3), points=(0, 0), object=9)
    last = Nothing(shape="nothing", layers=(4, 4), points=(0, 0))
    ideal, of_shape = lay_beams([nothing, panels, own, last])
    assert ideal.object_id.tolist() == [1, 2, 3, 9, 10]
    assert of_shape.tolist() == [0, 1, 1, 2, 3]
    assert ideal.distance_m[0] == 0.0


# Reading


def test_a_scenario_with_an_inline_model(tmp_path):
    scenario = load(tmp_path, HEAD + BEAMS + KPIS)
    assert scenario.name == "small"
    assert scenario.description == "a small one"
    assert scenario.model.sensor.variant == "SMART"
    assert scenario.frames == 1
    assert len(scenario.ideal) == 30
    (kpi,) = scenario.kpis
    assert (kpi.name, kpi.kind, kpi.unit, kpi.direction) == ("area_mean", "mean", "counts", "target")
    assert (kpi.tolerance, kpi.low, kpi.high, kpi.feature) == (1.0, None, None, None)


def test_a_model_file_is_found_beside_the_scenario(tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models/m.toml").write_text('variant = "SLIM"\n[materials.1]\nreflectance = 0.5\n')
    scenario = load(tmp_path, 'description = "d"\nmodel = "models/m.toml"\n' + BEAMS + KPIS)
    assert scenario.model.sensor.variant == "SLIM"


def test_default_names_tell_selections_apart(tmp_path):
    more = """
[[kpis]]
kpi = "detection_probability"
object = 1
range_m = [20.0, 25.5]
window_m = 1.0
tolerance = 0.01
low = 0.9

[[kpis]]
kpi = "area_distance"
material = [1, 2]
tolerance = 3
"""
    _, detection, distance = load(tmp_path, HEAD + BEAMS + KPIS + more).kpis
    assert detection.name == "detection_probability.object_1.20_25p5m.within_1m"
    assert (detection.kind, detection.direction, detection.low) == ("proportion", "target", 0.9)
    assert (distance.name, distance.kind) == ("area_distance.material_1_2", "distance")
    assert distance.feature == distance.name


def test_the_hash_covers_beams_and_kpis_but_not_words_and_model(tmp_path):
    text = HEAD + BEAMS + KPIS
    same = load(tmp_path, text).content_hash
    for other in (text.replace("a small one", "another"), "# why\n" + text, text.replace("SMART", "SLIM")):
        assert load(tmp_path, other).content_hash == same
    changes = [
        ("29.0", "28.0"),
        ("12]", "13]"),
        ("tolerance = 1.0", "tolerance = 2.0"),
        ("area_mean", "peak_mean"),
        ("material = 1\n", "material = 1\nobject = 4\n"),
    ]
    for old, new in changes:
        assert load(tmp_path, text.replace(old, new)).content_hash != same


def test_an_ideal_file_in_place_of_shapes(tmp_path):
    n = 6
    ideal = IdealScan(np.arange(n), np.zeros(n), np.full(n, 10.0), np.ones(n), np.zeros(n))
    save_ideal(ideal, tmp_path / "ideal.csv")
    text = 'ideal = "ideal.csv"\n' + HEAD + KPIS
    scenario = load(tmp_path, text)
    assert scenario.ideal.layer.tolist() == list(range(n))
    assert faults(tmp_path, text + "object = 1\n") == [
        (line_of(text, "[[kpis]]"), "object is asked for, but the ideal scan has no ObjectID")
    ]


def test_a_measured_file_makes_distances_means(tmp_path):
    text = 'measured = "measured.csv"\n' + HEAD + BEAMS + KPIS.replace("area_mean", "area_distance")
    layer, point = np.array([10, 11], dtype=np.int32), np.array([100, 100], dtype=np.int32)
    save_scan(
        Scan.from_beams(layer, point, np.array([20.0, 20.1]), area=np.array([5.0, 7.0])), tmp_path / "measured.csv"
    )
    scenario = load(tmp_path, text)
    assert scenario.kpis[0].kind == "mean"
    assert scenario.kpis[0].feature is None
    assert scenario.asked[0].measured.tolist() == [5.0, 7.0]
    save_scan(Scan.from_beams(layer + 90, point, np.array([20.0, 20.1])), tmp_path / "measured.csv")
    (fault,) = faults(tmp_path, text)
    assert fault[0] == 1
    assert "Layer 100, Point 100" in fault[1]


def test_other_measured_echoes_are_another_scenario(tmp_path):
    text = 'measured = "measured.csv"\n' + HEAD + BEAMS + KPIS.replace("area_mean", "area_distance")
    layer, point = np.array([10, 11], dtype=np.int32), np.array([100, 100], dtype=np.int32)

    def content_hash(area: list[float]) -> str:
        echoes = Scan.from_beams(layer, point, np.array([20.0, 20.1]), area=np.array(area))
        save_scan(echoes, tmp_path / "measured.csv")
        return load(tmp_path, text).content_hash

    assert content_hash([5.0, 7.0]) == content_hash([5.0, 7.0]) != content_hash([5.0, 7.5])


# Faults


def test_all_faults_of_a_file_come_at_once_with_their_lines(tmp_path):
    text = HEAD.replace("description", "descripton") + BEAMS.replace("[10, 12]", "[12, 10]").replace("29.0", "-1.0")
    text += KPIS.replace("area_mean", "area_meen").replace("1.0", "0.0")
    found = faults(tmp_path, text)
    assert [line for line, _ in found if line] == sorted(line for line, _ in found if line)
    words = "\n".join(f"{line} {what}" for line, what in found)
    for part in ("descripton", "layers = ", "range_m = ", 'kpi = "area_meen"', "tolerance = "):
        assert f"{line_of(text, part)} " in words
    assert "description is missing" in words


@pytest.mark.parametrize(
    ("old", "new", "at", "says"),
    [
        ('shape = "surface"', 'shape = "surfaces"', "[[beams]]", "surfaces"),
        ("material = 1\n", "material = 7\n", "material = 7", "has material 7, which the model's table lacks"),
        ("29.0]", "400.0]", "[[beams]]", "reaches 400.0 m, the sensor only 300 m"),
        ("points = [100, 109]", "points = [100, 1090]", "points = ", "out of range"),
        ("tolerance = 1.0", "tolerance = 1.0\nmaterial = 3", "[[kpis]]", "selects no beams"),
        ("tolerance = 1.0", "tolerance = 1.0\nrange_m = [5, 3]", "range_m = [5", "lower end is above the upper"),
        ("tolerance = 1.0", "tolerance = 1.0\nlow = 3\nhigh = 2", "[[kpis]]", "low = 3 is above high = 2"),
        ("tolerance = 1.0", "tolerance = 1.0\nobject = true", "object = true", "object = true"),
        ("tolerance = 1.0", "tolerance = 1.0\nmaterial = []", "material = []", "empty"),
        ("tolerance = 1.0", 'tolerance = 1.0\nname = "a b"', 'name = "a b"', "not valid"),
        ("tolerance = 1.0", 'tolerance = 1.0\ndirection = "up"', "direction", "not a valid choice"),
        ("tolerance = 1.0", "tolerance = nan", "tolerance", "not a finite number"),
        (KPIS, KPIS + KPIS, "[[kpis]]", "two KPIs"),
        (BEAMS, BEAMS + BEAMS, "[[beams]]", "beams[1] shares Layer 10, Point 100 with beams[0]"),
        (BEAMS, "", "description", "no beams"),
        (HEAD, 'frames = 0\nmodel = "none.toml"\ndescription = "d"\n', "frames = 0", "out of range"),
        (HEAD, 'model = "none.toml"\ndescription = "d"\n', "model = ", 'model = "none.toml" is not a file'),
        (HEAD, f'model = "{"x" * 3000}"\ndescription = "d"\n', "model = ", "is not a file"),
        ('variant = "SMART"', 'variant = "SMALL"', "variant", "not a valid choice"),
        ("description =", 'ideal = "a"\ndescription =', "description", "ideal stands beside"),
        ("reflectance = 0.5", "reflectance = 1.5", "reflectance", "out of range"),
    ],
)
def test_a_fault_names_its_line(tmp_path, old, new, at, says):
    good = HEAD + BEAMS + KPIS
    text = good.replace(old, new)
    assert text != good
    (fault,) = faults(tmp_path, text)
    assert says in fault[1]
    whole_document = says in ("no beams", "ideal stands beside")
    assert fault[0] == (1 if whole_document else line_of(text, at))


def test_a_fix_is_in_words(tmp_path):
    path = tmp_path / "one.toml"
    text = HEAD + BEAMS.replace("[10, 12]", "[240]") + KPIS + 'name = ""\n'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    said = str(caught.value)
    assert "layers = [240]: 1 entry; write [first, last], both included" in said
    assert 'name = "" is not valid; use a name of letters, digits, _, . and -' in said


def test_a_surface_kpi_on_nothing_is_refused(tmp_path):
    nothing = '\n[[beams]]\nshape = "nothing"\nlayers = [0, 1]\npoints = [0, 1]\n'
    (fault,) = faults(tmp_path, HEAD + nothing + KPIS)
    assert "no selected beam meets one" in fault[1]
    alarms = KPIS.replace("area_mean", "false_alarms_per_beam")
    assert load(tmp_path, HEAD + nothing + alarms).kpis[0].name == "false_alarms_per_beam"


def test_panels_must_share_their_layers_evenly(tmp_path):
    panels = BEAMS.replace("surface", "panels").replace("range_m = [20.0, 29.0]", "x_m = [5.0, 6.0]")
    (fault,) = faults(tmp_path, HEAD + panels + KPIS)
    assert fault[1] == "3 layers cannot be shared evenly by 2 panels"


def test_an_external_model_knows_no_frames(tmp_path):
    external = 'description = "d"\nframes = 2\n[model.external]\ncommand = ["true", "{scan}"]\n'
    (fault,) = faults(tmp_path, external + BEAMS + KPIS)
    assert fault == (2, "frames = 2, but an external model does not know frames")


@pytest.mark.parametrize("text", ["", "x", "[[beams]]", "\0", "description = 1\nmodel = 2\nbeams = 3\nkpis = 4\n"])
def test_rubbish_is_an_error_of_ours(tmp_path, text):
    with pytest.raises(LidarcheckError) as caught:
        load(tmp_path, text)
    assert all(line.startswith("error: ") for line in caught.value.lines())


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml"):
        load_scenario(tmp_path / "none.toml")


# The shipped ones


def test_at_least_twelve_are_shipped_for_both_variants():
    assert len(SHIPPED) >= 12
    variants = [load_scenario(file).model.sensor.variant for file in SHIPPED]
    assert variants.count("SMART") == variants.count("SLIM")


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_shipped_scenario_is_well_formed(file):
    scenario = load_scenario(file)
    assert 1 <= len(scenario.kpis) <= 16
    assert len(scenario.ideal) <= 40_000
    assert not scenario.model.effects
    assert all(asked.kind in KINDS for asked in scenario.asked)
    assert file.read_text(encoding="utf-8").startswith("# ")


def test_the_documentation_names_every_kind_and_shape():
    text = (SCENARIOS.parent / "docs/scenarios.md").read_text(encoding="utf-8")
    for name, kind in KINDS.items():
        assert f"| `{name}` | {kind.meaning} | {kind.unit} | {kind.direction} |" in text
    for shape in ("surface", "panels", "incidence", "nothing"):
        assert f'| `shape = "{shape}"` |' in text


def test_the_documentation_shows_a_scenario_that_works(tmp_path):
    text = (SCENARIOS.parent / "docs/scenarios.md").read_text(encoding="utf-8")
    example = text.split("```toml\n")[1].split("```")[0]
    (tmp_path / "models").mkdir()
    (tmp_path / "models/SMART.toml").write_text((SCENARIOS / "models/SMART.toml").read_text())
    assert len(load(tmp_path, example).kpis) == 3
