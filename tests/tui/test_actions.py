"""Every action has a twin on the command line, or says why not; a key means one thing; no line is cut in a word."""

import pytest

from lidarcheck.cli import main
from lidarcheck.cli.core.app import COMMANDS
from lidarcheck.tui.actions import ACTIONS, SCREENS, actions_of, key_name, plot_actions
from lidarcheck.tui.entries import entry_at, key_entries, line_of, tab_entries
from lidarcheck.tui.help import help_lines
from lidarcheck.tui.palette import Menu, Palette


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


def meanings(actions):
    """Each key with the names of all that it does."""
    found = {}
    for action in actions:
        for key in action.keys:
            found.setdefault(key, set()).add(action.name)
    return found


def test_a_key_means_one_thing_on_every_screen():
    assert {key: names for key, names in meanings(ACTIONS).items() if len(names) > 1} == {}
    for screen in SCREENS:
        keys = [key for action in actions_of(screen) for key in action.keys]
        assert len(keys) == len(set(keys))


def test_a_plots_keys_are_its_own_and_none_of_those_that_are_everywhere():
    plot = plot_actions()
    assert all(len(names) == 1 for names in meanings(plot).values())
    assert not set(meanings(plot)) & set(meanings(action for action in ACTIONS if not action.screen))
    keys = [key for action in actions_of("blooming", "plot") for key in action.keys]
    assert len(keys) == len(set(keys))


def test_a_digit_belongs_to_the_pane_that_has_the_focus():
    typed_in = [action for action in ACTIONS if action.screen in ("", "blooming")]
    assert not {key for key in meanings(typed_in) if key.isdigit()}


@pytest.mark.parametrize("screen", SCREENS)
def test_every_key_is_in_footer_menu_or_help_and_in_the_palette(screen):
    for pane in ("", "plot"):
        able = actions_of(screen, pane)
        assert all(action.method or action.name == "move" for action in able)
        named = "".join("".join(text for text, _ in parts) for parts in help_lines("", screen, 100, pane))
        assert all(key_name(key) in named for action in able for key in action.keys)
        listed = {key for action in Palette(able).items for key in action.keys}
        assert listed == {key for action in Menu("", able).items for key in action.keys}
        assert listed == {key for action in able if action.method for key in action.keys}


@pytest.mark.parametrize("width", [20, 40, 79, 80, 120, 200])
@pytest.mark.parametrize("screen", SCREENS)
def test_the_first_and_the_last_line_are_of_whole_entries(screen, width):
    for pane in ("", "plot"):
        text = "".join(text for text, _ in line_of(key_entries(actions_of(screen, pane), width)))
        assert len(text) <= width
        if width >= 24:
            assert text.endswith("? Help  ^P Find  q Quit")
            assert len(text) == width
        whole = {action.short if " " in action.short else f"{key_name(action.keys[0])} {action.short}"
                 for action in actions_of(screen, pane) if action.short and action.keys}  # fmt: skip
        assert {part.strip() for part in text.split("  ")} - {""} <= whole
    for running in ((), ("noise",), tuple(SCREENS)):
        for how in ((False, False), (True, False), (False, True), (True, True)):
            tabs = tab_entries(screen, running, width, bracketed=how[0], labelled=how[1])
            text = "".join(text for text, _ in line_of(tabs))
            assert len(text) <= width
            assert all(text[tab.start : tab.end] == tab.text for tab in tabs)
            if width >= 40:
                assert len(tabs) == len(SCREENS)
                assert text.count("~") == len(running)
                assert ("[" in text) == how[0]


def test_a_click_finds_the_entry_that_is_under_it():
    entries = key_entries(actions_of("overview"), 80)
    assert entry_at(entries, 80 - len("q Quit")).action.name == "quit"
    for entry in entries:
        assert key_name(entry.action.keys[0])[0] in entry.text.split()[0]
    assert entry_at(entries, 0) is entries[0]
    assert entry_at(entries, entries[0].end) is None
