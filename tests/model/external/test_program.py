import dataclasses
import signal
import stat
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from external_kit import IDEAL, gone, refusal
from lidarcheck.errors import ExternalModelError, UsageError
from lidarcheck.model.external import Request, check_command, run_external, run_requests
from lidarcheck.model.spec import External

pytestmark = pytest.mark.usefixtures("trusting")

POSTPRO = """\
import sys
ideal, ini, scan, seed = sys.argv[1:]
gain = float(open(ini).read().split("=")[1])
lines = open(ideal).read().splitlines()
names = lines[0].lstrip("/").split()
out = ["X Y Z Point Layer EchoNumber WIDTH AREA PEAK"]
for line in lines[1:]:
    row = dict(zip(names, line.split()))
    if len(row) > 2 and float(row["Distance"]) > 0:
        out.append(f"{row['Distance']} 0 0 {row['Point']} {row['Layer']} 1 9 {gain} {seed}")
open(scan, "w").write("\\n".join(out) + "\\n")
print("not data", flush=True)
print("a warning", file=sys.stderr)
"""


def python(tmp_path: Path, source: str, *arguments: str, timeout_s: float = 20.0) -> External:
    (tmp_path / "model.py").write_text(source)
    return External((sys.executable, "-S", "model.py", *arguments), tmp_path, timeout_s=timeout_s)


def test_an_external_model_simulates(tmp_path: Path, scratch: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a b.ini").write_text("gain = 12.5")
    external = python(tmp_path, POSTPRO, "{ideal}", "{ini}", "{scan}", "{seed}")
    external = External(external.command, tmp_path, tmp_path / "a b.ini")
    scan = run_external(IDEAL, external, seed=77)
    assert scan.layer.tolist() == [10, 12]
    assert scan.point.tolist() == [5, 7]
    assert scan.range_m.tolist() == [20.0, 33.5]
    assert scan.area.tolist() == [12.5, 12.5]
    assert scan.peak.tolist() == [77.0, 77.0]
    assert capfd.readouterr() == ("", "")
    assert list(scratch.iterdir()) == []


def test_a_program_beside_the_model_file(tmp_path: Path) -> None:
    script = tmp_path / "postpro"
    script.write_text('#!/bin/sh\necho "X Y Z EchoNumber" > "$2"; echo "1 2 3 1" >> "$2"; test "$1" = "{x}"\n')
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    scan = run_external(IDEAL, External(("./postpro", "{{x}}", "{scan}"), tmp_path), seed=0)
    assert (scan.x_m[0], scan.y_m[0], scan.z_m[0]) == (1.0, 2.0, 3.0)
    line = refusal(External(("postpro", "{scan}"), tmp_path))
    assert line == (
        "error: the external model postpro '{scan}' cannot be started: No such file or directory; "
        "write ./postpro for the file beside the model"
    )


def test_exit_code_and_last_words(tmp_path: Path, scratch: Path) -> None:
    source = "import sys; sys.stderr.write('first\\nlast \\x1b[31mwords\\n\\n'); sys.exit(3)"
    line = refusal(python(tmp_path, source, "{ideal}", "{scan}"))
    assert line.startswith("error: the external model ")
    assert "model.py '{ideal}' '{scan}' ended with exit code 3 (it said: \"last  [31mwords\"); run the command" in line
    assert list(scratch.iterdir()) == []


def test_a_signal(tmp_path: Path) -> None:
    line = refusal(python(tmp_path, "import os; os.kill(os.getpid(), 9)", "{scan}"))
    assert "was killed by SIGKILL; run the command by hand" in line


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("pass", "wrote no scan; let it write its echoes to {scan}"),
        ("import sys; open(sys.argv[1], 'w')", "wrote an empty scan; let it"),
        ("import sys; open(sys.argv[1], 'w').write('X Y Z\\n1 2\\n')", "wrote a malformed scan: "),
        ("import sys; open(sys.argv[1], 'wb').write(bytes(range(256)))", "wrote a malformed scan: "),
        ("import sys, os; os.mkdir(sys.argv[1])", "wrote "),
    ],
)
def test_no_usable_scan(tmp_path: Path, scratch: Path, source: str, what: str) -> None:
    assert what in refusal(python(tmp_path, source, "{scan}"))
    assert list(scratch.iterdir()) == []


def test_what_cannot_be_started(tmp_path: Path) -> None:
    assert "cannot be started: No such file" in refusal(External(("./none", "{scan}"), tmp_path))
    (tmp_path / "plain").write_text("x")
    assert "cannot be started: Permission denied" in refusal(External(("./plain", "{scan}"), tmp_path))
    assert "there is no directory" in refusal(External(("true", "{scan}"), tmp_path / "gone"))


GRANDCHILD = """\
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(60)"])
open("pid", "w").write(str(child.pid))
print("waiting", file=sys.stderr, flush=True)
time.sleep(60)
"""


def test_a_timeout_kills_the_model_and_all_that_it_started(tmp_path: Path, scratch: Path) -> None:
    started = time.monotonic()
    line = refusal(python(tmp_path, GRANDCHILD, "{scan}", timeout_s=1.0))
    assert time.monotonic() - started < 10
    assert 'took longer than 1 s (it said: "waiting"); raise timeout_s or make it faster' in line
    assert gone(int((tmp_path / "pid").read_text()))
    assert list(scratch.iterdir()) == []


def test_an_interrupt_kills_the_model_and_all_that_it_started(tmp_path: Path, scratch: Path) -> None:
    def interrupt() -> None:
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
            time.sleep(0.02)
        signal.raise_signal(signal.SIGINT)

    external = python(tmp_path, GRANDCHILD, "{scan}")
    thread = threading.Thread(target=interrupt)
    # A shell starts its background jobs deaf to the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            run_external(IDEAL, external, seed=0)
    finally:
        signal.signal(signal.SIGINT, before)
    thread.join()
    assert gone(int((tmp_path / "pid").read_text()))
    assert list(scratch.iterdir()) == []


def test_a_program_that_moves_into_a_session_of_its_own_still_ends(tmp_path: Path) -> None:
    source = "import os, time; os.setpgid(0, 0) if os.getpgid(0) != os.getpid() else None; time.sleep(60)"
    assert "took longer than 0.5 s" in refusal(python(tmp_path, source, "{scan}", timeout_s=0.5))


def test_placeholders_are_checked(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"unknown placeholder {scna}; did you mean {scan}\?"):
        run_external(IDEAL, External(("a", "{scna}"), tmp_path), seed=0)
    assert check_command(("a", "x{ideal}y{scan}", "{{}}")) == []
    assert [index for index, _ in check_command(("", "{scan"))] == [0, 1]
    [(_, fault)] = check_command(("a", "{s\tan}"))
    assert str(fault).isprintable()


def test_without_a_temporary_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    assert "there is no temporary directory" in refusal(External(("true", "{scan}"), tmp_path))


def test_an_ideal_scan_that_cannot_be_written_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", refuse)
    line = refusal(External(("true", "{scan}"), tmp_path))
    assert "cannot be given its ideal scan: No space left on device; free some space, or set TMPDIR" in line


def test_the_frame_and_own_parameters_stand_in_the_command(tmp_path: Path) -> None:
    source = "import sys; open(sys.argv[2], 'w').write(f'X Y Z Layer Point\\n{sys.argv[1]} 0 0 1 1\\n')"
    external = python(tmp_path, source, "{frame}{gain}", "{scan}")
    gains = {"gain": 0.25}
    first, other = run_requests(
        external, [Request(IDEAL, frame=3, parameters=gains), Request(IDEAL, frame=4, parameters=gains)]
    )
    assert (first.x_m.tolist(), other.x_m.tolist()) == ([30.25], [40.25])


def test_own_parameters_without_a_place_in_the_command_are_keys_of_the_settings(tmp_path: Path) -> None:
    source = (
        "import sys; open(sys.argv[2], 'w').write(f'X Y Z Layer Point\\n{len(open(sys.argv[1]).read())} 0 0 1 1\\n')"
    )
    settings = tmp_path / "s.ini"
    settings.write_text("Gain = 1 ; as measured\nOther.Gain = 2\n")
    external = dataclasses.replace(python(tmp_path, source, "{ini}", "{scan}"), ini=settings)
    [scan] = run_requests(external, [Request(IDEAL, parameters={"gain": 123456.5})])
    assert scan.x_m.tolist() == [len("Gain = 123456.5; as measured\nOther.Gain = 2\n")]
    assert settings.read_text().startswith("Gain = 1 ;")
    with pytest.raises(UsageError, match=r"the parameter loss is no key of .*s.ini"):
        run_requests(external, [Request(IDEAL, parameters={"loss": 1.0})])


def test_only_the_columns_that_are_asked_for_are_sent(tmp_path: Path) -> None:
    source = "import sys; sys.exit(open(sys.argv[1]).readline().strip())"
    ideal = dataclasses.replace(IDEAL, share=np.ones(3), extra={"Background": np.ones(3), "Other": np.ones(3)})
    external = python(tmp_path, source, "{ideal}", "{scan}")
    with pytest.raises(
        ExternalModelError, match=r"said: \"//Layer Point Distance MaterialID IncidenceAngle Background\""
    ):
        run_requests(external, [Request(ideal, columns=("Background",))])


SLEEPER = """\
import sys, time
from pathlib import Path
seed = sys.argv[1]
Path("begun" + seed).touch()
if seed == "0":
    while not Path("begun1").exists():
        time.sleep(0.01)
    sys.exit("out of luck")
time.sleep(60)
"""


def test_runs_beside_one_that_failed_are_ended(tmp_path: Path, scratch: Path) -> None:
    external = python(tmp_path, SLEEPER, "{seed}", "{scan}")
    started = time.monotonic()
    with pytest.raises(ExternalModelError, match="out of luck"):
        run_requests(external, [Request(IDEAL, seed) for seed in range(4)], jobs=2)
    assert time.monotonic() - started < 30
    assert list(scratch.iterdir()) == []


def test_without_an_ini_the_command_gets_one_with_the_seed(tmp_path: Path) -> None:
    source = (
        "import sys; open(sys.argv[2], 'w').write(f'X Y Z Layer Point\\n{len(open(sys.argv[1]).read())} 0 0 1 1\\n')"
    )
    scan = run_external(IDEAL, python(tmp_path, source, "{ini}", "{scan}"), seed=123)
    assert scan.x_m.tolist() == [len("PostPro.Seed = 123\n")]
