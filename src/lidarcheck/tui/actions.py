"""Every screen and every action of the interface: name, keys, help, method and its twin on the command line.

Footer, command palette, F1 and key bindings are made from these tables alone, and a test holds that each twin exists.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ACTIONS", "SCREENS", "Action", "Place", "actions_of", "command_of", "key_name", "page_actions"]


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
    "histograms": Place("Histograms", "f3", "H", "Hist", "vehicles, real against simulated", "vehicles compare", "distances"),
    "noise": Place("Noise", "f4", "N", "Noise", "range noise, detection and walk on panels", "panels", "panels"),
    "blooming": Place("Blooming", "f5", "B", "Bloom", "blooming tables and profiles", "bloom show", "profiles"),
    "ghosts": Place("Ghosts", "f6", "G", "Ghosts", "signs and their ghosts, step by step", "ghosts find", "ghosts"),
    "cloud": Place("Cloud", "f7", "C", "Cloud", "vehicles and frames as points, real and simulated", "vehicles merge", "beside"),
    "explain": Place("Explain", "f8", "E", "Explain", "which effect a model lacks", "explain", "model"),
    "goldens": Place("Goldens", "f9", "D", "Goldens", "what is proposed for the goldens", "review", "goldens"),
}  # fmt: skip
"""The screens by their names, in the order of their keys."""


class Action(NamedTuple):
    """`screen`: where it is, empty for everywhere. `keys`: the first is the one that is shown.

    `short`: one word for the footer, empty for none there. `method`: of the app or the screen, without `action_`.
    `twin`: the command that does the same, and `says`, a word of its help that shows so; or `reason`, why there is
    none.
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


# Why an action has no twin.
_PLACE = "which part of the interface is seen is not a matter of the command line"
_MOVE = "moves what is pointed at; commands are given rows and names"
_ALONE = "belongs to the interface alone"
_STOP = "Ctrl+C stops a command"
_BACK = "version control does it; the interface keeps what was there before"
_BY_HAND = "model.toml in --out is copied by hand"
_DROPPED = "a proposal is a file in .lidarcheck/proposals; the next check writes it anew"


def page_actions(screen: str, twin: str, says: str) -> tuple[Action, ...]:
    """The actions of a screen of pages that the command `twin` computes; `says`: a word of its help."""
    return (
        Action("move", screen, ("up", "down"), "", "the line above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
        Action("compute", screen, ("r", "enter"), "Run", "compute what is under the cursor", "compute", twin, says),
        Action("stop", screen, ("x", "escape"), "Stop", "stop what is computed", "stop", reason=_STOP),
        Action("next figures", screen, ("n", "right"), "Next", "the next figures of the page", "turn(1)", twin, "--plot"),
        Action("figures before", screen, ("p", "left"), "", "the figures before", "turn(-1)", twin, "--plot"),
        Action("kind", screen, ("v",), "View", "histogram, Q-Q, KDE, CDF, violin; clouds from top, side, front", "kind", twin, "--plot"),
        Action("words", screen, ("t",), "Tables", "words and tables of the page, or its figures", "words", twin, "--json"),
        Action("export", screen, ("e",), "Export", "write the page, the numbers and the pictures to a directory", "export", twin, "--out"),
        Action("look again", screen, ("ctrl+r", "R"), "", "look at the project's files again", "look_again", "info", "what is in it"),
    )  # fmt: skip


ACTIONS: tuple[Action, ...] = (
    # Everywhere
    *(Action(name, "", (p.key,), p.short, p.help, f"show('{name}')", p.twin, p.says) for name, p in SCREENS.items()),
    Action("help", "", ("f1",), "Help", "help for what has the focus", "help", "", "--help", _ALONE),
    Action("palette", "", ("ctrl+p", "f10"), "Find", "find any action by its name", "palette", reason=_PLACE),
    Action("jump", "", ("g",), "", "go to a screen or a pane by its label", "jump", reason=_PLACE),
    Action("log", "", ("L",), "Log", "show or hide the log", "log", reason=_PLACE),
    Action("theme", "", ("T",), "", "next theme: dark, light, high contrast, plain", "theme", "tui", "--theme"),
    Action("marks", "", ("M",), "", "plots of braille, of blocks, of ASCII, of one character a cell", "marks", "tui", "--marks"),
    Action("copy", "", ("c",), "", "copy the pane to the terminal's clipboard (OSC 52)", "copy", reason="a shell copies its own output"),
    Action("write", "", ("w",), "", "write the pane's text to a file; on Cloud both sides as one cloud", "write", reason="a shell writes to a file with >"),
    Action("baseline", "", ("B",), "", "compare numbers with what is set now, or no longer", "baseline", reason=_ALONE),
    Action("inputs", "", ("I",), "", "what the pane and the number are computed from: files, hashes, edit, sample, time, command", "inputs", reason="result.json says it of every result, in `computed_from`"),
    Action("next pane", "", ("tab",), "", "the next pane", "next_pane(1)", reason=_PLACE),
    Action("previous pane", "", ("shift+tab",), "", "the pane before", "next_pane(-1)", reason=_PLACE),
    Action("quit", "", ("q", "ctrl+q"), "Quit", "leave; what is not saved is kept and offered again", "leave", reason=_ALONE),
    # Overview
    Action("go", "overview", ("enter",), "Go", "the screen that shows the measurement; of a scenario: run it", "go", reason=_PLACE),
    Action("renew", "overview", ("r",), "Renew", "compute the number under the cursor again, or run the scenario", "renew", "gap", "helped"),
    Action("run all", "overview", ("R",), "Run all", "whole frames of all measurements with 64 seeds, or all scenarios", "all", "check", "all by default"),
    Action("cancel", "overview", ("escape", "x"), "Stop", "stop what is computed", "stop", reason=_STOP),
    Action("next distance", "overview", ("n",), "Dist", "look at the next distance", "distance(1)", reason=_MOVE),
    Action("distance before", "overview", ("p",), "", "look at the distance before", "distance(-1)", reason=_MOVE),
    Action("only fallen", "overview", ("f",), "Fallen", "show only what fell out or has a fault", "only_fallen", "check", "fell out"),
    Action("look again", "overview", ("ctrl+r",), "", "look at the project's files again", "look_again", "info", "what is in it"),
    # Histograms
    *page_actions("histograms", "vehicles compare", "real against simulated"),
    Action("model", "histograms", ("m",), "Model", "simulated files, or the next model to simulate with", "next_source", "vehicles compare", "--model"),
    Action("beside", "histograms", ("b",), "Beside", "both vehicles beside each other, from top and side, or the histograms", "beside", "vehicles merge", "beside"),
    Action("to the left", "histograms", ("plus", "equals_sign"), "", "beside: the simulated vehicle 0.25 m to the left (Y)", "nudge(0, 1)", "vehicles merge", "--y"),
    Action("to the right", "histograms", ("minus",), "", "beside: 0.25 m to the right (Y)", "nudge(0, -1)", "vehicles merge", "--y"),
    Action("forward", "histograms", ("right_square_bracket",), "", "beside: 0.25 m forward (X)", "nudge(1, 0)", "vehicles merge", "--x"),
    Action("backward", "histograms", ("left_square_bracket",), "", "beside: 0.25 m backward (X)", "nudge(-1, 0)", "vehicles merge", "--x"),
    Action("suggested", "histograms", ("s",), "", "beside: the offset that the vehicle's size suggests", "suggested", "vehicles merge", "suggested"),
    Action("merged cloud", "histograms", ("o",), "", "write both vehicles as one cloud (PCD)", "write_cloud", "vehicles merge", "--out"),
    Action("sheet", "histograms", ("i",), "Sheet", "write the histograms of all distances as one picture (PNG)", "write_sheet", "vehicles compare", "--out"),
    # Noise
    *page_actions("noise", "panels", "--model"),
    Action("model", "noise", ("m",), "Model", "the next model of the project, or none", "model", "panels", "--model"),
    Action("all panels", "noise", ("a",), "All", "figures of all panels together, or of the one under the cursor", "over_all", "panels", "--plot"),
    # Blooming
    Action("move", "blooming", ("up", "down"), "", "the row above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("type", "blooming", ("enter",), "", "digits type a scaled value 0 to 1000, with a point a true Y; Enter sets it", "enter", "lut set", "scaled"),
    Action("nudge up", "blooming", ("plus", "equals_sign"), "Up", "one step up, 0.007 decades", "nudge(1)", "lut scale", "--by"),
    Action("nudge down", "blooming", ("minus",), "Down", "one step down", "nudge(-1)", "lut scale", "--by"),
    Action("cell X", "blooming", ("left",), "", "type the row's X next", "cell('x')", "lut set", "another X"),
    Action("cell Y", "blooming", ("right",), "", "type the row's Y next", "cell('y')", reason=_MOVE),
    Action("add row", "blooming", ("i",), "Add", "a new row after this one: X between the two, Y on the line through them", "add_row", "lut add", "log10"),
    Action("remove rows", "blooming", ("D",), "Del", "take the marked rows out, or the one under the cursor", "remove_rows", "lut remove", "one must stay"),
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
    Action("save", "blooming", ("ctrl+s", "S"), "Save", "show what changes, then save", "save", "lut set", "bytes"),
    Action("reload", "blooming", ("ctrl+r", "R"), "", "read the table from the disk again", "reload", "lut show", "tables"),
    Action("next table", "blooming", ("t",), "", "the other table of the file: vertical, horizontal", "next_table", "lut set", "--table"),
    Action("next file", "blooming", ("o",), "", "the next LUT file", "next_file", "lut show", "FILE"),
    Action("next dataset", "blooming", ("n",), "Next", "the next distance", "next_dataset(1)", "bloom show", "SCAN"),
    Action("dataset before", "blooming", ("p",), "", "the distance before", "next_dataset(-1)", "bloom show", "SCAN"),
    Action("next model", "blooming", ("m",), "", "the next model", "next_model", "bloom show", "--model"),
    Action("next target", "blooming", ("k",), "", "the next retro-reflector of the model as the target", "next_target", "bloom show", "--target"),
    Action("settings", "blooming", ("E",), "Settings", "the settings of each distance in the table's place, and back", "settings", "bloom settings", "each distance"),
    Action("add distance", "blooming", ("A",), "", "settings for one more distance, as those of the nearest one", "add_distance", "bloom settings", "--set"),
    Action("remove distance", "blooming", ("X",), "", "take out the settings of the distance under the cursor", "remove_distance", "bloom settings", "--remove"),
    Action("arrange", "blooming", ("V",), "Four", "all four features of one distance, or distances side by side", "arrange", "bloom show", "Range, PEAK"),
    Action("feature", "blooming", ("v",), "View", "profile of AREA, PEAK, WIDTH, range", "feature", "bloom show", "AREA"),
    # Ghosts
    *page_actions("ghosts", "ghosts find", "--model"),
    Action("step", "ghosts", ("s",), "Step", "the next step of the extraction, from all points to what is left", "step(1)", "ghosts find", "--steps"),
    Action("step back", "ghosts", ("b",), "", "the step before", "step(-1)", "ghosts find", "--steps"),
    Action("model", "ghosts", ("m",), "Model", "the next model of the project, or none", "model", "ghosts find", "--model"),
    Action("least", "ghosts", ("i",), "", "the least AREA (or INTENSITY, ...) of a sign's echo; 0: by the sensor", "least", "ghosts find", "--bright"),
    Action("strip", "ghosts", ("d",), "PCD", "write what is left as PCD; of a fit, the model with the effect", "strip", "ghosts find", "stripped"),
    # Cloud
    Action("move", "cloud", ("up", "down", "k", "j"), "", "the cursor a row up, down; in the maps the list; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("to the left", "cloud", ("left", "h"), "", "the cursor a column to the left; in the maps the figures before", "across(-1)", reason=_MOVE),
    Action("to the right", "cloud", ("right", "l"), "", "the cursor a column to the right; in the maps the next figures", "across(1)", reason=_MOVE),
    Action("view", "cloud", ("v",), "View", "from above, behind, the side; merged; the whole frame; maps of where they disagree", "kind", "vehicles merge", "--plot"),
    Action("step up", "cloud", ("plus", "equals_sign"), "Zoom", "twice as near, about the cursor", "zoom(2)", reason=_PLACE),
    Action("step down", "cloud", ("minus",), "", "twice as far", "zoom(0.5)", reason=_PLACE),
    Action("fit", "cloud", ("0",), "Fit", "show all again", "fit", reason=_PLACE),
    Action("beside", "cloud", ("b",), "Over", "one side over the other, or beside it", "over", "vehicles merge", "beside"),
    Action("next distance", "cloud", ("n",), "Next", "the next measurement", "turn(1)", "vehicles merge", "REAL"),
    Action("distance before", "cloud", ("p",), "", "the measurement before", "turn(-1)", "vehicles merge", "REAL"),
    Action("renew", "cloud", ("r",), "", "compute what is seen: the clouds, or the comparison", "compute", "scenes compare", "measured frames"),
    Action("enter", "cloud", ("enter",), "", "name the beams under the cursor; in the maps compute", "beams", reason=_MOVE),
    Action("stop", "cloud", ("x", "escape"), "", "stop what is computed", "stop", reason=_STOP),
    Action("step ahead", "cloud", ("right_square_bracket",), "", "merged: the simulated vehicle 0.25 m forward (X)", "nudge(1, 0)", "vehicles merge", "--x"),
    Action("step back", "cloud", ("left_square_bracket",), "", "merged: 0.25 m backward (X)", "nudge(-1, 0)", "vehicles merge", "--x"),
    Action("left", "cloud", ("right_curly_bracket",), "", "merged: the simulated vehicle 0.25 m to the left (Y)", "nudge(0, 1)", "vehicles merge", "--y"),
    Action("right", "cloud", ("left_curly_bracket",), "", "merged: 0.25 m to the right (Y)", "nudge(0, -1)", "vehicles merge", "--y"),
    Action("suggested", "cloud", ("s",), "", "merged: the offset that the vehicle's size suggests", "suggested", "vehicles merge", "suggested"),
    Action("next model", "cloud", ("m",), "", "the next model to simulate with", "next_model", "scenes compare", "--model"),
    Action("settings", "cloud", ("E",), "", "switch effects of the model, and others, on and off", "effects", "scenes compare", "--effects"),
    Action("own effects", "cloud", ("d",), "", "the model's own effects again, and no others", "own_effects", "scenes compare", "--without"),
    Action("tables", "cloud", ("t",), "", "maps: words and tables of the comparison, or its figures", "words", "scenes compare", "--json"),
    Action("export", "cloud", ("e",), "", "maps: write the comparison's page, numbers and pictures to a directory", "export", "scenes compare", "--out"),
    Action("read again", "cloud", ("ctrl+r", "R"), "", "look at the project's files again", "look_again", "info", "what is in it"),
    # Explain
    Action("move", "explain", ("up", "down"), "", "the case above, below, or the text up and down; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("explain", "explain", ("r", "enter"), "Run", "explain the case under the cursor; goes on where it was stopped", "explain", "explain", "CASE"),
    Action("stop", "explain", ("escape", "x"), "Stop", "stop, what was done is kept; once more: end it at once", "stop", reason=_STOP),
    Action("view", "explain", ("v",), "View", "the next part of the answer: effects, gap, where, candidates ...", "view(1)", reason=_PLACE),
    Action("view before", "explain", ("b",), "", "the part of the answer before", "view(-1)", reason=_PLACE),
    Action("seed", "explain", ("s",), "Seed", "the seed of the next run", "seed", "explain", "--seed"),
    Action("exclude", "explain", ("e",), "", "effects that the next run is not to name", "exclude", "explain", "--exclude"),
    Action("accept", "explain", ("a",), "Accept", "take the explained model over: show the difference, then write", "accept", reason=_BY_HAND),
    Action("take back", "explain", ("u", "ctrl+z"), "Undo", "take back what was accepted last", "take_back", reason=_BACK),
    Action("look again", "explain", ("ctrl+r", "R"), "", "look at the cases and their results again", "look", "info", "what is in it"),
    # Goldens
    Action("move", "goldens", ("up", "down"), "", "the line above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("review", "goldens", ("r", "enter"), "Review", "run all 64 seeds of the scenario under the cursor, and say what speaks against accepting", "review_one", "review", "SCENARIO"),
    Action("review every", "goldens", ("e",), "Every", "review every scenario of the project", "review_every", "review", "all by default"),
    Action("accept", "goldens", ("a",), "Accept", "accept the marked KPIs of the scenario, or all of it: review, reason, diff, then write", "accept", "review", "--accept"),
    Action("accept all", "goldens", ("A",), "", "accept all that is listed", "accept_all", "review", "all"),
    Action("mark", "goldens", ("space",), "Mark", "mark the KPI for accepting, or not", "mark", "review", "KPIs to accept"),
    Action("drop", "goldens", ("d",), "Drop", "reject: drop the proposal, the golden stays", "drop", reason=_DROPPED),
    Action("stop", "goldens", ("escape", "x"), "Stop", "stop the review", "stop", reason=_STOP),
    Action("look", "goldens", ("ctrl+r", "R"), "", "look at goldens and proposals again", "look", "review", "proposed"),
)  # fmt: skip


def actions_of(screen: str) -> list[Action]:
    """What can be done on a screen: its own actions first, then those that are everywhere."""
    own = [a for a in ACTIONS if a.screen == screen and screen]
    return own + [a for a in ACTIONS if not a.screen]


def command_of(screen: str) -> str:
    """The command that computes what a screen of pages shows; empty where none does."""
    named = ("compute", "renew")
    return next((action.twin for action in ACTIONS if action.screen == screen and action.name in named), "")


_KEY_NAMES = {
    "plus": "+", "minus": "-", "equals_sign": "=", "right_square_bracket": "]", "left_square_bracket": "[",
    "left_curly_bracket": "{", "right_curly_bracket": "}",
    "escape": "Esc", "pagedown": "PgDn", "pageup": "PgUp",
}  # fmt: skip


def key_name(key: str) -> str:
    """A key as people call it."""
    if key in _KEY_NAMES:
        return _KEY_NAMES[key]
    if key.startswith("ctrl+"):
        return f"^{key[5:].upper()}"
    return key if len(key) == 1 else "+".join(part.capitalize() for part in key.split("+"))
