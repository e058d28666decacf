"""KPIs as lines: the golden's value, another, how far that is off in tolerances, what would be caught, the limits."""

from __future__ import annotations

from lidarcheck.tui.jobs.checks import KpiLine
from lidarcheck.tui.widgets.lines import Line, line
from lidarcheck.tui.widgets.themes import Role

__all__ = ["kpi_heading", "kpi_lines", "moved", "name_room"]

_NUMBERS = 60
_NARROW, _WIDE = 24, 40


def name_room(width: int) -> int:
    """How long a name can be in a pane of that width."""
    return min(max(width - _NUMBERS, _NARROW), _WIDE)


def kpi_heading(what: str, room: int = _NARROW) -> Line:
    """The heading; `what` stands above the value that is compared with the golden's."""
    return line(f" {'KPI':{room}} {'verdict':13}{'golden':>8} {what:>8} {'off/tol':>7} {'catches':>8} limits", "title")


def moved(kpi: KpiLine) -> float:
    """How far a KPI moved, in tolerances."""
    if kpi.golden is None or kpi.now is None or not kpi.tolerance:
        return 0.0
    return (kpi.now - kpi.golden) / kpi.tolerance


def kpi_lines(kpi: KpiLine, mark: str = " ", room: int = _NARROW) -> list[Line]:
    """A KPI behind its mark, and, where it fails, why. A name that has no room keeps its beginning and its end."""
    name = kpi.name if len(kpi.name) <= room else f"{kpi.name[: room // 2 - 2]}..{kpi.name[-room // 2 :]}"
    verdict = kpi.verdict.upper() if kpi.fails else kpi.verdict
    role: Role = "bad" if kpi.fails else "good" if kpi.verdict in ("identical", "equivalent") else "edited"
    numbers = f"{_number(kpi.golden):>8} {_number(kpi.now):>8} {moved(kpi):>+7.2f} {_number(kpi.catches):>8}"
    lines: list[Line] = [
        ((f"{mark}{name:{room}} ", "text"), (f"{verdict:13}", role), (f"{numbers} {kpi.limit} {kpi.unit}", "text"))
    ]
    if kpi.note and kpi.fails:
        lines.append(line(f"     {kpi.note}", "dim"))
    return lines


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
