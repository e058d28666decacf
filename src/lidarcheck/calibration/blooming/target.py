"""The bright target of a scan: which beams it stands on, at what range, and how much light each of them has.

Found in the measured echoes alone, by where they saturate, or told by an ideal scan and the model, which know the light
of every beam, also of those that the target's edge cuts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarcheck.arrays import BoolArray, FloatArray, IntArray
from lidarcheck.calibration.blooming.response import GATE_M, bin_length_m, strongest_echoes
from lidarcheck.errors import InputError, NotThereError
from lidarcheck.formats.lut import Axis
from lidarcheck.formats.settings import Setting, Settings
from lidarcheck.scan import IdealScan, Light, Scan
from lidarcheck.sensor import SpadArray

__all__ = [
    "STEP",
    "BrightTarget",
    "OwnLight",
    "bright_beams",
    "lines_and_places",
    "own_light",
    "saturated",
    "target_in_scan",
]

STEP: dict[Axis, float] = {"vertical": 3.0, "horizontal": 2.5}
"""Table units between neighbouring beams: SPAD rows a layer, columns of 0.05 deg a point."""
_SATURATED = 0.97
_AGAIN = 1.15
_NEAR_M = 3.0
"""How far a target may stand from the distance that a setting, or the user, names."""
_MOSTLY = 0.5
"""Share of a target's beams that must fire again before AREA can tell it from its bloom."""
_LINES = 3
"""Lines to either side on which a beam's neighbours are looked at: more than half of 7 are no chance."""
_PLACES = 30
"""Places within a bin that stand for all beams of a target."""
_MERGED_M = 0.3
"""Light this near in range makes one echo with the target's."""
_BESIDE_M = 4.0
"""A surface up to this far from the target's range may make one echo with the bloom: such beams are left out."""


@dataclass(frozen=True)
class BrightTarget:
    """Bright beams of one target: `line`, `place` and S, shape (m,) each; `center` is the place that offset 0 means.

    Lines and places are point columns and layers for vertical blooming, layers and points for horizontal. `within`:
    where in a bin its light comes, as `response_of` takes it; empty where its true range is not known.
    """

    distance_m: float
    center: float
    line: IntArray
    place: IntArray
    signal: FloatArray
    setting: Setting | None = None
    within: tuple[float, ...] = ()


@dataclass(frozen=True)
class OwnLight:
    """What beams have at the target's range without any bloom, shape (beams,): the target's light, other light, and
    whether the beam is left out for a surface near that range. `line`, `place`: which beams were fired.
    """

    line: IntArray
    place: IntArray
    target: FloatArray
    other: FloatArray
    left_out: BoolArray


def lines_and_places(table: Scan | IdealScan | Light, axis: Axis) -> tuple[IntArray, IntArray]:
    """Line and place of each row along an axis."""
    return (table.point, table.layer) if axis == "vertical" else (table.layer, table.point)


def saturated(peak: FloatArray, area: FloatArray, sensor: SpadArray) -> BoolArray:
    """Whether all detectors fired, by AREA; by PEAK, which may saturate earlier, where AREA is not known (NaN)."""
    by_area = area >= _SATURATED * sensor.detectors * sensor.on_bins
    by_peak = np.isnan(area) & (peak >= _SATURATED * sensor.peak_saturation)
    return np.asarray(by_area | by_peak)


def target_in_scan(
    scan: Scan,
    sensor: SpadArray,
    axis: Axis,
    *,
    signal_at_1m: float,
    settings: Settings,
    distance_m: float | None = None,
    name: str = "the scan",
) -> BrightTarget:
    """The target by the echoes that saturate; S = `signal_at_1m` / R^2 on each beam, edges known to a beam.

    The setting of its distance says where to look; defaults hold only where something saturates there. `InputError`
    names what was found instead.
    """
    # A beam whose detectors fire twice may show two echoes, each of which saturates: it is one beam.
    bright = strongest_echoes(scan.take(saturated(scan.peak, scan.area, sensor)))
    if not len(bright):
        full = sensor.detectors * sensor.on_bins
        most = f"the largest AREA is {scan.area.max():g}" if len(scan) else "it has no echoes"
        what = f"no echo saturates (AREA {full}, as when all detectors fire): {most}"
        raise NotThereError(what, file=name, fix="blooming needs a retro-reflecting target; is the variant right?")
    range_m = bright.range_m
    setting = _setting(bright, range_m, settings, axis, distance_m, name)
    near_m = distance_m if distance_m is not None else setting.distance_m if setting else _densest_m(range_m)
    at = _cluster_at(range_m, near_m)
    if at is None:
        found = ", ".join(f"{r:.1f}" for r in _clusters_m(range_m))
        what = f"nothing saturates within {_NEAR_M:g} m of {near_m:g} m; echoes saturate at {found} m"
        raise NotThereError(what, file=name, fix="name the distance as SCAN@DISTANCE")
    inside = np.abs(range_m - at) <= GATE_M
    line, place = lines_and_places(bright, axis)
    keep = inside if setting is None else inside & _in_setting(line, place, setting, axis)
    keep &= _brightest(bright.area, line, place, inside, sensor)
    signal = np.full(int(keep.sum()), signal_at_1m / at**2)
    center = float(np.median(place[keep])) if setting is None else float(setting.center)
    return BrightTarget(at, center, line[keep], place[keep], signal, setting)


def _brightest(area: FloatArray, line: IntArray, place: IntArray, inside: BoolArray, sensor: SpadArray) -> BoolArray:
    """Whether beams lie within the target, not in bloom so strong that all detectors fire there too.

    Where detectors fire again while the target's light lasts its AREA is well above one firing of each; then beams
    count from the first to the last on each line that are nearer to the target's AREA, or whose neighbours on the
    lines beside are as often as on the target: a beam of it may fire once by chance. Where most of its beams fire
    once, as the target's place within a bin decides, AREA does not tell and all count. `inside`: at its range.
    """
    one_firing = sensor.detectors * sensor.on_bins
    top = float(np.quantile(area[inside], 0.9)) if np.any(inside) else 0.0
    far = inside & (area >= 0.5 * (top + one_firing))
    if top < _AGAIN * one_firing or np.mean(far[inside & _between(far, line, place)]) < _MOSTLY:
        return np.ones(len(area), dtype=bool)
    often = far | (inside & (_share_beside(far, inside, line, place) >= 0.5 * np.mean(far[inside])))
    return _between(often, line, place)


def _between(which: BoolArray, line: IntArray, place: IntArray) -> BoolArray:
    """Beams from the first to the last of those in `which` on their line."""
    within = np.zeros(len(which), dtype=bool)
    for one in np.unique(line[which]):
        on = line == one
        low, high = place[which & on].min(), place[which & on].max()
        within |= on & (place >= low) & (place <= high)
    return within


def _share_beside(far: BoolArray, inside: BoolArray, line: IntArray, place: IntArray) -> FloatArray:
    """Of the beams at the same place on up to three lines to either side, the share that is far; shape (n,)."""
    shape = (int(line.max()) + 1 + 2 * _LINES, int(place.max()) + 1)
    counts = []
    for which in (far, inside):
        held = np.zeros(shape)
        np.add.at(held, (line[which] + _LINES, place[which]), 1.0)
        counts.append(sum(held[line + k, place] for k in range(2 * _LINES + 1)))
    return np.asarray(counts[0] / np.maximum(counts[1], 1.0))


def _setting(
    bright: Scan, range_m: FloatArray, settings: Settings, axis: Axis, distance_m: float | None, name: str
) -> Setting | None:
    """The setting that holds: of the distance named, else of where something saturates; None for none."""
    line, place = lines_and_places(bright, axis)
    from_file = settings.content is not None
    candidates = settings.entries
    if distance_m is not None:
        candidates = tuple(s for s in candidates if abs(s.distance_m - distance_m) <= _NEAR_M)
    here = [s for s in candidates if np.any(_in_setting(line, place, s, axis) & _about(range_m, s.distance_m))]
    if here:
        nearest = distance_m if distance_m is not None else here[0].distance_m
        return min(here, key=lambda s: abs(s.distance_m - nearest))
    if not from_file:
        return None
    wanted = [s for s in candidates if np.any(_about(range_m, s.distance_m))]
    if not wanted:
        known = ", ".join(f"{s.distance_m:g}" for s in settings.entries) or "none"
        found = ", ".join(f"{r:.1f}" for r in _clusters_m(range_m))
        what = f"no setting fits: they are for {known} m, echoes saturate at {found} m"
        raise InputError(what, file=name, fix=f"add one to {settings.file}")
    s = wanted[0]
    there = _about(range_m, s.distance_m)
    unit, across = ("layers", "columns") if axis == "vertical" else ("points", "layers")
    what = (
        f"nothing saturates at {s.distance_m:g} m where the setting says ({across[:-1]} {s.across}, index "
        f"{s.index_min} to {s.index_max}); it does in {across} {line[there].min()} to {line[there].max()}, "
        f"{unit} {place[there].min()} to {place[there].max()}"
    )
    raise InputError(what, file=name, fix=f"correct {settings.file}")


def _about(range_m: FloatArray, distance_m: float) -> BoolArray:
    return np.asarray(np.abs(range_m - distance_m) <= _NEAR_M)


def _in_setting(line: IntArray, place: IntArray, setting: Setting, axis: Axis) -> BoolArray:
    """Whether beams lie on the setting's line, within its SPAD rows or columns."""
    low, high = place * STEP[axis], (place + 1) * STEP[axis] - 1.0
    return np.asarray((line == setting.across) & (high >= setting.index_min) & (low <= setting.index_max))


def _densest_m(range_m: FloatArray) -> float:
    """The range about which most of the saturated echoes stand."""
    ordered = np.sort(range_m)
    count = np.searchsorted(ordered, ordered + GATE_M) - np.arange(len(ordered))
    first = int(np.argmax(count))
    return float(np.median(ordered[first : first + count[first]]))


def _cluster_at(range_m: FloatArray, near_m: float) -> float | None:
    near = range_m[_about(range_m, near_m)]
    return float(np.median(near)) if len(near) else None


def _clusters_m(range_m: FloatArray) -> Sequence[float]:
    """Ranges of the clusters of echoes, at most five, nearest first."""
    ordered = np.sort(range_m)
    parts = np.split(ordered, np.flatnonzero(np.diff(ordered) > GATE_M) + 1)
    return [float(np.median(part)) for part in sorted(parts, key=len, reverse=True)[:5]]


def bright_beams(
    light: Light, sensor: SpadArray, axis: Axis, bright_signal: float, distance_m: float | None, name: str
) -> BrightTarget:
    """The target by the light of an ideal scan: pulses of S >= `bright_signal`, as the effect takes them.

    Without a distance there must be but one range at which such light is. `InputError` names those there are.
    """
    bright = np.flatnonzero(light.pulse_signal >= bright_signal)
    range_m = light.pulse_range_m[bright]
    found = _clusters_m(range_m) if len(bright) else []
    if not found:
        most = light.pulse_signal.max() if len(light.pulse_signal) else 0.0
        what = f"no beam has S of {bright_signal:g} or more, from which light blooms; the largest is {most:.3g}"
        raise NotThereError(what, file=name, fix="is the target's material a retro-reflector in the model?")
    listed = ", ".join(f"{r:.1f}" for r in sorted(found))
    if distance_m is None and len(found) > 1:
        raise NotThereError(f"bright targets stand at {listed} m", file=name, fix=f"say which: SCAN@{found[0]:.1f}")
    at = _cluster_at(range_m, found[0] if distance_m is None else distance_m)
    if at is None:
        what = f"no bright target within {_NEAR_M:g} m of {distance_m:g} m; there are some at {listed} m"
        raise NotThereError(what, file=name, fix="name the distance of one of them")
    keep = bright[np.abs(range_m - at) <= GATE_M]
    lines, places = lines_and_places(light, axis)
    beam = light.pulse_beam[keep]
    order = np.lexsort((places[beam], lines[beam]))
    beam, signal = beam[order], light.pulse_signal[keep][order]
    center, within = float(np.median(places[beam])), _within(light.pulse_range_m[keep], sensor)
    return BrightTarget(at, center, lines[beam], places[beam], signal, within=within)


def _within(range_m: FloatArray, sensor: SpadArray) -> tuple[float, ...]:
    """Where in a bin light from these ranges comes, each place as often as it does there."""
    part = np.sort(range_m / bin_length_m(sensor) % 1.0)
    return tuple(part[((np.arange(_PLACES) + 0.5) * len(part) / _PLACES).astype(np.int64)].tolist())


def own_light(light: Light, target: BrightTarget, axis: Axis, bright_signal: float) -> OwnLight:
    """What the beams on the target's lines have at its range before anything blooms."""
    lines, places = lines_and_places(light, axis)
    rows = np.flatnonzero(np.isin(lines, np.unique(target.line)))
    of_row = np.full(len(light), -1)
    of_row[rows] = np.arange(len(rows))
    beam = of_row[light.pulse_beam]
    off_m = np.abs(light.pulse_range_m - target.distance_m)
    bright = light.pulse_signal >= bright_signal
    seen = (beam >= 0) & (light.pulse_signal > 0.0)

    def total(which: BoolArray) -> FloatArray:
        return np.asarray(np.bincount(beam[which], light.pulse_signal[which], len(rows)), dtype=np.float64)

    mine = total(seen & bright & (off_m <= GATE_M))
    with_it = total(seen & ~bright & (off_m <= _MERGED_M))
    beside = total(seen & ~bright & (off_m > _MERGED_M) & (off_m <= _BESIDE_M))
    return OwnLight(lines[rows], places[rows], mine, with_it, beside > 0.0)
