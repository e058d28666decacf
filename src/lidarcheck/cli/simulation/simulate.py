"""`lidarcheck simulate`: ideal scans through the sensor model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from lidarcheck.cli.core.options import MANY, Jobs, MaxRows, Permitted, Quiet, Seed, up_to
from lidarcheck.cli.core.outputs import check_writable
from lidarcheck.cli.core.terminal import hush, note, progress, stage
from lidarcheck.cli.core.workers import Scheduler
from lidarcheck.cli.simulation.simulate_frames import MOST_FRAMES, simulate_frames
from lidarcheck.errors import UsageError
from lidarcheck.formats.limits import limit_rows

if TYPE_CHECKING:
    from lidarcheck.cases.source import FrameFile
    from lidarcheck.model import Model
    from lidarcheck.model.fidelity import Device, Fidelity
    from lidarcheck.scenes.files.file import SceneFile

__all__ = ["simulate"]


def simulate(
    ideal: Annotated[Path, Parameter(help=f"What each fired beam meets, in any format that `info` knows{MANY}.")],
    /,
    *more: Annotated[Path, Parameter(name="MORE", help="Further ideal scans, likewise.")],
    model: Annotated[Path, Parameter(help="The sensor model, TOML.")],
    out: Annotated[
        Path,
        Parameter(
            help="Where the echoes go: .txt, .csv, .pcd, .las, .laz, .ply or .parquet; of many frames, a directory."
        ),
    ],
    scene: Annotated[
        str | None,
        Parameter(
            help="What the ideal scan was cast from, for effects that aim beams elsewhere: as `scene` takes it. "
            "Materials are those of the model, not of the scene."
        ),
    ] = None,
    seed: Seed = 0,
    frames: Annotated[
        int | None,
        Parameter(
            converter=up_to(MOST_FRAMES), help="So many frames of each ideal scan, with other random numbers each."
        ),
    ] = None,
    format: Annotated[
        Literal["parquet", "pcd", "txt", "csv", "las", "laz", "ply"] | None,
        Parameter(help="Of many frames: what each is written as, parquet by default."),
    ] = None,
    jobs: Jobs | None = None,
    scheduler: Scheduler | None = None,
    fidelity: Annotated[
        Literal["fast", "exact", "reference"],
        Parameter(help="Echoes from a library, by the exact chain, or detector by detector, which is slow."),
    ] = "exact",
    device: Annotated[
        Literal["cpu", "cuda"], Parameter(help="What runs the exact chain: the processor, or an NVIDIA GPU.")
    ] = "cpu",
    max_rows: MaxRows | None = None,
    quiet: Quiet = False,
    permitted: Permitted | None = None,
) -> int:
    """Run ideal scans through the sensor model."""
    hush(quiet)
    limit_rows(max_rows)
    from lidarcheck.cli.simulation.scene import find_scene

    with stage("reading"):
        ideals = _ideals((ideal, *more), out)
    if len(ideals) > 1 or frames is not None or ideal.is_dir():
        found = None if scene is None else find_scene(scene)
        return simulate_frames(
            ideals, model, out, scene=found, seed=seed, count=frames, suffix=format or "parquet", jobs=jobs,
            scheduler=scheduler, fidelity=fidelity, device=device,
        )  # fmt: skip
    for option, value in {"--format": format, "--scheduler": scheduler}.items():
        if value is not None:
            raise UsageError(f"{option} is for many frames", fix="add --frames N, or name several ideal scans")
    found = None if scene is None else find_scene(scene)
    return _one(ideals[0], model, out, scene=found, seed=seed, jobs=jobs, fidelity=fidelity, device=device)


def _ideals(given: Sequence[Path], out: Path) -> list[FrameFile]:
    """The ideal scans; refused where one file is to hold the echoes of several that one name stands for."""
    from lidarcheck.cases.source import SUFFIXES, each_frame

    groups = each_frame(given, "ideal")
    several = next((file for file, group in zip(given, groups, strict=True) if len(group) > 1), None)
    if several is not None and out.suffix.lower() in SUFFIXES and not out.is_dir():
        what = f"{several} holds several frames, and --out {out} is one file"
        raise UsageError(what, fix="name a directory for --out, where each is written to a file")
    return [frame for group in groups for frame in group]


def _one(
    ideal: FrameFile,
    model: Path,
    out: Path,
    *,
    scene: SceneFile | None,
    seed: int,
    jobs: int | None,
    fidelity: Fidelity,
    device: Device,
) -> int:
    from lidarcheck.cases.source import ideal_of
    from lidarcheck.effects.shared.ranges import in_front
    from lidarcheck.formats import save_scan
    from lidarcheck.formats.recognise import target_format
    from lidarcheck.model import load_model
    from lidarcheck.model import simulate as run
    from lidarcheck.model.fidelity import check_device
    from lidarcheck.workers import one_blas_thread

    target_format(out)
    check_writable(out, option="--out", besides=(ideal.path, model))
    sensor_model = load_model(model)
    check_device(device, fidelity, sensor_model)
    check_writable(out, option="--out", besides=_read(sensor_model, scene))
    with stage(f"reading {ideal.name}"):
        beams_meet = ideal_of(ideal, sensor_model.sensor)
    with progress("simulating") as show, one_blas_thread():
        scan = run(
            beams_meet,
            sensor_model,
            seed=seed,
            threads=jobs,
            scene=None if scene is None else scene.scene,
            fidelity=fidelity,
            device=device,
            progress=lambda done, beams: show(done, beams, f"{beams} beams"),
        )
    # What avalanches before the shot make is at 0; a file says by that range that a beam had no echo.
    scan = in_front(scan)
    with stage(f"writing {out.name}"):
        save_scan(scan, out, sensor_model.sensor)
    note(f"{out}: {len(scan)} echoes from {len(beams_meet)} rows of {ideal}, seed {seed}")
    return 0


def _read(model: Model, scene: SceneFile | None) -> list[Path]:
    """The files that the model and the scene name."""
    files = [Path(curve.file) for effect in model.effects for curve in effect.curves()]
    if model.external is not None:
        from lidarcheck.harness.goldens.provenance import (
            external_files,  # takes a while, with all that the harness needs
        )

        files += external_files(model.external)
    return files + list(scene.files if scene else ())
