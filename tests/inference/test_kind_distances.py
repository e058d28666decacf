"""Other echoes are compared with those of their own kind and place: which these are, and that a table edit is told."""

import dataclasses

import numpy as np
import pytest

from explain_core_kit import frames, model
from lidarcheck.cases.frame import Frame
from lidarcheck.effects import Effect, make
from lidarcheck.effects.base import Curve
from lidarcheck.effects.finding import with_role
from lidarcheck.inference.kind_distances import apart_by_kind, named_by_kind, unlike_echoes
from lidarcheck.inference.observed.kinds import KINDS, cells_of, kind_of_cell
from lidarcheck.inference.observed.observations import Observations
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.model import Model, simulate
from lidarcheck.scenes.files.file import builtin_path, load_scene
from lidarcheck.sensor import Sensor

FINE = {"layers": range(230, 290), "points": range(500, 620, 4), "sign": True}


def scale_of(*effects: Effect) -> Scale:
    return Scale.of(frames(model(*effects), 1, **FINE), model(), 5)


def kinds_in(scale: Scale) -> dict[str, int]:
    """How many other echoes there are of each kind."""
    cell = cells_of(scale.beams, scale.measured)
    return dict(zip(KINDS, np.bincount(kind_of_cell()[cell[cell >= 0]], minlength=len(KINDS)).tolist(), strict=True))


@pytest.mark.parametrize(("role", "kind"), [("vertical blooming", "bloom"), ("ghost", "ghost")])
def test_what_an_effect_of_a_role_adds_is_of_its_kind(role: str, kind: str) -> None:
    strong = {"strength": 3.0} if role == "vertical blooming" else {}
    with_it, without = (kinds_in(scale_of(*e)) for e in ((make(with_role(role).name, strong),), ()))
    added = {name: with_it[name] - without[name] for name in KINDS}
    assert added[kind] > 20
    assert added[kind] > 0.8 * sum(added.values())


def stronger(one: Observations, by: float) -> Observations:
    return dataclasses.replace(one, extra_area=one.extra_area + by)


def test_an_unlike_echo_counts_less_than_one_that_is_not_there_and_more_the_less_it_is_like() -> None:
    scale = scale_of(make(with_role("vertical blooming").name, {"strength": 3.0}))
    one, ones = scale.measured, [np.ones(len(scale.beams))]
    number = int((cells_of(scale.beams, one) >= 0).sum())
    found = [unlike_echoes(scale.beams, stronger(one, by), [one], ones)[0] for by in (0.0, 0.1, 0.5, 2.0, 50.0)]
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    assert (np.diff(found) > 0.0).all()
    assert 0.9 * number < found[-1] < number
    none = dataclasses.replace(one, **{n: getattr(one, n)[:0] for n in ("extra_beam", "extra_m", "extra_side")},
        **{n: getattr(one, n)[:0] for n in ("extra_area", "extra_peak", "extra_width")})  # fmt: skip
    assert unlike_echoes(scale.beams, one, [none], ones)[0] == 0.0
    assert scale.distance(one, [none])[5] > scale.distance(stronger(one, 50.0), [one])[5]


def test_each_kind_has_its_features_and_none_where_a_sample_lacks_it() -> None:
    scale = scale_of(make(with_role("vertical blooming").name, {"strength": 3.0}))
    one = scale.measured
    apart = apart_by_kind(scale.beams, stronger(one, 0.1), [one])
    assert apart[KINDS.index("bloom")] == pytest.approx([0.5, 0.0, 0.0])
    named = named_by_kind(*(apart_by_kind(scale.beams, one, [other]) for other in (stronger(one, 0.2), one, one)))
    assert named["area of bloom"] == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)
    assert "area of ghost" not in named


# The direction of a table edit


X = np.arange(-204.0, 205.0, 12.0)


def table(y: np.ndarray) -> Effect:
    return with_role("vertical blooming")(lut=Curve(tuple(X), tuple(y), "lut.ini"))


def directions_told(count: int, seeds: int, edited: np.ndarray, points: tuple[int, int]) -> tuple[int, int]:
    """Of edits of a true table, a row a fifth down or a quarter up, how many widen the distance to a number of measured
    frames, and how many there are. Edits of rows whose bloom is never seen change nothing and are not counted."""
    scene = load_scene(builtin_path("sign_vertical_69m"))
    ideal, plain = scene.scene.ideal(points=points), Model(Sensor.of("SLIM"), scene.materials)
    y = 5e-4 * np.exp(-(np.abs(X / 120.0) ** 2))
    true = plain.with_(table(y))
    measured = [simulate(ideal, true, seed=4242, frame=k) for k in range(count)]
    scale = Scale.of([Frame(k, ideal, scan, 0.1 * k) for k, scan in enumerate(measured)], true, 11)

    def distance(one: Model) -> float:
        return float(scale.distance(scale.measured, scale.simulated(one, 9100, seeds)).mean())

    start, row = distance(true), np.arange(len(y))
    ways = [table(np.where(row == k, factor * y, y)) for k in edited for factor in (0.8, 1.25)]
    found = [distance(plain.with_(way)) - start for way in ways]
    moved = np.abs(found) > 1e-4
    return int((np.array(found)[moved] > 0.0).sum()), int(moved.sum())


@pytest.mark.parametrize(
    ("count", "seeds", "edited", "points"),
    [
        # One frame's chance decides one edit in ten; of eight frames, none of 32 was told the wrong way.
        pytest.param(8, 4, np.array([6, 12, 22, 28]), (474, 485), id="some rows"),
        pytest.param(1, 64, np.arange(2, len(X) - 2), (0, 959), marks=pytest.mark.long, id="whole frame"),
    ],
)
def test_the_direction_of_a_table_edit_is_told(
    count: int, seeds: int, edited: np.ndarray, points: tuple[int, int]
) -> None:
    right, of = directions_told(count, seeds, edited, points)
    assert of >= len(edited)
    assert right >= 0.9 * of
