"""Hidden cases of foreign sensors: their generator agrees with the package, and hides what it says."""

import sys
from pathlib import Path

import numpy as np
import pytest

import hidden
from lidarcheck.cases.case import load_case
from lidarcheck.explain.benchmark.run import load_generator
from lidarcheck.model import simulate

PLACE = Path(hidden.__file__).parent / "foreign"
foreign = load_generator(PLACE)
orders = sys.modules[f"{foreign.__name__}.orders"]
cases = sys.modules[f"{foreign.__name__}.cases"]
visibility = sys.modules[f"{foreign.__name__}.visibility"]
FRAMES = {"street": 3, "bench": 12}


def quiet(sensor: str, seed: int = 5):
    scene = "bench" if orders.DETECTOR[sensor] == "photon_histogram" else "street"
    return foreign.CaseOrder(0, "null", seed, (), "medium", sensor, scene)


def of_scans(ideals, scans) -> dict[str, np.ndarray]:
    """Values (n,) of all echoes of all frames by name, and how many echoes each beam has."""
    found: dict[str, list[np.ndarray]] = {}
    for ideal, scan in zip(ideals, scans, strict=True):
        rows = ideal.beams.index(ideal.layer.astype(np.int64), ideal.point.astype(np.int64))
        ways = {beam: ideal.distance_m[rows == beam] for beam in np.unique(rows)} if len(rows) < 2000 else None
        single = dict(zip(rows.tolist(), ideal.distance_m[:, None], strict=True)) if ways is None else ways
        echo = ideal.beams.index(scan.layer, scan.point)
        way = scan.range_m - scan.beams.range_offset_m(scan.layer)
        nearest = np.array([np.abs(single[beam] - r).min() for beam, r in zip(echo.tolist(), way, strict=True)])
        on = nearest < visibility.ON_SURFACE_M
        beams = np.unique(rows)
        counts, extra = (np.bincount(np.searchsorted(beams, echo[part]), minlength=len(beams)) for part in (on, ~on))
        values = {"found": counts, "extra": extra, "distance": nearest[on]}
        values |= {name: scan.feature(name)[on] for name in scan.feature_names}
        for name, column in values.items():
            found.setdefault(name, []).append(np.asarray(column, np.float64))
    return {name: np.concatenate(columns) for name, columns in found.items()}


@pytest.mark.parametrize("sensor", orders.SENSORS)
def test_agrees_with_the_package_where_nothing_is_hidden(sensor, tmp_path):
    order = quiet(sensor)
    foreign.write_case(order, tmp_path, frames=FRAMES[order.scene])
    case = load_case(tmp_path)
    ideals = [frame.ideal for frame in case.frames]
    measured = of_scans(ideals, [frame.measured for frame in case.frames])
    simulated = of_scans(ideals, [simulate(one, case.model, seed=k) for k, one in enumerate(ideals)])
    again = of_scans(ideals, [simulate(one, case.model, seed=50 + k) for k, one in enumerate(ideals)])
    assert set(measured) == set(simulated)
    for name in measured:
        both = np.concatenate([simulated[name], again[name]])
        a = measured[name]
        spread = np.sqrt((both.var() + 1e-12) * (1 / len(a) + 1 / len(both)))
        assert abs(a.mean() - both.mean()) < visibility.VISIBLE_Z * spread + 1e-9, name
        if name in ("distance", "found"):
            for share in (0.1, 0.9):
                assert np.quantile(a, share) == pytest.approx(np.quantile(both, share), abs=0.004), name
