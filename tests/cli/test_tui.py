"""The command `lidarcheck tui`: what it refuses before it draws, and what its help loads."""

import json
import subprocess
import sys

import pytest

from lidarcheck.cli import main


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "the terminal interface needs a terminal, and stdin is none; run it in a terminal without pipes"),
        (["nowhere"], "nowhere: there is no such directory; give the directory with scenarios"),
    ],
)
def test_without_a_terminal_it_says_so(arguments, said, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(["tui", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("term", ["dumb", ""])
def test_a_terminal_that_cannot_place_text_is_refused(term, capsys, monkeypatch, tmp_path):
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(getattr(sys, name), "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", term)
    assert main(["tui", str(tmp_path)]) == 2
    assert "cannot place text; set TERM" in capsys.readouterr().err


def test_help_loads_no_textual():
    program = "import sys\nfrom lidarcheck.cli import main\nmain(['--help']); main(['tui', '--help'])\n"
    program += "print([name for name in sys.modules if name.startswith('textual')], file=sys.stderr)"
    ran = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert json.loads(ran.stderr.replace("'", '"')) == []
