"""The table of materials, as model files and scenes hold it: `[materials.<id>]`."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from lidarcheck.config.schema import Config, LineIndex
from lidarcheck.sensor import RETRO_GAIN_MAX, Material

__all__ = ["MATERIAL_ID_MAX", "MaterialId", "MaterialTable", "materials_of"]

_log = logging.getLogger(__name__)

MATERIAL_ID_MAX = 2**31 - 1
_ID = re.compile(r"0|[1-9][0-9]{0,9}")


def _check_id(text: str) -> str:
    if not _ID.fullmatch(text) or int(text) > MATERIAL_ID_MAX:
        raise ValueError("not a material's number")
    return text


MaterialId = Annotated[
    str,
    AfterValidator(_check_id),
    Field(json_schema_extra={"words": f"a whole number from 0 to {MATERIAL_ID_MAX}"}),
]


class MaterialTable(Config):
    """One entry of the table."""

    name: str = Field("", min_length=1, validate_default=False)
    reflectance: float = Field(ge=0.0, le=1.0)
    kind: Literal["lambertian", "retro"] = "lambertian"
    retro_gain: float | None = Field(None, ge=0.0, le=RETRO_GAIN_MAX)

    @model_validator(mode="after")
    def _gain_belongs_to_retro(self) -> MaterialTable:
        if self.kind == "retro" and self.retro_gain is None:
            raise ValueError("a retro-reflector has no retro_gain; add retro_gain, a number from 0 to 1e+06")
        return self


def materials_of(tables: Mapping[str, MaterialTable], lines: LineIndex) -> dict[int, Material]:
    """The materials by their numbers; a retro_gain that has no effect is logged with its line."""
    return {int(number): _material(number, entry, lines) for number, entry in tables.items()}


def _material(number: str, table: MaterialTable, lines: LineIndex) -> Material:
    if table.kind == "lambertian" and table.retro_gain not in (None, 1.0):
        where = f"{lines.file}:{lines.line(('materials', number, 'retro_gain'))}"
        _log.warning("%s: material %s is lambertian: retro_gain = %g has no effect", where, number, table.retro_gain)
    gain = 1.0 if table.retro_gain is None or table.kind == "lambertian" else table.retro_gain
    return Material(table.name or f"material_{number}", table.reflectance, table.kind, gain)
