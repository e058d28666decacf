"""Fog in patches: measured after the fit, where its backscatter differs between frames and directions."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.cases.frame import Frame
from lidarcheck.effects import Effect, make
from lidarcheck.effects.search.fog_patches import Patchiness, patchiness_of
from lidarcheck.explain.decision.late_forms import ScaleReplays, late_words, with_forms_of_beams
from lidarcheck.explain.report.explanation import Finding
from lidarcheck.inference.intervals import Interval
from lidarcheck.inference.nuisances import Nuisance
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model import simulate
from lidarcheck.scan import Scan
from lidarcheck.workers import WorkerPool

AIR = {"mor_m": 300.0, "backscatter": 0.05, "overlap_start_m": 1.0, "overlap_full_m": 7.0}
EVEN = make("fog", AIR)
VIEW = {"layers": range(230, 290, 2), "points": range(400, 560, 2)}
DENSITIES = (0.6, 1.5, 0.75, 1.4)


def fog(density: float) -> Effect:
    """Even fog of so many times the density."""
    return make("fog", AIR | {"mor_m": 300.0 / density})


def measured(*densities: tuple[float, ...]) -> tuple[Frame, ...]:
    """Frames of even fog of some densities, side by side in as many parts of the view, another frame each."""
    found = []
    for k, frame in enumerate(frames(model(), len(densities), **VIEW)):
        parts = np.array_split(np.unique(frame.ideal.point), len(densities[k]))
        scans = [simulate(frame.ideal, model(fog(d)), seed=77, frame=k, threads=1) for d in densities[k]]
        chosen = [scan.take(np.isin(scan.point, part)) for scan, part in zip(scans, parts, strict=True)]
        found.append(dataclasses.replace(frame, measured=joined(chosen)))
    return tuple(found)


def joined(scans: list[Scan]) -> Scan:
    """Scans of different columns as one."""
    names = ("layer", "point", "range_m", "echo_number", "width_ns", "area", "peak")
    columns = {name: np.concatenate([getattr(scan, name) for scan in scans]) for name in names}
    order = np.lexsort((columns["echo_number"], columns["point"], columns["layer"]))
    layer, point, range_m = (columns.pop(name)[order] for name in names[:3])
    return Scan.from_beams(layer, point, range_m, **{name: column[order] for name, column in columns.items()})


def seen(*densities: tuple[float, ...]) -> Scale:
    return Scale.of(measured(*densities), model(), 5)


def finding() -> Finding:
    parameters = {"mor_m": Interval(300.0, 290.0, 310.0, "m"), "backscatter": Interval(0.05, 0.045, 0.055)}
    return Finding("fog", parameters, 0.9, (), "in front", effects=(EVEN,))


def patchiness(scale: Scale) -> Patchiness | None:
    """How patchy the fog of some frames is."""
    return patchiness_of(ScaleReplays(scale, model(EVEN), Nuisance(), WorkerPool()), EVEN)


@pytest.mark.long
def test_even_fog_is_not_patchy() -> None:
    scale = seen((1.0,), (1.0,), (1.0,), (1.0,))
    assert patchiness(scale) is None
    assert with_forms_of_beams(scale, model(), [finding()], Nuisance(), WorkerPool()) == (finding(),)


def test_other_effects_are_left_as_they_are() -> None:
    other = Finding("dropout", {}, 0.9, (), "", effects=(make("dropout", {}),))
    assert with_forms_of_beams(seen(*((d,) for d in DENSITIES)), model(), [other], Nuisance(), WorkerPool()) == (other,)


@pytest.mark.long
def test_frames_of_different_density_have_patches_larger_than_the_view() -> None:
    found = patchiness(seen(*((d,) for d in DENSITIES)))
    assert found is not None
    spread = float(np.log(DENSITIES).std(ddof=1))
    assert found.patchiness[0] == pytest.approx(spread, rel=0.15)
    assert found.patchiness[1] < spread < found.patchiness[2]
    assert found.patch_deg > 20.0


@pytest.mark.long
def test_directions_of_different_density_have_patches_within_the_view() -> None:
    stripes = [(a, b, a, b) for a, b in ((0.6, 1.5), (1.4, 0.7), (0.75, 1.3), (1.5, 0.6))]
    found = patchiness(seen(*stripes))
    assert found is not None
    assert found.patchiness[0] == pytest.approx(float(np.log(stripes).std()), rel=0.2)
    # Stripes of 5 degrees.
    assert 1.0 < found.patch_deg < 8.0


@pytest.mark.long
def test_a_name_of_fog_gets_the_patches_with_their_interval() -> None:
    scale = seen(*((d,) for d in DENSITIES))
    [found] = with_forms_of_beams(scale, model(), [finding()], Nuisance(), WorkerPool())
    settings = found.effects[0].settings()
    spread, mor = found.parameters["patchiness"], found.parameters["mor_m"]
    assert settings["patchiness"] == pytest.approx(spread.value, abs=1e-4)
    assert settings["mor_m"] == 300.0
    assert late_words([finding()]) == []
    [(step, words)] = late_words([found])
    assert step == "patches"
    assert "differs by 4" in words
    # Four frames tell the mean density less well than the fit thinks.
    assert mor.low < 270.0
    assert mor.high > 335.0
    (left, _), (there, _) = (scale.excess(model(one)) for one in (EVEN, found.effects[0]))
    assert there < left
