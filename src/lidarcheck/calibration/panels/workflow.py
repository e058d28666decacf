"""Noise characterisation on the panels of a laboratory: find them, gather their echoes, set the model beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lidarcheck.calibration.echoes import amplitude
from lidarcheck.calibration.panels.find import FoundPanels, Panel, Reject, find_panels
from lidarcheck.calibration.panels.image import (
    BeamImage,
    StrongestEchoes,
    echoes_of,
    image_of_frames,
    image_of_ideal,
)
from lidarcheck.calibration.panels.noise import PanelNoise, WalkCurve, compare_sides, noise_of, scatter_of, walk_curve
from lidarcheck.calibration.panels.samples import PanelSamples, Sampler
from lidarcheck.calibration.panels.settings import PanelSettings
from lidarcheck.errors import InputError
from lidarcheck.kpi.scatter import RangeScatter
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor

__all__ = ["Arrangement", "PanelFrame", "PanelSettings", "PanelsResult", "characterise", "panel_scan"]

Progress = Callable[[int, int, str], object]

MOST_SURVEYED = 16
MOST_HELD = 4_000_000
"""Echoes of the surveyed frames that are held; frames beyond are read a second time."""
STILL_M = 0.5
MOVED_SHARE = 0.25
POOR_SHARE = 0.5
FEWEST_SEEN = 20.0
"""Beams on panels that a frame usually shows, from which on a frame without any is no chance."""
SOME_REJECTS = 4
WALK_BINS_ALL = 24


@dataclass(frozen=True)
class PanelFrame:
    """A frame by name, read when it is its turn; reading it again must give the same."""

    name: str
    load: Callable[[], Scan]


@dataclass(frozen=True)
class Arrangement:
    """A scene that stands still: what its beams meet, where that is known, and the frames that show it."""

    ideal: IdealScan | None
    measured: Sequence[PanelFrame]
    simulated: Sequence[PanelFrame] = ()


@dataclass(frozen=True)
class PanelsResult:
    """All panels in order of range, and what real and simulated frames show of each; the sequences go together.

    `found_in`: "ideal" or "measured". `rejects`: the largest flat surfaces that are no panels. `floor_m`, `roof_m`:
    below and above the sensor, NaN where there is none. `materials`: names by number. `sensor`: what measured, where
    that is known. `walk_*`, `scatter_*`: over all
    panels. `notes`: what a reader should know.
    """

    panels: tuple[Panel, ...]
    noise: tuple[PanelNoise, ...]
    measured: tuple[PanelSamples, ...]
    simulated: tuple[PanelSamples, ...] | None
    rejects: tuple[Reject, ...]
    floor_m: float
    roof_m: float
    found_in: str
    frames_measured: int
    frames_simulated: int
    walk_measured: WalkCurve
    walk_simulated: WalkCurve | None
    scatter_measured: RangeScatter
    scatter_simulated: RangeScatter | None
    settings: PanelSettings
    materials: Mapping[int, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    sensor: Sensor | None = None


@dataclass(frozen=True)
class _Part:
    """One arrangement's share of the result."""

    found: FoundPanels
    measured: tuple[PanelSamples, ...]
    simulated: tuple[PanelSamples, ...] | None
    notes: tuple[str, ...]


def characterise(
    arrangements: Iterable[Arrangement],
    settings: PanelSettings | None = None,
    *,
    materials: Mapping[int, str] | None = None,
    sensor: Sensor | None = None,
    progress: Progress = lambda _done, _total, _label: None,
) -> PanelsResult:
    """Find the panels of every arrangement and say of each what its echoes show, real and simulated.

    Panels are found in the ideal scan, or, without one, in up to 16 measured frames merged. Frames are read one at a
    time; of each only what lies on panels is kept. `materials`: names by number; `sensor`: what measured.
    `InputError`: no panel, another number than `settings.expect`, a frame without echoes or of another scene, no echo
    on any panel; each says what was found instead.
    """
    settings = settings or PanelSettings()
    with_ideal = False
    parts = []
    for arrangement in arrangements:
        with_ideal = arrangement.ideal is not None
        parts.append(_one(arrangement, settings, sensor, progress))
    _check_expected(parts, settings)
    return _together(parts, settings, materials or {}, sensor, with_ideal)


def panel_scan(samples: PanelSamples) -> Scan:
    """The echoes of a panel with the frame that each comes from, counted from 0, as column Frame."""
    extra = {name: column for name, column in samples.scan.extra.items() if name.upper() != "FRAME"}
    return replace(samples.scan, extra={**extra, "Frame": samples.frame.astype(np.int32)})


def _one(arrangement: Arrangement, settings: PanelSettings, sensor: Sensor | None, progress: Progress) -> _Part:
    held: dict[int, Scan] = {}
    if arrangement.ideal is not None:
        image, where = image_of_ideal(arrangement.ideal), arrangement.ideal.file
    else:
        image, where = _survey(arrangement.measured, held, sensor, progress), arrangement.measured[0].name
    found = find_panels(image, settings)
    if not found.panels:
        raise InputError(f"no panel found; {_instead(found)}", file=where or None, fix=_REMEDY)
    measured, notes = _sampled(arrangement.measured, found, image, settings, sensor, progress, held)
    if not any(sample.detected for sample in measured):
        raise _nothing_on_panels(arrangement, found, settings)
    simulated = None
    if arrangement.simulated:
        simulated, more = _sampled(arrangement.simulated, found, image, settings, sensor, progress, {})
        notes += more
    return _Part(found, measured, simulated, notes)


def _survey(
    frames: Sequence[PanelFrame], held: dict[int, Scan], sensor: Sensor | None, progress: Progress
) -> BeamImage:
    """The first frames merged; `held` gets those that need not be read again."""
    surveyed = min(len(frames), MOST_SURVEYED)
    echoes = []
    for i in range(surveyed):
        progress(i, surveyed, f"looking for panels, {frames[i].name}")
        scan = _loaded(frames[i])
        echoes.append(echoes_of(scan, sensor))
        if sum(len(other) for other in held.values()) + len(scan) <= MOST_HELD:
            held[i] = scan
    image = image_of_frames(echoes, frames[0].name)
    shown = np.zeros(image.shape, dtype=np.int64)
    for echo in echoes:
        shown[echo.at] += 1
    for frame, echo in zip(frames, echoes, strict=False):
        _check_still(image, echo, shown[echo.at] > 1, frame.name)
    return image


def _check_still(image: BeamImage, echo: StrongestEchoes, shared: npt.NDArray[np.bool_], name: str) -> None:
    """Refuse a frame that shows another scene than the frames together, on the beams that another frame shows too."""
    off = np.abs(echo.range_m - image.range_m[echo.at])[shared]
    if not len(off):
        return
    moved = float(np.mean(off > STILL_M + 0.01 * echo.range_m[shared]))
    if moved > MOVED_SHARE:
        raise InputError(
            f"{100 * moved:.0f} % of its echoes on common beams lie elsewhere than in the frames together",
            file=name,
            fix="merge frames of one scene that stands still, or give each frame its --ideal",
        )


def _sampled(
    frames: Sequence[PanelFrame], found: FoundPanels, image: BeamImage, settings: PanelSettings,
    sensor: Sensor | None, progress: Progress, held: dict[int, Scan],
) -> tuple[tuple[PanelSamples, ...], tuple[str, ...]]:  # fmt: skip
    """The echoes on panels of every frame, and a note on each frame that shows far less than the others."""
    sampler = Sampler(found.panels, settings.window_m, image.shape, sensor)
    counts = []
    for i, frame in enumerate(frames):
        progress(i, len(frames), frame.name)
        scan = held.pop(i, None)
        counts.append(sampler.add(_loaded(frame) if scan is None else scan))
    progress(len(frames), len(frames), "")
    usual = float(np.median([count for count in counts if count] or [0]))
    beams = sum(len(panel.layer) for panel in found.panels)
    for frame, count in zip(frames, counts, strict=True):
        if not count and usual >= FEWEST_SEEN:
            what = f"shows none of the {beams} beams on panels, the other frames {usual:.0f} in the middle"
            raise InputError(what, file=frame.name, fix="it is of another scene, or covered: leave it out")
    notes = [
        f"{frame.name} shows {count} of {beams} beams on panels, the frames in the middle {usual:.0f}"
        for frame, count in zip(frames, counts, strict=True)
        if count < POOR_SHARE * usual
    ]
    return sampler.samples(), tuple(notes)


def _loaded(frame: PanelFrame) -> Scan:
    scan = frame.load()
    if not len(scan):
        raise InputError("holds no echo", file=frame.name, fix="leave the frame out, or record it again")
    return scan


_REMEDY = "if one of these is a panel, widen --size, --range or --max-incidence"


def _instead(found: FoundPanels) -> str:
    """What a scene without panels holds, in a line."""
    levels = [
        f"{name} {abs(level.z_m):.2f} m {side} the sensor"
        for name, side, level in (("a floor", "below", found.floor), ("a roof", "above", found.roof))
        if level is not None
    ]
    flat = [
        f"{r.width_m:.1f} x {r.height_m:.1f} m at {r.range_m:.1f} m ({r.why})" for r in found.rejects[:SOME_REJECTS]
    ]
    if not levels and not flat:
        return "nor any other flat surface"
    flats = f"flat surfaces: {', '.join(flat)}" if flat else "no flat surface"
    return f"found instead: {', '.join([*levels, flats])}"


def _check_expected(parts: Sequence[_Part], settings: PanelSettings) -> None:
    panels = [panel for part in parts for panel in part.found.panels]
    if settings.expect is None or len(panels) == settings.expect:
        return
    places = ", ".join(f"{panel.range_m:.1f}" for panel in sorted(panels, key=lambda panel: panel.range_m)[:40])
    raise InputError(
        f"{len(panels)} panels found where {settings.expect} are expected: at {places} m; {_instead(parts[0].found)}",
        fix="correct --expect, or --size, --range and --max-incidence",
    )


def _nothing_on_panels(arrangement: Arrangement, found: FoundPanels, settings: PanelSettings) -> InputError:
    """What the first frame shows on the beams that should hit panels."""
    frame = arrangement.measured[0]
    shape = tuple(max(int(getattr(p, name).max()) for p in found.panels) + 1 for name in ("layer", "point"))
    sampler = Sampler(found.panels, np.inf, (shape[0], shape[1]))
    beams = sum(len(panel.layer) for panel in found.panels)
    count = sampler.add(frame.load())
    seen = f"{count} of the {beams} beams that should hit one echo"
    if count:
        off = float(np.median(np.concatenate([sample.residual_m for sample in sampler.samples()])))
        seen += f", in the middle {abs(off):.2f} m {'behind' if off > 0 else 'before'} it"
    return InputError(
        f"no echo within {settings.window_m:g} m of any of the {len(found.panels)} panels of the ideal scan; {seen}",
        file=frame.name,
        fix="is it the ideal scan of this scene, seen from this place?",
    )


def _together(
    parts: Sequence[_Part],
    settings: PanelSettings,
    materials: Mapping[int, str],
    sensor: Sensor | None,
    with_ideal: bool,
) -> PanelsResult:
    """The parts' panels in order of range, numbered on, with their figures."""
    panels = [panel for part in parts for panel in part.found.panels]
    order = sorted(range(len(panels)), key=lambda i: (panels[i].range_m, panels[i].azimuth_deg))
    measured = [sample for part in parts for sample in part.measured]
    simulated = [sample for part in parts for sample in part.simulated or ()]
    both = len(simulated) == len(measured)
    m = tuple(measured[i] for i in order)
    s = tuple(simulated[i] for i in order) if both else None
    numbered = tuple(replace(panels[i], number=k) for k, i in enumerate(order, start=1))
    rejects = sorted((r for part in parts for r in part.found.rejects), key=lambda r: -r.beams)
    noise = tuple(
        _noise(panel, m[k], None if s is None else s[k], sensor, with_ideal) for k, panel in enumerate(numbered)
    )
    return PanelsResult(
        panels=numbered,
        noise=noise,
        measured=m,
        simulated=s,
        rejects=tuple(rejects),
        floor_m=_height(parts, "floor"),
        roof_m=_height(parts, "roof"),
        found_in="ideal" if with_ideal else "measured",
        frames_measured=sum(len(part.measured[0].detected_in) for part in parts),
        frames_simulated=sum(len(part.simulated[0].detected_in) for part in parts if part.simulated),
        walk_measured=_walk(m, sensor),
        walk_simulated=None if s is None else _walk(s, sensor),
        scatter_measured=scatter_of(m, sensor),
        scatter_simulated=None if s is None else scatter_of(s, sensor),
        settings=settings,
        materials=dict(materials),
        notes=tuple(note for part in parts for note in part.notes),
        sensor=sensor,
    )


def _noise(
    panel: Panel, measured: PanelSamples, simulated: PanelSamples | None, sensor: Sensor | None, with_ideal: bool
) -> PanelNoise:
    beams = len(panel.layer)
    real = noise_of(measured, beams, known_truth=with_ideal, sensor=sensor)
    if simulated is None:
        return PanelNoise(real, None, {}, None)
    gaps, walk = compare_sides(measured, simulated, sensor)
    return PanelNoise(real, noise_of(simulated, beams, known_truth=with_ideal, sensor=sensor), gaps, walk)


def _walk(samples: Sequence[PanelSamples], sensor: Sensor | None) -> WalkCurve:
    """Over all panels, in finer bins than of one."""
    strength = [amplitude(sample.scan, sensor)[1] for sample in samples]
    return walk_curve(np.concatenate(strength), np.concatenate([s.residual_m for s in samples]), bins=WALK_BINS_ALL)


def _height(parts: Sequence[_Part], name: str) -> float:
    levels = [getattr(part.found, name) for part in parts]
    return next((level.z_m for level in levels if level is not None), float("nan"))
