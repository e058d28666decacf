"""Real processes and real faults: signals in the middle of the work, streams that are not there."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scenario_texts import kpis, surface

pytestmark = pytest.mark.usefixtures("trusting")

ROOT = Path(__file__).resolve().parents[3]
COMMAND = [sys.executable, "-m", "lidarcheck"]
SLOW = """
description = "an external model that takes its time"
[model.external]
command = ["bash", "-c", "echo $$ >> pids; sleep 300 & sleep 300; :", "{scan}"]
"""
SLOW += surface((200, 201), (0, 9), (20.0, 21.0)) + kpis(echoes_per_beam=0.1)


def wait_for(condition: object, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)


def alive(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize(("told", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_check_and_its_external_models(told: signal.Signals, code: int, tmp_path: Path) -> None:
    scenarios = tmp_path / "scenarios"
    scenarios.mkdir()
    (scenarios / "slow.toml").write_text(SLOW)
    process = subprocess.Popen(
        [*COMMAND, "check"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A background job of a shell inherits that SIGINT is ignored, and the tests may be one.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    pids = scenarios / "pids"
    try:
        wait_for(lambda: pids.exists() and pids.read_text().endswith("\n"))
        process.send_signal(told)
        _, errors = process.communicate(timeout=20)
    finally:
        process.kill()
        process.communicate()
    assert (process.returncode, errors) == (code, "")
    groups = [int(line) for line in pids.read_text().split()]
    wait_for(lambda: not any(alive(group) for group in groups))


BETWEEN = """
import pathlib, sys, time
from concurrent.futures import ThreadPoolExecutor
begin = ThreadPoolExecutor.submit
def interrupted(self, *arguments):
    begin(self, *arguments)
    while not pathlib.Path("scenarios/pids").exists():
        time.sleep(0.02)
    raise KeyboardInterrupt
ThreadPoolExecutor.submit = interrupted
from lidarcheck.cli import main
sys.argv = ["lidarcheck", "check"]
sys.exit(main())
"""


def test_an_interrupt_between_beginning_a_task_and_keeping_its_future_ends_the_check(tmp_path: Path) -> None:
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "slow.toml").write_text(SLOW)
    ended = subprocess.run(
        [sys.executable, "-c", BETWEEN], cwd=tmp_path, capture_output=True, text=True, timeout=40, check=False
    )
    assert (ended.returncode, ended.stderr) == (130, "")


def test_a_signal_while_writing_leaves_nothing(tmp_path: Path) -> None:
    source, target = tmp_path / "big.txt", tmp_path / "big.pcd"
    row = "24.34180069 -8.17420006 0.79573798 331 295 1 39 6007 236\n"
    source.write_text("//X Y Z Point Layer EchoNumber WIDTH AREA PEAK\n" + row * 400_000)
    process = subprocess.Popen([*COMMAND, "convert", str(source), str(tmp_path / "big.laz")], stderr=subprocess.PIPE)
    wait_for(lambda: list(tmp_path.glob(".*.part")) or process.poll() is not None)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=30)
    assert process.returncode in (0, 143)
    assert not list(tmp_path.glob(".*.part"))
    assert not target.exists()


@pytest.mark.parametrize("closed", [(1,), (2,), (0, 1, 2)])
def test_missing_streams_are_no_failure(closed: tuple[int, ...]) -> None:
    shut = " ".join(f"{stream}{'<' if stream == 0 else '>'}&-" for stream in closed)
    example = ROOT / "examples" / "wall_ideal.txt"
    run = subprocess.run(
        ["sh", "-c", f'"$0" -m lidarcheck info "$1" {shut}', sys.executable, str(example)], check=False
    )
    assert run.returncode == 0


@pytest.mark.long
def test_a_cache_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    example, model = ROOT / "examples" / "wall_ideal.txt", ROOT / "scenarios" / "models" / "SMART.toml"
    arguments = ["simulate", str(example), "--model", str(model), "--out", str(tmp_path / "o.txt")]
    environment = {**os.environ, "LIDARCHECK_CACHE": os.devnull, "TMPDIR": str(tmp_path)}
    run = subprocess.run([*COMMAND, *arguments], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0
    assert "cannot be written: kernels are compiled anew in each run; set LIDARCHECK_CACHE" in run.stderr
    assert not list(tmp_path.glob("lidarcheck-*")), "the kernels are gone with the process"


IN_CALLBACK = """
import ctypes, os, signal, sys, time
from lidarcheck.cli.core import entry
def lost():
    os.kill(os.getpid(), getattr(signal, sys.argv[1]))
    return 0
def command(_argv):
    callback = ctypes.CFUNCTYPE(ctypes.c_int)(lost)
    callback()
    time.sleep(20)
    return 0
entry._run = command
sys.exit(entry.main())
"""

AMID_COMPILING = """
import os, signal, sys
from llvmlite.binding import executionengine
told, old, calls = getattr(signal, sys.argv.pop(1)), executionengine.ExecutionEngine._find_module_ptr, []
def asked(self, module):
    calls.append(module)
    if len(calls) == 3:
        os.kill(os.getpid(), told)
    return old(self, module)
executionengine.ExecutionEngine._find_module_ptr = asked
from lidarcheck.cli import main
sys.exit(main())
"""


@pytest.mark.parametrize(("told", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_signal_that_a_callback_swallows_still_ends_the_command(told: str, code: int) -> None:
    run = subprocess.run(
        [sys.executable, "-c", IN_CALLBACK, told],
        capture_output=True,
        text=True,
        timeout=15,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert (run.returncode, run.stdout, run.stderr) == (code, "", "")


@pytest.mark.long
@pytest.mark.parametrize(("told", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_signal_while_kernels_compile_for_the_first_time_ends_the_command(
    told: str, code: int, tmp_path: Path
) -> None:
    ideal, model = ROOT / "examples" / "wall_ideal.txt", ROOT / "scenarios" / "models" / "SMART.toml"
    arguments = ["simulate", str(ideal), "--model", str(model), "--out", str(tmp_path / "out.txt"), "-q"]
    run = subprocess.run(
        [sys.executable, "-c", AMID_COMPILING, told, *arguments],
        env={**os.environ, "LIDARCHECK_CACHE": str(tmp_path / "cold")},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert (run.returncode, run.stdout, run.stderr) == (code, "", "")
    assert [path.name for path in tmp_path.iterdir()] == ["cold"]
