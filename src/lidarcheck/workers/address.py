"""The address of a scheduler, as it is given and as it answers."""

from __future__ import annotations

import re
import socket

from lidarcheck.errors import UsageError, WorkerError

__all__ = ["START", "check_address", "check_reachable"]

START = "start one with `dask scheduler --host HOST --port 8786` (see docs/cluster.md), or leave out --scheduler"
_FORM = re.compile(r"(?:tcp|tls)://(?P<host>\[[0-9A-Fa-f:.]+\]|[\w.-]+):(?P<port>[0-9]{1,5})", re.ASCII)
_TIMEOUT_S = 5.0


def check_address(address: str) -> str:
    """The address; `UsageError` where it is none."""
    found = _FORM.fullmatch(address)
    if found is None or not 1 <= int(found["port"]) <= 65535:
        fix = "give tcp://HOST:PORT, as tcp://127.0.0.1:8786, or tls://HOST:PORT"
        raise UsageError(f"--scheduler {address} is no address of a scheduler", fix=fix)
    return address


def check_reachable(address: str) -> None:
    """`WorkerError` where nobody listens: this says so at once, and why."""
    found = _FORM.fullmatch(check_address(address))
    assert found is not None
    try:
        socket.create_connection((found["host"].strip("[]"), int(found["port"])), _TIMEOUT_S).close()
    except OSError as error:
        reason = (error.strerror or str(error) or "no answer").lower()
        raise WorkerError(f"there is no scheduler at {address}: {reason}", fix=START) from None
