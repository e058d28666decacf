"""What a search must know of an effect beside its law.

Each file here has one effect's `SPEC`, found by being here; a plugin has it in its own module. The search, the report
and the harness ask `search_spec(name)` and know no effect by name. An effect without one is not searched for, has no
relatives, and all else works.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from lidarcheck.arrays import FloatArray
from lidarcheck.effects.base import Effect
from lidarcheck.effects.finding import find, make
from lidarcheck.effects.plugins import plugins
from lidarcheck.effects.search.evidence import Evidence
from lidarcheck.effects.search.parts import BeamByBeam, Imitation, ListReader, TakeOver, UsualError
from lidarcheck.sensor import Sensor

__all__ = [
    "GAIN_ERROR",
    "LOG_STEP",
    "POSE_ERROR_DEG",
    "REFLECTANCE_ERROR",
    "FreeParameter",
    "Probe",
    "SearchSpec",
    "Variant",
    "search_spec",
    "search_specs",
]

Settings = dict[str, Any]

LOG_STEP = 0.2
"""One step of a parameter that scales: small beside what a start is off by, large beside what flips single beams."""

GAIN_ERROR, REFLECTANCE_ERROR, POSE_ERROR_DEG = 0.02, 0.04, 0.015
"""Usual errors (standard deviations) of the gain, of table entries and of the sensor's angles: worth no name."""


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """A parameter that a fit may move: on a logarithmic scale, or in steps of `step` in its own unit.

    `least`: below it the effect would be no more what its name says; `most`: above it the sensor has no more beams.
    """

    name: str
    step: float
    log: bool = False
    whole: bool = False
    least: float = -float("inf")
    most: float = float("inf")

    def encode(self, value: float) -> float:
        """The value on the fit's own scale, where one step has length 1."""
        return float(np.log(max(value, 1e-12)) / self.step if self.log else value / self.step)

    def decode(self, x: float, low: float, high: float) -> float:
        """The parameter's value, kept within its range."""
        value = float(np.exp(np.clip(x * self.step, -60.0, 60.0)) if self.log else x * self.step)
        value = min(max(value, low, self.least), high, self.most)
        return float(round(value)) if self.whole else value


@dataclass(frozen=True, slots=True)
class Probe:
    """One start of the search for an effect: its settings there, and the parameters that are free.

    `variant`: starts of one effect that differ in kind are fitted each, else the best one only. `ways`: settings of
    which one is tried after the other where the effect's plain kind ends, and the fit goes on from the best.
    """

    name: str
    settings: Mapping[str, Any]
    free: tuple[FreeParameter, ...]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    variant: str = ""
    ways: tuple[Mapping[str, Any], ...] = ()

    @property
    def strikes_anew(self) -> bool:
        """Whether this kind of start acts otherwise in every frame."""
        return self.variant in search_spec(self.name).variants_anew

    def plain(self) -> Probe:
        """The same start of the effect's plain kind."""
        ways = {name for way in self.ways for name in way}
        settings = {name: value for name, value in self.settings.items() if name not in ways}
        return Probe(self.name, settings, search_spec(self.name).free, self.fixed)

    def effect(self, x: FloatArray | None = None) -> Effect:
        """The effect at the start, or at a point of the fit's scale."""
        values = {**self.fixed, **self.settings}
        if x is not None:
            ranges = {p.name: (p.low, p.high) for p in find(self.name).parameters()}
            for one, at in zip(self.free, x, strict=True):
                values[one.name] = one.decode(float(at), *ranges[one.name])
        for low, high in search_spec(self.name).ascending:
            values[low] = min(values[low], values.get(high, np.inf))
        whole = {p.name for p in find(self.name).parameters() if p.whole}
        return make(self.name, {k: int(v) if k in whole else v for k, v in values.items()})

    def scaled(self, factor: float) -> Probe:
        """The same start with the effect's strength scaled, as far as its parameters have a strength."""
        return replace(self, settings=search_spec(self.name).scaled(self.settings, factor))

    def weaker(self, x: FloatArray, factor: float) -> Probe:
        """A start at a point of the fit's scale, with the strength there scaled."""
        there = self.effect(x).settings()
        moved = {one.name: there[one.name] for one in self.free}
        return replace(self, settings={**self.settings, **moved}).scaled(factor)

    def start(self) -> FloatArray:
        """The start on the fit's scale, shape (n_free,)."""
        typical = {p.name: p.typical for p in find(self.name).parameters()}
        values = {**typical, **self.fixed, **self.settings}
        return np.array([one.encode(float(values[one.name])) for one in self.free])


@dataclass(frozen=True)
class Variant:
    """A start of another kind, with what is free there; `ways`: see `Probe`."""

    kind: str
    settings: Mapping[str, float]
    free: tuple[FreeParameter, ...]
    ways: tuple[Mapping[str, float], ...] = ()


def _nothing_more(settings: Settings, _factor: float) -> Settings:
    return settings


@dataclass(frozen=True)
class SearchSpec:
    """All that a search must know of one effect."""

    name: str

    # Where the search begins.
    free: tuple[FreeParameter, ...] = ()
    """The parameters that a fit moves. One step should change the data visibly, since single beams flip."""
    fixed_starts: tuple[Mapping[str, Any], ...] = ()
    """Starts that need no look at the data: of both signs, weak and strong."""
    variants: tuple[Variant, ...] = ()
    """Starts that differ in kind, which are fitted each."""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    """Settings for the search alone, such as few rays for speed."""
    starts: Callable[[Evidence], list[Probe]] | None = None
    """Starts that are read off the residuals."""
    starts_of_each: Callable[[Evidence], list[Probe]] | None = None
    """Starts for each material or object in view."""
    order: float = float("inf")
    """Variants and starts from data stand in this order; it decides between candidates that explain the same."""

    # Its strength.
    factors: tuple[str, ...] = ()
    """Parameters, and lists of such, that are 1 without the effect."""
    amounts: tuple[str, ...] = ()
    """Parameters that are 0 without the effect."""
    of_background: tuple[str, ...] = ()
    """Parameters in the unit of the sensor's own background: starts are as many times that as of the reference's."""
    of_signal: tuple[str, ...] = ()
    """The same of S, as many times what is just seen."""
    of_threshold: tuple[str, ...] = ()
    """The same of the detection threshold."""
    rescale: Callable[[Settings, float], Settings] = _nothing_more
    """What else a scaled strength changes."""
    ascending: tuple[tuple[str, str], ...] = ()
    """Pairs of parameters of which the first must not pass the second."""

    # Its relatives.
    groups: frozenset[str] = frozenset()
    """Effects of one group change the same features in the same way, more or less."""
    special_case_of: str = ""
    """An effect that can do all that this one does, and more; it also takes up what is not quite right elsewhere."""
    lasting_case_of: str = ""
    """An effect that follows what this one does if it acts anew in every frame."""
    confused_with: Mapping[str, str] = field(default_factory=dict)
    """Effects that it is taken for, each with the measurement that separates the two; one of both says it."""
    imitated_by: tuple[str, ...] = ()
    """Effects of which a read-off form may be nearly the same as this one: to take its place, they must leave less."""
    imitation: Imitation | None = None
    """One of these that is tried in its place once all else is found."""
    kinds_alike: bool = False
    """Summaries hardly tell its kinds of start apart; beams do."""
    takes_over: TakeOver | None = None
    usual_error: UsualError | None = None

    # How it acts.
    at_edges: bool = False
    """By it beams look elsewhere: what it changes most is at edges."""
    splits_echoes: bool = False
    """By it beams see both sides of an edge."""
    at_random: Literal["", "adds echoes", "loses echoes", "turns the view"] = ""
    """What it does at random, elsewhere in every frame."""
    variants_anew: tuple[str, ...] = ()
    """Kinds of start that act otherwise in every frame as a whole."""
    acts_anew: Callable[[Effect], bool] | None = None
    """Whether it does so with its settings: a few frames then have a mean pose of their own by chance."""
    shows_images: bool = False
    """It shows what lies beyond the view, which no ideal scan can place."""
    named_by: Mapping[str, float] = field(default_factory=dict)
    """Settings with which nothing is left of what its name says; what it gains must come from more than the rest."""
    is_another: Callable[[Evidence, Effect], bool] | None = None
    """Whether its fitted form is what another name says."""
    why_unseen: Callable[[Evidence], str] | None = None
    """Why these frames cannot show it, empty where its strength alone is to blame."""

    # What an ideal scan that was estimated from measurements has taken up.
    in_repeats: bool = False
    """Whether repeats of a still scene show it beside an ideal scan made from them: by scatter, loss, or echoes of no
    surface. What is the same in all repeats is in that ideal scan."""
    beside_repeats: tuple[Variant, ...] = ()
    """What repeats still show of an effect that is in their ideal scan: starts at which it takes nothing from surfaces.
    It is fitted so that no other effect gets its name, and is not named."""
    in_fitted_pose: bool = False
    """Whether it is lost where the pose, or a target's plane, was fitted to the same scans."""
    in_fitted_laws: bool = False
    """Whether it is lost where the laws of range, noise and loss were fitted to the same scans."""

    # How wrong its form may be.
    form_errors: Mapping[str, float] = field(default_factory=dict)
    """Part of a parameter's value by which it may be off since the form is not quite the sensor's; else the usual."""
    least_errors: Mapping[str, float] = field(default_factory=dict)
    """By how much it may be off at least, in its own unit."""
    may_stay: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Of an effect of one form only: what may stay open of the parts of the gap that it is of, a share and a least."""
    chance_errors: Callable[[Evidence, Probe, Effect], Mapping[str, float]] | None = None
    """Parts of its parameters by which these are off by chance, since few things were hit."""
    as_struck: Callable[[Evidence, Probe, Effect], Mapping[str, float]] | None = None
    """Settings with which it strikes as often as it did in some other frames, where chance may make the difference."""

    # What follows the fit.
    list_reader: ListReader | None = None
    read_lists: tuple[str, ...] = ()
    """Lists read off the data, whose numbers count as a part of free ones each."""
    whole_steps: Mapping[str, Callable[[Sensor], float]] = field(default_factory=dict)
    """Parameters that act in whole steps, and how wide these are: fitted step by step."""
    finer: Callable[[Probe, FloatArray], Probe] | None = None
    """The same effect in a finer and slower form."""
    beam_by_beam: BeamByBeam | None = None

    watched_by: tuple[str, ...] = ()
    """The kinds of KPI that it moves by what it does, the most telling first."""
    shown_by: tuple[str, str] | None = None
    """The picture that proves it in a report of a gap: of range, area, peak, width, detected or others (echoes that
    belong to no surface), over a covariate, as a map or as a histogram."""

    @property
    def is_searched(self) -> bool:
        """Whether a search knows where to begin, and what to fit."""
        return bool(self.free)

    def scaled(self, settings: Mapping[str, Any], factor: float) -> Settings:
        """The settings with the effect's strength scaled."""
        found = dict(settings)
        for name in (name for name in self.factors if name in found):
            value = found[name]
            found[name] = tuple(round(v**factor, 4) for v in value) if isinstance(value, tuple) else value**factor
        found |= {name: found[name] * factor for name in self.amounts if name in found}
        return self.rescale(found, factor)


@functools.cache
def search_specs() -> Mapping[str, SearchSpec]:
    """The specs of all effects that have one, by name, in their own order."""
    package = importlib.import_module("lidarcheck.effects.search")
    modules = [importlib.import_module(f"{package.__name__}.{m.name}") for m in pkgutil.iter_modules(package.__path__)]
    found = [getattr(one, "SPEC", None) for one in (*modules, *plugins())]
    found += [spec for module in modules for spec in getattr(module, "SPECS", ())]
    specs = sorted((spec for spec in found if isinstance(spec, SearchSpec)), key=lambda spec: (spec.order, spec.name))
    return {spec.name: spec for spec in specs}


def search_spec(name: str) -> SearchSpec:
    """What a search must know of an effect; of one that says nothing, that nothing is known."""
    return search_specs().get(name) or SearchSpec(name)
