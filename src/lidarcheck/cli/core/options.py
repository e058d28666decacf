"""What several commands take: their types, ranges and help."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from lidarcheck.errors import UsageError
from lidarcheck.formats.limits import MAX_ROWS, MOST_ROWS
from lidarcheck.permissions import Permissions

if TYPE_CHECKING:
    from lidarcheck.formats.field.choice import Choice
    from lidarcheck.formats.geometry import Placement
    from lidarcheck.model import Model
    from lidarcheck.sensor import Sensor

__all__ = [
    "MANY",
    "MAX_SEED",
    "Files",
    "Flag",
    "Jobs",
    "JsonFile",
    "JsonFlag",
    "MaxRows",
    "Permitted",
    "Placed",
    "Quiet",
    "Rooted",
    "Seed",
    "SensorName",
    "Several",
    "TimeUnit",
    "Whole",
    "placement_of",
    "sensor_file",
    "sensor_named",
    "up_to",
]

MAX_SEED = 2**64 - 1
MAX_JOBS = 1024


def _seed(_type: Any, tokens: Sequence[Any]) -> int:
    seed = _whole(tokens[0].value)
    if seed is None or seed > MAX_SEED:
        what = f"--seed {tokens[0].value} is not a seed"
        raise UsageError(what, fix=f"use a whole number from 0 to {MAX_SEED} (2^64 - 1)")
    return seed


def up_to(most: int) -> Callable[[Any, Sequence[Any]], int]:
    """A converter for whole numbers from 1 to `most`; `UsageError` for all else."""

    def converted(_type: Any, tokens: Sequence[Any]) -> int:
        option, text = tokens[0].keyword, tokens[0].value
        number = _whole(text)
        if number is None or not 1 <= number <= most:
            raise UsageError(f"{option} {text} is out of range", fix=f"use a whole number from 1 to {most}")
        return number

    return converted


def _whole(text: str) -> int | None:
    """The number that decimal digits spell; None for other text, and for more digits than any option takes."""
    digits = text.lstrip("0") or text[-1:]
    return int(digits) if digits.isascii() and digits.isdecimal() and len(digits) <= 20 else None


def _whole_number(_type: Any, tokens: Sequence[Any]) -> int:
    option, text = tokens[0].keyword, tokens[0].value
    if not re.fullmatch(r"[+-]?[0-9]{1,18}", text):
        raise UsageError(f"{option} {text} is no whole number", fix="write digits alone, as 5")
    return int(text)


MANY = ", or many frames: a folder, a file of several, a bag (FILE#TOPIC), a data set, a pattern in quotes"
"""What help says of an argument in whose place many frames may be given."""
Flag = Parameter(negative=(), show_default=False)
"""An option that is given or not, without a --no- of its own."""
Several = Parameter(consume_multiple=True, negative=())
"""An option with any number of values behind it."""
Many = Parameter(consume_multiple=True, negative=(), show_default=False)
"""The same, of which help shows no default."""
TimeUnit = Annotated[
    Literal["s", "ms", "us", "ns"], Parameter(help="The unit of the scan's time column, where it does not tell.")
]
Files = Annotated[list[Path], Several]
Whole = Parameter(converter=_whole_number)
"""A whole number: the parser alone would round 1.5 to 2 and say nothing."""
Target = Annotated[
    int | None, Whole, Parameter(help="The target's material in the model, where there are several retro-reflectors.")
]
Seed = Annotated[
    int, Parameter(converter=_seed, help="Seed of the random numbers, 0 to 2^64 - 1: the same seed, the same bytes.")
]
Jobs = Annotated[int, Parameter(converter=up_to(MAX_JOBS), help="Cores to use, 1 to 1024; all of them by default.")]
MaxRows = Annotated[
    int,
    Parameter(
        name="--max-rows",
        converter=up_to(MOST_ROWS),
        help=f"Rows that a file of points may have; {MAX_ROWS} by default.",
    ),
]
Quiet = Annotated[
    bool, Flag, Parameter(name=("--quiet", "-q"), help="Results and errors only, no progress or warnings.")
]
SensorName = Annotated[
    str | None,
    Parameter(
        name="--sensor", help="What measured: a sensor's name or file; by default the model's, else a built-in one."
    ),
]
JsonFile = Annotated[str, Parameter(help="Also write the result as JSON to this file; `-` is standard output.")]
JsonFlag = Annotated[bool, Flag, Parameter(help="Print JSON instead of text.")]


@Parameter(name="*")
@dataclass(frozen=True)
class Placed:
    """What a command declares of the measured scans that it reads."""

    mirror: Annotated[
        Literal["x", "y", "z"] | None, Parameter(help="This axis of the measured scans is negated in the files.")
    ] = None
    unit: Annotated[
        Literal["m", "mm", "cm", "ft", "in", "hm", "km"] | None,
        Parameter(help="The unit of X, Y, Z in the measured scans; m by default."),
    ] = None
    pose: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True,
            help='"x,y,z,roll,pitch,yaw" [m, deg]: takes the measured scans (mirrored) into the sensor\'s frame.',
        ),
    ] = None
    topic: Annotated[
        str | None, Parameter(help="The topic of a bag with several; as FILE#TOPIC of one bag among others.")
    ] = None
    sensor_frame: Annotated[
        str | None,
        Parameter(help="The sensor's frame in a bag's static transforms, where its clouds are in another."),
    ] = None

    def choice(self) -> Choice:
        """What is chosen in recordings; the parser sees to it."""
        from lidarcheck.formats.field.choice import Choice

        return Choice(self.topic or "", self.sensor_frame or "")


@Parameter(name="*")
@dataclass(frozen=True)
class Rooted:
    """What the user permits the files that a command reads; the parser grants it, the command need not look at it."""

    root: Annotated[
        list[Path] | None,
        Parameter(negative=(), help="A folder outside of the project whose files may be named; given again, another."),
    ] = None

    def permissions(self) -> Permissions:
        """The same, for this process; `UsageError` where a root is no folder."""
        for root in self.root or ():
            if not root.is_dir():
                raise UsageError(f"--root {root} is no folder", fix="name one that is there")
        return Permissions(getattr(self, "trust", False), tuple(root.absolute() for root in self.root or ()))


@Parameter(name="*")
@dataclass(frozen=True)
class Permitted(Rooted):
    """The same of a command that may run a model."""

    trust: Annotated[
        bool,
        Flag,
        Parameter(
            help="Run the program of an [external] model, whatever it is. Programs can be trusted one by one: "
            "LIDARCHECK_TRUST holds their hashes, or all, which runs whatever a pull request brings."
        ),
    ] = False


def placement_of(placed: Placed | None) -> Placement:
    """What the options say, `UsageError` where a pose is none."""
    from lidarcheck.formats.geometry import Placement, parse_pose

    given = placed or Placed()
    pose = None if given.pose is None else parse_pose(given.pose)
    return Placement(given.unit or "m", given.mirror or "", pose)


def sensor_named(name: str | None, model: Model | None = None) -> Sensor | None:
    """The sensor of `--sensor`, else the model's; None where nobody names one. A model's own stands alone."""
    if model is not None:
        if name is not None:
            raise UsageError("--sensor stands beside --model, whose variant is a sensor", fix="give one of them")
        return model.sensor
    if name is None:
        return None
    from lidarcheck.model.files.sensor_file import load_sensor

    return load_sensor(name)


def sensor_file(name: str | None) -> str | None:
    """The file that `--sensor` names, which no output may replace; None for a shipped sensor."""
    if name is None:
        return None
    from lidarcheck.model.files.sensor_file import is_sensor_file

    return name if is_sensor_file(name) else None
