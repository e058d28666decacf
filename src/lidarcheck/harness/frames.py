"""Many frames through the model, a file each: read, simulated, written and forgotten, whoever works.

A directory of frames belongs to one model, seed and scene, and says so in `frames.json`. Frames that are there already
are kept: a file takes its place only when it is whole.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from lidarcheck.cases.source import FrameFile, Named, ideal_of
from lidarcheck.errors import InputError, LidarcheckError, UsageError
from lidarcheck.formats import load_ideal, save_scan
from lidarcheck.formats.atomic import write_bytes, write_text
from lidarcheck.formats.recognise import target_format
from lidarcheck.harness.goldens.provenance import parameters_hash, source_hash
from lidarcheck.model import simulate
from lidarcheck.model.fidelity import Device, Fidelity, check_device, check_fidelity
from lidarcheck.model.spec import Model
from lidarcheck.rays import Caster
from lidarcheck.scan import IdealScan
from lidarcheck.scenes.files.file import SceneFile
from lidarcheck.sensor import Sensor
from lidarcheck.workers import Shared, WorkerPool, one_blas_thread

__all__ = ["NOTES", "FrameBatch", "FramesWritten"]

NOTES = "frames.json"
ProgressCallback = Callable[[int, int, str], object]


class FramesWritten(NamedTuple):
    """What a run has done: frames simulated, frames that were there, echoes of those simulated."""

    simulated: int
    kept: int
    echoes: int


class _Source(NamedTuple):
    """An ideal scan on its way to a worker, which may have no file system in common with us."""

    file: str
    content: bytes


class _Task(NamedTuple):
    ideal: Named
    frame: int
    place: Path


def _identity(path: Path) -> object:
    """What is the same for all names of a file."""
    try:
        found = path.stat()
    except OSError:
        return os.path.realpath(path)
    return found.st_dev, found.st_ino


@dataclass(frozen=True)
class FrameBatch:
    """`count` frames of each of some ideal scans, or each as it is where None, into the directory `out`.

    `suffix`: of the files, which says their format. `scene`: what the ideal scans were cast from, if known.
    """

    ideals: Sequence[Named]
    model: Model
    out: Path
    count: int | None = None
    suffix: str = ".parquet"
    seed: int = 0
    scene: SceneFile | None = None
    fidelity: Fidelity = "exact"
    device: Device = "cpu"

    def check(self, *, here: bool = True) -> None:
        """`UsageError` or `InputError` for what can be known before the work; `here`: whether this machine does it."""
        target_format(self.out / f"frame{self.suffix}")
        check_fidelity(self.fidelity, self.model)
        check_device(self.device, self.fidelity, self.model, here=here)
        external = self.model.external
        if external is not None and not external.draws_anew and (self.count or 1) > 1:
            fix = "leave out --frames, or give an ideal scan for each frame"
            raise UsageError("an external model does not know frames: all would be the same", fix=fix)
        seen: dict[str, Named] = {}
        for ideal in self.ideals:
            other = seen.setdefault(ideal.stem, ideal)
            if other is not ideal:
                what = f"{other} and {ideal} would be written to the same files"
                raise UsageError(what, fix="name each once, and give them different names")
        read = {_identity(Path(os.fspath(ideal))): ideal for ideal in self.ideals}
        for task in self._tasks():
            if found := read.get(_identity(task.place)):
                raise UsageError(f"{found} would be replaced by its frame", fix="name another directory for --out")
        if self.out.exists() and not self.out.is_dir():
            raise InputError("is not a directory", file=self.out, fix="name a directory for the frames")

    def run(self, pool: WorkerPool, progress: ProgressCallback = lambda _done, _of, _what: None) -> FramesWritten:
        """Simulate and write what is not there yet; `progress` gets frames done, of how many, and the last one's name.

        The same bytes for every worker pool. On an error or interrupt the frames that were written stay.
        """
        tasks = [*self._tasks()]
        with self._directory(), one_blas_thread():
            left = [task for task in tasks if not task.place.exists()]
            kept, echoes = len(tasks) - len(left), 0
            progress(kept, len(tasks), "")
            for done, (content, count) in enumerate(pool.map(_simulated, self._packed(left)), start=1):
                place = left[done - 1].place
                write_bytes(place, content)
                echoes += count
                progress(kept + done, len(tasks), place.name)
        return FramesWritten(len(left), kept, echoes)

    def _tasks(self) -> Iterator[_Task]:
        for ideal in self.ideals:
            for frame in range(self.count or 1):
                name = ideal.stem if self.count is None else f"{ideal.stem}_{frame:06d}"
                yield _Task(ideal, frame, self.out / f"{name}{self.suffix}")

    def _packed(self, left: Sequence[_Task]) -> Iterator[tuple[Any, ...]]:
        """The tasks with what they need; an ideal scan that there are many frames of goes to each worker once."""
        setup = Shared((self.model, None if self.scene is None else self.scene.scene))
        only = Shared(ideal_of(self.ideals[0], self.model.sensor)) if len(self.ideals) == 1 and left else None
        for task in left:
            yield (
                setup,
                only or _source(task.ideal, self.model.sensor),
                self.seed,
                task.frame,
                self.suffix,
                self.fidelity,
                self.device,
            )

    @contextlib.contextmanager
    def _directory(self) -> Iterator[None]:
        """The directory with its notes; gone again where it is new and nothing was written."""
        new = not self.out.exists()
        notes = self._notes()
        try:
            self.out.mkdir(exist_ok=True)
            there = (self.out / NOTES).is_file()
            write_text(self.out / NOTES, json.dumps(notes, indent=1, ensure_ascii=False) + "\n")
        except OSError as error:
            what = f"cannot be written: {error.strerror or error}"
            raise InputError(what, file=self.out, fix="choose another place") from error
        try:
            yield
        finally:
            if not there and not any(task.place.exists() for task in self._tasks()):
                (self.out / NOTES).unlink(missing_ok=True)
                if new:
                    with contextlib.suppress(OSError):
                        self.out.rmdir()

    def _notes(self) -> Mapping[str, Any]:
        """What the frames of the directory are of; `InputError` where those that are there are of something else."""
        mine: dict[str, Any] = {
            "model": parameters_hash(self.model),
            "seed": self.seed,
            "fidelity": self.fidelity,
            "scene": _hash_of(self.scene.files) if self.scene else None,
            "source": source_hash(),
        }
        if self.device != "cpu":
            mine = {"device": self.device, **mine}
        ideals = {one.stem: _hash_of_ideal(one) for one in self.ideals}
        found = self._found()
        if found is None:
            return {**mine, "ideals": ideals}
        words = {"source": "version of lidarcheck"}
        others = [
            f"another {words.get(key, key)}"
            for key in dict.fromkeys([*mine, "device"])
            if found.get(key) != mine.get(key)
        ]
        before = found.get("ideals", {})
        others += [f"another {stem}" for stem in ideals if before.get(stem, ideals[stem]) != ideals[stem]]
        if others:
            what = f"holds frames of {', '.join(others)}"
            raise InputError(what, file=self.out, fix="remove it, or name another directory")
        return {**mine, "ideals": {**before, **ideals}}

    def _found(self) -> dict[str, Any] | None:
        path = self.out / NOTES
        try:
            found = json.loads(path.read_bytes()) if path.is_file() else None
        except (OSError, ValueError):
            found = {}
        if found is not None and not (isinstance(found, dict) and isinstance(found.get("ideals"), dict)):
            what = "cannot be read, so that nobody knows of what the frames are"
            raise InputError(what, file=path, fix="remove it with the frames, or name another directory")
        there = [task.place for task in self._tasks() if task.place.exists()] if found is None else []
        if there:
            fix = "move it away, or name another directory"
            raise InputError(f"is there already, without a {NOTES} that says of what it is", file=there[0], fix=fix)
        return found


def _hash_of(files: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for path in files:
        try:
            with path.open("rb") as stream:
                digest.update(hashlib.file_digest(stream, "sha256").digest())
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}", file=path, fix="check the path") from error
    return digest.hexdigest()


def _hash_of_ideal(ideal: Named) -> str:
    """Of the file; of a frame in a file of several also which it is."""
    file = _hash_of([Path(ideal)])
    return f"{file} {ideal.label}" if isinstance(ideal, FrameFile) and len(ideal.frames) > 1 else file


def _source(ideal: Named, sensor: Sensor) -> _Source | IdealScan:
    """An ideal scan to send: a file as it is, of a file of several the frame."""
    if isinstance(ideal, FrameFile) and len(ideal.frames) > 1:
        return ideal_of(ideal, sensor)
    path = Path(ideal)
    try:
        return _Source(str(path), path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path, fix="check the path") from error


def _simulated(
    setup: tuple[Model, Caster | None],
    ideal: IdealScan | _Source,
    seed: int,
    frame: int,
    suffix: str,
    fidelity: Fidelity,
    device: Device,
) -> tuple[bytes, int]:
    """A frame's file, and how many echoes are in it."""
    model, scene = setup
    with tempfile.TemporaryDirectory(prefix="lidarcheck-frame-", ignore_cleanup_errors=True) as name:
        beams = _read(ideal, Path(name), model.sensor) if isinstance(ideal, _Source) else ideal
        scan = simulate(beams, model, seed=seed, frame=frame, threads=1, scene=scene, fidelity=fidelity, device=device)
        file = Path(name) / f"frame{suffix}"
        save_scan(scan, file, model.sensor)
        return file.read_bytes(), len(scan)


def _read(source: _Source, directory: Path, sensor: Sensor) -> IdealScan:
    """An ideal scan as it came; errors name the file that it came from."""
    file = directory / f"ideal{Path(source.file).suffix}"
    file.write_bytes(source.content)
    try:
        return replace(load_ideal(file, sensor), file=source.file)
    except LidarcheckError as error:
        error.file = source.file
        raise
