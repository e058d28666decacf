"""The keys of a scenario file, and what each may hold."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from lidarcheck.config.schema import Config, PathText
from lidarcheck.config.words import nearest
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.harness.kpis.spec import Direction
from lidarcheck.harness.scenario.shapes import BeamShape
from lidarcheck.scenes.files.file import SamplingTable
from lidarcheck.scenes.files.spans import Span

__all__ = ["KpiTable", "ScenarioTable"]

ID_MIN, ID_MAX = -(2**31), 2**31 - 1
"""What the MaterialID and ObjectID of an ideal scan may be."""

_EntryT = TypeVar("_EntryT")


def _known_kind(name: str) -> str:
    if name not in KINDS:
        near = nearest(name, KINDS)
        fix = f"did you mean {near}?" if near else f"kinds are {', '.join(KINDS)}"
        raise ValueError(f"there is no such kind of KPI; {fix}")
    return name


def _as_list(value: object) -> object:
    return (value,) if isinstance(value, int) and not isinstance(value, bool) else value


def _ordered(window: tuple[float, float]) -> tuple[float, float]:
    if window[0] > window[1]:
        raise ValueError("the lower end is above the upper; write [low, high]")
    return window


def _not_empty(entries: tuple[_EntryT, ...]) -> tuple[_EntryT, ...]:
    # Not pydantic's min_length, which counts valid entries only and so reports a list of wrong ones as empty.
    if not entries:
        raise ValueError("the list is empty; add an entry")
    return entries


_Kind = Annotated[str, AfterValidator(_known_kind), Field(json_schema_extra={"words": "a kind of KPI"})]
_Name = Annotated[
    str,
    Field(
        pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.\-]*$",
        json_schema_extra={"words": "a name of letters, digits, _, . and -, that begins with a letter, a digit or _"},
    ),
]
_Id = Annotated[int, Field(ge=ID_MIN, le=ID_MAX)]
_Ids = Annotated[tuple[_Id, ...], BeforeValidator(_as_list), AfterValidator(_not_empty)]
_Window = Annotated[tuple[float, float], AfterValidator(_ordered)]


class KpiTable(Config):
    """One `[[kpis]]` table: a kind from `KINDS`, what it looks at, and what is asked of it."""

    kpi: _Kind
    name: _Name | None = None
    object: _Ids | None = None
    material: _Ids | None = None
    range_m: _Window | None = None
    incidence_deg: _Window | None = None
    layers: Span | None = None
    points: Span | None = None
    echo_range_m: _Window | None = None
    window_m: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    number: Annotated[int, Field(ge=0, le=255)] | None = None
    feature: _Name | None = None
    tolerance: Annotated[float, Field(gt=0.0)]
    direction: Direction | None = None
    low: float | None = None
    high: float | None = None
    requirement: Annotated[str, Field(min_length=1)] | None = None
    catches: Annotated[float, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def _catches_beyond_the_tolerance(self) -> KpiTable:
        if self.catches is not None and self.catches <= self.tolerance:
            raise ValueError("catches is not above the tolerance; a change up to the tolerance does not matter")
        return self

    @model_validator(mode="after")
    def _limits_in_order(self) -> KpiTable:
        if self.low is not None and self.high is not None and self.low > self.high:
            raise ValueError(f"low = {self.low:g} is above high = {self.high:g}; exchange them")
        return self

    @model_validator(mode="after")
    def _number_where_asked(self) -> KpiTable:
        if KINDS[self.kpi].of_number and self.number is None:
            raise ValueError(f"{self.kpi} does not say of which echo number; add number = 1")
        if not KINDS[self.kpi].of_number and self.number is not None:
            raise ValueError(f"{self.kpi} is of all echo numbers; remove number, or ask for echo_number_share")
        return self

    @model_validator(mode="after")
    def _feature_where_asked(self) -> KpiTable:
        if KINDS[self.kpi].of_feature and self.feature is None:
            raise ValueError(f'{self.kpi} does not say of which feature; add feature = "NAME"')
        if not KINDS[self.kpi].of_feature and self.feature is not None:
            raise ValueError(f"{self.kpi} is of no other feature; remove feature, or ask for feature_mean")
        return self


class ScenarioTable(Config):
    """A scenario file."""

    description: Annotated[str, Field(min_length=1)]
    model: PathText | dict[str, Any]
    ideal: PathText | None = None
    scene: str | dict[str, Any] | None = None
    sampling: SamplingTable | None = None
    measured: PathText | None = None
    beams: tuple[BeamShape, ...] = ()
    frames: Annotated[int, Field(ge=1, le=1000)] = 1
    kpis: Annotated[tuple[KpiTable, ...], AfterValidator(_not_empty)]

    @model_validator(mode="after")
    def _one_source_of_beams(self) -> ScenarioTable:
        sources = {"[[beams]]": bool(self.beams), "ideal": self.ideal is not None, "scene": self.scene is not None}
        given = [name for name, there in sources.items() if there]
        if not given:
            raise ValueError('the scenario has no beams; add [[beams]] tables, ideal = "FILE" or scene = "NAME"')
        if len(given) > 1:
            raise ValueError(f"{' and '.join(given)} stand beside each other; keep one of them")
        if self.sampling is not None and self.scene is None:
            raise ValueError("sampling says how a scene is cast, and there is none; remove it, or add a scene")
        return self
