"""Pairs of scans between which nothing, or one known thing, differs; and what `compare` says of them.

    python tests/kits/chance_kit.py 200 [KIND ...]     (or ci/nulls)

counts the nulls in which anything stands out, of each kind; `powers` in the place of a kind measures how often a known
difference does. Kinds: `plain`, one frame, two seeds of the model; `patches`, echoes lost in patches of 16 x 8 beams on
both sides; `gain`, ten frames whose signal is off by 2 % (one standard deviation) frame by frame, on both sides.
"""

import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from lidarcheck.effects.finding import make
from lidarcheck.kpi.chance.verdict import ChanceTest, Verdict
from lidarcheck.kpi.compare import compare
from lidarcheck.model import simulate
from lidarcheck.model.spec import Model
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material, Sensor

MATERIALS = {1: Material("wall", 0.5), 2: Material("asphalt", 0.12), 3: Material("dark", 0.03)}
FRAMES = {"plain": 1, "patches": 1, "gain": 10}
PATCH_POINTS, PATCH_LAYERS, PATCHES = 16, 8, 12
GAIN_SD = 0.02


class Pair(NamedTuple):
    ideal: IdealScan
    measured: Scan
    simulated: Scan


def model_of(variant: str = "SMART", *effects: object) -> Model:
    return Model(Sensor.of(variant), MATERIALS, effects=tuple(effects))


def street(layers: int, points: int, seed: int = 0) -> IdealScan:
    """Walls from 6 to 95 m, a piece of 5 to 40 points each, in three materials; the upper layers see the sky."""
    rng = np.random.default_rng(seed)
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(layers), np.arange(points), indexing="ij"))
    piece = np.searchsorted(np.cumsum(rng.integers(5, 40, points)), np.arange(points))
    distance = rng.uniform(6.0, 95.0, piece.max() + 1)[piece[point]] + 0.02 * layer
    material = rng.integers(1, 4, piece.max() + 1)[piece[point]]
    distance = np.where(layer >= layers * 7 // 8, 0.0, distance)
    return IdealScan(layer + 250, point, distance, material, np.full(layer.size, 10.0))


def without_patches(scan: Scan, ideal: IdealScan, rng: np.random.Generator) -> Scan:
    """The scan with patches of neighbouring beams lost, anywhere, in a number that varies."""
    lost = np.zeros(len(scan), dtype=bool)
    low = int(ideal.layer.min())
    for _ in range(rng.poisson(PATCHES)):
        layer = rng.integers(low - PATCH_LAYERS + 1, int(ideal.layer.max()) + 1)
        point = rng.integers(1 - PATCH_POINTS, int(ideal.point.max()) + 1)
        lost |= (abs(scan.layer - layer - 3.5) < 4) & (abs(scan.point - point - 7.5) < 8)
    return scan.take(~lost)


def null(kind: str, seed: int, layers: int = 24, points: int = 960) -> Iterator[Pair]:
    """Frames of two sides that are alike."""
    rng = np.random.default_rng([seed, 7])
    if kind == "gain":
        layers, points = layers // 2, points // 4
    for frame in range(FRAMES[kind]):
        ideal = street(layers, points, seed + 1000 * frame)
        sides = []
        for side in (0, 1):
            gain = rng.normal(1.0, GAIN_SD) if kind == "gain" else 1.0
            model = model_of("SMART", make("signal_gain", {"gain": gain})) if kind == "gain" else model_of()
            scan = simulate(ideal, model, seed=2 * seed + side, frame=frame, threads=1)
            sides.append(without_patches(scan, ideal, rng) if kind == "patches" else scan)
        yield Pair(ideal, *sides)


def verdict_on(frames: Iterator[Pair], model: Model | None = None) -> Verdict:
    test = ChanceTest()
    for one in frames:
        compare(one.measured, one.simulated, one.ideal, model=model, look=test.add)
    return test.verdict()


def alarms(kind: str, seeds: range) -> list[int]:
    """The seeds of nulls in which anything stands out."""
    return [seed for seed in seeds if verdict_on(null(kind, seed)).standing_out]


DIFFERENCES: dict[str, tuple[str, dict[str, float]]] = {
    "walk 5 mm a decade": ("walk_error", {"per_decade_m": 0.005}),
    "signal -3 %": ("signal_gain", {"gain": 0.97}),
    "offset 2 mm": ("range_offset", {"offset_m": 0.002}),
    "dropout 0.5 %": ("dropout", {"share": 0.005}),
    "blooming +10 %": ("blooming_vertical", {"strength": 1.1}),
}
"""Whose power is measured: an effect of the measured side alone; of blooming the simulated side has it at 1."""
SIGN = Material("sign", 0.5, "retro", 1000.0)
ONE, MANY = (128, 960, 1), (64, 240, 12)
"""Layers, points and frames of the two sizes that powers are measured on."""


def signs(layers: int, points: int, seed: int) -> IdealScan:
    """A wall at 80 m with retro-reflecting signs of 6 x 8 beams before it at 40 m, one in each 80 points."""
    ideal = street(layers, points, seed)
    row, column = ideal.layer - 250, ideal.point % 80
    sign = (abs(row - layers // 2) < 3) & (column >= 36) & (column < 44)
    distance, material = np.where(sign, 40.0, 80.0), np.where(sign, 4, 2)
    return IdealScan(ideal.layer, ideal.point, distance, material, np.zeros(len(ideal)))


def differing(name: str, seed: int, size: tuple[int, int, int]) -> tuple[Model, Iterator[Pair]]:
    """The simulated side's model, and frames of which the measured side has the named difference."""
    effect, settings = DIFFERENCES[name]
    layers, points, frames = size
    bloom = effect == "blooming_vertical"
    table = {**MATERIALS, 4: SIGN}
    plain = Model(Sensor.of("SMART"), table, effects=(make(effect, {"strength": 1.0}),) if bloom else ())
    other = Model(Sensor.of("SMART"), table, effects=(make(effect, settings),))

    def pairs() -> Iterator[Pair]:
        scene: Callable[[int, int, int], IdealScan] = signs if bloom else street
        for frame in range(frames):
            ideal = scene(layers, points, seed)
            shown = [
                simulate(ideal, model, seed=2 * seed + side, frame=frame, threads=1)
                for side, model in enumerate((other, plain))
            ]
            yield Pair(ideal, *shown)

    return plain, pairs()


def found(name: str, seed: int, size: tuple[int, int, int]) -> Verdict:
    """What is said of one comparison in which the named thing differs."""
    model, frames = differing(name, seed, size)
    return verdict_on(frames, model)


def main() -> None:
    number, kinds = int(sys.argv[1]), sys.argv[2:] or [*FRAMES]
    for kind in kinds:
        if kind == "powers":
            for name in DIFFERENCES:
                for size in (ONE, MANY):
                    seen = [found(name, 5000 + seed, size) for seed in range(number)]
                    out = sum(bool(v.standing_out) for v in seen)
                    first = [v.standing_out[0] for v in seen if v.standing_out]
                    words = sorted({f"{one.kpi} {one.of}" for one in first})
                    print(f"{name}, {size}: {out} of {number}; strongest: {', '.join(words)}", flush=True)
        else:
            bad = alarms(kind, range(1000, 1000 + number))
            print(f"{kind}: {len(bad)} of {number} nulls with anything standing out: {bad}", flush=True)


if __name__ == "__main__":
    main()
