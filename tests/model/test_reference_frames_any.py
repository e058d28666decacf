"""Linear detectors and a histogram chip against frames of an independent simulator, written from the contracts alone.

Light is made here, from the rows of the ideal scan and the table of materials. Detection: detected beams against the
sum of beams' shares over many seeds, as z. Values: two-sample Kolmogorov–Smirnov in groups of one material and 20 m of
range. Histograms: bin by bin, as chi-squared of all. Seeds are fixed, so that the outcome is too.
"""

import csv

import numpy as np
import pytest
from scipy import stats

from lidarcheck.model import load_model
from lidarcheck.model.histogram.echoes import histogram_echoes
from lidarcheck.model.linear.echoes import linear_echoes
from lidarcheck.scan import Light
from places import shared_path

FOLDER = "data/reference_frames_any"
GROUP_M = 20.0
FEWEST = 20
SEEDS = 30


def columns_of(path):
    with path.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def light_of_rows(path, model):
    """The light of the beams of an ideal scan, and the material of each pulse."""
    layer, point, distance, material, incidence = np.loadtxt(path, skiprows=2)[:, :5].T
    strength, falloff = np.zeros(len(layer)), np.zeros(len(layer))
    for number, known in model.materials.items():
        retro = known.kind == "retro"
        strength[material == number] = known.reflectance * (known.retro_gain if retro else 1.0)
        falloff[material == number] = 0.0 if retro else 1.0
    lit = strength * np.cos(np.deg2rad(incidence)) ** falloff
    signal = model.sensor.signal_at_1m * np.divide(lit, distance**2, out=np.zeros(len(lit)), where=distance > 0.0)
    key = layer * 1e6 + point
    order = np.lexsort((distance, key))
    first = np.flatnonzero(np.concatenate([[True], np.diff(key[order]) > 0.0]))
    rows = np.diff(np.append(first, len(order)))
    light = Light(
        layer=layer[order][first].astype(np.int32),
        point=point[order][first].astype(np.int32),
        background_per_ns=np.full(len(first), model.sensor.background_per_ns),
        first_pulse=np.append(first, len(order)),
        pulse_range_m=distance[order],
        pulse_signal=(signal[order] / np.repeat(rows, rows)),
        beams=model.sensor.beams,
    )
    return light, material[order].astype(int)


@pytest.fixture(scope="module", params=["hdl32e", "os1_128", "xt32"])
def frame(request):
    """Light, materials, sensor, the reference's columns without copies of rows, and our echoes of many seeds."""
    model = load_model(shared_path(f"{FOLDER}/{request.param}/model.toml"))
    light, material = light_of_rows(shared_path(f"{FOLDER}/{request.param}/ideal.txt"), model)
    reference = columns_of(shared_path(f"{FOLDER}/{request.param}/echoes.csv"))
    whole = np.column_stack([values for name, values in reference.items() if name != "EchoNumber"])
    new = np.concatenate([[True], np.any(whole[1:] != whole[:-1], axis=1)])
    reference = {name: values[new] for name, values in reference.items()}
    key = light.layer.astype(np.int64) * 10**6 + light.point
    reference["beam"] = np.searchsorted(key, (reference["Layer"] * 10**6 + reference["Point"]).astype(np.int64))
    return light, material, model.sensor, reference, [linear_echoes(light, model.sensor, seed=s) for s in range(SEEDS)]


def test_detections_and_false_echoes_agree(frame):
    light, _, _, reference, ours = frame
    share = np.mean([np.bincount(found.beam, minlength=len(light)) for found in ours], axis=0)
    assert share.max() <= 1.0  # single surfaces and hardly a false echo, so that a share is a chance
    seen = np.bincount(reference["beam"], minlength=len(light))
    assert seen.max() == 1
    spread = np.sqrt((share * (1.0 - share)).sum() * (1.0 + 1.0 / SEEDS))
    assert abs(seen.sum() - share.sum()) < 4.0 * spread
    assert np.all(seen[share == 1.0].mean() > 0.999)


def test_ranges_and_features_agree(frame):
    light, material, sensor, reference, ours = frame
    surface_m = light.pulse_range_m + np.asarray(sensor.beams.range_offset_m(light.layer))
    group = np.where(light.pulse_range_m > 0.0, material * 1000 + (light.pulse_range_m // GROUP_M).astype(int), -1)
    p_values = []
    ours_beam = np.concatenate([found.beam for found in ours])
    ours_m = np.concatenate([found.range_m for found in ours])
    for number in np.unique(group[group >= 0]):
        theirs, mine = group[reference["beam"]] == number, group[ours_beam] == number
        if theirs.sum() < FEWEST:
            continue
        residuals = (reference["RANGE"] - surface_m[reference["beam"]])[theirs], (ours_m - surface_m[ours_beam])[mine]
        p_values.append(stats.ks_2samp(*residuals).pvalue)
        for feature in sensor.features:
            values = np.concatenate([found.features[feature.name] for found in ours])
            p_values.append(stats.ks_2samp(reference[feature.name][theirs], values[mine]).pvalue)
    assert len(p_values) >= 14
    assert min(p_values) * len(p_values) > 1e-3


@pytest.fixture(scope="module")
def zones():
    """Each frame of the chip: light, the reference's columns, our echoes of some seeds; and the sensor."""
    model = load_model(shared_path(f"{FOLDER}/tmf8820_short/model.toml"))
    frames = []
    for number in range(40):
        light, _ = light_of_rows(shared_path(f"{FOLDER}/tmf8820_short/ideal_{number:02}.txt"), model)
        reference = columns_of(shared_path(f"{FOLDER}/tmf8820_short/echoes_{number:02}.csv"))
        ours = [histogram_echoes(light, model.sensor, seed=seed, frame=number) for seed in range(SEEDS)]
        reference["beam"] = (reference["Layer"] * 3 + reference["Point"]).astype(int)
        frames.append((light, reference, ours))
    return frames, model.sensor


def test_histograms_agree_bin_by_bin(zones):
    frames, sensor = zones
    total, number = 0.0, 0
    for _, reference, ours in frames:
        mean = np.mean([found.histogram for found in ours], axis=0)
        beams, first = np.unique(reference["beam"], return_index=True)
        counts = np.column_stack([reference[f"h{k}"] for k in range(sensor.bins)])[first]
        total += ((counts - mean[beams]) ** 2 / (mean[beams] * (1.0 + 1.0 / SEEDS))).sum()
        number += counts.size
    # A Poisson number of mean m gives its chi-squared a variance of 2 + 1 / m; the faintest bins hold about 7.
    assert abs(total - number) < 4.0 * np.sqrt(number * (2.0 + 1.0 / 6.0))


def test_echoes_of_histograms_agree(zones):
    frames, _ = zones
    theirs, mine = ([], [], []), ([], [], [])
    for light, reference, ours in frames:
        mean_m = np.add.reduceat(light.pulse_range_m * light.pulse_signal, light.first_pulse[:-1])
        mean_m /= np.add.reduceat(light.pulse_signal, light.first_pulse[:-1])
        rows = (reference["RANGE"] - mean_m[reference["beam"]], reference["CONFIDENCE"], reference["EchoNumber"])
        for column, values in zip(theirs, rows, strict=True):
            column.append(values)
        for found in ours:
            rows = (found.range_m - mean_m[found.beam], found.features["CONFIDENCE"], found.echo_number)
            for column, values in zip(mine, rows, strict=True):
                column.append(values)
    theirs, mine = ([np.concatenate(column) for column in side] for side in (theirs, mine))
    assert abs(len(theirs[0]) - len(mine[0]) / SEEDS) < 4.0 * 3.0  # few zones are near the threshold
    for number in (1, 2):
        for column in (0, 1):
            pair = [side[column][side[2] == number] for side in (theirs, mine)]
            assert stats.ks_2samp(*pair).pvalue > 1e-3
