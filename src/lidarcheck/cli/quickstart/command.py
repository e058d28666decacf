"""`lidarcheck quickstart`: from a recording to a verdict."""

from __future__ import annotations

import json as json_module
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tomli_w
from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    Jobs,
    JsonFile,
    MaxRows,
    Quiet,
    Rooted,
    Seed,
    SensorName,
    sensor_file,
    up_to,
)
from lidarcheck.cli.core.outputs import check_writable, files_given, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import emit, hush, stage
from lidarcheck.cli.quickstart.page import write_laws, write_verdict
from lidarcheck.cli.quickstart.steps import Steps
from lidarcheck.errors import InputError, UsageError
from lidarcheck.formats.atomic import write_text
from lidarcheck.formats.limits import limit_rows

__all__ = ["quickstart"]

_MOST, _USUAL = 1000, 20
_FEWEST = 3
_USUAL_RATE_HZ = 10.0


def quickstart(
    recording: Annotated[
        list[Path], Parameter(negative=(), help=f"A recording of a sensor and a scene at rest: a bag, scans{MANY}.")
    ],
    /,
    *,
    out: Annotated[Path, Parameter(help="Directory for everything; given again, the work goes on there.")],
    sensor: SensorName = None,
    most: Annotated[int, Parameter(converter=up_to(_MOST), help="So many frames are enough, 20 by default.")] = _USUAL,
    seed: Seed = 0,
    jobs: Jobs | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Rooted | None = None,
) -> int:
    """Go from a recording to a verdict, each step a command that it prints."""
    hush(quiet)
    limit_rows(max_rows)
    files = files_given(*recording)
    run = Steps(out, files)
    if json is not None:
        check_writable(json, option="--json", besides=files)
    run.begin()
    work = _Work(run, out, recording, seed, jobs)
    frames = work.choose_frames(most)
    name = work.find_sensor(sensor, frames)
    facts = work.estimate(name)
    if len(frames) < _FEWEST:
        return _laws_alone(work, facts, json)
    shown = work.make_and_check(facts)
    if not shown["shown"]:
        return _laws_alone(work, facts, json)
    lines = [f"{shown['words']}: {', '.join(shown['shown'])}", *work.said]
    work.explain()
    with stage("drawing"):
        words = write_verdict(out / "case", out / "found", out / "report.html", lines)
    document = {"first": lines, "verdict": words[0], "shown": shown, "commands": run.commands, "seconds": run.seconds}
    _tell(json, {**document, "page": str(out / "report.html")}, [*lines, *words, f"page: {out / 'report.html'}"])
    return 0


def _laws_alone(work: _Work, facts: dict[str, Any], json: str | None) -> int:
    """The end of what too few frames, or such as show nothing, can give: the laws of range, noise and loss."""
    from lidarcheck.effects.finding import catalogue

    count = len(facts["frames"])
    lines = [f"0 of {len(catalogue())} effects can be shown by these data", *work.said]
    if count < _FEWEST:
        lines.insert(1, f"{count} frames give laws of range, noise and loss, not a verdict: record three or more")
    words = write_laws(facts, work.out / "report.html", lines)
    document = {"first": lines, "verdict": None, "commands": work.run.commands, "seconds": work.run.seconds}
    page = work.out / "report.html"
    _tell(json, {**document, "page": str(page), "laws": facts["laws"]["fitted"]}, [*lines, *words, f"page: {page}"])
    return 0


def _tell(json: str | None, document: dict[str, Any], lines: Sequence[str]) -> None:
    if json is not None:
        write_result(json, json_text(with_origin(document)))
    if json != "-":
        emit("\n".join(lines))


@dataclass
class _Work:
    """The steps in their order. `said`: what was supposed on the way, which stands on the page."""

    run: Steps
    out: Path
    recording: Sequence[Path]
    seed: int
    jobs: int | None
    period_s: float | None = None

    def __post_init__(self) -> None:
        self.said: list[str] = []

    def choose_frames(self, most: int) -> list[Path]:
        """The longest run of frames that stand still, as files."""
        frames, facts = self.out / "frames", self.out / "steps" / "frames.json"
        argv = ["still", *self.recording, "--out", frames, "--most", most, "--json", facts]
        self.run.run("frames", argv, [frames, facts])
        found = _read(facts)
        self.period_s = found["period_s"]
        places = [Path(one["file"]) for one in found["frames"]]
        self._as_data_set(places)
        return places

    def _as_data_set(self, frames: Sequence[Path]) -> None:
        """Make the directory a project, whose models may name files in all of it, by the data set of its frames."""
        period = self.period_s or 1.0 / _USUAL_RATE_HZ
        entries = [
            {"measured": frame.relative_to(self.out).as_posix(), "time": round(number * period, 9)}
            for number, frame in enumerate(frames)
        ]
        write_text(self.out / "dataset.toml", tomli_w.dumps({"frames": entries}))

    def find_sensor(self, given: str | None, frames: Sequence[Path]) -> str:
        """The sensor that is named, else the one of those that come with lidarcheck that the frames fit, else a guess
        from them."""
        guess = self.out / "sensor.toml"
        name = given or self._known(frames[0])
        if name is None:
            rate = _USUAL_RATE_HZ if self.period_s is None else 1.0 / self.period_s
            argv = ["sensor", "guess", self.out / "frames", "--rate", f"{rate:.6g}", "--features", "--out", guess]
            self.run.run("sensor", argv, [guess])
            self.said.append(f"no known sensor fits: its beams were guessed from the frames ({guess})")
            if self.period_s is None:
                self.said.append(f"{rate:g} frames a second are supposed: the frames have no times")
            self.said += _supposed(guess)
            return str(guess)
        if given is not None and (file := sensor_file(given)) is not None and not Path(file).is_file():
            raise UsageError(
                f"--sensor {given} is no file", fix="name a sensor file, or one of `lidarcheck sensor list`"
            )
        argv = ["sensor", "check", frames[0], "--sensor", name]
        said = self.run.run("sensor", argv, [], codes=(0, 1)).splitlines()[0]
        if said.startswith("does not fit") or "another sensor's" in said:
            fix = "name the sensor that measured with --sensor, or leave it out: its beams are then guessed"
            raise InputError(f"{name} {said}", file=frames[0], fix=fix)
        self.said.append(f"sensor {name}: {said}")
        return name

    def _known(self, frame: Path) -> str | None:
        from lidarcheck.formats.guess.known import known_sensors
        from lidarcheck.formats.recognise import read_table

        with stage("comparing with known sensors"):
            found = [name for name, _ in known_sensors(read_table(frame))]
        if len(found) > 1:
            what = f"the frames fit {' and '.join(found)}"
            raise InputError(what, file=frame, fix=f"say which with --sensor {found[0]}")
        return found[0] if found else None

    def estimate(self, sensor: str) -> dict[str, Any]:
        """Ideal scans and laws from the repeats."""
        repeats = self.out / "repeats"
        argv = ["ideal", "from-repeats", self.out / "frames", "--sensor", sensor, "--out", repeats]
        self.run.run("repeats", argv, [repeats])
        return _read(repeats / "repeats.json")

    def make_and_check(self, facts: dict[str, Any]) -> dict[str, Any]:
        """The case, and what its data can show."""
        case, shown = self.out / "case", self.out / "steps" / "check.json"
        frames = facts["frames"]
        parts = [sum(frame["part"] == part for frame in frames) for part in ("fit", "select", "verify")]
        argv = ["case", "make", "--measured", self.out / "frames", "--ideal", self.out / "repeats" / "ideals"]
        argv += ["--model", self.out / "repeats" / "model.toml", "--ideals-from", "repeats"]
        argv += ["--repeats", min(frame["repeats"] for frame in frames), "--parts", ",".join(map(str, parts))]
        argv += ["--laws-from", "repeats"] if facts["laws"]["fitted"] else []
        argv += [] if self.period_s is None else ["--period", f"{self.period_s:.6g}"]
        self.run.run("case", [*argv, "--out", case], [case])
        check = ["case", "check", case, "--seed", self.seed, "--json", shown, *self._jobs()]
        self.run.run("check", check, [shown], codes=(0, 1))
        return _read(shown)

    def explain(self) -> None:
        """The gap workflow; it goes on by itself where it was interrupted."""
        found = self.out / "found"
        argv = ["explain", self.out / "case", "--out", found, "--seed", self.seed, "--no-html", *self._jobs()]
        self.run.run("explain", argv, [found / "report.json"])

    def _jobs(self) -> list[str]:
        return [] if self.jobs is None else ["--jobs", str(self.jobs)]


def _read(file: Path) -> dict[str, Any]:
    found: dict[str, Any] = json_module.loads(file.read_text(encoding="utf-8"))
    return found


def _supposed(sensor: Path) -> list[str]:
    """What a guessed sensor file says of suppositions: among its sources, and in its head."""
    from lidarcheck.model.files.sensor_file import load_sensor

    head = [line.lstrip("# ") for line in sensor.read_text(encoding="utf-8").splitlines() if line.startswith("#   ")]
    return [line for line in (*head, *load_sensor(sensor).source) if "supposed to" in line]
