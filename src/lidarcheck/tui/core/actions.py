"""Every action of the interface: name, key, help, method and its twin on the command line.

Footer, command palette, F1 and key bindings are made from this table alone, and a test holds that each twin exists.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ACTIONS", "SCREENS", "Action", "actions_of"]

SCREENS = {"overview": "Overview", "blooming": "Blooming"}
"""The screens' names, and their titles."""


class Action(NamedTuple):
    """`screen`: where it is, empty for everywhere. `keys`: the first is the one that is shown.

    `short`: one word for the footer, empty for none there. `method`: of the app or the screen, without `action_`.
    `twin`: the command that does the same, and `says`, a word of its help that shows so; or `reason`, why there is none.
    """

    name: str
    screen: str
    keys: tuple[str, ...]
    short: str
    help: str
    method: str
    twin: str = ""
    says: str = ""
    reason: str = ""


_SCREEN = "which part of the interface is seen is not a matter of the command line"
_MOVE = "moves what is pointed at; commands are given rows and names"
_ALONE = "belongs to the interface alone"

ACTIONS: tuple[Action, ...] = (
    Action("help", "", ("f1",), "Help", "help for what has the focus", "help", "", "--help", _ALONE),
    Action("overview", "", ("f2",), "Overview", "scenarios, verdicts and KPIs", "show('overview')", "check", "goldens"),
    Action("blooming", "", ("f3",), "Blooming", "blooming tables and profiles", "show('blooming')", "bloom show", "profiles"),
    Action("palette", "", ("f4", "ctrl+p"), "Find", "find any action by its name", "palette", reason=_SCREEN),
    Action("jump", "", ("g",), "", "go to a screen or a pane by its label", "jump", reason=_SCREEN),
    Action("log", "", ("f9",), "Log", "show or hide the log", "log", reason=_SCREEN),
    Action("theme", "", ("f8",), "", "next theme: dark, light, high contrast, plain", "theme", "tui", "--theme"),
    Action("copy", "", ("c",), "", "copy the pane to the terminal's clipboard (OSC 52)", "copy", reason="a shell copies its own output"),
    Action("write", "", ("w",), "", "write the pane's text to a file", "write", reason="a shell writes to a file with >"),
    Action("next pane", "", ("tab",), "", "the next pane", "next_pane(1)", reason=_SCREEN),
    Action("previous pane", "", ("shift+tab",), "", "the pane before", "next_pane(-1)", reason=_SCREEN),
    Action("quit", "", ("q", "ctrl+q"), "Quit", "leave; what is not saved is kept and offered again", "leave", reason=_ALONE),
    Action("run", "overview", ("r", "enter"), "Run", "run the scenario under the cursor", "run_one", "check", "SCENARIO"),
    Action("run all", "overview", ("a",), "All", "run all scenarios", "run_all", "check", "all by default"),
    Action("cancel", "overview", ("escape", "x"), "Stop", "stop the run", "stop", reason="Ctrl+C stops a command"),
    Action("only fallen", "overview", ("f",), "Fallen", "show only what fell out or has a fault", "only_fallen", "check", "fell out"),
    Action("look again", "overview", ("l",), "", "look at the project's files again", "look_again", "info", "what is in it"),
    Action("move", "blooming", ("up", "down"), "", "the row above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("type", "blooming", ("enter",), "", "digits type a scaled value 0 to 1000, with a point a true Y; Enter sets it", "enter", "lut set", "scaled"),
    Action("nudge up", "blooming", ("plus", "equals_sign", "right"), "Up", "one step up, 0.007 decades", "nudge(1)", "lut scale", "--by"),
    Action("nudge down", "blooming", ("minus", "left"), "Down", "one step down", "nudge(-1)", "lut scale", "--by"),
    Action("nudge far up", "blooming", ("right_square_bracket",), "", "20 steps up", "nudge(20)", "lut scale", "--by"),
    Action("nudge far down", "blooming", ("left_square_bracket",), "", "20 steps down", "nudge(-20)", "lut scale", "--by"),
    Action("mark", "blooming", ("space",), "Mark", "mark the row for the next edits, or not", "mark", "lut scale", "--rows"),
    Action("mark down", "blooming", ("shift+down",), "", "mark the row and go on", "mark_and_move(1)", "lut scale", "--rows"),
    Action("mark up", "blooming", ("shift+up",), "", "mark the row and go back", "mark_and_move(-1)", "lut scale", "--rows"),
    Action("mark all", "blooming", ("a",), "", "mark all rows, or none", "mark_all", "lut scale", "--rows"),
    Action("smooth", "blooming", ("s",), "Smooth", "smooth the marked rows on the log scale", "smooth", "lut smooth", "log10"),
    Action("undo", "blooming", ("u", "ctrl+z"), "Undo", "take the last edit back", "undo", "lut undo", "back"),
    Action("redo", "blooming", ("r", "ctrl+y"), "Redo", "make it again", "redo", "lut undo", "again"),
    Action("diff", "blooming", ("d",), "", "what saving would change", "diff", "lut set", "--dry-run"),
    Action("save", "blooming", ("f5", "ctrl+s"), "Save", "show what changes, then save", "save", "lut set", "bytes"),
    Action("reload", "blooming", ("f6",), "", "read the table from the disk again", "reload", "lut show", "tables"),
    Action("next table", "blooming", ("t",), "", "the other table of the file: vertical, horizontal", "next_table", "lut set", "--table"),
    Action("next file", "blooming", ("o",), "", "the next LUT file", "next_file", "lut show", "FILE"),
    Action("next dataset", "blooming", ("n",), "Next", "the next distance", "next_dataset(1)", "bloom show", "SCAN"),
    Action("dataset before", "blooming", ("p",), "", "the distance before", "next_dataset(-1)", "bloom show", "SCAN"),
    Action("next model", "blooming", ("m",), "", "the next model", "next_model", "bloom show", "--model"),
    Action("next target", "blooming", ("k",), "", "the next retro-reflector of the model as the target", "next_target", "bloom show", "--target"),
    Action("feature", "blooming", ("v",), "View", "profile of AREA, PEAK, WIDTH, range", "feature", "bloom show", "AREA"),
)  # fmt: skip


def actions_of(screen: str) -> list[Action]:
    """What can be done on a screen: its own actions first, then those that are everywhere."""
    own = [a for a in ACTIONS if a.screen == screen and screen]
    return own + [a for a in ACTIONS if not a.screen]
