"""Where the text of a Python module lies that a model names in `[external]`: beside the model's file, or installed."""

from __future__ import annotations

import os
import sys
from importlib.machinery import PathFinder
from pathlib import Path

from lidarcheck.errors import ExternalModelError
from lidarcheck.trust.places import check_place

__all__ = ["module_place"]


def module_place(module: str, directory: Path) -> Path:
    """The folder of the package, or the file of the module, that `package.module:function` begins with.

    Nothing is imported. `directory`: the folder of the model's file, which comes before what is installed.
    `ExternalModelError` where there is none, `InputError` where a link leads out of the project.
    """
    top = module.partition(":")[0].partition(".")[0]
    for places in ([str(directory)], [place for place in sys.path if place]):
        found = PathFinder.find_spec(top, places)
        if found is None:
            continue
        inside = list(found.submodule_search_locations or ())
        place = Path(inside[0] if inside else found.origin or os.devnull)
        if places == [str(directory)]:
            check_place(place, directory / "model.toml")
        return place
    what = f"the external model {module} cannot be found: there is no module {top}"
    raise ExternalModelError(what, fix=f"put it beside the model file, in {directory}, or install it")
