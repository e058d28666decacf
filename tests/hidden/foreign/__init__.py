"""Cases with hidden effects for sensors that a file describes: other grids, other detectors.

Written from the contract of sensor files alone; like the generator around it, it never imports the package under test.
It reads the numbers of the shipped sensors from their own files. `lidarcheck explain --benchmark 60 --generator
tests/hidden/foreign` runs its cases.
"""

import sys
from pathlib import Path

_TESTS = str(Path(__file__).resolve().parents[2])
if _TESTS not in sys.path:  # a benchmark loads this folder as a package of its own
    sys.path.append(_TESTS)

from .cases import write_case  # noqa: E402
from .orders import CaseOrder, plan  # noqa: E402

__all__ = ["CaseOrder", "plan", "write_case"]
