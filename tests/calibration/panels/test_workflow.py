"""Panels: found against a known truth; what is said of them against closed forms and the simulator's own numbers."""

import json
from dataclasses import replace

import numpy as np
import pytest

import panel_halls as ph
from hidden.places import PANEL_10, PANEL_50, PANEL_80
from lidarcheck.beams import Fired
from lidarcheck.calibration.panels.find import find_panels
from lidarcheck.calibration.panels.image import echoes_of, image_of_frames, image_of_ideal
from lidarcheck.calibration.panels.noise import resolution_of, walk_curve
from lidarcheck.calibration.panels.planes import fit_plane, level_of
from lidarcheck.calibration.panels.samples import Sampler
from lidarcheck.calibration.panels.workflow import (
    Arrangement,
    PanelFrame,
    PanelSettings,
    characterise,
    panel_scan,
)
from lidarcheck.cli import main
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.pages.panels import document, page
from lidarcheck.formats import load_ideal, load_scan, save_scan
from lidarcheck.formats.plain import plain
from lidarcheck.formats.recognise import read_table
from lidarcheck.kpi.scenes import same_scene
from lidarcheck.scan import Scan
from places import shared_path
from reference_grid import beam_directions


def measured(hall, hits, variant, seeds, beams=ph.BLOCK):
    return [ph.scan_of(ph.echoes(hits, variant, s, beams, hall.dead_layers), beams) for s in seeds]


def frames(scans):
    return [PanelFrame(f"frame {i}", lambda scan=scan: scan) for i, scan in enumerate(scans)]


@pytest.fixture(scope="session")
def small():
    """A hall with three panels in a small view, six real frames."""
    spots = [
        ph.Spot(12.0, -3.0, 0.0, 0.5, 0.4, PANEL_80),
        ph.Spot(30.0, 0.5, 0.0, 1.0, 0.9, PANEL_50),
        ph.Spot(65.0, 4.0, 0.0, 1.6, 1.5, PANEL_10),
    ]
    hall = ph.Hall(spots, stands=False)
    hits = ph.meets(hall, ph.SMALL)
    return hall, hits, measured(hall, hits, "SMART", range(6), ph.SMALL)


@pytest.fixture(scope="session")
def result(small):
    """Real and simulated frames of the small hall, the second of other seeds and 5 cm farther."""
    hall, hits, scans = small
    other = measured(hall, hits, "SMART", range(50, 54), ph.SMALL)
    far = [replace(s, x_m=s.x_m * k, y_m=s.y_m * k, z_m=s.z_m * k) for s in other for k in [1 + 0.05 / s.range_m]]
    ideal = ph.ideal_of(hits, ph.SMALL)
    return characterise([Arrangement(ideal, frames(scans), frames(far))])


# --- found ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "source"), [(402, "ideal"), (403, "without objects"), (404, "measured")])
def test_all_sixteen_panels_of_a_hall_are_found(seed, source):
    # Halls that nothing was tuned on.
    hall = replace(ph.random_hall(seed), pillars=[])
    hits = ph.meets(hall)
    if source == "measured":
        near = ph.around(hits, len(hall.spots))
        scan = ph.scan_of(ph.echoes(hits, "SMART", seed, dead_layers=hall.dead_layers, only=near))
        image = image_of_frames([echoes_of(scan)])
    else:
        image = image_of_ideal(ph.ideal_of(hits, object_ids=source == "ideal"))
    found, wrong, said = ph.score(hall, hits, find_panels(image, PanelSettings()).panels)
    assert (found, wrong) == (16, 0), said


def test_the_panels_are_where_and_as_large_as_they_are(small):
    hall, hits, scans = small
    for image in (image_of_ideal(ph.ideal_of(hits, ph.SMALL)), image_of_frames([echoes_of(s) for s in scans])):
        found = find_panels(image, PanelSettings())
        assert found.floor.z_m == pytest.approx(hall.floor_m, abs=0.1) if image.ideal else True
        assert len(found.panels) == 3
        for spot, panel in zip(hall.spots, found.panels, strict=True):
            assert panel.range_m == pytest.approx(spot.range_m, abs=0.02 if image.ideal else 0.8)  # walk
            assert panel.azimuth_deg == pytest.approx(spot.azimuth_deg, abs=0.13)
            step_m = spot.range_m * np.deg2rad(0.125)
            assert panel.width_m == pytest.approx(spot.width_m, abs=1.5 * step_m)
            assert panel.height_m == pytest.approx(spot.height_m, abs=1.5 * step_m)


def pair(gap_m, materials, behind_m=0.0):
    apart = 2 * np.rad2deg(np.arctan((1.0 + gap_m) / 2 / 25.0))
    spots = [
        ph.Spot(25.0, 0.0, 0.0, 1.0, 0.9, materials[0]),
        ph.Spot(25.0 + behind_m, apart, 0.0, 1.0, 0.9, materials[1]),
    ]
    return ph.Hall(spots, stands=False)


@pytest.mark.long
@pytest.mark.parametrize(
    ("gap_m", "materials", "behind_m"),
    [(0.15, (PANEL_50, PANEL_50), 0.0), (0.0, (PANEL_10, PANEL_80), 0.0), (0.0, (PANEL_50, PANEL_50), 0.5)],
)
def test_neighbours_are_told_apart_in_measured_points(gap_m, materials, behind_m):
    hall = pair(gap_m, materials, behind_m)
    hits = ph.meets(hall, ph.SMALL)
    image = image_of_frames([echoes_of(s) for s in measured(hall, hits, "SLIM", range(4), ph.SMALL)])
    found, wrong, said = ph.score(hall, hits, find_panels(image, PanelSettings()).panels, ph.SMALL)
    assert (found, wrong) == (2, 0), said


def test_a_dead_layer_parts_no_panel_and_counts_as_not_detected(small):
    hall, hits, _ = small
    dead = replace(hall, dead_layers=(259, 260))
    result = characterise([Arrangement(None, frames(measured(dead, hits, "SMART", range(3), ph.SMALL)))])
    assert len(result.panels) == 3
    for panel, noise in zip(result.panels, result.noise, strict=True):
        lost = np.isin(panel.layer, dead.dead_layers).mean()
        assert lost > 0
        assert noise.measured.detection <= 1 - lost + 1e-9


def test_borders_lose_what_is_asked(small):
    _, hits, _ = small
    image = image_of_ideal(ph.ideal_of(hits, ph.SMALL))
    whole = find_panels(image, PanelSettings(trim_layers=0, trim_points=0)).panels
    cut = find_panels(image, PanelSettings(trim_layers=3, trim_points=2)).panels
    metres = find_panels(image, PanelSettings(trim_layers=0, trim_points=0, trim_m=0.1)).panels
    for a, b, c in zip(whole, cut, metres, strict=True):
        assert len(a.layer) == a.outline_beams
        assert np.ptp(b.layer) == np.ptp(a.layer) - 6
        assert np.ptp(b.point) == np.ptp(a.point) - 4
        assert np.ptp(c.layer) == np.ptp(a.layer) - 2 * np.ceil(0.1 / (a.range_m * np.deg2rad(0.05)))


def test_settings_shift_what_is_a_panel(small):
    _, hits, _ = small
    image = image_of_ideal(ph.ideal_of(hits, ph.SMALL))
    assert len(find_panels(image, PanelSettings(range_m=(20.0, 85.0))).panels) == 2
    small_only = find_panels(image, PanelSettings(size_m=(0.25, 1.2)))
    assert len(small_only.panels) == 2
    assert any("larger than 1.2 m" in reject.why for reject in small_only.rejects)


# --- measured ---------------------------------------------------------------------------------------------------------


def test_detection_counts_what_the_simulator_gave(small, result):
    _, _, scans = small
    for panel, noise in zip(result.panels, result.noise, strict=True):
        beams = set(zip(panel.layer.tolist(), panel.point.tolist(), strict=True))
        hit = 0
        for scan in scans:
            near = np.abs(scan.range_m - panel.range_m) < 1.05
            hit += len(beams & set(zip(scan.layer[near].tolist(), scan.point[near].tolist(), strict=True)))
        assert noise.measured.trials == len(beams) * len(scans)
        assert noise.measured.detected == pytest.approx(hit, abs=2)
        assert noise.measured.detection_low <= noise.measured.detection <= noise.measured.detection_high


def test_a_model_that_is_5_cm_off_is_seen_to_be(result):
    for noise in result.noise:
        gap = noise.gaps["range residual"]
        assert gap.dvm_bias == pytest.approx(-0.05, abs=0.012)
        assert noise.simulated.bias_m - noise.measured.bias_m == pytest.approx(0.05, abs=0.012)
        assert noise.gaps["AREA"].ks < 0.1


def test_noise_is_that_of_known_gaussian_ranges(small):
    _, hits, _ = small
    image = image_of_ideal(ph.ideal_of(hits, ph.SMALL))
    panels = find_panels(image, PanelSettings()).panels
    rng = np.random.default_rng(1)
    sigma, pattern = 0.03, rng.normal(0.0, 0.02, (520, 960))
    sampled = Sampler(panels, 1.0, image.shape)
    scans = []
    for _ in range(12):
        layer = np.concatenate([p.layer for p in panels]).astype(np.int32)
        point = np.concatenate([p.point for p in panels]).astype(np.int32)
        expected = np.concatenate([p.expected_m for p in panels])
        range_m = np.round(expected + pattern[layer, point] + rng.normal(0.0, sigma, len(layer)), 2)
        one = ph.Scan.from_beams(layer, point, range_m, area=np.full(len(layer), 100.0))
        scans.append(one)
        sampled.add(one)
    outcome = characterise([Arrangement(ph.ideal_of(hits, ph.SMALL), frames(scans))])
    for noise in outcome.noise:
        side = noise.measured
        assert side.resolution_m == 0.01
        assert side.noise_robust_m == pytest.approx(sigma, rel=0.1)
        assert side.noise_m == pytest.approx(np.hypot(sigma, 0.01 / np.sqrt(12)), rel=0.08)
        assert side.plane_m == pytest.approx(np.hypot(sigma, 0.02), rel=0.15)
        assert side.bias_m == pytest.approx(0.0, abs=0.01)
        assert side.detection == 1.0


def test_walk_follows_the_amplitude():
    rng = np.random.default_rng(2)
    area = 10 ** rng.uniform(1, 3, 5000)
    walk = walk_curve(area, -0.1 * np.log10(area) + rng.normal(0, 0.02, 5000))
    assert np.all(np.diff(walk.amplitude) > 0)
    assert walk.residual_m == pytest.approx(-0.1 * np.log10(walk.amplitude), abs=0.01)
    assert np.all((walk.low_m <= walk.residual_m) & (walk.residual_m <= walk.high_m))
    assert walk.echoes.sum() == 5000
    assert walk_curve(area[:5], area[:5]).amplitude.size == 0


@pytest.mark.parametrize("step", [0.01, 0.004, 0.0])
def test_the_step_of_ranges_is_told(step):
    r = np.random.default_rng(3).uniform(5, 80, 1000)
    assert resolution_of(np.round(r / step) * step if step else r) == step


def test_more_echoes_than_are_held_keep_the_counts(small, monkeypatch):
    _, hits, scans = small
    panels = find_panels(image_of_ideal(ph.ideal_of(hits, ph.SMALL)), PanelSettings()).panels
    full, thinned = Sampler(panels, 1.0, (520, 960)), Sampler(panels, 1.0, (520, 960))
    for scan in scans:
        full.add(scan)
    monkeypatch.setattr("lidarcheck.calibration.panels.samples.MOST_ECHOES", 500)
    for scan in scans:
        thinned.add(scan)
    for all_of, some in zip(full.samples(), thinned.samples(), strict=True):
        assert some.detected == all_of.detected
        assert len(some.scan) <= 500
        if some.kept_beams > 1:
            assert np.all(some.beam % some.kept_beams == 0)


def test_saved_echoes_are_those_on_the_panel(result):
    for panel, sample in zip(result.panels, result.measured, strict=True):
        scan = panel_scan(sample)
        beams = set(zip(panel.layer.tolist(), panel.point.tolist(), strict=True))
        assert set(zip(scan.layer.tolist(), scan.point.tolist(), strict=True)) <= beams
        assert scan.extra["Frame"].max() == 5
        assert len(np.unique(np.stack([scan.layer, scan.point, scan.extra["Frame"]]), axis=1).T) == len(scan)


# --- planes and levels ------------------------------------------------------------------------------------------------


def test_a_plane_is_fitted_through_outliers():
    rng = np.random.default_rng(4)
    u = beam_directions(rng.integers(240, 280, 400), rng.integers(460, 500, 400))
    normal = np.array([0.9, 0.3, 0.1]) / np.linalg.norm([0.9, 0.3, 0.1])
    r = 20.0 / (u @ normal) + rng.normal(0, 0.01, 400)
    r[:60] += rng.uniform(0.5, 3.0, 60)
    plane = fit_plane(u, r)
    assert plane.range_m(u) == pytest.approx(20.0 / (u @ normal), abs=0.01)
    assert plane.incidence_deg(normal) < 1.0


def test_a_sloping_floor_is_found_below_walls():
    rng = np.random.default_rng(5)
    x, y = rng.uniform(5, 50, 4000), rng.uniform(-15, 15, 4000)
    wall_y, wall_z = rng.uniform(-15, 15, 8000), rng.uniform(-1.7, 3, 8000)
    z = -1.8 + 0.01 * x
    floor = level_of(np.append(x, np.full(8000, 50.5)), np.append(y, wall_y), np.append(z, wall_z))
    assert floor.z_m == pytest.approx(-1.8, abs=0.03)
    assert floor.slope_x == pytest.approx(0.01, abs=0.001)
    assert level_of(np.full(800, 50.5), wall_y[:800], wall_z[:800]) is None


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def hall_files(tmp_path_factory):
    directory = tmp_path_factory.mktemp("hall")
    hall = ph.Hall([ph.Spot(12.0, -3.0, 0.0, 0.5, 0.4, PANEL_80), ph.Spot(30.0, 0.5, 0.0, 1.0, 0.9, PANEL_50)])
    return directory, ph.write_frames(directory, hall, "SMART", range(2), ph.SMALL)


@pytest.fixture
def no_pictures(monkeypatch):
    """Drawing is tested elsewhere and takes seconds."""
    monkeypatch.setattr("lidarcheck.figures.files.result_folder.draw_pictures", lambda *_: None)
    monkeypatch.setattr("lidarcheck.figures.html.page.page_html", lambda shown: shown.summary)


def run(*arguments):
    return main(["panels", *(str(a) for a in arguments)])


def test_the_command_writes_report_and_panels(hall_files, tmp_path, capsys, no_pictures):
    directory, measured_files = hall_files
    out = tmp_path / "out"
    code = run(*measured_files, "--ideal", directory / "ideal.txt", "--model", directory / "model.toml", "--out", out)
    assert code == 0
    text = capsys.readouterr()
    assert text.out.startswith("2 panels from 12.0 to 30.0 m in 2 measured frames: 100.00 % of the beams")
    assert "panel_50" in text.out
    names = {path.name for path in (out / "panels").iterdir()}
    assert names == {f"panel_0{n}_{side}.pcd" for n in (1, 2) for side in ("real", "simulated")}
    found = json.loads((out / "result.json").read_text())["result"]["panels"]
    assert [p["material_name"] for p in found] == ["panel_80", "panel_50"]
    saved = read_table(out / "panels" / "panel_02_real.pcd")
    assert len(saved) == found[1]["measured"]["echoes"]
    # Another format takes the place of the first run's files.
    assert run(*measured_files, "--out", out, "--format", "csv", "-q") == 0
    assert {path.name for path in (out / "panels").iterdir()} == {"panel_01_real.csv", "panel_02_real.csv"}


def test_ideals_of_two_places_are_two_arrangements(tmp_path, capsys, no_pictures):
    files, ideals = [], []
    for k, range_m in enumerate((12.0, 12.0, 30.0)):
        place = tmp_path / str(k)
        place.mkdir()
        hall = ph.Hall([ph.Spot(range_m, 0.0, 0.0, 0.7, 0.45, PANEL_50)], stands=False)
        files += ph.write_frames(place, hall, "SMART", range(k, k + 1), ph.SMALL)
        ideals.append(place / "ideal.txt")
    assert same_scene(load_ideal(ideals[0]), load_ideal(ideals[1]))
    assert run(*files, "--ideal", *ideals, "--out", tmp_path / "out", "--expect", 2, "--json", "-", "-q") == 0
    panels = json.loads(capsys.readouterr().out)["result"]["panels"]
    assert [p["measured"]["frames"] for p in panels] == [2, 1]
    assert [round(p["range_m"]) for p in panels] == [12, 30]


REFUSED = {
    "": "no measured frame is given",
    "{f0} {f1} --ideal {ideal} {ideal} {ideal}": "3 ideal scans for 2 measured frames",
    "{f0} --model {model}": "--model needs --ideal",
    "{f0} --ideal {ideal} --model {model} --simulated {f1}": "--model and --simulated are both given",
    "{f0} nowhere.txt": "nowhere.txt: there is no such file",
    "{f0} {f0}": "is named twice; name each file once",
    "{f0} --trim-layers 1.5": "--trim-layers 1.5 is no whole number",
    "{f0} --expect 2.": "--expect 2. is no whole number",
    "{f0} {f1} {moved} --ideal {ideal}": "frame_09.txt: shows none of the ",
    "{f0} {f1} {wide}": "of its echoes on common beams lie elsewhere than in the frames together",
    "{f0} --range 80 5": "--range 80 5 is no interval",
    "{f0} --size 0 4": "--size 0 4 is no interval",
    "{f0} --trim-layers -1": "--trim-layers -1 is out of range; use 0 to 100 layers",
    "{f0} --floor-m 3 --roof-m 1": "the floor at 3 m is not below the roof at 1 m",
    "{f0} --format xls": "cannot write '.xls' files",
    "{f0} --expect 16": "2 panels found where 16 are expected: at ",
    "{f0} --range 50 60": "no panel found; found instead: ",
    "{empty}": "holds no echo",
    "{f0} {moved}": "of its echoes on common beams lie elsewhere than in the frames together",
    "{f0} --ideal {other}": "is it the ideal scan of this scene",
}


def _write_wide(frame, path):
    """A frame of another place with ten times as many beams, most of which the others do not have."""
    scan = load_scan(frame)
    more = [np.concatenate([column, *([column] * 9)]) for column in (scan.layer, scan.point, scan.range_m)]
    more[0] = np.concatenate([scan.layer, *(scan.layer % 20 + 300 + 20 * k for k in range(9))])
    beams, first = np.unique(np.column_stack(more[:2]), axis=0, return_index=True)
    save_scan(Scan.from_beams(beams[:, 0], beams[:, 1], more[2][first]), path)


@pytest.mark.parametrize(("arguments", "says"), REFUSED.items())
def test_what_is_wrong_is_said(hall_files, tmp_path, arguments, says, capsys):
    directory, (f0, f1) = hall_files
    (tmp_path / "empty.txt").write_text(f0.read_text().splitlines()[0] + "\n0\n")
    other = ph.Hall([ph.Spot(20.0, 5.0, 0.0, 0.7, 0.8, PANEL_50)], end_m=60.0, side_m=5.0, stands=False)
    moved = ph.write_frames(tmp_path, other, "SMART", range(9, 10), ph.SMALL)[0]
    places = {"f0": f0, "f1": f1, "ideal": directory / "ideal.txt", "model": directory / "model.toml"}
    wide = tmp_path / "wide.txt"
    _write_wide(moved, wide)
    places |= {"wide": wide}
    places |= {"empty": tmp_path / "empty.txt", "moved": moved, "other": tmp_path / "ideal.txt"}
    assert run(*arguments.format(**places).split(), "--out", tmp_path / "out", "-q") == 2
    text = capsys.readouterr()
    assert text.out == ""
    assert text.err.startswith("error: ")
    assert text.err.count("\n") == 1
    assert says in text.err
    assert not (tmp_path / "out").exists()


def test_an_interrupt_while_the_pictures_are_drawn_leaves_nothing(hall_files, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("lidarcheck.figures.files.result_folder.draw_pictures", interrupted)
    assert run(hall_files[1][0], "--out", tmp_path / "out", "-q") == 130
    assert not (tmp_path / "out").exists()


def test_results_do_not_go_where_the_input_lies(hall_files, tmp_path, capsys):
    place = tmp_path / "out" / "panels"
    place.mkdir(parents=True)
    frame = place / "panel_01_real.txt"
    frame.write_bytes(hall_files[1][0].read_bytes())
    assert run(frame, "--out", tmp_path / "out") == 2
    assert "lies where the panels are written" in capsys.readouterr().err
    assert frame.exists()


def test_the_page_and_the_document_hold_the_result(result):
    shown = page(result, {"command": "lidarcheck panels"})
    titles = [figure.title for figure in shown.figures()]
    assert len(titles) == len(set(titles)) < 100
    assert {"Detection over range", "AREA over range", "PEAK over range", "Bias over range"} <= set(titles)
    assert shown.provenance
    text = json.dumps(plain(document(result)), allow_nan=False)
    assert len(json.loads(text)["panels"]) == 3
    assert len(text) < 100_000


def test_an_angle_that_rounds_to_nothing_has_no_sign(result):
    panels = [replace(panel, azimuth_deg=-0.004, elevation_deg=-0.001) for panel in result.panels]
    found = page(replace(result, panels=panels), {}).sections[0].tables[0]
    assert {row[2:4] for row in found.rows} == {("0.00", "0.00")}


# --- real captures and reference frames -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        ("ouster_os0_128/scan_{}", PanelSettings(), r"no panel found; found instead: .* m at .* m \("),
        (
            "hesai_xt32/rotation_{}",
            PanelSettings(expect=16),
            r"[1-9] panels found where 16 are expected: at .* m; found",
        ),
    ],
)
def test_a_room_without_the_expected_panels_is_said_to_have_none(name, settings, says):
    scans = [load_scan(shared_path(f"data/{name.format(i)}.parquet")) for i in (0, 1)]
    with pytest.raises(InputError, match=says) as error:
        characterise([Arrangement(None, frames(scans))], settings)
    assert "nan" not in str(error.value)


def test_the_reference_laboratory_looks_the_same_with_and_without_its_ideal_scan():
    folder = "data/reference_frames/SMART_lab"
    scan, ideal = load_scan(shared_path(f"{folder}_echoes.txt")), load_ideal(shared_path(f"{folder}_ideal.txt"))
    with_ideal, without = (characterise([Arrangement(i, frames([scan]))]) for i in (ideal, None))
    assert len(with_ideal.panels) == len(without.panels) == 4
    for a, b in zip(with_ideal.noise, without.noise, strict=True):
        assert a.measured.detection == pytest.approx(b.measured.detection, abs=0.01)
        assert a.measured.means["AREA"] == pytest.approx(b.measured.means["AREA"], rel=0.01)
    assert np.isnan(without.noise[0].measured.bias_m)


def test_settings_out_of_range_are_refused():
    with pytest.raises(UsageError, match="--max-incidence 90 is out of range"):
        PanelSettings(max_incidence_deg=90.0)
    with pytest.raises(UsageError, match="--expect 0 is out of range"):
        PanelSettings(expect=0)


def test_beams_that_were_not_fired_are_no_trials(small):
    _, hits, scans = small
    panels = find_panels(image_of_ideal(ph.ideal_of(hits, ph.SMALL)), PanelSettings()).panels
    sampler = Sampler(panels, 1.0, (520, 960))
    one = panels[0]
    half = one.point < np.median(one.point)
    sampler.add(replace(scans[0], fired=Fired(one.layer[half], one.point[half])))
    sampler.add(scans[1])
    assert sampler.samples()[0].trials == np.count_nonzero(half) + len(one.layer)
