"""Effects of other packages, found by their entry points."""

from __future__ import annotations

import functools
import importlib.metadata

from lidarcheck.errors import UsageError

__all__ = ["plugins"]


@functools.cache
def plugins() -> tuple[object, ...]:
    """What other packages bring: the modules, or what is in them, that their entry points `lidarcheck.effects` name.

    `UsageError` for one that does not load.
    """
    found = []
    for point in importlib.metadata.entry_points(group="lidarcheck.effects"):
        try:
            found.append(point.load())
        except (ImportError, AttributeError) as error:
            fix = "correct its entry point lidarcheck.effects, or uninstall the package that has it"
            raise UsageError(f"the plugin {point.name} ({point.value}) does not load: {error}", fix=fix) from error
    return tuple(found)
