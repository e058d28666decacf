"""Every action of the interface has a twin on the command line, or says why not; no key means two things."""

import pytest

from lidarcheck.cli import main
from lidarcheck.cli.core.app import COMMANDS
from lidarcheck.tui.actions import ACTIONS, SCREENS


@pytest.mark.parametrize("action", ACTIONS, ids=lambda action: f"{action.screen} {action.name}")
def test_every_action_has_a_twin_or_a_reason(action, capsys):
    assert action.screen in ("", *SCREENS)
    assert action.help
    assert bool(action.reason) != bool(action.twin)
    if action.twin:
        assert action.twin in {command.name for command in COMMANDS}
        assert main([*action.twin.split(), "--help"]) == 0
        text = " ".join(capsys.readouterr().out.split())
        assert action.says
        assert action.says in text


def test_no_key_means_two_things_on_a_screen():
    for screen in SCREENS:
        keys = [key for action in ACTIONS if action.screen in ("", screen) for key in action.keys]
        assert len(keys) == len(set(keys))
