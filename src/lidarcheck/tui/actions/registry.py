"""Every screen and every action of the interface: name, keys, help, method and its twin on the command line.

Bars, command palette, F1 and key bindings are made from these tables alone, and a test holds that each twin exists.
"""

from __future__ import annotations

from typing import NamedTuple

from lidarcheck.tui.actions.action import ALONE, PLACE, Action
from lidarcheck.tui.actions.blooming import BLOOMING
from lidarcheck.tui.actions.explain import EXPLAIN
from lidarcheck.tui.actions.ghosts import GHOSTS
from lidarcheck.tui.actions.goldens import GOLDENS
from lidarcheck.tui.actions.histograms import HISTOGRAMS
from lidarcheck.tui.actions.noise import NOISE
from lidarcheck.tui.actions.overview import OVERVIEW
from lidarcheck.tui.actions.scenes import SCENES

__all__ = ["ACTIONS", "SCREENS", "Action", "Place", "actions_of"]


class Place(NamedTuple):
    """A screen: its key, the letter to jump to it by, its word in the bar, help, and its twin as of an `Action`."""

    title: str
    key: str
    label: str
    short: str
    help: str
    twin: str
    says: str


SCREENS = {
    "overview": Place("Overview", "f2", "O", "Overview", "scenarios, verdicts and KPIs", "check", "goldens"),
    "histograms": Place(
        "Histograms", "f3", "H", "Hist", "vehicles, real against simulated", "vehicles compare", "distances"
    ),
    "noise": Place("Noise", "f4", "N", "Noise", "range noise, detection and walk on panels", "panels", "panels"),
    "blooming": Place("Blooming", "f5", "B", "Bloom", "blooming tables and profiles", "bloom show", "profiles"),
    "ghosts": Place("Ghosts", "f6", "G", "Ghosts", "signs and their ghosts, step by step", "ghosts find", "ghosts"),
    "scenes": Place(
        "Scenes", "f7", "S", "Scenes", "whole frames, measured and simulated", "scenes compare", "measured"
    ),
    "explain": Place("Explain", "f8", "E", "Explain", "which effect a model lacks", "explain", "model"),
    "goldens": Place("Goldens", "f9", "D", "Goldens", "what is proposed for the goldens", "review", "goldens"),
}
"""The screens by their names, in the order of their keys."""

_SHOWN = tuple(
    Action(name, "", (place.key,), place.short, place.help, f"show('{name}')", place.twin, place.says)
    for name, place in SCREENS.items()
)

_EVERYWHERE: tuple[Action, ...] = (
    Action("help", "", ("f1",), "Help", "help for what has the focus", "help", "", "--help", ALONE),
    Action("palette", "", ("ctrl+p", "f10"), "Find", "find any action by its name", "palette", reason=PLACE),
    Action("jump", "", ("g",), "", "go to a screen or a pane by its label", "jump", reason=PLACE),
    Action("log", "", ("L",), "Log", "show or hide the log", "log", reason=PLACE),
    Action("theme", "", ("T",), "", "next theme: dark, light, high contrast, plain", "theme", "tui", "--theme"),
    Action("copy", "", ("c",), "", "copy the pane to the terminal's clipboard (OSC 52)", "copy", reason="a shell copies its own output"),
    Action("write", "", ("w",), "", "write the pane's text to a file", "write", reason="a shell writes to a file with >"),
    Action("next pane", "", ("tab",), "", "the next pane", "next_pane(1)", reason=PLACE),
    Action("previous pane", "", ("shift+tab",), "", "the pane before", "next_pane(-1)", reason=PLACE),
    Action("quit", "", ("q", "ctrl+q"), "Quit", "leave; what is not saved is kept and offered again", "leave", reason=ALONE),
)  # fmt: skip

ACTIONS: tuple[Action, ...] = (
    *_SHOWN, *_EVERYWHERE, *OVERVIEW, *HISTOGRAMS, *NOISE, *BLOOMING, *GHOSTS, *SCENES, *EXPLAIN, *GOLDENS,
)  # fmt: skip


def actions_of(screen: str) -> list[Action]:
    """What can be done on a screen: its own actions first, then those that are everywhere."""
    own = [a for a in ACTIONS if a.screen == screen and screen]
    return own + [a for a in ACTIONS if not a.screen]
