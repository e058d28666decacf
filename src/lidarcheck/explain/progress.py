"""How far a run is: the steps' shares of the whole, and who hears of it."""

from __future__ import annotations

from lidarcheck.explain.report.explanation import Progress, ProgressCallback, SearchStep

__all__ = ["PROGRESS", "ignore_progress", "ignore_step", "report_fit"]

PROGRESS = Progress(
    {
        "residuals and floor": 0.17,
        "candidates": 0.19,
        "fit": 0.29,
        "second look": 0.14,
        "equivalence and testability": 0.07,
        "unknown": 0.04,
        "verification": 0.10,
    }
)


def ignore_progress(_step: str, _done: int, _of: int) -> None:
    """Tell nobody how far a step is."""


def ignore_step(_step: SearchStep) -> None:
    """Hear nothing of what is found."""


def report_fit(on_progress: ProgressCallback, step: str, done: int, of: int) -> None:
    """How far the fit is: four rounds, the leaving out again and the detours, in hundredths."""
    place = {"leave out again": 4, "detour": 5}.get(step) or int(step.rsplit(" ", 1)[-1]) - 1
    on_progress("fit", 16 * place + round(16 * done / max(of, 1)), 100)
