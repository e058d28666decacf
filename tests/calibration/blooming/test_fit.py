"""The fit of blooming tables: against an independent generator with a known table, and a measured profile."""

from dataclasses import replace

import numpy as np
import pytest

from blooming_kit import X, lut_text, sign_frame, sign_model, true_y
from lidarcheck.calibration.blooming.cells import cells_of_scan
from lidarcheck.calibration.blooming.fit import FreeLight
from lidarcheck.calibration.blooming.operator import light_of_table, nodes_of, spread
from lidarcheck.calibration.blooming.response import response_of
from lidarcheck.calibration.blooming.target import bright_beams, own_light
from lidarcheck.calibration.blooming.workflow import (
    BloomingMeasurement,
    calibrate,
    fitted_model,
    gather,
    model_side_of,
    rms_of,
)
from lidarcheck.effects.base import Curve
from lidarcheck.effects.finding import make
from lidarcheck.errors import InputError
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.formats.lut import load_lut, parse_lut
from lidarcheck.model import load_model, save_model, simulate
from lidarcheck.model.stages import light_after_effects
from lidarcheck.scan import PulseShape
from lidarcheck.sensor import Sensor
from places import shared_path

DISTANCES = (69.0, 156.6, 199.0)
LUT = parse_lut(lut_text().encode())
SIDEWAYS = parse_lut(lut_text(key="LUT_bloomingH").encode())


def cells_at(distance_m, variant, seed, axis="vertical"):
    scan, ideal = sign_frame(distance_m, variant, seed, axis=axis)
    light, _ = light_after_effects(ideal, sign_model(variant))
    target = bright_beams(light, Sensor.of(variant), axis, 30.0, distance_m, "scan")
    return cells_of_scan(scan, target, axis, own=own_light(light, target, axis, 30.0))


@pytest.fixture(scope="session")
def fits():
    """A fit of each variant to three distances, on seeds that nothing was tuned on."""
    return fits_of("vertical", LUT, SMART=3001, SLIM=4001)


@pytest.fixture(scope="session")
def sideways():
    """The same along the layers, on seeds of its own."""
    return fits_of("horizontal", SIDEWAYS, SMART=3501, SLIM=4501)


def fits_of(axis, lut, **seeds):
    """A fit of each variant."""
    made = {}
    for variant, seed in seeds.items():
        cells = [cells_at(d, variant, seed + i, axis) for i, d in enumerate(DISTANCES)]
        made[variant] = calibrate(cells, model_side_of(sign_model(variant), axis), lut)
    return made


def holds(result, least):
    """The fitted rows, at least so many, are the true ones."""
    fitted = [row for row in result.rows if row.status == "fitted"]
    error = np.log10([row.y / true_y(row.x) for row in fitted])
    print(f"{len(fitted)} rows, rms {np.sqrt(np.mean(error**2)):.3f}, worst {np.abs(error).max():.3f} decades")
    assert len(fitted) >= least
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.abs(error).max() < 0.1
    assert [row.x for row in result.rows] == list(X)


@pytest.mark.long
@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_a_known_table_is_found_again(fits, variant):
    holds(fits[variant], least=12)


@pytest.mark.parametrize("variant", ["SMART", "SLIM"])
def test_a_known_horizontal_table_is_found_again(sideways, variant):
    """Left and right are told apart: the table has a hump on one side, and half of the core on that side."""
    result = sideways[variant]
    holds(result, least=16)
    rows = {row.x: row.y for row in result.rows}
    assert rows[60] > 10 * rows[-50]
    assert rows[-5.87] > 1.5 * rows[5.87]
    assert result.axis == "horizontal"
    written = result.lut.tables["horizontal"]
    assert written.y.tolist() == pytest.approx([row.y for row in result.rows], abs=6e-8)


@pytest.mark.parametrize("axis", ["fits", "sideways"])
def test_intervals_hold_the_truth(axis, request):
    results = request.getfixturevalue(axis)
    rows = [row for result in results.values() for row in result.rows if row.status == "fitted"]
    inside = [row.low <= true_y(row.x) <= row.high for row in rows]
    assert np.mean(inside) >= 0.85


def test_what_no_cell_sees_is_held(fits):
    for result in fits.values():
        row = next(row for row in result.rows if row.x == 0)
        assert (row.status, row.y) == ("held", 1.0)
        assert {row.status for row in result.rows} <= {"fitted", "smooth", "limit", "held"}


@pytest.mark.parametrize("axis", ["vertical", "horizontal"])
def test_the_operator_is_the_models_own(axis):
    table = LUT.tables["vertical"] if axis == "vertical" else parse_lut(
        lut_text(x=(0, 2, 4, 8, 30, 100), y=(1, 1e-2, 1e-3, 1e-4, 1e-5, 0), key="LUT_bloomingH").encode()
    ).tables["horizontal"]  # fmt: skip
    _, ideal = sign_frame(69.0, "SLIM", 5, axis=axis)
    effect = make(f"blooming_{axis}", {"lut": Curve(tuple(table.x), tuple(table.y), "lut.ini"), "bright_signal": 30.0})
    model = sign_model("SLIM")
    bloomed, _ = light_after_effects(ideal, model.with_(effect))
    cells = cells_at(69.0, "SLIM", 5, axis)
    predicted = light_of_table(cells, nodes_of(table, axis))
    near = np.abs(bloomed.pulse_range_m - 69.0) < 0.5
    beam = bloomed.pulse_beam[near]
    light = np.bincount(beam, bloomed.pulse_signal[near], len(bloomed))
    place = bloomed.layer if axis == "vertical" else bloomed.point
    center = 259.5 if axis == "vertical" else 479.5
    strong = np.flatnonzero((predicted > 0.01) & (cells.target == 0.0))
    assert len(strong) > 10
    step = 3.0 if axis == "vertical" else 2.5
    found_center = place[light > 20].mean()
    assert abs(found_center - center) < 4
    for row in strong:
        there = np.isclose(step * (place - np.median(place[light > 20])), cells.offset[row]) & (light > 0)
        assert np.min(np.abs(light[there] / predicted[row] - 1.0)) < 0.02


def test_a_bright_beam_gives_itself_nothing():
    cells = cells_at(156.6, "SLIM", 7)
    nodes = nodes_of(LUT.tables["vertical"], "vertical")
    assert np.all(spread(cells, nodes)[:, nodes.x == 0.0] == 0.0)


def test_the_response_is_that_of_simulated_echoes():
    """Means over detected echoes near the threshold lie far above the mean trace; far from it they are near it."""
    response = response_of(Sensor.of("SLIM"))
    low, high = response.features([-2.0, 0.0])[0]
    assert 10.0 <= low[0] < 14.0
    assert high[0] == pytest.approx(315 * (1 - np.exp(-1.0)), rel=0.05)
    assert high[1] / high[0] == pytest.approx(9.0, rel=0.05)
    p, _ = response.probability([-2.5, -1.0])
    assert p[0] < 0.02 < 0.99 < p[1]


def test_a_short_pulse_gives_narrow_echoes():
    sensor = Sensor.of("SLIM")
    long, short = (response_of(sensor, PulseShape(fwhm)).features([-0.5])[0][0, 2] for fwhm in (5.0, 2.0))
    assert short < long - 2.0


def test_the_measured_sign():
    profile = shared_path("data/sign_blooming/vertical_157m.csv")
    lut = load_lut(shared_path("samples/vertical_lut.ini"))
    bench = model_side_of(sign_model("SLIM"), "vertical")
    cells = gather([BloomingMeasurement(profile)], bench)
    result = calibrate(cells, bench, lut, free=FreeLight(pulse=True))
    off = rms_of(result.measured[0], result.expected[0])
    fwhm = result.fit.parameters[0]
    print(f"PEAK {off['PEAK']:.3f}, AREA {off['AREA']:.3f}, WIDTH {off['WIDTH']:.2f} ns, FWHM {fwhm.value:.2f} ns")
    assert off["PEAK"] < 0.15
    assert off["AREA"] < 0.15
    assert off["WIDTH"] < 1.5
    assert 1.5 < fwhm.value < 3.0
    rows = {row.x: row for row in result.rows}
    assert rows[40.0].y > 1.5 * rows[100.0].y
    assert rows[-80.0].status != "fitted" or rows[-80.0].y < 0.1 * rows[80.0].y


def test_the_fitted_model_can_be_saved_and_run(tmp_path, fits):
    model, result = sign_model("SLIM"), fits["SLIM"]
    lut_file = tmp_path / "lut.ini"
    lut_file.write_bytes(result.lut.content)
    bench = model_side_of(model, "vertical")
    save_model(fitted_model(model, bench, result, lut_file, FreeLight()), tmp_path / "model.toml")
    loaded = load_model(tmp_path / "model.toml")
    measured, ideal = sign_frame(156.6, "SLIM", 203)
    simulated = simulate(ideal, loaded, seed=1)
    near = [np.sum(np.abs(scan.range_m - 156.6) < 1.5) for scan in (measured, simulated)]
    assert near[1] == pytest.approx(near[0], rel=0.1)


def test_the_fitted_model_keeps_all_of_the_pulse(tmp_path, fits):
    """A second pulse that the model had already was fitted with, and must be written with the rest."""
    result, shape = fits["SLIM"], PulseShape(4.0, 0.1, 2.0, 9.5)
    twice = replace(result, fit=replace(result.fit, shape=shape))
    lut_file = tmp_path / "lut.ini"
    lut_file.write_bytes(result.lut.content)
    model = sign_model("SLIM")
    written = fitted_model(model, model_side_of(model, "vertical"), twice, lut_file, FreeLight(pulse=True))
    own = next(effect.settings() for effect in written.effects if effect.name == "pulse_shape")
    stretch = 4.0 / model.sensor.pulse_fwhm_ns
    assert own == {"stretch": stretch, "tail_share": 0.1, "tail_ns": 2.0, "tail_delay_ns": 9.5}


# --- targets in scans alone, and what is refused ----------------------------------------------------------------------


def saved(tmp_path, scan, name="scan.txt"):
    save_scan(scan, tmp_path / name)
    return tmp_path / name


def one_sign(variant="SLIM"):
    """The bench of a model whose one retro-reflector is the sign."""
    return model_side_of(sign_model(variant), "vertical")


@pytest.mark.parametrize("distance_m", [69.0, 156.6])
def test_without_an_ideal_scan_the_target_is_found_by_its_echoes(tmp_path, distance_m):
    """At 69 m the bloom itself makes all detectors fire, up to eighty rows beside the sign."""
    scan, ideal = sign_frame(distance_m, "SLIM", 9)
    path = saved(tmp_path, scan)
    save_ideal(ideal, tmp_path / "ideal.txt")
    alone, told = (gather([BloomingMeasurement(path, None, i)], one_sign())[0] for i in (None, tmp_path / "ideal.txt"))
    assert alone.distance_m == pytest.approx(told.distance_m, abs=0.5)
    assert np.subtract(alone.extent, told.extent).tolist() == pytest.approx([0, 0], abs=3.1)
    assert abs(len(alone.sources[0].offset) - len(told.sources[0].offset)) <= 1


def test_a_target_at_the_end_of_the_view(tmp_path):
    scan, _ = sign_frame(69.0, "SLIM", 9)
    path = saved(tmp_path, scan.take(scan.layer >= 260))
    with pytest.raises(InputError, match="target is cut by the end of the scan: it covers layers 260"):
        gather([BloomingMeasurement(path)], one_sign())


def test_no_bright_target(tmp_path):
    scan, _ = sign_frame(69.0, "SLIM", 9)
    path = saved(tmp_path, scan.take(scan.peak < 100))
    with pytest.raises(InputError, match=r"no echo saturates \(AREA 2835, .*\): the largest AREA is \d+"):
        gather([BloomingMeasurement(path)], one_sign())


def test_another_distance_than_named(tmp_path):
    path = saved(tmp_path, sign_frame(69.0, "SLIM", 9)[0])
    with pytest.raises(InputError, match=r"nothing saturates within 3 m of 120 m; echoes saturate at 6\d\.\d m"):
        gather([BloomingMeasurement(path, 120.0)], one_sign())


def test_a_table_that_does_not_cover_the_offsets():
    short = parse_lut(lut_text(x=(-10, -5, 0, 5, 10)).encode())
    with pytest.raises(InputError, match=r"covers offsets -10 to 10, but .* lie outside, from"):
        calibrate([cells_at(69.0, "SLIM", 9)], one_sign(), short)


def test_fewer_offsets_than_a_fit_needs():
    cells = cells_at(69.0, "SLIM", 9)
    few = cells.take((np.abs(cells.offset) < 30) & (cells.offset > 0))
    with pytest.raises(InputError, match=r"\d offsets beside the target have an echo; a fit needs at least 8"):
        calibrate([few], one_sign(), LUT)
    none = replace(cells, echoes=np.where(cells.target > 0, cells.echoes, 0))
    with pytest.raises(InputError, match=r"no echo beside the target at 69\.0 m"):
        calibrate([cells, none], one_sign(), LUT)
