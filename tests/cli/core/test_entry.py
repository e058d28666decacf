"""Exit codes and lines: what the command line makes of whatever happens."""

import errno
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lidarcheck import __version__
from lidarcheck.cli import main
from lidarcheck.cli.core.app import COMMANDS
from lidarcheck.cli.core.calibration_commands import GROUPS
from lidarcheck.errors import ConfigError, InputError


@pytest.fixture
def failing(monkeypatch):
    """Make `info` raise, or do, what a test gives it."""

    def install(action):
        def info(file: Path, /, *, quiet: bool = False) -> int:
            from lidarcheck.cli.core.terminal import hush

            hush(quiet)
            if isinstance(action, BaseException):
                raise action
            action()
            return 0

        monkeypatch.setattr("lidarcheck.cli.scans.info.info", info)

    return install


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"{__version__}\n"


@pytest.mark.parametrize("argv", [[], ["--help"], ["-h"]])
def test_help_names_every_command(argv, capsys):
    assert main(argv) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for command in COMMANDS:
        expected = (
            f"  {command.group}: {GROUPS[command.group]}" if command.group else f"  {command.name}: {command.summary}"
        )
        assert expected in out


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_names_its_commands(group, capsys):
    assert main([group, "--help"]) == 0
    out = capsys.readouterr().out
    for command in COMMANDS:
        if command.group == group:
            assert f"  {command.verb}: {command.summary}" in out


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.name)
def test_every_command_teaches_by_example(command, capsys):
    assert main([*command.name.split(), "--help"]) == 0
    out = capsys.readouterr().out
    for example in command.examples:
        assert f"  {example}" in out
    assert "--quiet" in out


WRONG_LINES = {
    "simulat": "there is no command simulat; did you mean simulate?",
    "--verson": "there is no option --verson; did you mean --version?",
    "frobnicate": "there is no command frobnicate; see lidarcheck --help",
    "simulate": "lidarcheck simulate needs IDEAL; see lidarcheck simulate --help",
    "simulate a --out b.txt": "lidarcheck simulate needs --model; see lidarcheck simulate --help",
    "simulate a --model": "--model needs a value; see lidarcheck simulate --help",
    "simulate a --model b --out c.txt --sed 3": "lidarcheck simulate has no option --sed; did you mean --seed?",
    "convert a b c": "lidarcheck convert has no use for 'c'; see lidarcheck convert --help",
    "simulate a --model b --model c --out d.txt": "--model is given more than once; give it once",
    "compare a": "lidarcheck compare needs SIMULATED; see lidarcheck compare --help",
    "compare a b --json": "--json needs a value; see lidarcheck compare --help",
    "info": "lidarcheck info needs FILE; see lidarcheck info --help",
    "check --jobs 0": "--jobs 0 is out of range; use a whole number from 1 to 1024",
    "check --jobs 00001025": "--jobs 00001025 is out of range; use a whole number from 1 to 1024",
    "bench --quick=maybe": "",
    "--install-completion --shell tcsh": "",
}


@pytest.mark.parametrize(("line", "says"), WRONG_LINES.items())
def test_a_wrong_line_is_one_line(line, says, capsys):
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    assert err == f"error: {says}\n" or not says


@pytest.mark.parametrize(
    "seed", ["-1", "x", "1.0", "", "0x1", "1_0", "18446744073709551616", "0" * 30 + "9" * 30, "9" * 400, "²", "nan"]
)
@pytest.mark.parametrize("command", ["simulate a --model m.toml --out s.txt", "check"])
def test_a_seed_out_of_range(seed, command, capsys):
    assert main([*command.split(), f"--seed={seed}"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "0 to 18446744073709551615" in err or "needs a value" in err


def test_an_error_of_the_package_is_a_line_per_fault(failing, capsys):
    faults = [InputError("bad", file="m.toml", line=3, fix="fix it"), InputError("worse", file="m.toml", line=9)]
    failing(ConfigError(faults))
    assert main(["info", "x"]) == 2
    out, err = capsys.readouterr()
    assert (out, err) == ("", "error: m.toml:3: bad; fix it\nerror: m.toml:9: worse\n")


def test_a_bug_is_one_line_without_a_traceback(failing, capsys, monkeypatch):
    monkeypatch.delenv("LIDARCHECK_DEBUG", raising=False)
    failing(ZeroDivisionError("division\nby zero"))
    assert main(["info", "x"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.startswith("error: internal error, ZeroDivisionError: division by zero; please report it")


def test_a_bug_with_debug_shows_its_traceback(failing, capsys, monkeypatch):
    monkeypatch.setenv("LIDARCHECK_DEBUG", "1")
    failing(ZeroDivisionError())
    assert main(["info", "x"]) == 2
    assert "Traceback" in capsys.readouterr().err


FULL = OSError(errno.ENOSPC, "No space left on device")
SYSTEM = [
    (KeyboardInterrupt(), 130, ""),
    (BrokenPipeError(errno.EPIPE, "Broken pipe"), 141, ""),
    (MemoryError(), 2, "error: there is not enough memory for this; use smaller input, or fewer --jobs\n"),
    (FULL, 2, "error: no space left on device; free some space, then run it again\n"),
    (
        PermissionError(errno.EACCES, "Permission denied", "f"),
        2,
        "error: f: permission denied; check its permissions\n",
    ),
]


@pytest.mark.parametrize(("raised", "code", "says"), SYSTEM)
def test_what_the_system_does(failing, raised, code, says, capfd):
    failing(raised)
    out = os.dup(1)
    try:
        assert main(["info", "x"]) == code
    finally:
        os.dup2(out, 1)
        os.close(out)
    assert capfd.readouterr().err == says


@pytest.mark.parametrize(("argv", "says"), [([], "warning: no WIDTH\n"), (["--quiet"], "")])
def test_warnings_of_the_package_go_to_standard_error_once(failing, argv, says, capsys):
    def warn():
        for _ in range(2):
            logging.getLogger("lidarcheck.formats.scans").warning("no %s", "WIDTH")

    failing(warn)
    assert main(["info", "x", *argv]) == 0
    assert capsys.readouterr() == ("", says)


def test_control_characters_of_a_file_cannot_reach_the_terminal(failing, capsys):
    failing(InputError("found '\x1b[2J'", file="a\rb"))
    assert main(["info", "x"]) == 2
    err = capsys.readouterr().err
    assert "\x1b" not in err
    assert "\r" not in err
    assert "\\x1b[2J" in err


def lidarcheck(*arguments, **options):
    return subprocess.run([sys.executable, "-m", "lidarcheck", *arguments], check=False, text=True, **options)


def test_the_process_ends_with_the_code_and_no_output_of_its_own():
    ran = lidarcheck("simulat", capture_output=True)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr == "error: there is no command simulat; did you mean simulate?\n"


def test_a_reader_that_leaves_is_no_error():
    read, write = os.pipe()
    os.close(read)
    ran = lidarcheck("--help", stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (ran.returncode, ran.stderr) == (141, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_standard_output_that_is_full():
    with Path("/dev/full").open("w") as full:
        ran = lidarcheck("--version", stdout=full, stderr=subprocess.PIPE)
    assert ran.returncode == 2
    assert ran.stderr == "error: no space left on device; free some space, then run it again\n"
