"""The truth of a case, and the seal that gives it only in exchange for the answer."""

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Truth:
    """What a case hides.

    `parameters` are those of the generator's own forms, by effect; `comparable` those that mean the same as a
    parameter of the catalogue, by "effect.parameter", nuisances of the same kind (of gain, pose, reflectance) taken in:
    what data and model file differ by in all; `observable` and `z` tell, by effect, whether and how far it
    stands out of the noise in these frames; `nuisance` is what differs besides and is no effect.
    """

    kind: str
    effects: tuple[str, ...]
    forms: dict[str, str]
    parameters: dict[str, dict[str, float]]
    comparable: dict[str, float]
    observable: dict[str, bool]
    z: dict[str, float]
    shows_in: dict[str, str]
    nuisance: dict[str, Any]
    in_model: dict[str, dict[str, float]]

    def text(self) -> str:
        """As JSON, keys sorted: the same bytes for the same truth."""
        return json.dumps(asdict(self), sort_keys=True)


class NoAnswerError(ValueError):
    """The seal was to be opened without an answer, or with a second one."""


@dataclass
class Sealed:
    """A case's sealed truth. `digest` is SHA-256 over salt and truth, and lies in the case as `sealed.txt`."""

    digest: str
    salt: str
    _truth: Truth = field(repr=False)
    answer_digest: str | None = None

    @classmethod
    def seal(cls, truth: Truth, salt: str) -> "Sealed":
        return cls(hashlib.sha256((salt + truth.text()).encode()).hexdigest(), salt, truth)

    def open(self, report: dict[str, Any]) -> Truth:
        """The truth for the first answer given; raises NoAnswerError for none, or for another one later."""
        if not isinstance(report, dict) or report.get("verdict") not in ("no_gap", "explained", "unknown"):
            raise NoAnswerError("the seal opens for a report with a verdict: no_gap, explained or unknown")
        answer = hashlib.sha256(json.dumps(report, sort_keys=True, default=str).encode()).hexdigest()
        if self.answer_digest not in (None, answer):
            raise NoAnswerError("another answer was given before; the first one counts")
        self.answer_digest = answer
        return self._truth

    def holds(self) -> bool:
        """Whether the truth is still the one that was sealed."""
        return hashlib.sha256((self.salt + self._truth.text()).encode()).hexdigest() == self.digest
