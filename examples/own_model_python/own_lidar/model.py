"""Ideal scan in, echoes out: noisy amplitudes, a comparator that fires early on strong pulses, a counter's steps."""

import numpy as np

ENERGY = 150_000.0  # amplitude of a white surface at 1 m
NOISE = 1.0  # standard deviation of the amplitude, in the dark
SHOT = 0.05  # variance that a unit of light adds
EDGE_M = 0.35  # half the rise of the pulse
APART_M = 0.9  # surfaces of a beam that are nearer than that are one echo
STEP_M = 0.01
NEAREST_M, FARTHEST_M = 0.5, 100.0
FULL_SCALE = 4095.0
LAYERS, POINTS, RETURNS = 32, 1200, 2
REFLECTANCE = {1: 0.12, 2: 0.1, 3: 0.5, 4: 0.8, 5: 0.35, 6: 0.3, 7: 0.6, 8: 0.25}
RETRO = {7: 900.0}


def simulate(ideal, seed, frame=0, threshold=5.0):
    """The echoes of an ideal scan: a dict of columns. `ideal` has columns by name, `threshold` is an amplitude."""
    met = ideal["Distance"] > 0
    beam = ideal["Layer"].astype(np.int64) * POINTS + ideal["Point"]
    light, place = amplitudes(ideal, beam), ideal["Distance"].astype(float)
    dark = NOISE**2 * ideal.get("Background", np.ones(len(beam)))
    beam, place, light, dark = merged(*(column[met] for column in (beam, place, light, dark)))
    heard, early = draws(beam, seed, frame)
    amplitude = light + np.sqrt(dark + SHOT * light) * heard
    # The comparator fires where the leading edge crosses the threshold: earlier on a strong pulse.
    sure = np.maximum(amplitude, threshold)
    spread = 0.01 + EDGE_M * np.sqrt(dark + SHOT * light) / sure
    away = place + EDGE_M * (np.sqrt(threshold / sure) - 0.3) + spread * early
    away = np.round(away / STEP_M) * STEP_M
    seen = (amplitude > threshold) & (away > NEAREST_M) & (away < FARTHEST_M)
    beam, away, amplitude = beam[seen], away[seen], amplitude[seen]
    number = places(beam) + 1
    columns = {"Layer": beam // POINTS, "Point": beam % POINTS, "RANGE": away, "EchoNumber": number}
    columns["INTENSITY"] = np.rint(np.minimum(amplitude, FULL_SCALE))
    return {name: column[number <= RETURNS] for name, column in columns.items()}


def amplitudes(ideal, beam):
    """The amplitude of each row without noise, (n,): by its material, angle, distance and share of the light."""
    material = ideal["MaterialID"]
    known = np.zeros(max(int(material.max(initial=0)), *REFLECTANCE) + 1)
    gain = np.zeros(len(known))
    known[list(REFLECTANCE)] = list(REFLECTANCE.values())
    gain[list(RETRO)] = list(RETRO.values())
    cosine = np.where(gain[material] > 0, gain[material], np.cos(np.deg2rad(ideal["IncidenceAngle"])))
    _, own, rows = np.unique(beam, return_inverse=True, return_counts=True)
    share = ideal["Share"] if "Share" in ideal else 1.0 / rows[own]
    bright = ideal.get("Reflectance", known[material])
    bright = np.where(np.isfinite(bright), bright, known[material])
    return ENERGY * share * bright * cosine / np.maximum(ideal["Distance"], 0.1) ** 2


def merged(beam, place, light, dark):
    """Rows of a beam that are too near for two echoes as one, where most of the light is; by beam and distance."""
    order = np.lexsort((place, beam))
    beam, place, light, dark = (column[order] for column in (beam, place, light, dark))
    new = np.ones(len(beam), bool)
    new[1:] = (np.diff(beam) != 0) | (np.diff(place) > APART_M)
    group = np.cumsum(new) - 1
    total = np.bincount(group, light)
    middle = np.bincount(group, light * place) / np.maximum(total, 1e-30)
    return beam[new], np.where(total > 0, middle, place[new]), total, dark[new]


def places(beam):
    """The place of each row among those of its beam, from 0; rows of a beam stand together."""
    at = np.arange(len(beam))
    first = np.ones(len(beam), bool)
    first[1:] = np.diff(beam) != 0
    return at - np.maximum.accumulate(np.where(first, at, 0))


def draws(beam, seed, frame):
    """Normal numbers for amplitude and range of each row; those of a beam do not depend on other beams."""
    drawn = np.random.default_rng([seed, frame]).standard_normal((2, 4, LAYERS * POINTS))
    slot = np.minimum(places(beam), 3)
    return drawn[0, slot, beam], drawn[1, slot, beam]
