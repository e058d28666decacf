"""The printed rows of a real sign and its ghost, against the example model that was fitted to them.

The sign's saturated echoes scatter from 29 to 44 ns between neighbouring beams, ten times what photon statistics give:
its beams must return between a tenth and all of a full beam's light, as dark print and edges do. At the WIDTH of each
printed row the model's AREA agrees. The ghosts are held against beams that return all.

What the model does not give: ghosts whose AREA is nine times their PEAK at 25 m and seven times at 44 m, as there is
one ON time; and an excess of the ghost's range that does not change with the sign's WIDTH, as a longer echo is also a
later one in the model.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from lidarcheck.formats import load_scan
from lidarcheck.model import Model, load_model, simulate
from lidarcheck.scan import IdealScan, Scan
from lidarcheck.sensor import Sensor
from places import ROOT, shared_path

BEAMS = 3000
PLACES = {"1_25m": 25.1, "2_45m": 44.1}
"""True range of the sign, so that the model reports it about where the rows stand: its echo is pulled by the tail."""
SLANT_M = 0.15
"""The sign is no sphere around the sensor: its beams' ranges differ by about a bin."""
LEAST_SHARE = 0.02


@dataclass
class Rows:
    """A sign's echo of each beam, the largest of those at its range, and the ghosts; the excess by ghost."""

    sign: Scan
    ghost: Scan
    excess_m: np.ndarray


def rows_of(scan: Scan, true_m: float) -> Rows:
    beam = scan.layer.astype(np.int64) * 960 + scan.point
    near = np.flatnonzero(scan.range_m < 1.5 * true_m)
    near = near[np.lexsort((-scan.area[near], beam[near]))]
    _, first = np.unique(beam[near], return_index=True)
    sign, far = near[first], np.flatnonzero(scan.range_m >= 1.5 * true_m)
    far = far[np.isin(beam[far], beam[sign])]
    partner = sign[np.searchsorted(beam[sign], beam[far])]
    return Rows(scan.take(sign), scan.take(far), scan.range_m[far] - 2.0 * scan.range_m[partner])


def simulated(model: Model, true_m: float, *, least_share: float = 1.0) -> Rows:
    """Beams that return a share of a full beam's light, from `least_share` to 1, evenly over its logarithm."""
    layer, point = np.divmod(np.arange(BEAMS), 40)
    distance = true_m + SLANT_M * (np.arange(BEAMS) % 29) / 29
    share = np.geomspace(least_share, 1.0, BEAMS)
    ideal = IdealScan(layer + 200, point + 300, distance, np.full(BEAMS, 2), np.zeros(BEAMS), share=share)
    return rows_of(simulate(ideal, model, seed=11), true_m)


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(ROOT / "examples/sign_ghost_SLIM.toml")


@pytest.fixture(scope="module", params=sorted(PLACES))
def printed(request: pytest.FixtureRequest) -> tuple[Rows, float]:
    """The printed rows, and the sign's true range."""
    true_m = PLACES[request.param]
    return rows_of(load_scan(shared_path(f"samples/{request.param}.txt")), true_m), true_m


def interval(values: np.ndarray) -> tuple[float, float]:
    low, high = np.quantile(values, [0.01, 0.99])
    return float(low), float(high)


@pytest.mark.parametrize("feature", ["width_ns", "area", "peak"])
def test_printed_ghosts_lie_within_the_model(printed: tuple[Rows, float], model: Model, feature: str) -> None:
    rows, true_m = printed
    found = getattr(rows.ghost, feature)
    low, high = interval(getattr(simulated(model, true_m).ghost, feature))
    # PEAK 20 at 44 m is a detector or two below the interval.
    slack = 2.0 if feature == "peak" else 0.0
    assert len(found) >= 2
    assert np.all((found >= low - slack) & (found <= high)), (low, high)


def test_printed_saturated_echoes_lie_within_the_model(printed: tuple[Rows, float], model: Model) -> None:
    rows, true_m = printed
    sign = simulated(model, true_m, least_share=LEAST_SHARE).sign
    assert set(rows.sign.peak) == {236.0}
    for width, area in zip(rows.sign.width_ns.tolist(), rows.sign.area.tolist(), strict=True):
        like = np.abs(sign.width_ns - width) <= 1.0
        assert like.sum() >= 30, f"the model has echoes of {width} ns"
        assert np.all(sign.peak[like] == 236.0)
        low, high = interval(sign.area[like])
        # The row of 19 ns lies half a metre behind the others, at the sign's edge.
        slack = 0.12 if width < 20.0 else 0.04
        assert low * (1.0 - slack) <= area <= high * (1.0 + slack), (width, area, low, high)


def test_neighbouring_beams_of_the_sign_do_not_return_the_same_light(model: Model) -> None:
    """Full beams give a narrow band of WIDTH at each distance, around the widest of the printed rows."""
    for name, widest in (("1_25m", 44.0), ("2_45m", 34.0)):
        low, high = interval(simulated(model, PLACES[name]).sign.width_ns)
        assert low - 2.0 <= widest <= high + 2.0
        assert high - low < 10.0


def test_printed_excesses_lie_within_the_model(printed: tuple[Rows, float], model: Model) -> None:
    rows, true_m = printed
    assert np.all((rows.excess_m > 0.13) & (rows.excess_m < 0.34))
    ghost_m = np.median(simulated(model, true_m).ghost.range_m)
    sign = simulated(model, true_m, least_share=LEAST_SHARE).sign
    modelled = ghost_m - 2.0 * sign.range_m
    low, high = interval(modelled)
    assert np.all((rows.excess_m >= low) & (rows.excess_m <= high)), (low, high)


def test_the_ghost_fades_as_measured(model: Model) -> None:
    near, far = (simulated(model, PLACES[name]).ghost for name in ("1_25m", "2_45m"))
    # PEAK saturates as SPADs run out: avalanches per SPAD come from the share of them that is ON.
    s = [-np.log(1.0 - np.mean(scan.peak) / model.sensor.detectors) for scan in (near, far)]
    decay = np.log(s[1] / s[0]) / np.log(PLACES["2_45m"] / PLACES["1_25m"])
    assert decay == pytest.approx(-2.25, abs=0.2)


def test_the_reference_sensor_cannot_give_the_narrow_ghosts(model: Model) -> None:
    """Outputs ON for 9 bins: n avalanches above the threshold are never narrower, printed are 7 and 8."""
    reference = Model(Sensor.of("SLIM"), model.materials, model.effects)
    rows = simulated(reference, PLACES["2_45m"])
    assert np.quantile(rows.ghost.width_ns[rows.ghost.peak >= 19], 0.01) >= 9.0
    assert np.median(rows.sign.width_ns) < 19.0, "synchronous detectors: the tail meets none that is armed"
