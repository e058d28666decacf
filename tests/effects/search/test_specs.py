"""What effects say of themselves to a search holds together."""

import numpy as np
import pytest

from lidarcheck.effects import catalogue, empirical_terms, find
from lidarcheck.effects.search import SearchSpec, search_spec, search_specs
from lidarcheck.figures.gap.measure import COVARIATES
from lidarcheck.harness.kpis.registry import KINDS
from lidarcheck.inference.wasserstein import PARTS

SPECS = [search_spec(name) for name in catalogue()]
IDS = list(catalogue())


def test_every_effect_says_what_a_search_must_know() -> None:
    assert set(search_specs()) == {*catalogue(), *empirical_terms()}
    assert all(spec.is_searched for spec in SPECS)
    assert not any(search_spec(name).is_searched for name in empirical_terms())


def test_of_an_effect_that_says_nothing_nothing_is_known() -> None:
    spec = search_spec("of_a_plugin")
    assert spec == SearchSpec("of_a_plugin")
    assert not spec.is_searched
    assert spec.scaled({"a": 2.0}, 0.5) == {"a": 2.0}


@pytest.mark.parametrize("spec", SPECS, ids=IDS)
def test_it_speaks_of_parameters_that_the_effect_has(spec: SearchSpec) -> None:
    effect = find(spec.name)
    numbers = {p.name for p in effect.parameters()}
    everything = numbers | {p.name for p in effect.lists()} | {p.name for p in effect.choices()}
    frees = [spec.free, *(one.free for one in spec.variants)]
    assert {one.name for free in frees for one in free} <= numbers
    ways = [way for one in spec.variants for way in one.ways]
    settings = [*spec.fixed_starts, *(one.settings for one in spec.variants), *ways, spec.fixed, spec.named_by]
    assert {name for one in settings for name in one} <= everything
    said = [spec.factors, spec.amounts, spec.read_lists, *spec.ascending, spec.form_errors, spec.least_errors]
    assert {name for names in (*said, spec.whole_steps) for name in names} <= everything
    if spec.list_reader is not None:
        assert spec.list_reader.parameter in everything
    if spec.usual_error is not None:
        assert effect.role
        assert set(spec.usual_error.parameters) <= numbers


@pytest.mark.parametrize("spec", SPECS, ids=IDS)
def test_it_speaks_of_effects_that_there_are(spec: SearchSpec) -> None:
    others = [spec.special_case_of, spec.lasting_case_of, *spec.confused_with, *spec.imitated_by]
    others += [one for one in (spec.takes_over and spec.takes_over.of, spec.imitation and spec.imitation.name) if one]
    assert {one for one in others if one} <= set(catalogue()) - {spec.name}
    for other in spec.confused_with:
        assert spec.name not in search_spec(other).confused_with, "one of both says it"
    assert set(spec.may_stay) <= set(PARTS)


def test_starts_of_other_kinds_stand_in_an_order_of_their_own() -> None:
    orders = [spec.order for spec in SPECS if spec.variants or spec.starts or spec.starts_of_each]
    assert np.isfinite(orders).all()
    assert len(set(orders)) == len(orders)


@pytest.mark.parametrize("spec", SPECS, ids=IDS)
def test_a_kpi_watches_it_and_a_picture_proves_it(spec: SearchSpec) -> None:
    assert spec.watched_by
    assert set(spec.watched_by) <= set(KINDS)
    assert spec.shown_by is not None
    feature, over = spec.shown_by
    assert feature in {"range", "area", "peak", "width", "detected", "others"}
    assert over in {*COVARIATES, "map", "histogram"}
