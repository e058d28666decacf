"""Explanations made by hand on real simulated frames, for the tests of what is drawn from them."""

import dataclasses
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lidarcheck.cases.frame import Frame
from lidarcheck.effects.finding import make
from lidarcheck.explain.report.explanation import Candidate, Explanation, Finding, SearchStep, Standout
from lidarcheck.inference.intervals import Gap, Interval
from lidarcheck.model.chain import simulate
from lidarcheck.model.showcase.scene import MATERIALS, ideal_scan
from lidarcheck.model.spec import Model
from lidarcheck.sensor import Sensor

MODEL = Model(Sensor.of("SMART"), MATERIALS)
FOG = make("fog", {"mor_m": 180.0})
GAIN = make("layer_gain", {})
CURVE = make("empirical_signal", {"covariate": "range_m", "knots": (10.0, 40.0, 80.0), "values": (-0.4, -1.2, -2.2)})
AFTER = MODEL.with_(FOG).with_(GAIN)


@dataclass(frozen=True)
class FakeCase:
    """What the page needs of a case."""

    frames: tuple[Frame, ...]
    model: Model = MODEL
    directory: Path = Path("/somewhere/street")
    hashes: dict[str, str] = field(default_factory=lambda: {"model.toml": "ab" * 32, "frames/0.txt": "cd" * 32})


def frames(model=AFTER, *, numbers=(2, 5), every=1):
    ideal = ideal_scan()
    ideal = ideal.take(slice(None, None, every))
    return tuple(
        Frame(n, ideal, simulate(ideal, model, seed=77, frame=n, threads=1), 0.04 * n) for n in numbers
    )  # fmt: skip


def case(model=AFTER, **choice):
    return FakeCase(frames(model, **choice))


def candidate(name, gain, **changes):
    values = {"round": 1, "needed": 40.0, "pull": 12.0, "closed": math.nan, "verdict": "chance may make as much"}
    return Candidate(name=name, gain=gain, **(values | changes))


def findings(verdict):
    parameters = {"mor_m": Interval(181.0, 172.0, 190.0, "m"), "backscatter": Interval(1.02, 0.95, 1.1)}
    fog = Finding("fog", parameters, 0.97, ("rain",), "AREA falls with range", "a wall at 100 m", (FOG,))
    gain = Finding("layer_gain", {"gain": Interval(0.8, 0.79, 0.82)}, 0.99, (), "layers 250-269 are dim", "", (GAIN,))
    unknown = Finding("unknown", {}, 0.9, (), "PEAK depends on the range", "", (CURVE,))
    return {"explained": (fog, gain), "unknown": (unknown,), "no_gap": ()}[verdict]


def gap(verdict):
    before, after, floor = Interval(0.9, 0.85, 0.95), Interval(0.03, 0.02, 0.045), Interval(0.02, 0.015, 0.027)
    if verdict == "no_gap":
        before = after = Interval(0.021, 0.014, 0.029)
    falls = (("fog", Interval(0.2, 0.17, 0.23)), ("layer_gain", after)) if verdict == "explained" else ()
    return Gap(before, after, floor, {"range": (0.1, 0.011, 0.01), "area": (0.5, 0.02, 0.015)}, falls)


def explanation(verdict="explained", **changes):
    values = {
        "verdict": verdict,
        "findings": findings(verdict),
        "not_testable": {"mirror_multipath": "nothing here is mirror-like", "motion": "nothing moves"},
        "gap": gap(verdict),
        "model": {"explained": AFTER, "unknown": MODEL.with_(CURVE), "no_gap": MODEL}[verdict],
        "steps": (
            SearchStep("split", "2 frames to fit, 2 to select, 2 to verify"),
            SearchStep("screen", "28 candidates"),
        ),
        "where": (Standout("area", "range", "60-80 m", -31.2, "AREA is 31 standard deviations lower at 60-80 m"),),
        "candidates": (
            candidate("fog", 900.0, closed=0.71, verdict="accepted", equivalent_to=("rain",)),
            candidate("layer_gain", 300.0, round=2, closed=0.99, verdict="accepted"),
            candidate("dropout", 12.0),
            candidate("walk_error", -3.0),
        ),
        "split": {"fit": (0, 3), "select": (1, 4), "verify": (2, 5)},
        "seeds": {"seed": 5},
        "hashes": {"ideal 0": "ef" * 32},
    }
    return Explanation(**(values | changes))


def no_echoes(frame):
    return dataclasses.replace(frame, measured=frame.measured.take(np.zeros(len(frame.measured), dtype=bool)))


def odd_frames():
    (one,) = frames(numbers=(0,), every=5)
    layer = one.ideal.layer == one.ideal.layer[0]
    line = one.ideal.take(layer)
    nothing = dataclasses.replace(one.ideal, distance_m=np.zeros(len(one.ideal)))
    beam = one.ideal.take(slice(0, 1))
    return {
        "no frame": (),
        "no echo": (no_echoes(one),),
        "one layer": (Frame(0, line, simulate(line, AFTER, seed=1), 0.0),),
        "one beam": (Frame(0, beam, simulate(beam, AFTER, seed=1), 0.0),),
        "no beam": (Frame(0, one.ideal.take(slice(0, 0)), one.measured.take(slice(0, 0)), 0.0),),
        "nothing met": (Frame(0, nothing, simulate(nothing, AFTER, seed=1), 0.0),),
        "one of two empty": (one, dataclasses.replace(no_echoes(one), number=1)),
    }
