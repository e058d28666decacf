"""`lidarcheck simulate`: one ideal scan through the sensor model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from lidarcheck.cli.options import Quiet, Seed
from lidarcheck.cli.outputs import check_writable
from lidarcheck.cli.terminal import hush, note, progress, stage

if TYPE_CHECKING:
    from lidarcheck.harness.scene_file import SceneFile
    from lidarcheck.model import Model

__all__ = ["simulate"]


def simulate(
    ideal: Annotated[Path, Parameter(help="What each fired beam meets, in any format that `info` knows.")],
    /,
    *,
    model: Annotated[Path, Parameter(help="The sensor model, TOML.")],
    out: Annotated[Path, Parameter(help="Where the echoes go: .txt, .csv, .pcd, .las, .laz, .ply or .parquet.")],
    scene: Annotated[
        str | None,
        Parameter(
            help="What the ideal scan was cast from, for effects that aim beams elsewhere: as `scene` takes it. "
            "Materials are those of the model, not of the scene."
        ),
    ] = None,
    seed: Seed = 0,
    fidelity: Annotated[
        Literal["fast", "exact", "reference"],
        Parameter(help="Echoes from a library, by the exact chain, or detector by detector, which is slow."),
    ] = "exact",
    quiet: Quiet = False,
) -> int:
    """Run one ideal scan through the sensor model."""
    hush(quiet)
    from lidarcheck.cli.scene import find_scene
    from lidarcheck.formats import load_ideal, save_scan
    from lidarcheck.formats.recognise import target_format
    from lidarcheck.model import load_model
    from lidarcheck.model import simulate as run

    target_format(out)
    check_writable(out, option="--out", besides=(ideal, model))
    sensor_model = load_model(model)
    scene_file = None if scene is None else find_scene(scene)
    check_writable(out, option="--out", besides=_read(sensor_model, scene_file))
    with stage(f"reading {ideal.name}"):
        beams_meet = load_ideal(ideal)
    with progress("simulating") as show:
        scan = run(
            beams_meet,
            sensor_model,
            seed=seed,
            fidelity=fidelity,
            scene=None if scene_file is None else scene_file.scene,
            progress=lambda done, beams: show(done, beams, f"{beams} beams"),
        )
    with stage(f"writing {out.name}"):
        save_scan(scan, out)
    note(f"{out}: {len(scan)} echoes from {len(beams_meet)} rows of {ideal}, seed {seed}")
    return 0


def _read(model: Model, scene: SceneFile | None) -> list[Path]:
    """The files that the model and the scene name."""
    from lidarcheck.harness.provenance import external_files

    files = [Path(curve.file) for effect in model.effects for curve in effect.curves()]
    files += external_files(model.external) if model.external else []
    return files + list(scene.files if scene else ())
