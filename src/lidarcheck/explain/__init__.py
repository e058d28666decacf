"""The gap workflow: where model and measurement disagree, and why; `workflow` reads like its description.

The public interface has a function of this name, `lidarcheck.explain(case)`: calling the package calls the function.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lidarcheck.cases.case import Case
    from lidarcheck.explain.report.explanation import Explanation


class _Package(ModuleType):
    """A package that can be called."""

    def __call__(self, case: Case, **options: Any) -> Explanation:
        """What `lidarcheck.explain.workflow.explain` finds, with its options."""
        from lidarcheck.explain.workflow import explain

        return explain(case, **options)


sys.modules[__name__].__class__ = _Package
