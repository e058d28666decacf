"""Rules of the search: kin beside each other, effects that the select frames cannot show, walks read off the data."""

import dataclasses

import numpy as np
import pytest

from lidarcheck.effects import find
from lidarcheck.effects.search import Probe, search_specs
from lidarcheck.effects.search.walk_error import walks
from lidarcheck.errors import UsageError
from lidarcheck.explain.search import second_look
from lidarcheck.explain.search.merit import FittedCandidate
from lidarcheck.explain.search.refine import Judged
from lidarcheck.explain.search.related import are_related
from lidarcheck.explain.search.selection import RANDOM_RELATED_PART, RELATED_PART, Search, beside_related
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.explain.search.trial import tried
from lidarcheck.inference.effect_fit import Fit
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Sensor


def trial(name: str, gain: float, before: float, after: float, change: float) -> FittedCandidate:
    probe = next(probe for probe in fixed_probes([name]) if not probe.variant)
    fit = Fit((probe,), (probe.start(),), 1.0, np.zeros((1, 3)))
    return FittedCandidate(name, 1, fit, gain, 1.0, before, after, change)


def probe_of(name: str, variant: str = "") -> Probe:
    return next(probe for probe in fixed_probes([name]) if probe.variant == variant)


def test_what_turns_at_random_needs_more_beside_its_relatives() -> None:
    first = trial("boresight", 5000.0, 4000.0, 100.0, 5000.0)
    found = Search(first.fit, first.fit, [first])
    assert beside_related(probe_of("vibration"), found) == pytest.approx(RELATED_PART * 5000.0)
    assert beside_related(probe_of("vibration", "wander"), found) == pytest.approx(RANDOM_RELATED_PART * 5000.0)


def test_a_second_look_asks_the_same_of_what_turns_at_random(monkeypatch: pytest.MonkeyPatch) -> None:
    first = trial("boresight", 5000.0, 4000.0, 100.0, 5000.0)
    others = [probe_of("vibration", "wander"), probe_of("vibration")]
    again = [
        dataclasses.replace(trial("vibration", 1300.0, 3000.0, 1800.0, 900.0), fit=two(first, one)) for one in others
    ]
    monkeypatch.setattr(second_look, "run_round", lambda *_: again)
    monkeypatch.setattr(second_look, "_likely", lambda *_: [])
    own = Judged(None, dataclasses.replace(first.fit, distance=3000.0), 0.1, 0.001)  # type: ignore[arg-type]
    look = second_look.Look(None, [])  # type: ignore[arg-type]
    found = second_look._trials(own, look, 2, Search(first.fit, first.fit, [first]))
    assert [one.needed for one in found] == [pytest.approx(RANDOM_RELATED_PART * 5000.0), 1.0]
    assert [one.passes for one in found] == [False, True]


def two(first: FittedCandidate, other: Probe) -> Fit:
    """A fit of a trial's effect and another one."""
    probes = (*first.fit.probes, other)
    return dataclasses.replace(first.fit, probes=probes, x=tuple(probe.start() for probe in probes))


def test_an_effect_must_hold_on_the_select_frames_where_it_shows_there() -> None:
    shown = trial("walk_error", 1000.0, 400.0, 100.0, 500.0)
    assert shown.passes
    assert not dataclasses.replace(shown, select_after=400.0).passes
    assert not dataclasses.replace(shown, select_after=800.0).passes


def test_where_the_select_frames_cannot_show_it_an_effect_must_only_do_no_harm() -> None:
    unseen = trial("retro_ghost", 1000.0, 400.0, 400.0, 0.0)
    assert unseen.passes
    assert unseen.select_change < 0.05 * unseen.gain
    assert dataclasses.replace(unseen, select_after=415.0).passes
    assert not dataclasses.replace(unseen, select_after=425.0).passes
    assert not dataclasses.replace(unseen, select_change=90.0).passes


def test_where_the_select_frames_show_it_weakly_most_of_what_it_changes_there_must_be_to_the_better() -> None:
    weak = trial("walk_error", 1000.0, 140.0, 90.0, 85.0)
    assert weak.passes
    assert not dataclasses.replace(weak, select_after=110.0).passes
    assert not dataclasses.replace(weak, select_after=200.0).passes


def test_losses_at_random_hold_where_a_frame_is_as_far_as_another_one_would_be() -> None:
    lost = dataclasses.replace(trial("dropout", 1000.0, 800.0, 1000.0, 500.0), own=960.0)
    assert lost.passes
    assert not dataclasses.replace(lost, own=None).passes
    assert not dataclasses.replace(lost, own=850.0).passes
    assert not dataclasses.replace(lost, own=1200.0).passes, "such a model scatters more than the sensor"
    assert not dataclasses.replace(lost, needed=600.0).passes


def test_what_explains_much_holds_where_the_select_frames_are_near_their_floor_with_it_and_without() -> None:
    quiet = dataclasses.replace(trial("incidence_falloff", 400.0, 550.0, 600.0, 220.0), needed=50.0, select_floor=556.0)
    assert quiet.passes
    assert not dataclasses.replace(quiet, select_floor=float("-inf")).passes
    assert not dataclasses.replace(quiet, select_after=690.0).passes
    assert not dataclasses.replace(quiet, needed=110.0).passes
    turned = trial("boresight", 400.0, 550.0, 600.0, 220.0)
    assert not dataclasses.replace(turned, needed=50.0, select_floor=556.0).passes, "edges may do that"


def test_beside_its_relatives_an_effect_must_explain_a_part_of_what_that_one_does() -> None:
    first = trial("walk_error", 5000.0, 4000.0, 100.0, 5000.0)
    found = Search(first.fit, first.fit, [first])
    assert beside_related(probe_of("range_scale"), found) == pytest.approx(RELATED_PART * 5000.0)
    assert beside_related(probe_of("fog"), found) == 0.0
    assert (
        beside_related(
            probe_of("range_scale"), Search(first.fit, dataclasses.replace(first.fit, probes=(), x=()), [first])
        )
        == 0.0
    )


def test_relatives_are_effects_and_none_is_its_own() -> None:
    for name in search_specs():
        find(name)
        assert not are_related(name, name)
    assert are_related("range_offset", "walk_error")
    assert not are_related("range_offset", "fog")


@pytest.mark.parametrize(
    "shift_m",
    [
        lambda area: 0.06 * np.log10(area / 1000.0),
        lambda area: -0.08 * np.log10(area / 300.0) + 0.03 * np.log10(area / 300.0) ** 2,
        lambda area: 4.8 / np.sqrt(area),
        lambda area: -30.0 / area,
        lambda area: 0.002 * np.sqrt(area) - 0.05,
    ],
    ids=["decades", "parabola", "root", "inverse", "rising root"],
)
def test_a_walk_is_read_off_its_curve(shift_m) -> None:
    area = np.geomspace(20.0, 6000.0, 24)
    wanted = shift_m(area)
    errors = []
    for probe in walks(np.log10(area), wanted):
        found = find("walk_error")(**{**probe.fixed, **probe.settings}).shift_m(area)
        errors.append(np.abs(found - wanted).max() / np.ptp(wanted))
    assert min(errors) < 0.03


class NarrowLab:
    """A laboratory that only applies what an effect does to the sensor."""

    def __init__(self, sensor: Sensor) -> None:
        self.model, self.measured, self.metric, self.seeds = Model(sensor), np.zeros(3), self, 2

    def shows(self, model, seeds=None, *, nuisance=None):
        for effect in model.effects:
            effect.detector(model.sensor)
        return np.zeros((1, 3))

    def distance(self, shown):
        return 1.0

    def varies(self, shown):
        return False

    def times(self, jacobian):
        return jacobian

    def square(self, change):
        return 0.0


@pytest.mark.parametrize(("shift_ns", "found"), [(-3.7, True), (-900.0, False)])
def test_a_start_that_no_sensor_can_have_is_made_weaker_or_left(shift_ns: float, found: bool) -> None:
    sensor = Sensor.of("SMART")
    probe = next(probe for probe in fixed_probes(["dead_time"]) if not probe.variant)
    probe = dataclasses.replace(probe, settings={**probe.settings, "shift_ns": shift_ns})
    with pytest.raises(UsageError):
        probe.effect(probe.start()).detector(sensor)
    simulator = NarrowLab(sensor)
    fit, after, *_ = tried(simulator, simulator, Fit((), (), 1.0, np.zeros((1, 3))), np.zeros((1, 3)), 1.0, probe)
    assert fit.possible == found
    assert np.isfinite(after) == found


@pytest.mark.parametrize("size_deg", [0.12, 0.2, 0.3, 0.42])
def test_an_aim_that_is_off_in_any_direction_has_a_start_near_it(size_deg: float) -> None:
    """From a start on one axis a fit at edges did not find the other one's part: the edges stood in between."""
    starts = [(probe.settings["yaw_deg"], probe.settings["pitch_deg"]) for probe in fixed_probes(["boresight"])]
    for way in np.deg2rad(np.arange(0.0, 360.0, 15.0)):
        truth = size_deg * np.array([np.cos(way), np.sin(way)])
        assert min(np.hypot(*(truth - start)) for start in starts) < 0.16
