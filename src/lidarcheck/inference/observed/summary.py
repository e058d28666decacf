"""What one summary is of."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Summary"]


class Summary(NamedTuple):
    """What one summary is of: a feature, the covariate, the bin's name."""

    feature: str
    covariate: str
    bin: str
