"""The figures of `bench --effects`: how fast each effect and each mix is simulated, and where the time goes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from lidarcheck.cli.bench.kit import MEGA, times
from lidarcheck.cli.bench.mixes import Mix, mixes, with_effects
from lidarcheck.cli.bench.scene import lab_model, sized_frame

if TYPE_CHECKING:
    from lidarcheck.model.spec import Model
    from lidarcheck.scan import IdealScan, Light
    from lidarcheck.sensor import Sensor

__all__ = ["SENSORS", "Row", "rows_of", "tried"]

SENSORS = ("SMART", "SLIM", "XT32", "OS1-128", "TMF8820-short")
PLAIN = "no effect"
_LONG_S = 0.5
"""What takes longer is timed once more, what takes less a few times more."""


@dataclass(frozen=True, slots=True)
class Row:
    """What was measured with one effect or mix.

    `exact_mpts_s`, `fast_mpts_s`: million beams a second of the whole `simulate`, None where there is no such path.
    `of_plain`: the former beside the same frame without effects. `stages_ms`: what an exact frame
    takes, by stage. `floor`: bins walked, bins worth a draw and what a draw takes, of a SPAD array.
    `over_floor`: time of the draws beside that floor on as many cores. `without`: why effects of a mix were left out;
    `why_not`: why nothing was measured.
    """

    name: str
    exact_mpts_s: float | None = None
    fast_mpts_s: float | None = None
    of_plain: float | None = None
    stages_ms: Mapping[str, float] = field(default_factory=dict)
    bins_walked: float | None = None
    bins_worth: float | None = None
    draw_ns: float | None = None
    over_floor: float | None = None
    without: Mapping[str, str] = field(default_factory=dict)
    why_not: str = ""


def tried() -> dict[str, Mix]:
    """No effect, each effect alone at its typical values, and the mixes, by name."""
    from lidarcheck.effects import catalogue

    return {PLAIN: {}, **{name: {name: effect.example()} for name, effect in catalogue().items()}, **mixes("mixes")}


def rows_of(variant: str, beams: int, progress: Callable[[int, int, str], object]) -> tuple[int, list[Row]]:
    """The beams of a frame of about that many, and a row for each of `tried`; `progress` as the terminal's."""
    plain = lab_model(variant)
    frame = sized_frame(plain.sensor, beams)
    rows: list[Row] = []
    chosen = tried()
    for done, (name, mix) in enumerate(chosen.items()):
        progress(done, len(chosen), f"{variant}, {name}")
        rows.append(_measured(name, mix, plain, frame, rows[0].exact_mpts_s if rows else None))
    return len(frame), rows


def _measured(name: str, mix: Mix, plain: Model, frame: IdealScan, plain_mpts_s: float | None) -> Row:
    from lidarcheck.errors import LidarcheckError
    from lidarcheck.model import simulate
    from lidarcheck.sensor import SpadArray

    try:
        model, without = with_effects(plain, mix)
        if mix and len(without) == len(mix):
            return Row(name, why_not="; ".join(without.values()))
        exact = _seconds(lambda: simulate(frame, model, seed=1))
        counted = isinstance(model.sensor, SpadArray)
        fast = _seconds(lambda: simulate(frame, model, seed=1, fidelity="fast")) if counted else None
        stages, floor = _stages(frame, model)
    except LidarcheckError as error:
        return Row(name, why_not=error.what)
    mpts = len(frame) / MEGA
    return Row(
        name,
        mpts / exact,
        None if fast is None else mpts / fast,
        1.0 if plain_mpts_s is None else mpts / exact / plain_mpts_s,
        stages,
        **floor,
        without=without,
    )


def _seconds(work: Callable[[], object]) -> float:
    """The best of few repeats behind one that warms caches."""
    first = times(work, 1)[0]
    return min([first, *times(work, 1 if first > _LONG_S else 3, warm=False)])


def _stages(frame: IdealScan, model: Model) -> tuple[dict[str, float], dict[str, Any]]:
    """Milliseconds of light, pulses, draws and table, and of a SPAD array the floor, as fields of a `Row`."""
    from lidarcheck.model.chain import echoes_of
    from lidarcheck.model.stages import run_and_light
    from lidarcheck.sensor import SpadArray

    run, light = run_and_light(frame, model, 1, 0, None, None, None)
    stages = {"light": 1e3 * _seconds(lambda: run_and_light(frame, model, 1, 0, None, None, None))}
    if not isinstance(run.sensor, SpadArray):
        stages["draws"] = 1e3 * _seconds(lambda: echoes_of(light, run.sensor, seed=1))
        return stages, {}
    return _stages_of_spads(light, run.sensor, stages)


def _stages_of_spads(light: Light, sensor: Sensor, stages: dict[str, float]) -> tuple[dict[str, float], dict[str, Any]]:
    from lidarcheck.cli.bench.floor import floor_of
    from lidarcheck.model.detection import chain_echoes
    from lidarcheck.model.exact.listing import scan_of
    from lidarcheck.model.exact.numbers import numbers_of
    from lidarcheck.model.exact.pulses import pulses_of
    from lidarcheck.model.sharing import share
    from lidarcheck.sensor import SpadArray
    from lidarcheck.workers.cores import usable_cores

    spads, among = SpadArray.narrow(sensor), functools.partial(share, threads=None)
    echoes = chain_echoes(light, spads, seed=1)
    pulses = _seconds(lambda: pulses_of(light, spads, numbers_of(spads), among))
    draws = _seconds(lambda: chain_echoes(light, spads, seed=1)) - pulses
    table = _seconds(lambda: scan_of(echoes, light, spads, True, among))
    stages = {**stages, "pulses": 1e3 * pulses, "draws": 1e3 * draws, "table": 1e3 * table}
    floor = floor_of(light, spads)
    least = floor.beam_ns * len(light) / usable_cores()
    found = {"bins_walked": floor.walked, "bins_worth": floor.worth, "draw_ns": floor.draw_ns}
    return stages, {**found, "over_floor": 1e9 * draws / least if least > 0.0 else None}
