"""The linear detector as the contract on sensors (6.1) states it, beam by beam in plain Python."""

import math

import numpy as np

C = 0.299792458


def merged(surfaces, separation):
    """Chains of surfaces (range, S) nearer to each other than `separation`, each as one: weighted range, summed S."""
    chains = []
    for range_m, signal in sorted(surfaces):
        if chains and range_m - chains[-1][-1][0] < separation:
            chains[-1].append((range_m, signal))
        else:
            chains.append([(range_m, signal)])
    return [(sum(r * s for r, s in chain) / sum(s for _, s in chain), sum(s for _, s in chain)) for chain in chains]


def rice_per_ns(sensor, variance):
    """False echoes a ns of noise alone."""
    if sensor.noise == 0.0:
        return 0.0

    def rice(v):
        return 0.44 / sensor.pulse_fwhm_ns / math.sqrt(3.0) * math.exp(-(sensor.threshold**2) / (2.0 * v))

    if sensor.false_rate_hz is None:
        return rice(variance)
    return sensor.false_rate_hz * 1e-9 * rice(variance) / rice(sensor.noise**2)


def range_sigma(sensor, range_m, signal, sigma):
    if sensor.range_law == "distance":
        return sensor.range_base_m + sensor.range_slope * range_m
    if sensor.range_law == "power":
        return math.hypot(
            sensor.range_floor_m, sensor.range_at_threshold_m * (sensor.threshold / signal) ** sensor.range_power
        )
    width = C / 2 * sensor.edge_factor * sensor.pulse_fwhm_ns / 2.3548
    return math.hypot(sensor.range_floor_m, width * sigma / signal)


def kept(keep, most, echoes):
    """Which of the echoes (dicts, nearest first) survive, in the order that `keep` names."""
    by_strength = sorted(echoes, key=lambda echo: (-echo["a"], echo["path"]))
    lists = {"strongest": by_strength, "first": echoes, "last": echoes[::-1]}
    if keep in lists:
        return lists[keep][:most]
    if not echoes:
        return []
    words = {"strongest": by_strength[0], "first": echoes[0], "last": echoes[-1]}
    first, second = keep.split("_")
    pair = [words[first]]
    others = [echo for echo in by_strength if echo is not pair[0]]
    if others and most > 1:
        wanted = words.get(second, pair[0])
        pair.append(others[0] if wanted is pair[0] else wanted)
    return pair


def beam_echoes(sensor, surfaces, ambient, rng):
    """The echoes of one shot, nearest first: dicts of path, reported range, a, pick."""
    dark = sensor.noise**2 + ambient
    found, real = [], []
    for range_m, signal in merged([s for s in surfaces if s[1] > 0.0], sensor.separation_m):
        sigma = math.sqrt(dark + sensor.excess * signal + (sensor.relative * signal) ** 2)
        a = signal + sigma * rng.standard_normal()
        if a <= sensor.threshold:
            continue
        a = a if sensor.saturation is None else min(a, sensor.saturation)
        path = range_m + range_sigma(sensor, range_m, signal, sigma) * rng.standard_normal()
        reference = 10.0 * sensor.threshold if sensor.walk_reference is None else sensor.walk_reference
        path -= sensor.walk_m_per_decade * math.log10(a / reference) if sensor.walk_m_per_decade else 0.0
        found.append({"path": path, "a": a})
        real.append(range_m)
    gate = sensor.max_range_m - sensor.min_range_m
    if rng.random() < 1.0 - math.exp(-rice_per_ns(sensor, dark) * 2.0 * gate / C):
        path = sensor.min_range_m + gate * rng.random() - sensor.range_offset_m
        if all(abs(path - r) >= sensor.separation_m for r in real):
            found.append({"path": path, "a": math.sqrt(sensor.threshold**2 + 2.0 * dark * rng.exponential())})
    for echo in found:
        range_m = echo["path"] + sensor.range_offset_m
        step = sensor.range_resolution_m
        echo["range"] = round(range_m / step) * step if step > 0.0 else range_m
    inside = [echo for echo in found if sensor.min_range_m <= echo["range"] <= sensor.max_range_m]
    inside.sort(key=lambda echo: echo["path"])
    for place, echo in enumerate(kept(sensor.keep, sensor.max_echoes, inside)):
        echo["pick"] = place
    return [echo for echo in inside if "pick" in echo]


def frame(sensor, surfaces, ambient, beams, seed):
    """Beam, number, pick, range and amplitude of the echoes of that many beams with the same surfaces, as columns."""
    rng = np.random.default_rng(seed)
    rows = []
    for beam in range(beams):
        for number, echo in enumerate(beam_echoes(sensor, surfaces, ambient, rng), start=1):
            rows.append((beam, number, echo["pick"], echo["range"], echo["a"]))
    return np.array(rows).reshape(-1, 5).T
