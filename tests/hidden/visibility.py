"""How far an effect stands out of the noise: simple summaries of frames with it and without it, as z."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .rays import Beams, Hits
from .sensor import Echoes

F = NDArray[np.float64]
N = NDArray[np.int64]
# The largest of 120 pairs of effect-free runs (4 frames, all scenes, both variants) was 3.8, their median 2.2.
VISIBLE_Z = 5.0
FEWEST = 40
NEAR_SURFACE_M = 2.0


@dataclass(frozen=True)
class Seen:
    """Features of every beam of several frames, (n,); NaN where there is no such echo."""

    features: dict[str, F]
    groups: dict[str, NDArray[np.bool_]]
    layer: N
    point: N


def _of_frame(echoes: Echoes, beams: Beams, hits: Hits) -> dict[str, F]:
    n = len(beams)
    order = np.lexsort((-echoes.area, echoes.beam))
    beam, first = np.unique(echoes.beam[order], return_index=True)
    best = order[first]
    values = {name: np.full(n, np.nan) for name in ("residual", "log_area", "peak", "width")}
    surface = hits.range_m[beam]
    near = (surface > 0) & (np.abs(echoes.range_m[best] - surface) < NEAR_SURFACE_M)
    beam, best = beam[near], best[near]
    values["residual"][beam] = echoes.range_m[best] - hits.range_m[beam]
    values["log_area"][beam] = np.log(np.maximum(echoes.area[best], 1.0))
    values["peak"][beam] = echoes.peak[best]
    values["width"][beam] = echoes.width_ns[best]
    at = hits.range_m[echoes.beam]
    apart = np.abs(echoes.range_m - at) > NEAR_SURFACE_M
    values["found"] = np.isfinite(values["residual"]).astype(float)
    for name, part in (
        ("extra", apart),
        ("extra_near", apart & (echoes.range_m < 20.0)),
        ("extra_twice", apart & (np.abs(echoes.range_m - 2 * at) < 3.0)),
        ("extra_behind", apart & (echoes.range_m > at) & (at > 0)),
    ):
        values[name] = np.bincount(echoes.beam[part], minlength=n).astype(float)
    return values


def _groups_of_frame(beams: Beams, hits: Hits) -> dict[str, NDArray[np.bool_]]:
    groups = {"all": np.ones(len(beams), bool), "sky": hits.rectangle < 0}
    for m in range(1, 10):
        groups[f"material {m}"] = hits.material == m
    for low, high in ((0, 15), (15, 25), (25, 40), (40, 60), (60, 90), (90, 120), (120, 300)):
        groups[f"{low} to {high} m"] = (hits.range_m > low) & (hits.range_m <= high)
    for low in range(210, 306, 12):
        groups[f"layer {low}"] = (beams.layer >= low) & (beams.layer < low + 12)
    for low in range(430, 526, 12):
        groups[f"point {low}"] = (beams.point >= low) & (beams.point < low + 12)
    for low in (0, 30, 60, 80):
        groups[f"incidence {low}"] = (hits.range_m > 0) & (hits.incidence_deg >= low)
    width = len(np.unique(beams.point))
    image = hits.rectangle.reshape(-1, width)
    edge = np.zeros(image.shape, bool)
    edge[1:] |= image[1:] != image[:-1]
    edge[:-1] |= image[1:] != image[:-1]
    edge[:, 1:] |= image[:, 1:] != image[:, :-1]
    edge[:, :-1] |= image[:, 1:] != image[:, :-1]
    groups["edge"] = edge.ravel()
    retro = hits.material == 7
    groups["column of a sign"] = np.isin(beams.point, np.unique(beams.point[retro])) & ~retro
    groups["row of a sign"] = np.isin(beams.layer, np.unique(beams.layer[retro])) & ~retro
    return groups


def seen(frames: list[Echoes], beams: Beams, hits: list[Hits]) -> Seen:
    """The features of several frames, one after the other."""
    parts = [_of_frame(e, beams, h) for e, h in zip(frames, hits, strict=True)]
    groups = [_groups_of_frame(beams, h) for h in hits]
    return Seen(
        {name: np.concatenate([p[name] for p in parts]) for name in parts[0]},
        {name: np.concatenate([g[name] for g in groups]) for name in groups[0]},
        np.tile(beams.layer, len(frames)),
        np.tile(beams.point, len(frames)),
    )


def _z(a: F, b: F) -> float:
    a, b = a[np.isfinite(a)], b[np.isfinite(b)]
    if min(len(a), len(b)) < FEWEST:
        return 0.0
    variance = a.var() / len(a) + b.var() / len(b)
    return 0.0 if variance <= 0 else float((a.mean() - b.mean()) / np.sqrt(variance))


def _rate_z(a: F, b: F) -> float:
    """Of rare counts, by their Poisson scatter: a variance of nothing is no certainty."""
    if min(len(a), len(b)) < FEWEST:
        return 0.0
    return float((a.mean() - b.mean()) / np.sqrt((a.sum() + b.sum() + 8.0) / 2 * (1 / len(a) ** 2 + 1 / len(b) ** 2)))


def _line_z(line_a: N, a: F, line_b: N, b: F) -> float:
    """Chi-square of a feature's mean over layers or points, as z: sees what alternates."""
    low, lines = int(line_a.min()), int(line_a.max() - line_a.min()) + 1
    stats = []
    both = np.concatenate([a, b])
    variance = both[np.isfinite(both)].var()  # of single values, so that a line without scatter is no certainty
    for line, values in ((line_a, a), (line_b, b)):
        good = np.isfinite(values)
        count = np.bincount(line[good] - low, minlength=lines)
        total = np.bincount(line[good] - low, weights=values[good], minlength=lines)
        squares = np.bincount(line[good] - low, weights=values[good] ** 2, minlength=lines)
        mean = total / np.maximum(count, 1)
        own = squares / np.maximum(count, 1) - mean**2
        stats.append((count, mean, (0.7 * own + 0.3 * variance) / np.maximum(count, 1)))
    (n1, m1, v1), (n2, m2, v2) = stats
    good = (n1 >= FEWEST) & (n2 >= FEWEST) & (v1 + v2 > 0)
    if good.sum() < 5:
        return 0.0
    chi = np.sum((m1[good] - m2[good]) ** 2 / (v1[good] + v2[good]))
    surplus = max(float(chi - good.sum()), 0.0)
    # The first is how unlikely chance is, 1.5 since its tails are not normal; the second what a matched filter sees.
    return min(surplus / math.sqrt(2.0 * good.sum()) / 1.5, math.sqrt(surplus))


def _spread_z(a: F, b: F) -> float:
    """Of the distance from one common middle, far ones cut off."""
    a, b = a[np.isfinite(a)], b[np.isfinite(b)]
    if min(len(a), len(b)) < FEWEST:
        return 0.0
    middle = np.median(b)
    far = np.abs(b - middle)
    cut = max(5.0 * float(np.median(far)), 0.5 * float(b.std()))
    return _z(np.minimum(np.abs(a - middle), cut), np.minimum(far, cut))


def stands_out(with_effect: Seen, without: Seen) -> tuple[float, str]:
    """The largest |z| of all summaries, and which one it is."""
    best, where = 0.0, ""

    def look(z: float, what: str) -> None:
        nonlocal best, where
        if abs(z) > best:
            best, where = abs(z), what

    for group in with_effect.groups:
        one, other = with_effect.groups[group], without.groups[group]
        for name in with_effect.features:
            a, b = with_effect.features[name][one], without.features[name][other]
            if name.startswith("extra"):
                look(_rate_z(a, b), f"{name} of {group}")
                continue
            look(_z(a, b), f"mean {name} of {group}")
            if name in ("residual", "log_area"):
                look(_spread_z(a, b), f"spread of {name} of {group}")
    for name in ("residual", "log_area", "found", "extra"):
        a, b = with_effect.features[name], without.features[name]
        look(_line_z(with_effect.layer, a, without.layer, b), f"{name} layer by layer")
        look(_line_z(with_effect.point, a, without.point, b), f"{name} point by point")
    return best, where
