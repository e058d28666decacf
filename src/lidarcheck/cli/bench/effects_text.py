"""The figures of `bench --effects` as tables and as JSON, measured sensor by sensor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from lidarcheck.cli.bench.effects import SENSORS, Row, rows_of
from lidarcheck.cli.core.terminal import columns, table

__all__ = ["effects_json", "effects_measured", "effects_text"]

STAGES = ("light", "pulses", "draws", "table")
COLUMNS = columns(
    "with",
    "exact",
    "of plain",
    "fast",
    *(f"{stage} [ms]" for stage in STAGES),
    "bins",
    "worth",
    "x floor",
    right=("exact", "of plain", "fast", *(f"{stage} [ms]" for stage in STAGES), "bins", "worth", "x floor"),
)


def effects_measured(
    beams: int, sensors: Sequence[str] | None, progress: Callable[[int, int, str], object]
) -> dict[str, tuple[int, list[Row]]]:
    """Beams of a frame and rows by sensor, of all of `SENSORS` where None."""
    return {sensor: rows_of(sensor, beams, progress) for sensor in sensors or SENSORS}


def effects_json(measured: dict[str, tuple[int, list[Row]]]) -> dict[str, Any]:
    """For machines."""
    return {name: {"beams": beams, "rows": [asdict(row) for row in rows]} for name, (beams, rows) in measured.items()}


def effects_text(sensor: str, beams: int, rows: Sequence[Row]) -> str:
    """One sensor's table, and below it what could not be measured and why."""
    lines = [f"{sensor}, {beams} beams; million beams/s, exact and fast, and where an exact frame's time goes"]
    lines.append(table(COLUMNS, [_cells(row) for row in rows if not row.why_not]))
    lines += [f"{row.name}: {row.why_not}" for row in rows if row.why_not]
    lines += [
        f"{row.name} without {name}: {why}" for row in rows for name, why in row.without.items() if not row.why_not
    ]
    return "\n".join(lines)


def _cells(row: Row) -> tuple[str, ...]:
    times = (_text(row.stages_ms.get(stage), "{:.1f}") for stage in STAGES)
    bins = (_text(row.bins_walked, "{:.0f}"), _text(row.bins_worth, "{:.0f}"), _text(row.over_floor, "{:.2g}"))
    speeds = (_text(row.exact_mpts_s, "{:.3g}"), _text(row.of_plain, "{:.2f}"), _text(row.fast_mpts_s, "{:.3g}"))
    return (row.name, *speeds, *times, *bins)


def _text(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)
