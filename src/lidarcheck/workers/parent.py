"""The process that started a worker: when it is gone, however it ended, nobody waits for the worker any more."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import threading
from multiprocessing.connection import wait

__all__ = ["end_with_parent"]


def end_with_parent(directory: str = "") -> None:
    """Let this process end with the one that started it, which can be killed before it ends its workers.

    `directory`: what that one would have removed. A pipe that only the parent holds open tells, from the first moment
    on: the kernel's own signal (PR_SET_PDEATHSIG) comes when the *thread* ends that started the worker.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_watch, args=(parent.sentinel, directory), name="parent", daemon=True).start()


def _watch(sentinel: int, directory: str) -> None:
    wait([sentinel])
    if directory:
        shutil.rmtree(directory, ignore_errors=True)
    os.kill(os.getpid(), signal.SIGKILL)
