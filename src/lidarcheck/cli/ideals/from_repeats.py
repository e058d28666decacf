"""`lidarcheck ideal from-repeats`: what each ray meets, from repeats of a scene at rest, and the sensor's laws."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from lidarcheck.cli.core.options import (
    MANY,
    JsonFile,
    MaxRows,
    Permitted,
    Placed,
    Quiet,
    SensorName,
    placement_of,
    sensor_file,
    sensor_named,
)
from lidarcheck.cli.core.outputs import check_twice, check_writable, json_text, with_origin, write_result
from lidarcheck.cli.core.terminal import columns, emit, hush, note, progress, stage, table
from lidarcheck.cli.core.workflow_output import check_out_dir
from lidarcheck.cli.ideals.options import check_ideal_file
from lidarcheck.errors import InputError, UsageError
from lidarcheck.figures.files.sets import Folder, write_set
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.ideals.repeats.workflow import Repeats
    from lidarcheck.model.spec import Model
    from lidarcheck.sensor import Sensor

__all__ = ["from_repeats"]

MODEL, SUMMARY, IDEALS = "model.toml", "repeats.json", "ideals"
_MOST_NAMED = 4
"""Paths that the next command names one by one."""
_FRAMES = columns(
    "frame", "part", "repeats", "rays", "known", "edges", "unknown", "occluded",
    right=("repeats", "rays", "known", "edges", "unknown", "occluded"),
)  # fmt: skip
_LAWS = columns("number", "value", "low", "high", right=("value", "low", "high"))


def from_repeats(
    frames: Annotated[
        list[Path], Parameter(negative=(), help=f"Scans of a scene at rest, a frame each, in order of time{MANY}.")
    ],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            help="A directory: an ideal scan for each frame, by the others, with model.toml and repeats.json. A file "
            "(.txt, .csv, .pcd, .ply or .parquet): one ideal scan, by all frames."
        ),
    ],
    sensor: SensorName = None,
    model: Annotated[
        Path | None, Parameter(help="A model in the place of --sensor: its sensor with its numbers, and its materials.")
    ] = None,
    placed: Placed | None = None,
    json: JsonFile | None = None,
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Make ideal scans from repeats of a scene at rest."""
    hush(quiet)
    limit_rows(max_rows)
    from lidarcheck.cases.source import each_frame
    from lidarcheck.ideals.repeats.files import facts_of, material_of
    from lidarcheck.ideals.repeats.workflow import repeats_of

    own, known, stated = _sensor(sensor, model)
    single = bool(out.suffix) and not out.is_dir()
    if single:
        check_ideal_file(out)
    given = [frame for group in each_frame(frames) for frame in group]
    check_twice(given)
    read = [*(frame.path for frame in given), *(Path(p) for p in (model, sensor_file(sensor)) if p is not None)]
    _check_outputs(out, single, json, read)
    scans = _read(given, known, placed)
    number, materials = material_of(own)
    with progress("estimating") as show:
        found = repeats_of(
            [str(frame) for frame in given], scans, known, stated, material=number, whole=single, tell=show
        )
    ideals = [str(out)] if single else _names(given)
    facts = facts_of(found, [str(frame) for frame in given], ideals)
    with stage(f"writing {out.name}"):
        if single:
            _write_one(found, out)
        else:
            _write_all(found, own, materials, out, ideals, facts)
    if json is not None:
        write_result(json, json_text(with_origin(facts)))
    if json != "-":
        emit(_text(facts))
    _tell(found, frames, out, single)
    if own is not None and own.effects:
        named = ", ".join(effect.name for effect in own.effects)
        note(f"{model}: {named}: not taken out of the ideal scans; what is constant in time would count twice")
    return 0


def _sensor(name: str | None, model: Path | None) -> tuple[Model | None, Sensor, frozenset[str]]:
    """The model, the sensor, and its numbers that are known: those of its file, and of the model's `[sensor]`."""
    from lidarcheck.model import load_model
    from lidarcheck.sensor.document import own, stated_numbers

    loaded = None if model is None else load_model(model)
    if loaded is not None and loaded.external is not None:
        what = "an external model's laws are its own"
        raise InputError(what, file=model, fix="give --sensor: what its program sees does not enter the estimate")
    known = sensor_named(name, loaded)
    if known is None:
        raise UsageError("lidarcheck ideal from-repeats needs --sensor or --model", fix="say what measured")
    plain = own(known)
    changed = {n for n in known.numbers() if getattr(known, n) != getattr(plain, n)} if loaded is not None else set()
    return loaded, known, stated_numbers(plain) | frozenset(changed)


def _check_outputs(out: Path, single: bool, json: str | None, read: Sequence[Path]) -> None:
    if single:
        check_writable(out, option="--out", besides=read)
    else:
        check_out_dir(out, read, files=(MODEL, SUMMARY))
        inside = next((file for file in read if file.absolute().parent == (out / IDEALS).absolute()), None)
        if inside is not None:
            raise InputError(
                "is one of the frames, and lies where ideal scans go", file=inside, fix="name another --out"
            )
    if json is not None:
        check_writable(json, option="--json", besides=[*read, *([out] if single else [out / MODEL, out / SUMMARY])])


def _read(given: Sequence[FrameFile], sensor: Sensor, placed: Placed | None) -> list[Any]:
    from lidarcheck.cases.source import scan_of

    placement = placement_of(placed)
    scans = []
    with progress("reading") as show:
        for number, frame in enumerate(given):
            scans.append(scan_of(frame, placement, sensor))
            show(number + 1, len(given), frame.name)
    return scans


def _names(given: Sequence[FrameFile]) -> list[str]:
    """Where the ideal scan of each frame goes, below --out: named as the frame; two of one name get their numbers."""
    stems = [frame.stem for frame in given]
    if len(set(stems)) < len(stems):
        stems = [f"{stem}_{number:06d}" for number, stem in enumerate(stems)]
    return [f"{IDEALS}/{stem}.parquet" for stem in stems]


def _write_one(found: Repeats, out: Path) -> None:
    from lidarcheck.formats import save_ideal

    assert found.whole is not None
    save_ideal(found.whole.ideal, out)


def _write_all(
    found: Repeats, model: Model | None, materials: Any, out: Path, ideals: Sequence[str], facts: dict[str, Any]
) -> None:
    """The ideal scans, the model with what it names, and the summary: all or none."""
    from lidarcheck.formats import save_ideal
    from lidarcheck.ideals.repeats.files import model_text, named_tables

    text = model_text(model, found.laws, materials, out / MODEL)
    files: dict[str, Callable[[Path], object]] = {
        MODEL: lambda path: path.write_text(text, encoding="utf-8"),
        SUMMARY: lambda path: path.write_text(json_text(with_origin(facts)), encoding="utf-8"),
    }
    sensor = found.laws.sensor
    if sensor.file:
        own = Path(sensor.file)
        names = [own.name, *named_tables(sensor)]
        outside = next((name for name in names[1:] if Path(name).is_absolute() or ".." in Path(name).parts), None)
        if outside is not None:
            raise InputError(
                f"names {outside}, which cannot lie in {out} too", file=own, fix="put it beside the sensor"
            )
        for name in names:
            if (own.parent / name).resolve() != (out / name).resolve():
                files[name] = partial(_copy, own.parent / name)

    def fill(folder: Path) -> None:
        for one, name in zip(found.ideals, ideals, strict=True):
            save_ideal(one.ideal, folder / Path(name).name)

    folders = {IDEALS: Folder(fill, re.compile(r".*\.parquet"))} if found.ideals else {}
    write_set(out, files, folders)


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def _text(facts: dict[str, Any]) -> str:
    """The frames and what became of their rays, then the laws."""
    rows = [frame for frame in facts["frames"] if "rays" in frame]
    if "ideal" in facts:
        rows = [{**facts["ideal"], "measured": "all", "part": "-"}]
    parts = []
    if rows:
        names = ("repeats", "rays", "known", "edges", "unknown", "occluded")
        cells = [[Path(row["measured"]).name, row["part"], *(str(row[name]) for name in names)] for row in rows]
        parts.append(table(_FRAMES, cells))
    laws = facts["laws"]
    if laws["fitted"]:
        cells = [
            [name, *(f"{one[key]:.4g}" for key in ("value", "low", "high"))] for name, one in laws["fitted"].items()
        ]
        parts.append(table(_LAWS, cells))
    lines = [f"range_law is {laws['words']['range_law']}"] if laws["words"] else []
    lines += [f"note: {text}" for text in laws["notes"]]
    lines.append(f"{100.0 * facts['moved_share']:.1f} % of the rays show no range that comes again")
    return "\n\n".join([*parts, "\n".join(lines)])


def _tell(found: Repeats, given: Sequence[Path], out: Path, single: bool) -> None:
    if found.outside:
        note(f"{found.outside} echoes lie on no beam of the sensor and are left out")
    if single:
        note(f"{out}: one ideal scan by all frames; a frame judged by it judges itself in part")
        return
    if not found.ideals:
        note(
            f"{out}: {len(found.parts.names)} frames give laws (range, noise, loss), not a verdict: "
            "record three or more"
        )
        return
    counts = [str(found.parts.names.count(part)) for part in ("fit", "select", "verify")]
    repeats = min(one.counts.repeats for one in found.ideals)
    fitted = " --laws-from repeats" if found.laws.fitted else ""
    note(f"{out}: {len(found.ideals)} ideal scans, each by {repeats} repeats or more, and {MODEL}; next:")
    measured = " ".join(shlex.quote(str(path)) for path in given) if len(given) <= _MOST_NAMED else "FRAMES"
    note(
        f"lidarcheck case make --measured {measured} --ideal {out / IDEALS} --model {out / MODEL} "
        f"--ideals-from repeats --repeats {repeats} --parts {','.join(counts)}{fitted} --out CASE"
    )
