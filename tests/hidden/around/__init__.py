"""Cases with hidden effects around sensor models that are not ours: the programs of `examples/` give the echoes.

The effects are those of `hidden.foreign`, on the light that a program is handed and on the echoes that it gives; like
the generator around it, this never imports the package under test. `ci/external_models` runs its cases.
"""

import sys
from pathlib import Path

_TESTS = str(Path(__file__).resolve().parents[2])
if _TESTS not in sys.path:  # a benchmark loads this folder as a package of its own
    sys.path.append(_TESTS)

from .cases import write_case  # noqa: E402
from .orders import CaseOrder, plan  # noqa: E402

__all__ = ["CaseOrder", "plan", "write_case"]
