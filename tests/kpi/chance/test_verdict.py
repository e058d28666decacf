"""Whole comparisons: of what is alike nothing stands out, of what differs the right thing does."""

from dataclasses import replace

import numpy as np
import pytest

from chance_kit import DIFFERENCES, MANY, ONE, alarms, found, null, street, verdict_on
from lidarcheck.kpi.chance.verdict import ChanceTest
from lidarcheck.kpi.compare import compare


@pytest.mark.parametrize("kind", ["plain", "patches", "gain"])
def test_of_what_is_alike_nothing_stands_out(kind):
    """Four fixed nulls of each kind; ci/nulls runs 200, of which at most 18 may."""
    assert len(alarms(kind, range(4))) <= 1


@pytest.mark.parametrize(
    ("name", "kpis"),
    [
        ("signal -3 %", {"AREA", "PEAK", "detection_probability", "echoes"}),
        ("offset 2 mm", {"range_residual", "walk_offset"}),
        ("walk 5 mm a decade", {"range_residual", "walk_offset"}),
        ("dropout 0.5 %", {"detection_probability", "echoes"}),
        ("blooming +10 %", {"blooming_profile", "AREA", "PEAK", "WIDTH", "echoes", "false_alarms"}),
    ],
)
def test_what_differs_stands_out(name, kpis):
    out = found(name, 1, MANY if name.startswith("blooming") else ONE).standing_out
    assert out
    assert {out[0].of, out[0].kpi} & kpis
    assert set(DIFFERENCES) >= {name}


def half_a_layer_up(scan):
    level_m, up = np.hypot(scan.x_m, scan.y_m), np.arctan2(scan.z_m, np.hypot(scan.x_m, scan.y_m)) + np.deg2rad(0.025)
    range_m = np.hypot(level_m, scan.z_m)
    part = range_m * np.cos(up) / level_m
    return replace(scan, x_m=scan.x_m * part, y_m=scan.y_m * part, z_m=range_m * np.sin(up))


@pytest.mark.parametrize(
    ("written", "kpis"),
    [
        (half_a_layer_up, {("direction_bias", "elevation"), ("position_bias_z", "")}),
        (lambda scan: replace(scan, y_m=-scan.y_m), {("direction_scatter", "azimuth")}),
        (lambda scan: replace(scan, echo_number=scan.echo_number - 1), {("echo_number_share", "0")}),
    ],
)
def test_what_is_written_otherwise_stands_out(written, kpis):
    (pair,) = null("plain", 3, 12)
    out = verdict_on(iter([pair._replace(measured=written(pair.measured))])).standing_out
    assert kpis <= {(one.kpi, one.of) for one in out}
    assert {one.kpi.split("_")[0] for one in out} <= {"direction", "position", "echo"}


def test_units_are_blocks_of_a_frame_and_frames_from_ten_on():
    pairs = list(null("gain", 3, 12, 480))
    # 120 points are 8 blocks, of which one in a frame may be too dark for an echo (68 to 71 of 72 in seven seeds).
    for frames, units, words in ((1, 8, "blocks of 16 columns"), (9, 72, "blocks of 16 columns"), (10, 10, "frames")):
        verdict = verdict_on(iter(pairs[:frames]))
        assert (verdict.unit_words, verdict.frames) == (words, frames)
        assert units * 7 // 8 <= verdict.units <= units
        assert ("chance between frames is not in it" in verdict.closing) == (1 < frames < 10)
        assert len(verdict.closing) <= 80


def test_every_line_of_a_comparison_has_a_verdict_or_a_reason():
    (pair,) = null("plain", 1)
    test = ChanceTest()
    comparison = compare(pair.measured, pair.simulated, pair.ideal, look=test.add)
    verdict = test.verdict()
    assert set(verdict.kpis) == {(row.kpi, row.of) for row in comparison.rows()}
    assert {verdict.word(row.kpi, row.of) for row in comparison.rows()} == {"as chance", "not judged"}
    assert verdict.kpis["overlap", "within 0.1 m"].not_judged
    assert verdict.kpis["chamfer", ""].not_judged
    # What stands on a few columns alone cannot be told from one lost packet.
    bound = verdict.kpis["ks", "AREA"].chance
    assert 0.0 < comparison.features["AREA"].ks < 3.0 * bound


def test_the_test_changes_no_kpi():
    (pair,) = null("plain", 2)
    plain = compare(pair.measured, pair.simulated, pair.ideal)
    assert compare(pair.measured, pair.simulated, pair.ideal, look=ChanceTest().add).to_dict() == plain.to_dict()


def test_a_lost_packet_alone_does_not_stand_out():
    """All echoes of one block: many beams, one unit."""
    (pair,) = null("plain", 4)
    lost = pair._replace(measured=pair.measured.take((pair.measured.point < 320) | (pair.measured.point >= 336)))
    assert not verdict_on(iter([lost])).standing_out


def test_few_beams_are_not_judged():
    (pair,) = null("plain", 5, 6, 40)
    verdict = verdict_on(iter([pair]))
    assert not verdict.judged
    assert verdict.closing == "No KPI could be judged: echoes lie in 3 blocks of 16 columns."
    assert all(one.not_judged for one in verdict.kpis.values())


def test_scans_without_an_echo():
    (pair,) = null("plain", 5, 6, 40)
    nothing = pair.measured.take(np.zeros(len(pair.measured), dtype=bool))
    verdict = verdict_on(iter([pair._replace(measured=nothing, simulated=nothing)]))
    assert (verdict.judged, verdict.units) == (0, 0)
    # All echoes of one side are gone: their number says so, and no feature is compared.
    wide = next(null("plain", 6, 6, 960))
    gone = verdict_on(iter([wide._replace(measured=wide.measured.take(np.zeros(len(wide.measured), dtype=bool)))]))
    assert gone.kpis["echoes", ""].stands_out
    assert gone.kpis["ks", "AREA"].not_judged


def test_frames_without_echoes_and_of_other_sizes_are_pooled():
    pairs = [*null("plain", 7, 6, 480), *null("plain", 8, 6, 960)]
    nothing = pairs[0].measured.take(np.zeros(len(pairs[0].measured), dtype=bool))
    pairs.append(pairs[0]._replace(measured=nothing, simulated=nothing))
    verdict = verdict_on(iter(pairs))
    assert verdict.frames == 3
    assert 85 <= verdict.units <= 90
    assert not verdict.kpis["ks", "AREA"].not_judged


def test_the_scene_of_the_tests_has_what_kpis_need():
    ideal = street(24, 960)
    assert set(np.unique(ideal.material_id)) == {1, 2, 3}
    assert (ideal.distance_m == 0.0).any()
