"""The register of forms: for each effect, functions that draw one effect of that form at a strength."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .chain import Effect

STRENGTHS = ("weak", "medium", "strong")
# Places of the light effects along its way: the surface, the air, the window, the receiver.
AT_SURFACE, AT_MIRROR, IN_AIR, AT_WINDOW, IN_OPTICS, AT_RECEIVER = range(6)


@dataclass(frozen=True)
class Draw:
    """What a form draws its parameters from."""

    rng: np.random.Generator
    strength: str
    variant: str
    materials: tuple[int, ...]  # that the case's scenes show often

    def level(self, weak: float, medium: float, strong: float) -> float:
        """The value of this case's strength, within a tenth."""
        value = dict(zip(STRENGTHS, (weak, medium, strong), strict=True))[self.strength]
        return float(value * self.rng.uniform(0.9, 1.1))

    def sign(self) -> float:
        return 1.0 if self.rng.random() < 0.5 else -1.0

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def factor(self, weak: float, medium: float, strong: float) -> float:
        """A factor below 1, or as often the inverse of one half as far away."""
        down = 1.0 - self.level(weak, medium, strong)
        return down if self.rng.random() < 0.6 else 1.0 / down


Form = Callable[[Draw], Effect]
FORMS: dict[str, dict[str, Form]] = {}
ALIENS: dict[str, Form] = {}


def form(name: str, kind: str) -> Callable[[Form], Form]:
    """Registers a form of an effect of the public catalogue."""

    def register(function: Form) -> Form:
        FORMS.setdefault(name, {})[kind] = function
        return function

    return register


def alien(name: str) -> Callable[[Form], Form]:
    """Registers an effect that is in no catalogue."""

    def register(function: Form) -> Form:
        ALIENS[name] = function
        return function

    return register


def draw_effect(name: str, draw: Draw, kind: str | None = None) -> Effect:
    """One effect by name; its form is drawn unless given."""
    kinds = sorted(FORMS[name])
    return FORMS[name][kind or kinds[int(draw.rng.integers(len(kinds)))]](draw)


def draw_alien(name: str, draw: Draw) -> Effect:
    """One effect that no catalogue has."""
    return ALIENS[name](draw)
