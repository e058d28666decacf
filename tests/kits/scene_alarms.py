"""How often a scene comparison names what is wrong, and how often something where nothing is.

    python tests/kits/scene_alarms.py 200 220

runs those seeds, three scenes of the independent generator each (tests/hidden), and prints the counts. Measured frames
are the generator's, simulated ones the package's. Wrong is, one at a time: nothing; a layer that is dead; an object
that returns half the light; one that stands 0.3 m farther; one that stands 0.4 m to the left.
"""

import sys
from collections import Counter

import numpy as np

from lidarcheck.calibration.scenes.frame import simulated_frame
from lidarcheck.calibration.scenes.workflow import compare_scene
from lidarcheck.kpi.pairing import pair_with_ideal
from scene_kit import BEAMS, halved, hits_of, ideal_of, measured, model_of, scene_of, shifted

LEAST_OBJECT, LEAST_LAYER = 100, 30
"""Echoes: of what is hardly seen nothing can be said."""
LARGEST_MOVED_M = 20.0


def _listed(scan, ideal, model, seed):
    found = compare_scene([simulated_frame(scan, ideal, model, seed=seed)]).disagreements
    return [(d.kind, d.name) for d in found]


def _seen(scan, ideal, rng, movable):
    """An object with enough echoes, drawn at random; None where there is none."""
    pairing = pair_with_ideal(ideal, scan)
    echoes = Counter(ideal.object_id[pairing.surface[pairing.of_surface]].tolist())
    some = sorted(n for n, count in echoes.items() if count >= LEAST_OBJECT and n in movable)
    return int(rng.choice(some)) if some else None


def _direction(hits, number):
    azimuth = np.deg2rad(np.median(BEAMS.azimuth_deg[hits.object_id == number]))
    return np.cos(azimuth), np.sin(azimuth)


def run(seed, kind):
    """What was listed, by what was wrong: (wanted, all listed)."""
    variant = ("SMART", "SLIM")[seed % 2]
    model, scene, rng = model_of(variant), scene_of(kind, seed), np.random.default_rng(seed)
    hits = hits_of(scene)
    ideal, scan = ideal_of(hits), measured(scene, 7 * seed + 1, variant)
    results = {"nothing": (None, _listed(scan, ideal, model, seed))}
    layers, counts = np.unique(scan.layer, return_counts=True)
    layer = int(rng.choice(layers[counts >= LEAST_LAYER]))
    results["dead layer"] = ("layer", f"layer {layer}"), _listed(scan.take(scan.layer != layer), ideal, model, seed)
    objects = {part.object_id for part in scene.rectangles}
    large = {part.object_id for part in scene.rectangles if max(part.half_m) > LARGEST_MOVED_M}
    number = _seen(scan, ideal, rng, objects)
    other, table = halved(scene, number)
    wrong = measured(other, 7 * seed + 2, variant, table)
    results["half the light"] = ("object", f"object {number}"), _listed(wrong, ideal, model, seed)
    number = _seen(scan, ideal, rng, objects - large)
    if number is not None:
        ahead, left = _direction(hits, number)
        for name, by_m in (("0.3 m farther", (0.3 * ahead, 0.3 * left)), ("0.4 m left", (-0.4 * left, 0.4 * ahead))):
            wrong = measured(shifted(scene, number, (*by_m, 0.0)), 7 * seed + 3, variant)
            results[name] = ("object", f"object {number}"), _listed(wrong, ideal, model, seed)
    return results


def main(first, last):
    counts: dict[str, list[tuple[bool, bool, int]]] = {}
    for seed in range(first, last):
        for kind in ("street", "lab", "sign"):
            for name, (wanted, listed) in run(seed, kind).items():
                counts.setdefault(name, []).append((listed[:1] == [wanted], wanted in listed, len(listed)))
    for name, rows in counts.items():
        ranked, among, number = (sum(column) for column in zip(*rows, strict=True))
        if name == "nothing":
            print(f"{name}: something listed in {sum(bool(row[2]) for row in rows)} of {len(rows)} frames")
        else:
            print(f"{name}: first {ranked}, listed {among} of {len(rows)}; {number / len(rows):.1f} listed on average")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
