"""docs/own-simulator.md runs as it stands."""

import json
import re
import shlex

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.formats import load_scan
from lidarcheck.model import load_model
from places import ROOT

PAGE = (ROOT / "docs/own-simulator.md").read_text(encoding="utf-8")
COMMANDS = [line.strip() for line in PAGE.splitlines() if line.startswith("    lidarcheck ")]


@pytest.fixture
def followed(tmp_path, monkeypatch, capsys):
    """Follows the page up to a command; what each command said."""
    monkeypatch.chdir(tmp_path)
    for name, text in re.findall(r"```(?:toml|python) (\S+)\n(.*?)```", PAGE, re.DOTALL):
        (tmp_path / name).write_text(text, encoding="utf-8")

    def follow(commands):
        said = []
        for command in commands:
            assert main(shlex.split(command)[1:]) == 0, (command, capsys.readouterr())
            said.append(capsys.readouterr().out)
        return said

    return follow


def test_the_page_can_be_followed_to_a_case(followed, tmp_path, capsys):
    assert [command.split()[1] for command in COMMANDS] == ["scene", *["simulate"] * 4, "compare", "explain"]
    assert main(shlex.split(COMMANDS[0])[1:]) == 0
    assert main([*shlex.split(COMMANDS[1])[1:-1]]) == 2  # without --trust
    assert "runs a program that you do not trust: my_model:simulate in " in capsys.readouterr().err
    followed(COMMANDS[1:6])
    sensor = load_model(tmp_path / "model.toml").sensor
    frame, measured = (load_scan(tmp_path / name, sensor=sensor) for name in ("frame.csv", "measured_1.txt"))
    assert len(frame) > 2000
    near = [scan.feature("INTENSITY")[scan.range_m < 15.0] for scan in (frame, measured)]
    assert np.mean(near[1]) / np.mean(near[0]) == pytest.approx(0.8, abs=0.02)
    key = {(a, b): r for a, b, r in zip(frame.layer.tolist(), frame.point.tolist(), frame.range_m, strict=True)}
    pairs = zip(measured.layer.tolist(), measured.point.tolist(), measured.range_m, strict=True)
    apart = [r - key[a, b] for a, b, r in pairs if (a, b) in key]
    assert np.median(apart) == pytest.approx(0.08, abs=0.003)


@pytest.mark.long
def test_explain_names_what_the_page_hides(followed, tmp_path):
    followed(COMMANDS)
    report = json.loads((tmp_path / "found/report.json").read_text())
    assert {one["name"] for one in report["effects"]} == {"signal_gain", "range_offset"}
    assert load_model(tmp_path / "found/model.toml").external is not None
