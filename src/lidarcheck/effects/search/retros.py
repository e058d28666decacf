"""What the effects of retro-reflectors have in common."""

from __future__ import annotations

from lidarcheck.effects.search.evidence import Evidence

__all__ = ["HALO", "why_unseen"]

HALO = ("echo_share", "echo_area_mean", "echo_layer_spread", "echo_point_spread", "false_alarms_per_beam")
"""The kinds of KPI that see echoes about a bright target."""


def why_unseen(evidence: Evidence) -> str:
    """Why frames without a retro-reflector show nothing; empty with one."""
    return "" if evidence.beams.retro.any() else "no retro-reflector is in view"
