"""Forms inside the receiver: crosstalk, afterpulses, dead time, the pulse, the threshold."""

import numpy as np

from . import kernel
from .chain import Effect, Frame
from .forms import Draw, form
from .sensor import DEAD_BINS, FWHM_NS, ON_BINS, TABLE_NS, Detectors, gaussian_shape, summed_shape

SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))
CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))


@form("crosstalk", "anywhere")
def _anywhere(draw: Draw) -> Effect:
    chance = draw.level(0.04, 0.08, 0.2)

    def detectors(d: Detectors, frame: Frame) -> None:
        d.cross = (kernel.CROSS_ANYWHERE, chance, True)

    return Effect("crosstalk", "anywhere", {"chance": chance}, {}, detectors=detectors)


def _neighbours(draw: Draw, kind: str, by_offset: dict[tuple[int, int], float], comparable: dict[str, float]) -> Effect:
    def detectors(d: Detectors, frame: Frame) -> None:
        d.cross = (kernel.CROSS_NEIGHBOURS, 0.0, True)
        d.cross_by_offset = by_offset

    parameters = {f"chance_{down}_{right}": p for (down, right), p in by_offset.items()}
    return Effect("crosstalk", kind, parameters, comparable, detectors=detectors)


@form("crosstalk", "sides")
def _sides(draw: Draw) -> Effect:
    sides = draw.level(0.04, 0.1, 0.25)
    corners = draw.between(0.3, 0.6) * sides
    by_offset = dict.fromkeys(SIDES, sides / 4) | dict.fromkeys(CORNERS, corners / 4)
    return _neighbours(draw, "sides", by_offset, {"crosstalk.sides": sides, "crosstalk.corners": corners})


@form("crosstalk", "along_row")
def _along_row(draw: Draw) -> Effect:
    nearest = draw.level(0.018, 0.045, 0.1)
    return _neighbours(draw, "along_row", {(0, n): nearest * 0.5 ** (abs(n) - 1) for n in (-3, -2, -1, 1, 2, 3)}, {})


@form("afterpulsing", "exponential")
def _after_exponential(draw: Draw) -> Effect:
    share, delay = draw.level(0.045, 0.08, 0.16), draw.between(4, 12)

    def detectors(d: Detectors, frame: Frame) -> None:
        d.after = (kernel.AFTER_EXPONENTIAL, share, delay, 1.0)

    comparable = {"afterpulsing.probability": share}
    return Effect(
        "afterpulsing", "exponential", {"probability": share, "delay_ns": delay}, comparable, detectors=detectors
    )


@form("afterpulsing", "log_uniform")
def _after_log(draw: Draw) -> Effect:
    share, short, long = draw.level(0.05, 0.12, 0.25), draw.between(6, 12), draw.between(50, 100)

    def detectors(d: Detectors, frame: Frame) -> None:
        d.after = (kernel.AFTER_LOG_UNIFORM, share, short, long)

    parameters = {"probability": share, "shortest_ns": short, "longest_ns": long}
    return Effect("afterpulsing", "log_uniform", parameters, {}, detectors=detectors)


def _dead(kind: str, dead: tuple[int, int, float], comparable: dict[str, float]) -> Effect:
    def detectors(d: Detectors, frame: Frame) -> None:
        d.dead = dead

    return Effect("dead_time", kind, {"dead_ns": float(dead[0]), "spread_ns": dead[2]}, comparable, detectors=detectors)


@form("dead_time", "other")
def _dead_other(draw: Draw) -> Effect:
    shift = {"weak": (-1, 2), "medium": (-2, 4), "strong": (-3, 10)}[draw.strength][int(draw.rng.integers(2))]
    return _dead("other", (DEAD_BINS + shift, kernel.DEAD_FIXED, 0.0), {"dead_time.shift_ns": float(shift)})


@form("dead_time", "uniform")
def _dead_uniform(draw: Draw) -> Effect:
    centre = DEAD_BINS + {"weak": 1, "medium": 2, "strong": 6}[draw.strength]
    return _dead("uniform", (centre, kernel.DEAD_UNIFORM, draw.level(2.0, 4.0, 6.0)), {})


@form("dead_time", "exponential")
def _dead_exponential(draw: Draw) -> Effect:
    return _dead("exponential", (ON_BINS, kernel.DEAD_EXPONENTIAL, draw.level(3.2, 5.0, 9.0)), {})


def _pulse(
    kind: str, parameters: dict[str, float], shape: np.ndarray, comparable: dict[str, float] | None = None
) -> Effect:
    def detectors(d: Detectors, frame: Frame) -> None:
        d.shape = shape

    return Effect("pulse_shape", kind, parameters, comparable or {}, detectors=detectors)


@form("pulse_shape", "longer")
def _longer(draw: Draw) -> Effect:
    stretch = draw.factor(0.05, 0.15, 0.45)
    shape = gaussian_shape(FWHM_NS * stretch)
    return _pulse("longer", {"stretch": stretch}, shape, {"pulse_shape.stretch": stretch})


@form("pulse_shape", "skewed")
def _skewed(draw: Draw) -> Effect:
    fall = 2.123 * (1.0 + draw.level(0.12, 0.35, 1.3))
    power = np.exp(-0.5 * (TABLE_NS / np.where(TABLE_NS < 0, 2.123, fall)) ** 2)
    return _pulse("skewed", {"rise_ns": 2.123, "fall_ns": fall}, summed_shape(power))


@form("pulse_shape", "second_pulse")
def _second(draw: Draw) -> Effect:
    share, delay = draw.level(0.015, 0.05, 0.2), draw.between(7, 12)
    shape = (1 - share) * gaussian_shape(FWHM_NS) + share * np.interp(
        TABLE_NS - delay, TABLE_NS, gaussian_shape(FWHM_NS)
    )
    return _pulse("second_pulse", {"share": share, "delay_ns": delay}, shape)


@form("pulse_shape", "tail")
def _tail(draw: Draw) -> Effect:
    share, tail = draw.level(0.02, 0.07, 0.3), draw.between(5, 10)
    step = TABLE_NS[1] - TABLE_NS[0]
    decay = np.exp(-np.arange(0, 100, step) / tail)
    power = np.gradient(gaussian_shape(FWHM_NS))
    trailing = np.convolve(power, decay / decay.sum())[: len(power)]
    comparable = {"pulse_shape.tail_share": share, "pulse_shape.tail_ns": tail}
    return _pulse(
        "tail", {"share": share, "tail_ns": tail}, summed_shape((1 - share) * power + share * trailing), comparable
    )


def _threshold(draw: Draw, dithered: bool) -> Effect:
    down = draw.rng.random() < 0.4
    shift = {"weak": (1, -1), "medium": (3, -2), "strong": (6, -3)}[draw.strength][int(down)]

    def detectors(d: Detectors, frame: Frame) -> None:
        wobble = frame.rng.integers(0, 2, len(d.threshold)) if dithered else 0
        d.threshold = d.threshold + shift + wobble

    comparable = {} if dithered else {"threshold.shift": float(shift)}
    return Effect(
        "threshold", "dithered" if dithered else "shift", {"shift": float(shift)}, comparable, detectors=detectors
    )


@form("threshold", "shift")
def _threshold_shift(draw: Draw) -> Effect:
    return _threshold(draw, False)


@form("threshold", "dithered")
def _threshold_dithered(draw: Draw) -> Effect:
    return _threshold(draw, True)
