"""How long a user waits for what simulates again and again, with this tree and an earlier one. Run by ci/waits.

Without an earlier tree: how long a frame in fog takes with another model, with what the first one showed and without.

Processor time counts, of all that a command starts: on a busy machine wall time says how busy it was.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lidarcheck.cli.bench.scene import lab_frame, lab_model, signs_frame
from lidarcheck.effects import make
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.model import load_model, save_model, simulate
from lidarcheck.model.incremental import simulate_detected
from lidarcheck.model.spec import Model
from lidarcheck.model.stages import Surfaces

ROOT = Path(__file__).resolve().parents[1]
FOG = make("fog", {"mor_m": 200.0})
FRAMES = 6
SCENARIOS = (
    *(
        "effect_fog_SMART",
        "effect_fog_SLIM",
        "effect_rain_SMART",
        "effect_mirror_multipath_SMART",
        "weak_targets_SMART",
    ),
    *("scene_city_street_SMART", "watch_first_SMART", "watch_patches_SMART", "range_sweep_SLIM"),
)
NUMBER = """
import sys, time
from pathlib import Path
from lidarcheck.calibration.number.entry import sample
from lidarcheck.calibration.number.request import Request
from lidarcheck.reading import reading
folder = Path(sys.argv[1]).resolve()
start = {{str(folder / name): (folder / name).read_bytes() for name in ("model.toml", "table.ini")}}
request = Request(
    "{kind}", folder / "model.toml", (folder / "real.parquet",), (folder / "ideal.parquet",), start=start
)
text = (folder / "{file}").read_text()
assert "{old}" in text
sample(request)
start = time.process_time()
for step in range(1, 5):
    with reading({{str(folder / "{file}"): text.replace("{old}", "{new}".format(step=step)).encode()}}):
        sample(request)
print((time.process_time() - start) / 4)
"""


def write_case(place: Path, side: int) -> None:
    """Six frames of the laboratory in fog, seen by a sensor that has lost three tenths of its signal."""
    place.mkdir()
    model, frame = lab_model("SMART").with_(FOG), lab_frame()
    save_model(model, place / "model.toml")
    sensor = model.with_(make("signal_gain", {"gain": 0.7}))
    lines = ['model = "model.toml"']
    for number in range(FRAMES):
        column = number * 140
        near = (np.abs(frame.layer - 260) <= side) & (frame.layer % 2 == 0)
        part = frame.take(near & (frame.point >= column) & (frame.point < column + side))
        save_ideal(part, place / f"ideal_{number}.parquet")
        save_scan(simulate(part, sensor, seed=9, frame=number), place / f"measured_{number}.pcd")
        files = f'ideal = "ideal_{number}.parquet"\nmeasured = "measured_{number}.pcd"\ntime = {0.04 * number:.2f}'
        lines.append(f"\n[[frames]]\n{files}")
    (place / "case.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_sign(place: Path, *, fog: bool) -> None:
    """A sign whose light blooms, with its table, and what was measured of it."""
    sys.path.insert(0, str(ROOT / "tests" / "kits"))
    from number_kit import MODEL, sign, table

    place.mkdir()
    text = MODEL.format(variant="SLIM", axis="vertical")
    text += '\n[[effects]]\nname = "fog"\nmor_m = 200.0\n' if fog else ""
    (place / "model.toml").write_text(text, encoding="utf-8")
    (place / "table.ini").write_text(table(), encoding="utf-8")
    model: Model = load_model(place / "model.toml")
    ideal = sign(model.sensor.beams, at_m=(60.0,) if fog else (100.0,))
    save_ideal(ideal, place / "ideal.parquet")
    save_scan(simulate(ideal, model, seed=3), place / "real.parquet", model.sensor)


def commands(place: Path, side: int) -> dict[str, Callable[[Path], list[str]]]:
    """What is run, by its name: a function of the directory for results gives its arguments."""
    write_case(place / "case", side)
    write_sign(place / "sign", fog=False)
    write_sign(place / "fog", fog=True)
    case, sign = str(place / "case"), place / "sign"
    lidarcheck = ["-c", "from lidarcheck.cli.core.entry import main; main()"]
    fit = ["--rounds", "2", "--jobs", "1"]
    bloom = [str(sign / "real.parquet"), "--ideal", str(sign / "ideal.parquet"), "--model", str(sign / "model.toml"),
             "--lut", str(sign / "table.ini")]  # fmt: skip

    def number(kind: str, file: str, old: str, new: str) -> Callable[[Path], list[str]]:
        text = NUMBER.format(kind=kind, file=file, old=old, new=new)
        return lambda _out: ["-c", text, str(place / "fog")]

    return {
        "check": lambda _out: [*lidarcheck, "check", *SCENARIOS, "--jobs", "1"],
        "calibrate reflectance, range": lambda out: [
            *lidarcheck, "calibrate", case, "--free", "materials.2.reflectance, effects.range_offset.offset_m", *fit,
            "--out", str(out),
        ],
        "calibrate signal_at_1m": lambda out: [
            *lidarcheck, "calibrate", case, "--free", "signal_at_1m", *fit, "--out", str(out),
        ],
        "bloom fit": lambda out: [*lidarcheck, "bloom", "fit", *bloom, "--out", str(out)],
        "explain": lambda out: [*lidarcheck, "explain", case, "--no-html", "--jobs", "1", "--out", str(out)],
        "number, a row of the table": number("misfit", "table.ini", "0.0004000", "0.00041{step}0"),
        "number, a reflectance": number("gap", "model.toml", "reflectance = 0.3", "reflectance = 0.3{step}"),
        "number, the fog": number("gap", "model.toml", "mor_m = 200.0", "mor_m = 19{step}.0"),
    }  # fmt: skip


def again(side: int, rounds: int) -> None:
    """One frame of the case with another model: what is simulated with what the first one showed, and without."""
    frame = signs_frame()
    near = (np.abs(frame.layer - 260) <= side) & (frame.layer % 2 == 0)
    column = int(frame.point[frame.material_id == 5].min()) - side // 2
    ideal = frame.take(near & (frame.point >= column) & (frame.point < column + side))
    before = lab_model("SMART").with_(FOG)
    table = {**before.materials, 2: replace(before.materials[2], reflectance=0.55)}
    changes = {
        "another seed": before,
        "a reflectance": replace(before, materials=table),
        "range_offset": before.with_(make("range_offset", {})),
        "retro_ghost": before.with_(make("retro_ghost", {})),
        "blooming_vertical": before.with_(make("blooming_vertical", {})),
        "rain": before.with_(make("rain", {})),
        "the fog": before.with_(make("fog", {"mor_m": 190.0})),
    }
    print("| what differs | all [ms] | the rest is kept [ms] | all / rest |\n|---|---|---|---|")
    for what, model in changes.items():
        times: list[list[float]] = [[], []]
        for seed in range(rounds + 1):
            kept = Surfaces(ideal)
            like = simulate_detected(ideal, before, seed=seed, threads=1, surfaces=kept)
            seed += what == "another seed"
            runs: list[dict[str, Any]] = [{"surfaces": Surfaces(ideal)}, {"surfaces": kept, "like": like}]
            found = []
            for how, spent in zip(runs, times, strict=True):
                start = time.process_time()
                found.append(simulate_detected(ideal, model, seed=seed, threads=1, **how))
                spent.append(1e3 * (time.process_time() - start))
            assert found[0].scan.x_m.tobytes() == found[1].scan.x_m.tobytes()
        whole, rest = (statistics.median(spent[1:]) for spent in times)
        print(f"| {what} | {whole:.1f} | {rest:.1f} | {whole / rest:.1f} |", flush=True)


def seconds(tree: Path, arguments: Sequence[str], place: Path) -> float:
    """Processor time of a command with the sources of a tree, in a project of its own; a number's its own words."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
    run = subprocess.run(
        [sys.executable, *arguments], cwd=tree, env=environment, capture_output=True, text=True, check=False
    )
    if run.returncode:
        sys.exit(f"{arguments}: {run.stderr[-2000:]}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if "sample(request)" in arguments[1]:
        return float(run.stdout)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print a table of medians and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--before", type=Path, help="an earlier tree: git worktree add DIR COMMIT")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--side", type=int, default=96, help="beams of a frame of the case: so many times so many")
    parser.add_argument("--only", default="", help="commands whose name has this word in it")
    asked = parser.parse_args()
    if asked.before is None:
        again(asked.side, asked.rounds)
        return
    trees = [asked.before.resolve(), ROOT]
    print("| waits for | before [s] | now [s] | before / now |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="lidarcheck-waits-") as name:
        place = Path(name)
        for what, arguments in commands(place, asked.side).items():
            if asked.only not in what:
                continue
            found: list[list[float]] = [[], []]
            for number in range(asked.rounds + 1):  # the first one compiles what is not yet
                for tree, times in zip(trees, found, strict=True):
                    took = seconds(tree, arguments(place / f"{len(found[0])}-{tree.name}-{what}-{number}"), place)
                    times += [took] if number else []
            before, now = (statistics.median(times) for times in found)
            print(f"| {what} | {before:.2f} | {now:.2f} | {before / now:.2f} |", flush=True)


if __name__ == "__main__":
    main()
