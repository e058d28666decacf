"""`simulate` against frames of an independent simulator that follows every detector: feature by feature.

Each frame of echoes is held against many seeds of its own ideal scan, in groups of one material and 20 m of range.
Detection: the number of detected beams against the sum of the beams' shares over the seeds, as z. Features:
two-sample Kolmogorov–Smirnov. All tests together may err once in a thousand runs (Bonferroni); seeds are fixed, so
that the outcome is too.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.kpi.pairing import Pairing, pair_with_ideal
from lidarcheck.model import load_model, simulate
from lidarcheck.scan import IdealScan, Scan
from places import shared_path

FRAMES = ("SMART_lab", "SMART_street", "SLIM_sign")
SEEDS = 32
GROUP_M = 20.0
FEWEST = 20
ERROR_BUDGET = 1e-3
FEATURES = ("range_residual", "peak", "area", "width_ns")


@dataclass
class Frame:
    ideal: IdealScan
    reference: tuple[Scan, Pairing]
    simulated: list[tuple[Scan, Pairing]]


@pytest.fixture(scope="module", params=FRAMES)
def frame(request):
    folder = "data/reference_frames"
    ideal = load_ideal(shared_path(f"{folder}/{request.param}_ideal.txt"))
    echoes = load_scan(shared_path(f"{folder}/{request.param}_echoes.txt"))
    model = load_model(shared_path(f"{folder}/{request.param.split('_')[0]}_model.toml"))
    scans = [simulate(ideal, model, seed=seed) for seed in range(SEEDS)]
    return Frame(ideal, (echoes, pair_with_ideal(ideal, echoes)), [(s, pair_with_ideal(ideal, s)) for s in scans])


def group_of(ideal, rows):
    """Material and range bin of rows of the ideal scan, as one number; -1 for none."""
    bin_m = np.floor(ideal.distance_m[rows] / GROUP_M).astype(np.int64)
    return np.where(rows >= 0, ideal.material_id[rows] * 1000 + bin_m, -1)


def beams_seen(frame, pairing, group):
    """Whether each row's beam has an echo from that row's surface, for the rows of a group."""
    seen = np.zeros(len(frame.ideal), dtype=bool)
    seen[pairing.surface[pairing.of_surface]] = True
    return seen[group]


def column(scan, pairing, name, rows):
    return (pairing.residual_m if name == "range_residual" else getattr(scan, name))[rows]


def test_detection(frame):
    all_rows = np.arange(len(frame.ideal))
    groups = group_of(frame.ideal, all_rows)
    zs = {}
    for group in np.unique(groups[frame.ideal.distance_m > 0]):
        rows = np.flatnonzero((groups == group) & (frame.ideal.distance_m > 0))
        share = np.mean([beams_seen(frame, p, rows) for _, p in frame.simulated], axis=0)
        variance = np.sum(share * (1 - share)) * SEEDS / (SEEDS - 1) * (1 + 1 / SEEDS)
        difference = beams_seen(frame, frame.reference[1], rows).sum() - share.sum()
        if variance >= 3.0:
            zs[f"material {group // 1000}, {GROUP_M * (group % 1000):g} m"] = difference / np.sqrt(variance)
        else:
            assert abs(difference) <= 8.0, f"group {group}: {difference} beams"
    report("detection z", zs)
    assert zs
    limit = stats.norm.isf(ERROR_BUDGET / 2 / len(zs))
    assert max(abs(z) for z in zs.values()) < limit, zs


def test_number_of_echoes_off_all_surfaces(frame):
    simulated = sum(np.count_nonzero(~p.of_surface) for _, p in frame.simulated)
    found = np.count_nonzero(~frame.reference[1].of_surface)
    # Of rare echoes at one rate, the frame's share of all is that of one frame among SEEDS + 1.
    p = stats.binomtest(found, found + simulated, 1 / (SEEDS + 1)).pvalue if found + simulated else 1.0
    report("echoes off all surfaces, p", {f"{found} against {simulated} in {SEEDS} frames": p})
    assert p > ERROR_BUDGET


def test_number_of_echoes(frame):
    numbers = np.array([len(s) for s, _ in frame.simulated])
    z = (len(frame.reference[0]) - numbers.mean()) / (numbers.std(ddof=1) * np.sqrt(1 + 1 / SEEDS))
    report("echoes z", {f"{len(frame.reference[0])} against {numbers.mean():.1f}": z})
    assert abs(z) < stats.t.isf(ERROR_BUDGET / 2, SEEDS - 1)


def test_features(frame):
    scan, pairing = frame.reference
    scans = [s for s, _ in frame.simulated]
    groups = np.where(pairing.of_surface, group_of(frame.ideal, pairing.surface), -1)
    simulated_groups = [np.where(p.of_surface, group_of(frame.ideal, p.surface), -1) for _, p in frame.simulated]
    p_values = {}
    for group in np.unique(groups[groups >= 0]):
        rows = np.flatnonzero(groups == group)
        if rows.size < FEWEST:
            continue
        for name in FEATURES:
            mine = np.concatenate(
                [
                    column(s, p, name, g == group)
                    for s, (_, p), g in zip(scans, frame.simulated, simulated_groups, strict=True)
                ]
            )
            key = f"material {group // 1000}, {GROUP_M * (group % 1000):g} m, {name}, n = {rows.size}"
            p_values[key] = stats.ks_2samp(column(scan, pairing, name, rows), mine, method="asymp").pvalue
    report("KS p", p_values)
    assert min(p_values.values()) > ERROR_BUDGET / len(p_values), p_values


def test_mean_features(frame):
    """Means see a common shift that a distribution test spreads thin."""
    scan, pairing = frame.reference
    zs = {}
    for name in FEATURES:
        mine = [column(s, p, name, p.of_surface) for s, p in frame.simulated]
        means = np.array([sample.mean() for sample in mine])
        difference = column(scan, pairing, name, pairing.of_surface).mean() - means.mean()
        zs[name] = difference / (means.std(ddof=1) * np.sqrt(1 + 1 / SEEDS))
    report("means z", zs)
    limit = stats.t.isf(ERROR_BUDGET / 2 / len(zs), SEEDS - 1)
    assert max(abs(z) for z in zs.values()) < limit, zs


def report(what, numbers):
    for key, value in numbers.items():
        print(f"{what}: {key}: {value:.3g}")
