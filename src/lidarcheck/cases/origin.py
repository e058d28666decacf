"""Where a case's ideal scans come from: what was estimated from the measured scans themselves cannot show in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from lidarcheck.config.schema import Config, LineIndex
from lidarcheck.effects.search.base import SearchSpec
from lidarcheck.errors import InputError

__all__ = ["CAST", "PARTS", "Origin", "OriginKeys", "Part", "origin_faults", "origin_of"]

Part = Literal["", "fit", "select", "verify"]
PARTS: tuple[Part, ...] = ("fit", "select", "verify")
"""What a frame may be for."""

_FOR_LOCATION, _FOR_RATES = 5, 3
"""With fewer repeats in an estimate a mean is judged by little else than the estimate's own error; with two, a ray that
one of them lost tells nothing of losses either."""


class OriginKeys(Config):
    """The keys of `case.toml` that say where its ideal scans come from."""

    ideals_from: Literal["repeats", "snippet", "map"] | None = None
    pose_from: Literal["fit"] | None = None
    laws_from: Literal["repeats"] | None = None
    repeats: int | None = Field(None, ge=2)


@dataclass(frozen=True)
class Origin:
    """How the ideal scans of a case were made. `source`: empty where the case does not say, as of a cast scene.

    `pose_fitted`: the pose, or a target's plane, was fitted to the scans of the case; `laws_fitted`: so were the
    model's laws of range, noise and loss. `repeats`: in the estimate of each ideal scan, 0 where they are no estimates.
    """

    source: Literal["", "repeats", "snippet", "map"] = ""
    pose_fitted: bool = False
    laws_fitted: bool = False
    repeats: int = 0

    @property
    def judges_location(self) -> bool:
        """Whether mean residuals and mean amplitudes say anything."""
        return self.source != "repeats" or self.repeats >= _FOR_LOCATION

    @property
    def judges_rates(self) -> bool:
        """Whether losses and echoes of no surface say anything; else spread alone is judged."""
        return self.source != "repeats" or self.repeats >= _FOR_RATES

    def leaves_a_part(self, effect: SearchSpec) -> bool:
        """Whether such ideal scans have taken up an effect but for a part that can be taken for another effect."""
        return self.source == "repeats" and self.judges_rates and bool(effect.beside_repeats)

    def why_unseen(self, effect: SearchSpec) -> str:
        """Why an effect cannot show beside such ideal scans, which have taken it up; empty where it can."""
        if self.source == "repeats" and not effect.in_repeats:
            return "what is constant in time is in the ideal scan, which was made from repeats"
        if self.pose_fitted and effect.in_fitted_pose:
            return "the pose or plane of the ideal scans was fitted with these scans, and takes it up"
        if self.laws_fitted and effect.in_fitted_laws:
            return (
                "the laws of range, noise and loss were fitted here: it shows only as a change between the frames to "
                "fit and those to verify"
            )
        return ""


CAST = Origin()
"""Of a case that does not say where its ideal scans come from: cast from a scene."""


def origin_of(keys: OriginKeys, parts: Sequence[Part]) -> Origin:
    """What the keys say; of repeats without their number, that each frame to fit or select is left out of its own."""
    repeats = 0
    if keys.ideals_from == "repeats":
        repeats = keys.repeats or max(sum(part != "verify" for part in parts) - 1, 2)
    return Origin(keys.ideals_from or "", keys.pose_from == "fit", keys.laws_from == "repeats", repeats)


def origin_faults(keys: OriginKeys, parts: Sequence[Part], lines: LineIndex, *, split: bool) -> list[InputError]:
    """What contradicts itself in these keys and in the frames' parts; `split`: whether every part needs a frame."""
    faults = []
    belongs = {"pose_from": ("snippet", "map"), "laws_from": ("repeats",), "repeats": ("repeats",)}
    for key, sources in belongs.items():
        if getattr(keys, key) is not None and keys.ideals_from not in sources:
            wanted = " or ".join(f'"{source}"' for source in sources)
            what = f"`{key}` means nothing without ideals_from = {wanted}"
            faults.append(lines.fault((key,), what, fix="say where the ideal scans come from, or leave it out"))
    if not any(parts):
        return faults
    for i, part in enumerate(parts):
        if not part:
            what = f"frame {i} has no `part`, and others have"
            faults.append(lines.fault(("frames", i), what, fix='give each frame a part: "fit", "select" or "verify"'))
    lacking = [part for part in PARTS if part not in parts]
    if split and lacking and all(parts):
        what = f'no frame has part = "{lacking[0]}"'
        faults.append(lines.fault(("frames", 0, "part"), what, fix="give each part a frame, or no frame a part"))
    return faults
