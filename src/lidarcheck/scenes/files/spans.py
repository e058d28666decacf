"""Spans of layers and of points, as files write them: [first, last], both included."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field

from lidarcheck.scenes.files.shapes import entries
from lidarcheck.sensor import Beams

__all__ = ["Span", "beyond"]


def _rising(span: tuple[int, int]) -> tuple[int, int]:
    if span[0] > span[1]:
        raise ValueError("the first is above the last; write [first, last], both included")
    return span


_Index = Annotated[int, Field(ge=0, le=9_999_999)]
Span = Annotated[
    tuple[_Index, _Index], BeforeValidator(entries(2, "[first, last], both included")), AfterValidator(_rising)
]
"""The sensor says how far it may go: see `beyond`."""


def beyond(name: str, span: tuple[int, int] | None, beams: Beams) -> tuple[str, str] | None:
    """What is wrong with a span of a key that ends in `layers` or `points`, and what to do; None where nothing is."""
    count = beams.layers if name.endswith("layers") else beams.points
    if span is None or span[1] < count:
        return None
    return (
        f"{name} = [{span[0]}, {span[1]}] is out of range",
        f"use [first, last], both included, from 0 to {count - 1}",
    )
