"""lidarcheck: calibrates and validates a LiDAR sensor model against measurements.

`__all__` is the public interface, described in docs/python.md; everything below it is private. A name is loaded when
it is first asked for, so that `import lidarcheck` loads nothing else. `__init__.pyi` tells type checkers the same.
"""

from __future__ import annotations

import importlib

__version__ = "0.1.0"

_HOME = {
    "Calibration": "lidarcheck.calibration.parameters.workflow",
    "Case": "lidarcheck.cases.case",
    "Comparison": "lidarcheck.kpi.comparison",
    "Explanation": "lidarcheck.explain.report.explanation",
    "IdealScan": "lidarcheck.scan",
    "LidarcheckError": "lidarcheck.errors",
    "Model": "lidarcheck.model.spec",
    "Scan": "lidarcheck.scan",
    "calibrate": "lidarcheck.api",
    "compare": "lidarcheck.kpi.compare",
    "read_case": "lidarcheck.api",
    "read_ideal": "lidarcheck.api",
    "read_model": "lidarcheck.api",
    "read_scan": "lidarcheck.api",
    "simulate": "lidarcheck.model.chain",
    "write_model": "lidarcheck.api",
    "write_scan": "lidarcheck.api",
}
"""The module of each public name. `explain` is missing: it is the package of that name, which can be called."""

__all__ = ["__version__", "explain", *_HOME]


def __getattr__(name: str) -> object:
    """A public name, loaded now; `AttributeError` for any other."""
    if name == "explain":
        return importlib.import_module("lidarcheck.explain")
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
