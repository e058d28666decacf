"""The ghost effect's parameters, fitted to frames of the independent simulator whose truth is known."""

import numpy as np
import pytest

from ghost_frames import Recipe, made, scan_of
from lidarcheck.calibration.ghosts.data import check_expected, sign_beams, with_ghost
from lidarcheck.calibration.ghosts.fit import fit_ghosts
from lidarcheck.calibration.ghosts.library import library_of
from lidarcheck.calibration.ghosts.workflow import find_ghosts
from lidarcheck.errors import InputError
from lidarcheck.figures.pages.ghost_fit import fit_page
from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.model import load_model
from lidarcheck.sensor import Sensor

TRUTH = {"strength": 2.2e-4, "exponent": 0.4, "extra_m": 0.27}


def recipe(range_m: float, seed: int, variant: str = "SLIM") -> Recipe:
    return Recipe(
        variant=variant, range_m=range_m, seed=seed, ratio=TRUTH["strength"], power=TRUTH["exponent"],
        extra_m=TRUTH["extra_m"], turn_deg=5.0,
    )  # fmt: skip


@pytest.fixture(scope="session")
def measured(tmp_path_factory):
    """Four datasets of SLIM: what was found, ideal scans, the model."""
    return four_datasets(tmp_path_factory, "SLIM")


def four_datasets(tmp_path_factory, variant):
    place = tmp_path_factory.mktemp("measured")
    found, ideals = [], []
    for k, range_m in enumerate((25.0, 45.0, 65.0, 85.0)):
        frame = made(recipe(range_m, 3000 + k, variant))
        (place / "ideal.txt").write_text(frame.ideal_text)
        (place / "model.toml").write_text(frame.model_text)
        found.append(find_ghosts(scan_of(frame), name=f"at_{range_m:g}m"))
        ideals.append(load_ideal(place / "ideal.txt"))
    return found, ideals, load_model(place / "model.toml")


@pytest.fixture(scope="session")
def fitted(measured):
    return fit_ghosts(*measured)


@pytest.fixture(scope="session")
def fitted_smart(tmp_path_factory):
    return fit_ghosts(*four_datasets(tmp_path_factory, "SMART"))


@pytest.mark.parametrize("of", ["fitted", "fitted_smart"])
def test_the_true_values_lie_in_narrow_intervals(request, of):
    """Seeds that nothing was tuned on; half as wide again, since one in twenty may be out."""
    fitted = request.getfixturevalue(of)
    for name, truth in TRUTH.items():
        p = fitted.parameters[name]
        assert p.fitted
        assert p.low < p.value < p.high
        slack = 0.25 * (p.high - p.low)
        assert p.low - slack <= truth <= p.high + slack, name
    strength, exponent, extra = fitted.parameters.values()
    assert strength.high / strength.low < 1.08
    assert exponent.high - exponent.low < 0.2
    assert extra.high - extra.low < 0.02


def test_the_datasets_are_what_the_fitted_model_gives(fitted):
    for d in fitted.datasets:
        assert d.ghosts == pytest.approx(d.ghosts_expected, abs=3.0 + 3.0 * np.sqrt(max(d.beams - d.ghosts, 1)))
        assert abs(d.pull) < 4.0
    page = fit_page(fitted, [])
    assert "strength" in page.summary
    assert len(page.tables()) == 2


def test_the_model_keeps_all_else_and_gets_the_effect(measured, fitted):
    model = measured[2]
    assert fitted.model.without("retro_ghost") == model
    assert fitted.effect.strength == pytest.approx(TRUTH["strength"], rel=0.05)
    assert fitted.effect.retro_only == 1


def test_one_distance_leaves_the_exponent(measured):
    found, ideals, model = measured
    start = with_ghost(model, exponent=TRUTH["exponent"])
    fit = fit_ghosts(found[:1], ideals[:1], start)
    assert not fit.parameters["exponent"].fitted
    assert fit.parameters["exponent"].value == TRUTH["exponent"]
    assert fit.parameters["strength"].value == pytest.approx(TRUTH["strength"], rel=0.03)
    assert "exponent is not told" in fit.warnings[0]


def test_a_ghost_that_scatters_widens_the_intervals_and_is_said(measured):
    found, ideals, model = measured
    beams = sign_beams(found[:1], ideals[:1], model)[0]
    rng = np.random.default_rng(5)
    area = found[0].scan.area.copy()
    ghosts = found[0].signs[0].ghost_rows
    area[ghosts] *= np.exp(rng.normal(0.0, 0.3, len(ghosts)))
    from dataclasses import replace

    noisy = replace(found[0], scan=replace(found[0].scan, area=np.round(area)))
    fit, plain = fit_ghosts([noisy], ideals[:1], model), fit_ghosts(found[:1], ideals[:1], model)
    assert fit.scatter > 1.5 > plain.scatter
    assert any("scatters" in warning for warning in fit.warnings)
    width = [p.high / p.low - 1.0 for p in (fit.parameters["strength"], plain.parameters["strength"])]
    assert width[0] > 1.5 * width[1]
    assert fit.parameters["strength"].value == pytest.approx(plain.parameters["strength"].value, rel=0.2)
    assert len(beams) > 100


def test_a_beam_that_is_full_says_nothing_of_a_ghost(measured):
    found, ideals, model = measured
    beams = sign_beams(found, ideals, model)
    for one, b in zip(found, beams, strict=True):
        assert np.count_nonzero(b.detected) == pytest.approx(len(one.signs[0].ghost_rows), abs=2)
        assert np.all(np.isnan(b.area) == ~b.detected)
        assert np.all(b.unit_signal == pytest.approx(6000.0 * 0.6 * 900.0 / b.range_m**2, rel=1e-6))


def test_the_library_is_what_a_single_spad_s_chance_gives():
    """Far from the threshold every detector counts: AREA is 9 bins of N (1 - exp(-S)), within the run's cut ends."""
    library = library_of(Sensor.of("SLIM"), None, 0.0)
    log_signal = np.log(np.array([0.6, 1.0, 1.5]))
    expected = 9 * 315 * -np.expm1(-np.exp(log_signal))
    assert np.exp(library.at(library.log_area, log_signal)) == pytest.approx(expected, rel=0.03)
    assert np.all(np.diff(library.probability) > -0.01)
    assert library.probability[0] < 1e-3
    assert library.probability[-1] > 0.999
    assert np.all(library.at(library.shift_m, log_signal) < 0.0)  # strong pulses are early


def test_a_ghost_in_the_model_is_replaced_in_its_place(measured):
    model = with_ghost(measured[2], strength=1e-3, min_signal=2.0)
    again = with_ghost(model, strength=2e-3)
    assert [e.name for e in again.effects] == ["retro_ghost"]
    assert again.effects[0].settings() == {**model.effects[0].settings(), "strength": 2e-3}


# --- what is refused ------------------------------------------------------------------------------------------------


def test_a_fit_needs_ghosts(measured):
    _, ideals, model = measured
    bare = find_ghosts(scan_of(made(Recipe(range_m=25.0, seed=1, ghost_share=0.0, variant=model.sensor.variant))))
    with pytest.raises(InputError, match="no dataset has a ghost"):
        fit_ghosts([bare], ideals[:1], model)


def test_a_fit_needs_more_than_a_few_echoes(tmp_path):
    frame = made(Recipe(range_m=60.0, seed=9, size_m=(0.2, 0.2), ratio=4e-4))
    (tmp_path / "ideal.txt").write_text(frame.ideal_text)
    (tmp_path / "model.toml").write_text(frame.model_text)
    found = find_ghosts(scan_of(frame), name="small")
    with pytest.raises(InputError, match=r"at least 10 ghost echoes, and there are 4 \(small 4 on 4 beams\)"):
        fit_ghosts([found], [load_ideal(tmp_path / "ideal.txt")], load_model(tmp_path / "model.toml"))


def test_the_ideal_scan_of_another_frame_is_refused(measured):
    found, ideals, model = measured
    with pytest.raises(InputError, match=r"sign of \d+ beams at 45\.0. m, and the scan has none"):
        fit_ghosts(found[:1], ideals[1:2], model)


def test_an_ideal_scan_without_sign_is_refused(measured):
    found, ideals, model = measured
    wall = ideals[0].take(np.flatnonzero(ideals[0].material_id != 7))
    with pytest.raises(InputError, match="no sign"):
        check_expected(found[0], wall, model)


def test_a_scan_without_area_cannot_be_fitted(measured):
    from dataclasses import replace

    found, ideals, model = measured
    other = replace(found[0], brightness=replace(found[0].brightness, column="INTENSITY"))
    with pytest.raises(InputError, match="no AREA, only INTENSITY"):
        fit_ghosts([other], ideals[:1], model)


def test_what_the_fit_leaves_out_of_the_model_is_said(measured):
    from lidarcheck.effects import make

    found, ideals, model = measured
    fit = fit_ghosts(found[:1], ideals[:1], model.with_(make("walk_error", {})))
    assert any("walk_error" in warning for warning in fit.warnings)


def test_scans_of_files_fit_as_well(measured, tmp_path):
    """From text, with its six digits, to the same beams."""
    frame = made(recipe(25.0, 3000, measured[2].sensor.variant))
    (tmp_path / "scan.txt").write_text(frame.scan_text)
    found = find_ghosts(load_scan(tmp_path / "scan.txt"))
    assert np.array_equal(found.label, measured[0][0].label)
