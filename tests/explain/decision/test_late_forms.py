"""How many rays a named footprint has: as the search fitted it, or more where these leave less of the gap."""

from dataclasses import replace

import pytest

from explain_core_kit import frames, model
from lidarcheck.effects import make
from lidarcheck.explain.decision.equivalence import Polished
from lidarcheck.explain.decision.late_forms import with_finer_forms
from lidarcheck.explain.search.starts import fixed_probes
from lidarcheck.inference.effect_fit import Fit, fit
from lidarcheck.inference.simulator import Simulator
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.workers import WorkerPool

FINE = {"layers": range(240, 284, 2), "points": range(390, 600, 3), "sign": True}
WIDE = {"vertical_deg": 0.35, "horizontal_deg": 0.35}


def fitted(rays: int) -> tuple[Scale, Polished]:
    """A footprint of so many rays, as the search fits it."""
    seen = Scale.of(frames(model(make("beam_divergence", WIDE | {"rays": rays})), 2, **FINE), model(), 5)
    simulator = Simulator(seen.frames, model(), 3)
    probe = replace(fixed_probes(["beam_divergence"])[0], settings=WIDE)
    found = fit(simulator, [probe], [probe.start()], rounds=2)
    return seen, Polished(found, simulator, found, {})


def left(seen: Scale, now: Fit) -> float:
    return seen.excess(now.model(model()), now.nuisance)[0]


@pytest.mark.long
@pytest.mark.parametrize("rays", [3, 11])
def test_more_rays_are_taken_where_they_leave_less(rays: int) -> None:
    seen, before = fitted(rays)
    after = with_finer_forms(seen, model(), before, WorkerPool())
    used = after.last.effects()[0].settings()["rays"]
    assert used == 3 if rays == 3 else used > 3
    assert (after is before) == (rays == 3)
    if rays > 3:
        assert left(seen, after.last) < left(seen, before.last)
        # Fewer rays make up for the others by a wider footprint: of four drawings 0.42 to 0.44, and then 0.38 to 0.41.
        off = [one.last.effects()[0].settings()["horizontal_deg"] - WIDE["horizontal_deg"] for one in (before, after)]
        assert abs(off[1]) < 0.7 * abs(off[0])


def test_without_a_footprint_nothing_is_fitted() -> None:
    seen = Scale.of(frames(model(), 2), model(), 5)
    simulator = Simulator(seen.frames, model(), 3)
    plain = Polished(
        Fit((), (), 0.0, simulator.measured[None]), simulator, Fit((), (), 0.0, simulator.measured[None]), {}
    )
    assert with_finer_forms(seen, model(), plain, WorkerPool()) is plain
