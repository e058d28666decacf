"""How well ghosts are found and fitted on drawn frames.

`python tests/kits/ghost_scores.py find 2000 60`, `... fit 300 30`.

The first number is the first seed, the second how many. Prints a line for each seed, and the sums.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from ghost_frames import Made, Recipe, made
from lidarcheck.calibration.ghosts.fit import fit_ghosts
from lidarcheck.calibration.ghosts.workflow import GHOST, SIGN, GhostScan, find_ghosts
from lidarcheck.errors import InputError
from lidarcheck.formats import load_ideal, load_scan
from lidarcheck.model import load_model

RANGES_M = (25, 45, 65, 85)


def drawn(seed: int) -> Recipe:
    """A frame to find a sign in."""
    g = np.random.default_rng([seed, 99])
    range_m = RANGES_M[seed % 4] * g.uniform(0.95, 1.05)
    return Recipe(
        variant=("SMART", "SLIM")[seed // 4 % 2], range_m=range_m, seed=seed,
        ratio=float(np.exp(g.uniform(np.log(5e-5), np.log(5e-4)))), power=g.choice([0, 0.25, 0.5]),
        extra_m=g.uniform(0, 0.6), size_m=tuple(g.uniform(0.5, 0.95, 2)), turn_deg=g.uniform(-15, 15),
        ghost_share=g.choice([1, 1, 0.5, 0.0]), wall_at_ghost=g.random() < 0.5, noise_share=g.choice([0, 0.3, 0.6]),
        blooming=g.choice(["", "weak", "medium", "strong"]), second_sign=g.random() < 0.4,
    )  # fmt: skip


def case(seed: int) -> tuple[dict[str, float], list[Recipe]]:
    """True parameters and four frames to fit them to."""
    g = np.random.default_rng([seed, 77])
    variant = ("SMART", "SLIM")[seed % 2]
    least = np.log(8e-5 if variant == "SLIM" else 1.5e-4)
    strength, exponent = float(np.exp(g.uniform(least, np.log(5e-4)))), float(g.uniform(-0.3, 1.0))
    truth = {"strength": strength, "exponent": exponent, "extra_m": float(g.uniform(0, 0.6))}
    size_m = tuple(g.uniform(0.55, 0.95, 2))
    recipes = [
        Recipe(
            variant=variant, range_m=range_m * g.uniform(0.95, 1.05), seed=10 * seed + k, ratio=strength,
            power=exponent, extra_m=truth["extra_m"], size_m=size_m, turn_deg=g.uniform(-10, 10),
            wall_at_ghost=g.random() < 0.3,
            noise_share=g.choice([0, 0.3]), blooming=g.choice(["", "weak", "medium"]),
        )
        for k, range_m in enumerate(RANGES_M)
    ]  # fmt: skip
    return truth, recipes


def looked_at(frame: Made, place: Path, name: str) -> GhostScan:
    """What is found in a frame, read from its files."""
    for part, suffix in (("scan", "txt"), ("ideal", "txt"), ("model", "toml")):
        (place / f"{part}.{suffix}").write_text(getattr(frame, f"{part}_text"), encoding="utf-8")
    return find_ghosts(load_scan(place / "scan.txt"), name=name)


def score_find(seeds: range, place: Path) -> None:
    """Precision and recall of sign and ghost."""
    total = np.zeros((3, 3), dtype=int)
    for seed in seeds:
        frame = made(drawn(seed))
        try:
            label = looked_at(frame, place, str(seed)).label
        except InputError as error:
            print(seed, error)
            label = np.zeros(len(frame.label), dtype=int)
        counts = np.zeros((3, 3), dtype=int)
        np.add.at(counts, (frame.label, label), 1)
        total += counts
        print(seed, {name: counts[k, 1:].tolist() for name, k in (("sign", SIGN), ("ghost", GHOST))}, flush=True)
    for name, k in (("sign", SIGN), ("ghost", GHOST)):
        print(f"{name}: precision {total[k, k] / total[:, k].sum():.5f}, recall {total[k, k] / total[k].sum():.5f}")


def score_fit(seeds: range, place: Path) -> None:
    """How often the true value lies in the interval."""
    inside = []
    for seed in seeds:
        truth, recipes = case(seed)
        found, ideals = [], []
        for recipe in recipes:
            found.append(looked_at(made(recipe), place, f"{recipe.range_m:.0f} m"))
            ideals.append(load_ideal(place / "ideal.txt"))
        fit = fit_ghosts(found, ideals, load_model(place / "model.toml"))
        inside.append([p.low <= truth[name] <= p.high for name, p in fit.parameters.items()])
        print(seed, {name: f"{truth[name]:.4g} in {p.low:.4g} ... {p.high:.4g}" for name, p in fit.parameters.items()})
    print(dict(zip(truth, np.mean(inside, axis=0).round(3).tolist(), strict=True)), "of", len(inside))


if __name__ == "__main__":
    first, count = int(sys.argv[2]), int(sys.argv[3])
    with tempfile.TemporaryDirectory() as directory:
        {"find": score_find, "fit": score_fit}[sys.argv[1]](range(first, first + count), Path(directory))
