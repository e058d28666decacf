"""Recordings of a scene at rest, in which something is hidden that repeats can show, or something that they cannot.

The sensors, the light and the detectors are those of the foreign sensors' generator beside it; like that, it never
imports the package under test. `ci/repeats` makes ideal scans of its frames and explains these.
"""

import sys
from pathlib import Path

_TESTS = str(Path(__file__).resolve().parents[2])
if _TESTS not in sys.path:  # a benchmark loads this folder as a package of its own
    sys.path.append(_TESTS)

from .cases import write_case  # noqa: E402
from .orders import CaseOrder, plan  # noqa: E402

__all__ = ["CaseOrder", "plan", "write_case"]
