"""What a run of `lidarcheck explain` writes into its directory."""

from __future__ import annotations

__all__ = ["KEPT", "MODEL", "PAGE", "REPORT"]

REPORT, MODEL, PAGE = "report.json", "model.toml", "report.html"
KEPT = ".explain"
"""Where an interrupted run keeps what was done."""
