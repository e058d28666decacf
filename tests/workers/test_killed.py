"""A run that is killed with SIGKILL leaves nothing behind: no worker, no tracker, no external program, no pipe open."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

GONE_S = 5.0
POOL = """
import sys, time
from lidarcheck.workers import Processes
if __name__ == "__main__":
    with Processes(2) as pool:
        waiting = [pool.submit(time.sleep, 0), pool.submit(time.sleep, 600), pool.submit(time.sleep, 600)]
        waiting[0]()
        print("ready", flush=True)
        waiting[1]()
"""
IN_A_THREAD = """
import threading, time
from lidarcheck.workers import Processes
def work():
    with Processes(2) as pool:
        [wait() for wait in [pool.submit(time.sleep, 0), pool.submit(time.sleep, 0)]]
        print("ready", flush=True)
        pool.submit(time.sleep, 600)()
if __name__ == "__main__":
    threading.Thread(target=work, daemon=True).start()
    time.sleep(600)
"""
EXTERNAL = """
import sys
import time
from pathlib import Path
import numpy as np
from lidarcheck.model.external import run_external
from lidarcheck.model.spec import External
from lidarcheck.permissions import Permissions, grant
from lidarcheck.scan import IdealScan
grant(Permissions(trust=True))
column = np.zeros(1, np.int32)
ideal = IdealScan(layer=column, point=column, distance_m=np.ones(1), material_id=column, incidence_deg=np.zeros(1))
LAST
"""
SAID = "sleep 600 & echo $! > pids; echo $$ >> pids; wait"
PROGRAM = f'run_external(ideal, External(("sh", "-c", "{SAID}", "{{scan}}"), Path()), seed=1)'
SERVER = f'run_external(ideal, External(("sh", "-c", "{SAID}"), Path(), server=True), seed=1)'
MODULE = """
Path("own.py").write_text("import os, subprocess, time\\ndef simulate(ideal):\\n"
    "    child = subprocess.Popen(['sleep', '600']).pid\\n"
    "    open('pids', 'w').write(f'{child} {os.getpid()}')\\n    LASTLY\\n")
run_external(ideal, External((), Path().absolute(), module="own:simulate"), seed=1)
time.sleep(600)
"""
BUSY = MODULE.replace("LASTLY", "time.sleep(600)")
IDLE = MODULE.replace("LASTLY", "return {'Layer': [], 'Point': [], 'RANGE': []}")


def until(holds: Callable[[], object], seconds: float) -> bool:
    """Whether something holds before so much time is over."""
    end = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def there(group: int) -> list[int]:
    """The processes of a group that run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, of = stat.read_text().rpartition(")")[2].split()[:3]
        except (OSError, ValueError):
            continue
        if int(of) == group and state != "Z":
            found.append(int(stat.parent.name))
    return found


def runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[[str], subprocess.Popen[bytes]]]:
    """Starts a program in a group of its own, all of which is gone afterwards."""
    begun = []

    def start(program: str) -> subprocess.Popen[bytes]:
        (tmp_path / "program.py").write_text(program)
        begun.append(
            subprocess.Popen(
                [sys.executable, "program.py"],
                cwd=tmp_path,
                env={**os.environ, "TMPDIR": str(tmp_path)},
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
        )
        return begun[-1]

    yield start
    for process in begun:
        for pid in there(process.pid):
            os.kill(pid, signal.SIGKILL)
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system has no /proc")


@needs_proc
@pytest.mark.parametrize("program", [POOL, IN_A_THREAD], ids=["main", "thread"])
def test_workers_end_with_a_killed_run(
    program: str, started: Callable[[str], subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    run = started(program)
    assert run.stdout is not None
    assert run.stdout.readline() == b"ready\n"
    assert len(there(run.pid)) >= 3
    run.kill()
    run.wait()
    assert until(lambda: not there(run.pid), GONE_S)
    assert select.select([run.stdout], [], [], GONE_S)[0]
    assert run.stdout.read() == b""
    assert until(lambda: not list(tmp_path.glob("lidarcheck-workers-*")), GONE_S)


@needs_proc
@pytest.mark.parametrize("last", [PROGRAM, SERVER, BUSY, IDLE], ids=["program", "server", "module", "idle"])
def test_an_external_program_and_its_children_end_with_a_killed_run(
    last: str, started: Callable[[str], subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    run, pids = started(EXTERNAL.replace("LAST", last)), tmp_path / "pids"
    assert until(lambda: pids.is_file() and len(pids.read_text().split()) == 2, 30)
    told = [int(pid) for pid in pids.read_text().split()]
    assert all(runs(pid) for pid in told)
    assert list(tmp_path.glob("lidarcheck-*"))
    run.kill()
    run.wait()
    assert until(lambda: not any(runs(pid) for pid in told), GONE_S)
    assert until(lambda: not list(tmp_path.glob("lidarcheck-*")), GONE_S)
