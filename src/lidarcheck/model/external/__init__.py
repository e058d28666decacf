"""Somebody else's sensor model: ideal scans in, echoes out, by a program, a server or a Python function."""

from lidarcheck.model.external.command import PLACEHOLDERS, check_command
from lidarcheck.model.external.process import stop_external_models
from lidarcheck.model.external.running import Request, run_external, run_requests

__all__ = ["PLACEHOLDERS", "Request", "check_command", "run_external", "run_requests", "stop_external_models"]
