"""On what a speed was measured."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from typing import Any

from lidarcheck.workers.cores import usable_cores

__all__ = ["machine"]


def machine() -> dict[str, Any]:
    """Cores, load, interpreter and the versions that matter."""
    return {
        "cores": usable_cores(),
        "processor": _processor(),
        "load_1min": os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan"),
        "python": platform.python_version(),
        **{name: version(name) for name in ("lidarcheck", "numpy", "numba", "scipy", "pyarrow")},
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:  # noqa: PTH123 - not a file of anyone's
            return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
    except OSError:
        return platform.processor()
