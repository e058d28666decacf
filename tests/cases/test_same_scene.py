"""What is held against each other shows one scene, in one frame, unit and order of beams; else it is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from explain_kit import write_case
from lidarcheck.beams import Geometry
from lidarcheck.cases.case import load_case
from lidarcheck.cases.same_scene import Surfaces, _better, compare_scenes
from lidarcheck.cli import main
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats import load_ideal, load_scan, save_ideal, save_scan
from lidarcheck.model import load_model, save_model, simulate
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Material
from reference_grid import beam_directions


def street(*, ahead_m: float = 40.0, left_m: float = 6.0, height_m: float = 1.6, forward_m: float = 0.0) -> IdealScan:
    """Ground, a wall to the left, two posts and a wall ahead, seen by every tenth layer and fourth column."""
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(5, 520, 10), np.arange(2, 960, 4), indexing="ij"))
    x, y, z = beam_directions(layer, point).T
    with np.errstate(divide="ignore"):
        ground = np.where(z < 0.0, height_m / np.maximum(-z, 1e-9), np.inf)
        wall = np.where(y > 0.0, left_m / np.maximum(y, 1e-9), np.inf)
        end = np.where(x > 0.0, (ahead_m - forward_m) / np.maximum(x, 1e-9), np.inf)
    posts = np.where((point // 60) % 5 == 1, 12.0 - forward_m * x, np.inf)
    distance = np.minimum.reduce([ground, wall, end, posts])
    distance = np.where(distance < 120.0, distance, 0.0)
    ones = np.ones(len(layer), dtype=np.int32)
    return IdealScan(layer, point, distance, ones, np.zeros(len(layer)))


def measured(ideal: IdealScan, *, offset_m: float = 0.0, seed: int = 0) -> Scan:
    rng = np.random.default_rng(seed)
    hit = ideal.distance_m > 0.0
    range_m = np.round(ideal.distance_m[hit] + offset_m + rng.normal(0.0, 0.03, np.count_nonzero(hit)), 2)
    weak = np.full(len(range_m), 20.0)
    return Scan.from_beams(ideal.layer[hit], ideal.point[hit], range_m, width_ns=weak, area=9.0 * weak, peak=weak)


def scaled(scan: Scan, factor: float) -> Scan:
    return replace(scan, x_m=scan.x_m * factor, y_m=scan.y_m * factor, z_m=scan.z_m * factor)


SHOWN = {"ideal": street(), "simulated": measured(street(), seed=9)}


@pytest.mark.parametrize("against", SHOWN)
@pytest.mark.parametrize("offset_m", [0.0, -0.6, 1.1])
def test_what_belongs_together_is_not_refused(against: str, offset_m: float) -> None:
    found = compare_scenes(measured(street(), offset_m=offset_m), Surfaces.of(SHOWN[against]))
    assert found is not None
    assert not found.refused
    assert not found.doubtful


@pytest.mark.parametrize("against", SHOWN)
@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda s: replace(s, point=959 - s.point), "Y mirrored, or points from the other end"),
        (lambda s: replace(s, layer=519 - s.layer), "layers from the other end, or Z mirrored"),
        (lambda s: replace(s, layer=519 - s.layer, point=959 - s.point), "Y and Z mirrored, or layers and points"),
        (lambda s: scaled(s, 1.0 / 0.3048), "the measured ranges in ft"),
        (lambda s: scaled(s, 1000.0), "the measured ranges in mm"),
        (lambda s: scaled(s, 1.0 / 0.0254), "the measured ranges in in"),
    ],
)
def test_a_wrong_scan_is_named(against: str, wrong: object, said: str) -> None:
    # An even number of columns and layers: the mirrored beams are beams of the scene too.
    even = street()
    found = compare_scenes(wrong(measured(even)), _mirrorable(SHOWN[against]))  # type: ignore[operator]
    assert found is not None
    assert found.refused
    assert f"fits with {said}" in found.what


def _mirrorable(shown: IdealScan | Scan) -> Surfaces:
    """The surfaces on all beams: the nearest known layer and column stand for those between."""
    known = np.zeros((520, 960))
    surfaces = Surfaces.of(shown)
    known[surfaces.layer, surfaces.point] = surfaces.distance_m
    layer, point = (a.ravel() for a in np.meshgrid(np.arange(520), np.arange(960), indexing="ij"))
    distance = known[layer // 10 * 10 + 5, point // 4 * 4 + 2]
    return replace(surfaces, layer=layer, point=point, distance_m=distance)


@pytest.mark.parametrize(("shift_m", "said"), [(0.4, "the frame before"), (-0.4, "the frame after")])
def test_the_ideal_scan_of_a_neighbouring_frame_is_named(shift_m: float, said: str) -> None:
    """The scan is of a frame 0.4 m behind (or before) the one whose ideal scan it stands beside."""
    scan = measured(street(forward_m=1.0))
    own, other = street(forward_m=1.0 + shift_m), street(forward_m=1.0)
    neighbours = {"before": Surfaces.of(other)} if shift_m > 0.0 else {"after": Surfaces.of(other)}
    found = compare_scenes(scan, Surfaces.of(own), **neighbours)
    assert found is not None
    assert found.refused
    assert said in found.what
    right = compare_scenes(scan, Surfaces.of(other), before=Surfaces.of(own), after=Surfaces.of(street(forward_m=1.8)))
    assert right is not None
    assert not right.refused


def test_an_offset_does_not_make_the_next_frame_fit_better() -> None:
    scan = measured(street(), offset_m=-0.4)
    found = compare_scenes(scan, Surfaces.of(street()), after=Surfaces.of(street(forward_m=0.4)))
    assert found is not None
    assert not found.refused


def test_a_symmetric_scene_is_not_told_apart() -> None:
    wall = replace(street(), distance_m=np.full(len(street()), 10.0))
    found = compare_scenes(measured(wall), _mirrorable(wall))
    assert found is not None
    assert not found.refused
    assert "Y mirrored, or points from the other end" in found.equal


def test_a_few_ghosts_where_another_order_has_a_surface_tell_no_order() -> None:
    layer, point = street().layer, street().point
    low_right, high_left = (layer > 400) & (point < 240), (layer < 119) & (point > 719)
    shown = _mirrorable(replace(street(), distance_m=np.where(low_right, 14.0, 10.0)))
    seen = replace(street(), distance_m=np.where(low_right, 0.0, np.where(high_left, 14.0, 10.0)))
    found = compare_scenes(measured(seen), shown)
    assert found is not None
    assert not found.refused
    assert "Y and Z mirrored, or layers and points from the other end" in found.equal


def test_another_scene_is_said_to_be_one() -> None:
    city, road = street(ahead_m=25.0, left_m=4.0), street(ahead_m=300.0, left_m=60.0, height_m=2.4)
    found = compare_scenes(measured(city), Surfaces.of(measured(road, seed=3)), name="road.txt")
    assert found is not None
    assert found.refused or found.doubtful
    assert "not be the same scene" in found.what or "not the same scene" in found.what
    assert "road.txt" in found.what


def test_fewer_than_30_common_beams_tell_nothing() -> None:
    few = measured(street()).take(np.arange(20))
    assert compare_scenes(few, Surfaces.of(street())) is None


def test_compare_names_what_is_wrong_before_any_kpi(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ideal = street()
    save_scan(measured(ideal), tmp_path / "real.txt")
    save_scan(measured(ideal, seed=1), tmp_path / "sim.txt")
    save_scan(measured(street(ahead_m=90.0, left_m=30.0, height_m=4.0)), tmp_path / "other.txt")
    save_ideal(ideal, tmp_path / "ideal.txt")
    real, sim, other, scene = (str(tmp_path / f"{name}.txt") for name in ("real", "sim", "other", "ideal"))
    assert main(["compare", real, sim, "--ideal", scene]) == 0
    assert "geometry not checked" not in capsys.readouterr().err
    code = main(["compare", real, other])
    said = capsys.readouterr()
    assert "the same scene: only " in said.err
    assert code == 2 or said.out.startswith("KPI")
    # Without Layer and Point the mirror shows against the ideal scan alone.
    bare = bare_file(tmp_path / "bare.csv", measured(ideal), mirror=True)
    assert main(["compare", bare, sim]) in (0, 2)
    said_bare = capsys.readouterr().err
    assert "geometry not checked" in said_bare or "Y mirrored" in said_bare


def bare_file(path: Path, scan: Scan, *, mirror: bool) -> str:
    sign = -1.0 if mirror else 1.0
    rows = np.column_stack([scan.x_m, sign * scan.y_m, scan.z_m, scan.peak, scan.area, scan.width_ns])
    path.write_text("X,Y,Z,PEAK,AREA,WIDTH\n" + "\n".join(",".join(f"{v:.5f}" for v in row) for row in rows) + "\n")
    return str(path)


def test_a_case_whose_scans_stand_beside_the_next_ideal_scan_is_refused(tmp_path: Path) -> None:
    place = write_case(tmp_path / "case", frames=4)
    model = replace(load_model(place / "model.toml"), materials={1: Material("grey", 0.3)})
    save_model(model, place / "model.toml")
    ideals = [street(forward_m=0.5 * k) for k in range(5)]
    for k in range(4):
        save_ideal(ideals[k], place / f"i{k}.txt")
        save_scan(simulate(ideals[k], model, seed=7, frame=k), place / f"m{k}.txt")
    assert len(load_case(place).frames) == 4
    for k in range(4):
        save_scan(simulate(ideals[k + 1], model, seed=7, frame=k), place / f"m{k}.txt")
    with pytest.raises(LidarcheckError, match=r"fits with the frame after: median residual|fits i2.txt"):
        load_case(place)


def test_the_first_quarter_of_the_sweep_is_what_a_shift_is_tried_on() -> None:
    late = street().take(street().point > 300)
    found = compare_scenes(measured(late), Surfaces.of(late), after=Surfaces.of(street(forward_m=0.4)))
    assert found is not None
    assert "the frame after" not in found.tried


def test_round_trip_keeps_the_scene(tmp_path: Path) -> None:
    save_ideal(street(), tmp_path / "i.txt")
    save_scan(measured(street()), tmp_path / "m.txt")
    found = compare_scenes(load_scan(tmp_path / "m.txt"), Surfaces.of(load_ideal(tmp_path / "i.txt")))
    assert found is not None
    assert not found.refused


def test_another_order_of_beams_must_take_more_than_a_step_off_the_median():
    """A few ghosts of a mirror lie where the other order has a surface; the beam in the middle fits no better there."""
    own = np.full(400, 0.336)
    own[:40] = 2.0
    other = own - 0.004
    other[:40] = 0.1
    assert _better(own, other, few_tell=True) == 1
    assert _better(own, other, few_tell=False) == 0
    assert _better(own, other - 0.1, few_tell=False) == 1


def test_units_that_noise_cannot_tell_are_said_where_no_range_tells_them():
    """Echoes of background anywhere in the gate: every unit fits as badly."""
    rng = np.random.default_rng(5)
    layer, point = np.divmod(np.arange(2000), 100)
    scan = Scan.from_beams(layer.astype(np.int32), point.astype(np.int32), rng.uniform(1.0, 300.0, 2000))
    nothing = IdealScan(layer, point, np.full(2000, 20.0), np.ones(2000), np.zeros(2000))
    found = compare_scenes(scan, Surfaces.of(nothing))
    assert found is not None
    assert {"ft", "mm"} <= {*found.untold(scan)}
    known = replace(scan, geometry=Geometry("ok", 2000, 2000, 2000, unit_checked=True))
    assert found.untold(known) == ()
