"""What a number is asked of: a measurement, the model and its tables, and how much is simulated."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lidarcheck.calibration.number.number import Kind
from lidarcheck.errors import UsageError
from lidarcheck.formats.geometry import AS_IT_IS, Placement
from lidarcheck.formats.lut import Axis

__all__ = ["SAMPLE_SEEDS", "WHOLE_SEEDS", "Request"]

SAMPLE_SEEDS, WHOLE_SEEDS = 8, 64
"""Simulations of a sample after each edit, and of whole frames where the number goes into a report."""


@dataclass(frozen=True)
class Request:
    """One number of one measurement. It can be sent to another process, which reads the files.

    `model`, `lut`, `settings`: files; the table of `lut` stands in the place of the model's own along `axis`, and
    `settings` say where the target stands where no ideal scan does. `measured`: scans of one scene, or one profile;
    `ideal`: one for each scan, or one for all, empty where there is none; `case`: the directory of a case in the place
    of both, its frames that verify. `distance_m`, `material`: the target's, None for the only one. `start`: the
    contents, by path, of files that are edited, as the session found them: a gap counts in the spreads of the model
    that these make; `scale`: the model in whose spreads it counts, where that is another file.
    """

    kind: Kind
    model: Path
    measured: tuple[Path, ...] = ()
    ideal: tuple[Path, ...] = ()
    axis: Axis = "vertical"
    lut: Path | None = None
    settings: Path | None = None
    distance_m: float | None = None
    material: int | None = None
    case: Path | None = None
    seeds: int = SAMPLE_SEEDS
    seed: int = 0
    placement: Placement = AS_IT_IS
    start: Mapping[str, bytes] = field(default_factory=dict)
    scale: Path | None = None

    def command(self, *, whole: bool = False) -> str:
        """What a user types for the same number of the files as they are saved."""
        words = [
            "lidarcheck",
            "gap",
            *map(str, (self.case,) if self.case else self.measured),
            "--model",
            str(self.model),
        ]
        words += ["--ideal", *map(str, self.ideal)] if self.ideal else []
        words += ["--lut", str(self.lut), "--axis", self.axis] if self.lut else []
        words += ["--target", str(self.material)] if self.material is not None else []
        words += ["--seed", str(self.seed)] if self.seed else []
        return shlex.join([*words, *(["--whole"] if whole else [])])

    def __post_init__(self) -> None:
        if self.seeds < 2:
            raise UsageError(f"{self.seeds} seeds tell nothing of chance", fix="use 2 or more")

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that it names; tables that the model names, and frames that the case names, come on top."""
        from lidarcheck.cases.case import CASE_FILE

        case = None if self.case is None else self.case / CASE_FILE
        named = (self.model, self.scale, self.lut, self.settings, case, *self.measured, *self.ideal)
        return tuple(path for path in named if path is not None)
