"""What a search must know of each effect: a file an effect, found by being here; `base.SearchSpec` says what."""

from lidarcheck.effects.search.base import FreeParameter, Probe, SearchSpec, search_spec, search_specs

__all__ = ["FreeParameter", "Probe", "SearchSpec", "search_spec", "search_specs"]
