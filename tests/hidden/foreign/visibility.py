"""How far an effect stands out of the noise: means, spreads and losses with it and without it, as z."""

import numpy as np
from numpy.typing import NDArray

from hidden.rays import Hits

from .detectors import Echoes
from .device import Beams, Device

F = NDArray[np.float64]
VISIBLE_Z = 5.0
FEWEST = 30
ON_SURFACE_M = 1.0


def _table(
    device: Device, frames: list[Echoes], beams: list[Beams], parts: list[list[Hits]]
) -> tuple[dict[str, F], dict[str, F]]:
    """Features (n,) of every beam's strongest echo, NaN where there is none; and what groups them."""
    values: dict[str, list[F]] = {name: [] for name in ("residual", "strength", "found", "extra", "ambient", "width")}
    groups: dict[str, list[F]] = {name: [] for name in ("layer", "column", "range", "material")}
    for echoes, own, hits in zip(frames, beams, parts, strict=True):
        n = len(own)
        ranges = np.stack([h.range_m for h in hits])
        apart = np.abs(ranges[:, echoes.beam] - echoes.path_m)
        nearest = np.argmin(np.where(ranges[:, echoes.beam] > 0, apart, np.inf), axis=0)
        at = ranges[nearest, echoes.beam]
        on = (at > 0) & (np.abs(echoes.path_m - at) < ON_SURFACE_M)
        rows = np.flatnonzero(on)
        rows = rows[np.argsort(echoes.amplitude[rows], kind="stable")]  # the strongest is written last
        row = {name: np.full(n, np.nan) for name in values}
        row["residual"][echoes.beam[rows]] = echoes.path_m[rows] - at[rows]
        row["strength"][echoes.beam[rows]] = np.log(np.maximum(echoes.amplitude[rows], 1.0))
        if "width_ns" in echoes.more:
            row["width"][echoes.beam[rows]] = echoes.more["width_ns"][rows]
        row["found"] = np.isfinite(row["residual"]).astype(float)
        row["extra"] = np.bincount(echoes.beam[~on], minlength=n).astype(float)
        if "counts" in echoes.of_beams:
            row["ambient"] = echoes.of_beams["counts"][:, -30:].mean(axis=1)
        elif device.reports("background"):
            row["ambient"][echoes.beam] = echoes.of_beams["ambient"][echoes.beam]
        for name in values:
            values[name].append(row[name])
        middle = hits[len(hits) // 2]
        of = {"layer": own.layer, "column": own.point // 6, "range": middle.range_m // 12.0}
        of["material"] = middle.material
        for name in groups:
            groups[name].append(np.asarray(of[name], np.float64))
    return {k: np.concatenate(v) for k, v in values.items()}, {k: np.concatenate(v) for k, v in groups.items()}


def _z(a: F, b: F, rare: bool) -> float:
    a, b = a[np.isfinite(a)], b[np.isfinite(b)]
    if min(len(a), len(b)) < FEWEST:
        return 0.0
    both = np.concatenate([a, b])
    variance = (both.mean() + 4.0 / len(both) if rare else both.var() + 1e-12) * (1 / len(a) + 1 / len(b))
    return float(abs(a.mean() - b.mean()) / np.sqrt(variance))


def stands_out(
    device: Device, with_effect: list[Echoes], without: list[Echoes], beams: list[Beams], parts: list[list[Hits]]
) -> tuple[float, str]:
    """The largest z of all summaries, and which one it is."""
    (one, groups), (other, _) = (_table(device, frames, beams, parts) for frames in (with_effect, without))
    best = (0.0, "")
    for name in one:
        middle = np.nanmedian(other[name]) if np.isfinite(other[name]).any() else 0.0
        pairs = {name: (one[name], other[name])}
        if name in ("residual", "strength"):
            pairs[f"spread of {name}"] = (np.abs(one[name] - middle), np.abs(other[name] - middle))
        for what, (a, b) in pairs.items():
            best = max(best, (_z(a, b, name == "extra"), what))
            for group, keys in groups.items():
                for key in np.unique(keys):
                    rows = keys == key
                    best = max(best, (_z(a[rows], b[rows], name == "extra"), f"{what} of {group} {key:.0f}"))
    return best
