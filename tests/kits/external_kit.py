"""What tests of external models share: an ideal scan, the refusal of a run, and whether a process is gone."""

import os
import signal
import subprocess
import time

import numpy as np
import pytest

from lidarcheck.errors import LidarcheckError
from lidarcheck.model.external import Request, run_requests
from lidarcheck.model.spec import External
from lidarcheck.scan import IdealScan

IDEAL = IdealScan(
    layer=np.array([10, 11, 12], dtype=np.int32),
    point=np.array([5, 6, 7], dtype=np.int32),
    distance_m=np.array([20.0, 0.0, 33.5]),
    material_id=np.array([1, 1, 2], dtype=np.int32),
    incidence_deg=np.array([0.0, 0.0, 12.0]),
)
"""Three beams, one of which meets nothing."""


def refusal(external: External, *requests: Request) -> str:
    """The line that is said of a run that must fail."""
    with pytest.raises(LidarcheckError) as caught:
        run_requests(external, requests or [Request(IDEAL, 1)])
    [line] = caught.value.lines()
    return line


def gone(pid: int) -> bool:
    """Whether a process is gone after a moment; it is killed where it is not."""
    for _ in range(200):
        state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()
        if not state or state.startswith("Z"):
            return True
        time.sleep(0.02)
    os.kill(pid, signal.SIGKILL)
    return False
