"""What a scenario asks of one KPI, and what one seed of a scenario measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

__all__ = ["Direction", "GateKind", "KpiSpec", "SeedMeasurement"]

GateKind = Literal["mean", "proportion", "distance"]
Direction = Literal["higher", "lower", "target"]


@dataclass(frozen=True, slots=True)
class KpiSpec:
    """What a scenario asks of one KPI.

    `name`: unique within the scenario, as `area_mean.panels_50`.
    `kind`: how the gate treats it. "mean": one number per seed, about normal over seeds; "proportion": successes over
    `SeedMeasurement.trials`; "distance": of the sample `feature` from the golden's, never negative.
    `direction`: which way is better; "target": any departure is worse.
    `tolerance`: a change up to this does not matter in practice, in `unit`.
    `low`, `high`: absolute limits on the value, the sensor's requirement; None where there is none.
    `feature`: for a distance, the key of its sample in `SeedMeasurement.samples`; None otherwise.
    `requirement`: in words, where the limits come from; `catches`: the change that must be caught, in `unit`, None
    where the scenario leaves it at twice the tolerance. Neither moves a verdict, so that neither tells two specs apart.
    """

    name: str
    kind: GateKind
    unit: str
    direction: Direction
    tolerance: float
    low: float | None = None
    high: float | None = None
    feature: str | None = None
    requirement: str = field(default="", compare=False)
    catches: float | None = field(default=None, compare=False)

    @property
    def must_catch(self) -> float:
        """The smallest change that must be caught, in `unit`."""
        return 2.0 * self.tolerance if self.catches is None else self.catches


@dataclass(frozen=True, slots=True)
class SeedMeasurement:
    """One seed of one scenario.

    `values`: by KPI name; nan where it could not be computed (no echo in the selection). Distances are absent.
    `trials`: for proportions, by KPI name, the number of trials.
    `samples`: by `KpiSpec.feature`, what the distances are taken of, shape (n,) each.
    `digest`: SHA-256 over the simulated echoes' bytes; equal digests mean bit-identical echoes.
    """

    values: Mapping[str, float]
    trials: Mapping[str, int]
    samples: Mapping[str, npt.NDArray[np.floating[Any]]]
    digest: str
