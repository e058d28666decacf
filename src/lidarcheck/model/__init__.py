"""The sensor model: from what a beam meets to its echoes.

Names are found when they are asked for: who reads a model file does not wait for compilers.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lidarcheck.model.chain import echoes_of, simulate
    from lidarcheck.model.files.model_file import load_model, save_model
    from lidarcheck.model.light import light_of
    from lidarcheck.model.spec import External, Model
    from lidarcheck.model.trace import expected_trace

__all__ = ["External", "Model", "echoes_of", "expected_trace", "light_of", "load_model", "save_model", "simulate"]

_PLACES = {
    "External": "spec",
    "Model": "spec",
    "echoes_of": "chain",
    "expected_trace": "trace",
    "light_of": "light",
    "load_model": "files.model_file",
    "save_model": "files.model_file",
    "simulate": "chain",
}


def __getattr__(name: str) -> object:
    """One of these names, loaded now; `AttributeError` for any other."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)
    globals()[name] = found
    return found
