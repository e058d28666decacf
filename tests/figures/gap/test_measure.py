"""The numbers behind the pictures of a gap, against counting beam by beam."""

import dataclasses
import math

import numpy as np
import pytest

from explain_report_kit import AFTER, MODEL, frames
from lidarcheck.effects.finding import make
from lidarcheck.figures.gap.measure import pictures_of
from lidarcheck.model.chain import simulate
from lidarcheck.scan import Scan


def echoes_by_beam(scan):
    """(range, ln AREA, PEAK, WIDTH) of each echo, by beam."""
    found = {}
    columns = (scan.layer, scan.point, scan.range_m, np.log(scan.area), scan.peak, scan.width_ns)
    for layer, point, *features in zip(*(c.tolist() for c in columns), strict=True):
        found.setdefault((layer, point), []).append(features)
    return found


def paired(frame, scan):
    """The slow way: of each beam its surface's echo, or None, and its other echoes."""
    echoes = echoes_by_beam(scan)
    own, others = {}, {}
    for layer, point, distance in zip(*(c.tolist() for c in (frame.ideal.layer, frame.ideal.point,
                                                             frame.ideal.distance_m)), strict=True):  # fmt: skip
        mine = sorted(echoes.get((layer, point), []), key=lambda e: abs(e[0] - distance))
        hit = bool(mine) and distance > 0.0 and abs(mine[0][0] - distance) <= 2.0
        own[layer, point] = [mine[0][0] - distance, *mine[0][1:]] if hit else None
        others[layer, point] = mine[1:] if hit else mine
    return own, others


@pytest.fixture(scope="module")
def small():
    """A frame with few beams, its pictures, and the same found the slow way."""
    (frame,) = frames(numbers=(2,), every=7)
    found = pictures_of([frame], MODEL, AFTER, seed=5)
    scans = [simulate(frame.ideal, MODEL, seed=seed, frame=2) for seed in found.seeds]
    return frame, found, paired(frame, frame.measured), [paired(frame, scan) for scan in scans]


def test_histograms_count_every_echo_once(small):
    _, found, (own, others), before = small
    by_name = {one.feature: one for one in found.histograms}
    seen = sum(echo is not None for echo in own.values())
    assert [by_name[name].measured.sum() for name in ("range", "area", "peak", "width")] == [seen] * 4
    assert by_name["others"].measured.sum() == sum(map(len, others.values()))
    simulated = np.mean([sum(echo is not None for echo in side[0].values()) for side in before])
    assert by_name["area"].before.sum() == pytest.approx(simulated)


def test_histogram_bins_hold_what_they_say(small):
    _, found, (own, _), _ = small
    one = next(h for h in found.histograms if h.feature == "peak")
    peaks = [echo[2] for echo in own.values() if echo is not None]
    for i in range(1, len(one.measured) - 1):
        assert one.measured[i] == sum(one.edges[i] < peak < one.edges[i + 1] for peak in peaks)
    assert np.allclose(np.diff(one.edges), np.round(np.diff(one.edges)[0]))


@pytest.mark.parametrize(("feature", "column"), [("range", 0), ("area", 1), ("peak", 2), ("width", 3)])
def test_residuals_over_material_against_the_slow_way(small, feature, column):
    frame, found, (own, _), before = small
    curve = next(c for c in found.curves if (c.feature, c.covariate) == (feature, "material"))
    rows = zip(frame.ideal.layer.tolist(), frame.ideal.point.tolist(), frame.ideal.material_id.tolist(), strict=True)
    material = {(layer, point): MODEL.materials[m].name if m else "" for layer, point, m in rows}
    for i, name in enumerate(curve.bins):
        residuals = [
            own[beam][column] - side[beam][column]
            for side, _ in before
            for beam in own
            if material[beam] == name and own[beam] is not None and side[beam] is not None
        ]
        assert curve.count[i] == len(residuals)
        if len(residuals) >= 5:
            assert curve.before[i] == pytest.approx(np.quantile(residuals, [0.1, 0.5, 0.9]), abs=1e-9)
        else:
            assert np.isnan(curve.before[i]).all()


def test_detection_over_material_against_the_slow_way(small):
    frame, found, (own, _), before = small
    one = next(d for d in found.detected if d.covariate == "material")
    i = one.bins.index("panel 10 %")
    beams = [
        (int(a), int(b)) for a, b, m in zip(frame.ideal.layer, frame.ideal.point, frame.ideal.material_id, strict=True)
        if m == 3
    ]  # fmt: skip
    n, k = len(beams), sum(own[beam] is not None for beam in beams)
    z = 1.6448536269514722
    middle, half = (k + z**2 / 2) / (n + z**2), z * math.sqrt(k * (n - k) / n + z**2 / 4) / (n + z**2)
    assert one.count[i] == n
    assert one.measured[i] == pytest.approx([k / n, middle - half, middle + half])
    assert one.before[i] == pytest.approx(np.mean([[s[b] is not None for b in beams] for s, _ in before]))


def test_maps_against_the_slow_way(small):
    frame, found, (_, others), before = small
    one = next(m for m in found.maps if m.quantity == "others")
    for r, c in [(0, 0), (5, 9), (11, 23)]:
        (top, bottom), (left, right) = one.layers[r], one.points[c]
        beams = [b for b in others if top <= b[0] <= bottom and left <= b[1] <= right]
        if len(beams) < 5:
            assert math.isnan(one.before[r, c])
            continue
        more = np.mean([[len(others[b]) - len(side[b]) for b in beams] for _, side in before])
        assert one.before[r, c] == pytest.approx(100.0 * more)
    fired = len(np.unique(frame.ideal.layer)), len(np.unique(frame.ideal.point))
    assert one.before.shape == (min(12, fired[0]), min(24, fired[1]))


def test_an_offset_of_the_range_is_seen_as_such_and_goes():
    offset = MODEL.with_(make("range_offset", {"offset_m": 0.3}))
    found = pictures_of(frames(offset, numbers=(1,), every=3), MODEL, offset, seed=1)
    curve = next(c for c in found.curves if (c.feature, c.covariate) == ("range", "range"))
    assert curve.before[:, 1] == pytest.approx(0.3, abs=0.03)
    assert curve.after[:, 1] == pytest.approx(0.0, abs=0.03)
    image = next(m for m in found.maps if m.quantity == "range")
    assert np.nanmedian(image.before) == pytest.approx(0.3, abs=0.03)
    assert curve.clearness > 5.0 * dataclasses.replace(curve, before=curve.after).clearness


def test_amplitude_bins_do_not_make_a_bias():
    """Beams sorted by the very echoes that are compared would look too bright where they are bright."""
    found = pictures_of(frames(MODEL, numbers=(1, 4)), MODEL, MODEL, seed=1)
    curve = next(c for c in found.curves if (c.feature, c.covariate) == ("area", "amplitude"))
    known = np.isfinite(curve.before[:, 1]) & (curve.count > 200)
    assert known.sum() >= 5
    low, middle, high = curve.before[known].T
    # Standard error of a median of normal residuals; half of their variance is the measurement's, in both simulations.
    error = math.sqrt(1.5) * 1.2533 * (high - low) / 2.563 / np.sqrt(curve.count[known])
    # Chance exceeds three in one run of forty; sorted by the echoes that are compared, the dimmest are four off.
    assert np.all(np.abs(middle) < 3.0 * error), middle / error


def test_the_same_seed_gives_the_same_numbers_and_another_one_others():
    some = frames(numbers=(1,), every=9)
    first, again, other = (pictures_of(some, MODEL, AFTER, seed=seed) for seed in (3, 3, 4))
    assert np.array_equal(first.histograms[1].before, again.histograms[1].before)
    assert not np.array_equal(first.histograms[1].before, other.histograms[1].before)
    assert first.changed
    assert not pictures_of(some, MODEL, MODEL, seed=3).changed
    assert all(0 <= seed < 2**64 for seed in pictures_of(some, MODEL, MODEL, seed=2**64 - 1).seeds)


def test_of_very_many_beams_only_the_first_frames_are_shown(monkeypatch):
    some = frames(numbers=(3, 4, 5), every=9)
    monkeypatch.setattr("lidarcheck.figures.gap.measure._MOST_BEAMS", 2 * len(some[0].ideal))
    assert pictures_of(some, MODEL, AFTER, seed=1).frames == (3, 4)
    monkeypatch.setattr("lidarcheck.figures.gap.measure._MOST_BEAMS", 1)
    assert pictures_of(some, MODEL, AFTER, seed=1).frames == (3,)


def test_an_echo_at_the_sensor_does_not_break_the_log_scale():
    (frame,) = frames(numbers=(0,), every=50)
    m = frame.measured
    near = Scan.from_beams(m.layer, m.point, np.zeros(len(m)), width_ns=m.width_ns, area=0.0 * m.area, peak=m.peak)
    found = pictures_of([dataclasses.replace(frame, measured=near)], MODEL, AFTER, seed=1)
    assert found.histograms[0].measured.sum() == 0.0
    assert np.isfinite(found.histograms[1].edges).all()
    assert found.histograms[4].measured.sum() == len(m)
