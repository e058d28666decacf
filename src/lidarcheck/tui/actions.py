"""Every screen and every action of the interface: name, keys, help, method and its twin on the command line.

Footer, menu, palette, F1 and key bindings are made from these tables alone. A test holds that each twin exists, and
that a key means one thing wherever it exists: its name is the same on every screen, its help says what that is there.
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
    """`name`: what its keys mean, on every screen. `screen`: where it is, empty for everywhere. `keys`: the first is the
    one that is shown; without any it is in menu and palette alone.

    `short`: one word for the footer behind the key, or the whole entry, empty for none there. `method`: of the app or the screen, without `action_`.
    `pane`: the kind of pane whose own the action is, empty for the screen's. `twin`: the command that does the same, and `says`, a word of its help that shows so; or `reason`, why there is
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
    pane: str = ""


# Why an action has no twin.
_PLACE = "which part of the interface is seen is not a matter of the command line"
_MOVE = "moves what is pointed at; commands are given rows and names"
_ALONE = "belongs to the interface alone"
_STOP = "Ctrl+C stops a command"
_STOPS = ("x", "escape", "ctrl+g")
_BACK = "version control does it; the interface keeps what was there before"
_BY_HAND = "model.toml in --out is copied by hand"
_DROPPED = "a proposal is a file in .lidarcheck/proposals; the next check writes it anew"


_UP_DOWN = ("up", "down", "k", "j")


def page_actions(screen: str, twin: str, says: str) -> tuple[Action, ...]:
    """The actions of a screen of pages that the command `twin` computes; `says`: a word of its help."""
    return (
        Action("move", screen, _UP_DOWN, "", "the line above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
        Action("feature", screen, ("f",), "Feature", "the next figures of the page", "turn(1)", twin, "--plot"),
        Action("view", screen, ("v",), "View", "histogram, Q-Q, KDE, CDF, violin; clouds from top, side, front", "kind", twin, "--plot"),
        Action("renew", screen, ("r",), "Renew", "compute what is under the cursor", "compute", twin, says),
        Action("enter", screen, ("enter",), "", "compute what is under the cursor", "compute", twin, says),
        Action("stop", screen, _STOPS, "", "stop what is computed", "stop", reason=_STOP),
        Action("next distance", screen, ("n",), "n/p Dist", "the next measurement", "next_distance(1)", twin, says),
        Action("distance before", screen, ("p",), "", "the measurement before", "next_distance(-1)", twin, says),
        Action("to the right", screen, ("right", "l"), "", "the next figures of the page", "turn(1)", twin, "--plot"),
        Action("to the left", screen, ("left", "h"), "", "the figures before", "turn(-1)", twin, "--plot"),
        Action("tables", screen, ("t",), "Tables", "words and tables of the page, or its figures", "words", twin, "--json"),
        Action("export", screen, ("e",), "Export", "write the page, the numbers and the pictures to a directory", "export", twin, "--out"),
        Action("read again", screen, ("ctrl+r",), "", "look at the project's files again", "look_again", "info", "what is in it"),
    )  # fmt: skip


ACTIONS: tuple[Action, ...] = (
    # Everywhere
    *(Action(name, "", (p.key,), p.short, p.help, f"show('{name}')", p.twin, p.says) for name, p in SCREENS.items()),
    Action("open", "", ("o",), "Open", "find a measurement, scenario, file, model, feature, target, effect, and go there", "open", reason=_PLACE),
    Action("menu", "", ("m",), "", "what can be done here, with its keys", "menu", reason=_PLACE),
    Action("jump", "", ("g",), "", "go to a screen or a pane by its letter", "jump", reason=_PLACE),
    Action("next pane", "", ("tab",), "", "the next pane", "next_pane(1)", reason=_PLACE),
    Action("previous pane", "", ("shift+tab",), "", "the pane before", "next_pane(-1)", reason=_PLACE),
    Action("log", "", ("L",), "", "show or hide the log", "log", reason=_PLACE),
    Action("theme", "", ("T",), "", "next theme: dark, light, high contrast, plain", "theme", "tui", "--theme"),
    Action("marks", "", ("M",), "", "plots of braille, of blocks, of ASCII, of one character a cell", "marks", "tui", "--marks"),
    Action("draw again", "", ("ctrl+l",), "", "draw the whole screen again, after something else has written into it", "draw_again", reason=_ALONE),
    Action("copy", "", ("c",), "", "copy the pane to the terminal's clipboard (OSC 52)", "copy", reason="a shell copies its own output"),
    Action("write", "", ("w",), "", "write the pane's text to a file; on Cloud both sides as one cloud", "write", reason="a shell writes to a file with >"),
    Action("undo", "", ("u", "ctrl+z"), "", "take the last edit of all files back", "undo", "lut undo", "back"),
    Action("redo", "", ("U", "ctrl+y"), "", "make it again", "redo", "lut undo", "again"),
    Action("save", "", ("S", "ctrl+s"), "", "show what changes in which file, then save all", "save", "lut set", "bytes"),
    Action("difference", "", ("d",), "", "what saving would change", "difference", "lut set", "--dry-run"),
    Action("baseline", "", ("B",), "", "compare numbers with what is set now, or no longer", "baseline", reason=_ALONE),
    Action("show baseline", "", ("apostrophe",), "", "the baseline in the place of what is set now, in numbers, plots and pages; and back", "show_baseline", reason=_ALONE),
    Action("zoom pane", "", ("z",), "", "the pane on the whole screen, or all panes again", "zoom_pane", reason=_PLACE),
    Action("inputs", "", ("I",), "", "what the pane and the number are computed from: files, hashes, edit, sample, time, command", "inputs", reason="result.json says it of every result, in `computed_from`"),
    Action("help", "", ("question_mark", "f1"), "Help", "help for what has the focus", "help", "", "--help", _ALONE),
    Action("palette", "", ("ctrl+p", "f10", "colon"), "Find", "find any action by its name", "palette", reason=_PLACE),
    Action("quit", "", ("q", "ctrl+q"), "Quit", "leave; what is not saved is kept and offered again", "leave", reason=_ALONE),
    Action("calibrate", "", (), "", "fit numbers of the model to measured frames, and take them over", "form('calibrate')", "calibrate", "fitted numbers"),
    Action("simulate to a file", "", (), "", "run an ideal scan through the model, to a new file", "form('simulate')", "simulate", "Where the echoes go"),
    Action("compare with a simulated scan", "", (), "", "the KPIs of a measured scan against a simulated one", "form('compare')", "compare", "simulated"),
    Action("explain this measurement", "", (), "", "make a case of the measurement that is chosen, and explain it", "form('explain')", "case make", "explain"),
    Action("runs", "", (), "", "the commands that were started here: how each ended, what it printed, take it over", "runs", reason=_ALONE),
    Action("stop the command", "", (), "", "stop the command that runs; once more: end it at once", "stop_command", reason=_STOP),
    # Overview
    Action("move", "overview", _UP_DOWN, "", "the line above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("enter", "overview", ("enter",), "Go", "the screen that shows the measurement; of a scenario: run it", "go", reason=_PLACE),
    Action("renew", "overview", ("r",), "Renew", "compute the number under the cursor again, or run the scenario", "renew", "gap", "helped"),
    Action("run all", "overview", ("R",), "R Run all", "whole frames of all measurements with 64 seeds, or all scenarios", "all", "check", "all by default"),
    Action("stop", "overview", _STOPS, "", "stop what is computed", "stop", reason=_STOP),
    Action("next distance", "overview", ("n",), "n/p Dist", "look at the next distance", "distance(1)", reason=_MOVE),
    Action("distance before", "overview", ("p",), "", "look at the distance before", "distance(-1)", reason=_MOVE),
    Action("view", "overview", ("v",), "View", "show only what fell out or has a fault, or everything", "only_fallen", "check", "fell out"),
    Action("read again", "overview", ("ctrl+r",), "", "look at the project's files again", "look_again", "info", "what is in it"),
    # Histograms
    *page_actions("histograms", "vehicles compare", "real against simulated"),
    Action("next source", "histograms", (), "", "compare with the simulated files, or with what the next model makes of the ideal scans", "next_source", "vehicles compare", "--model"),
    Action("beside", "histograms", ("b",), "Beside", "both vehicles beside each other as points: Cloud", "beside", "vehicles merge", "beside"),
    Action("sheet", "histograms", (), "", "write the histograms of all distances as one picture (PNG)", "write_sheet", "vehicles compare", "--out"),
    # Noise
    *page_actions("noise", "panels", "--model"),
    Action("next model", "noise", (), "", "the next model of the project, or none", "model", "panels", "--model"),
    Action("beside", "noise", ("b",), "All", "figures of all panels together, or of the one under the cursor", "over_all", "panels", "--plot"),
    # Blooming
    Action("move", "blooming", _UP_DOWN, "", "the row above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("enter", "blooming", ("enter",), "Edit", "digits type a scaled value 0 to 1000, with a point a true Y; Enter sets it", "enter", "lut set", "scaled"),
    Action("add", "blooming", ("i",), "Add", "a new row after this one: X between the two, Y on the line through them; among settings one more distance", "add_row", "lut add", "log10"),
    Action("take out", "blooming", ("D",), "Del", "take the marked rows out, or the one under the cursor; among settings the distance under the cursor", "remove_rows", "lut remove", "one must stay"),
    Action("step up", "blooming", ("plus", "equals_sign"), "+- Nudge", "one step up, 0.007 decades", "nudge(1)", "lut scale", "--by"),
    Action("step down", "blooming", ("minus",), "", "one step down", "nudge(-1)", "lut scale", "--by"),
    Action("smooth", "blooming", ("s",), "Smooth", "smooth the marked rows on the log scale", "smooth", "lut smooth", "log10"),
    Action("fit to data", "blooming", ("F",), "", "fit the table to several distances: a form, then the fitted table as a curve, then take it over", "fit", "bloom fit", "fitted table"),
    Action("stop", "blooming", ("x",), "", "stop the command that runs; once more: end it at once", "stop", reason=_STOP),
    Action("undo", "blooming", ("u", "ctrl+z"), "Undo", "take the last edit of all files back", "app.undo", "lut undo", "back"),
    Action("redo", "blooming", ("U", "ctrl+y"), "Redo", "make it again", "app.redo", "lut undo", "again"),
    Action("save", "blooming", ("S", "ctrl+s"), "Save", "show what changes in which file, then save all", "app.save", "lut set", "bytes"),
    Action("next distance", "blooming", ("n",), "n/p Dist", "the next distance", "next_dataset(1)", "bloom show", "SCAN"),
    Action("distance before", "blooming", ("p",), "", "the distance before", "next_dataset(-1)", "bloom show", "SCAN"),
    Action("feature", "blooming", ("f",), "Feature", "profile of the next of the sensor's features", "feature", "bloom show", "AREA"),
    Action("mark", "blooming", ("space",), "Mark", "mark the row for the next edits, or not", "mark", "lut scale", "--rows"),
    Action("to the left", "blooming", ("left", "h"), "", "type the row's X next", "cell('x')", "lut set", "another X"),
    Action("to the right", "blooming", ("right", "l"), "", "type the row's Y next", "cell('y')", reason=_MOVE),
    Action("step ahead", "blooming", ("right_square_bracket",), "", "20 steps up", "nudge(20)", "lut scale", "--by"),
    Action("step back", "blooming", ("left_square_bracket",), "", "20 steps down", "nudge(-20)", "lut scale", "--by"),
    Action("mark down", "blooming", ("shift+down",), "", "mark the row and go on", "mark_and_move(1)", "lut scale", "--rows"),
    Action("mark up", "blooming", ("shift+up",), "", "mark the row and go back", "mark_and_move(-1)", "lut scale", "--rows"),
    Action("mark all", "blooming", ("asterisk",), "", "mark all rows, or none", "mark_all", "lut scale", "--rows"),
    Action("read again", "blooming", ("ctrl+r",), "", "read the table from the disk again", "reload", "lut show", "tables"),
    Action("beside", "blooming", ("b",), "", "all features of one distance, or distances side by side", "arrange", "bloom show", "Range, PEAK"),
    Action("settings", "blooming", ("E",), "Settings", "the settings of each distance in the table's place, and back", "settings", "bloom settings", "each distance"),
    Action("other table", "blooming", (), "", "the other table of the file: vertical, horizontal", "next_table", "lut set", "--table"),
    Action("next file", "blooming", (), "", "the next LUT file", "next_file", "lut show", "FILE"),
    Action("next model", "blooming", (), "", "the next model", "next_model", "bloom show", "--model"),
    Action("next target", "blooming", (), "", "the next retro-reflector of the model as the target", "next_target", "bloom show", "--target"),
    # Ghosts
    *page_actions("ghosts", "ghosts find", "--model"),
    Action("step ahead", "ghosts", ("right_square_bracket",), "] Step", "the next step of the extraction, from all points to what is left", "step(1)", "ghosts find", "--steps"),
    Action("step back", "ghosts", ("left_square_bracket",), "", "the step before", "step(-1)", "ghosts find", "--steps"),
    Action("next model", "ghosts", (), "", "the next model of the project, or none", "model", "ghosts find", "--model"),
    Action("fit to data", "ghosts", ("F",), "", "fit the ghost effect to signs at several ranges, and take it over", "fit", "ghosts fit", "the fitted effect"),
    Action("least amplitude", "ghosts", (), "", "the least AREA (or INTENSITY, ...) of a sign's echo; 0: by the sensor", "least", "ghosts find", "--bright"),
    Action("stripped points", "ghosts", (), "", "write what is left as PCD; of a fit, the model with the effect", "strip", "ghosts find", "stripped"),
    # Cloud
    Action("move", "cloud", _UP_DOWN, "", "the cursor a row up, down; in the maps the list; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("to the left", "cloud", ("left", "h"), "", "the cursor a column to the left; in the maps the figures before", "across(-1)", reason=_MOVE),
    Action("to the right", "cloud", ("right", "l"), "", "the cursor a column to the right; in the maps the next figures", "across(1)", reason=_MOVE),
    Action("view", "cloud", ("v",), "View", "from above, behind, the side; merged; the whole frame; maps of where they disagree", "kind", "vehicles merge", "--plot"),
    Action("step up", "cloud", ("plus", "equals_sign"), "+- Zoom", "twice as near, about the cursor", "zoom(2)", reason=_PLACE),
    Action("step down", "cloud", ("minus",), "", "twice as far", "zoom(0.5)", reason=_PLACE),
    Action("fit", "cloud", ("0",), "Fit", "show all again", "fit", reason=_PLACE),
    Action("beside", "cloud", ("b",), "Over", "one side over the other, or beside it", "over", "vehicles merge", "beside"),
    Action("next distance", "cloud", ("n",), "n/p Dist", "the next measurement", "turn(1)", "vehicles merge", "REAL"),
    Action("distance before", "cloud", ("p",), "", "the measurement before", "turn(-1)", "vehicles merge", "REAL"),
    Action("renew", "cloud", ("r",), "", "compute what is seen: the clouds, or the comparison", "compute", "scenes compare", "measured frames"),
    Action("enter", "cloud", ("enter",), "", "name the beams under the cursor; in the maps compute", "beams", reason=_MOVE),
    Action("stop", "cloud", _STOPS, "", "stop what is computed", "stop", reason=_STOP),
    Action("step ahead", "cloud", ("right_square_bracket",), "", "merged: the simulated vehicle 0.25 m forward (X)", "nudge(1, 0)", "vehicles merge", "--x"),
    Action("step back", "cloud", ("left_square_bracket",), "", "merged: 0.25 m backward (X)", "nudge(-1, 0)", "vehicles merge", "--x"),
    Action("left", "cloud", ("right_curly_bracket",), "", "merged: the simulated vehicle 0.25 m to the left (Y)", "nudge(0, 1)", "vehicles merge", "--y"),
    Action("right", "cloud", ("left_curly_bracket",), "", "merged: 0.25 m to the right (Y)", "nudge(0, -1)", "vehicles merge", "--y"),
    Action("suggested", "cloud", (), "", "merged: the offset that the vehicle's size suggests", "suggested", "vehicles merge", "suggested"),
    Action("next model", "cloud", (), "", "the next model to simulate with", "next_model", "scenes compare", "--model"),
    Action("settings", "cloud", ("E",), "", "switch effects of the model, and others, on and off", "effects", "scenes compare", "--effects"),
    Action("own effects", "cloud", (), "", "the model's own effects again, and no others", "own_effects", "scenes compare", "--without"),
    Action("tables", "cloud", ("t",), "", "maps: words and tables of the comparison, or its figures", "words", "scenes compare", "--json"),
    Action("export", "cloud", ("e",), "", "maps: write the comparison's page, numbers and pictures to a directory", "export", "scenes compare", "--out"),
    Action("read again", "cloud", ("ctrl+r",), "", "look at the project's files again", "look_again", "info", "what is in it"),
    # Explain
    Action("move", "explain", _UP_DOWN, "", "the case above, below, or the text up and down; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("renew", "explain", ("r",), "Run", "explain the case under the cursor; goes on where it was stopped", "explain", "explain", "CASE"),
    Action("enter", "explain", ("enter",), "", "explain the case under the cursor; goes on where it was stopped", "explain", "explain", "CASE"),
    Action("stop", "explain", _STOPS, "Stop", "stop, what was done is kept; once more: end it at once", "stop", reason=_STOP),
    Action("view", "explain", ("v",), "View", "the next part of the answer: effects, gap, where, candidates ...", "view(1)", reason=_PLACE),
    Action("to the right", "explain", ("right", "l"), "", "the next part of the answer", "view(1)", reason=_PLACE),
    Action("to the left", "explain", ("left", "h"), "", "the part of the answer before", "view(-1)", reason=_PLACE),
    Action("accept", "explain", ("a",), "Accept", "take the explained model over: show the difference, then write", "accept", reason=_BY_HAND),
    Action("undo", "explain", ("u", "ctrl+z"), "Undo", "take back what was accepted or edited last; also what an earlier session has accepted", "undo", reason=_BACK),
    Action("seed", "explain", (), "", "the seed of the next run", "seed", "explain", "--seed"),
    Action("exclude", "explain", (), "", "effects that the next run is not to name", "exclude", "explain", "--exclude"),
    Action("read again", "explain", ("ctrl+r",), "", "look at the cases and their results again", "look", "info", "what is in it"),
    # Goldens
    Action("move", "goldens", _UP_DOWN, "", "the line above, below; also Page Up, Page Down, Home, End", "", reason=_MOVE),
    Action("renew", "goldens", ("r",), "Review", "run all 64 seeds of the scenario under the cursor, and say what speaks against accepting", "review_one", "review", "SCENARIO"),
    Action("enter", "goldens", ("enter",), "", "review the scenario under the cursor", "review_one", "review", "SCENARIO"),
    Action("run all", "goldens", ("R",), "All", "review every scenario of the project", "review_every", "review", "all by default"),
    Action("mark", "goldens", ("space",), "Mark", "mark the KPI for accepting, or not", "mark", "review", "KPIs to accept"),
    Action("accept", "goldens", ("a",), "Accept", "accept the marked KPIs of the scenario, or all of it: review, reason, diff, then write", "accept", "review", "--accept"),
    Action("accept all", "goldens", ("A",), "", "accept all that is listed", "accept_all", "review", "all"),
    Action("take out", "goldens", ("D",), "Drop", "reject: drop the proposal, the golden stays", "drop", reason=_DROPPED),
    Action("stop", "goldens", _STOPS, "", "stop the review", "stop", reason=_STOP),
    Action("read again", "goldens", ("ctrl+r",), "", "look at goldens and proposals again", "look", "review", "proposed"),
)  # fmt: skip


def actions_of(screen: str, pane: str = "") -> list[Action]:
    """What can be done on a screen: what is the focused pane's own first, then the screen's, then what is everywhere,
    as far as the screen does not say of its own what that is here.
    """
    own = [a for a in ACTIONS if a.screen == screen and screen]
    if pane == "plot":
        plot = plot_actions()
        taken = {key for action in plot for key in action.keys}
        own = [*plot, *(action for action in own if not taken.intersection(action.keys))]
    names = {action.name for action in own if action.screen}
    return own + [a for a in ACTIONS if not a.screen and a.name not in names]


def plot_actions() -> list[Action]:
    """What a plot that has the focus can do, whatever screen it is on."""
    from lidarcheck.tui.plots.plot import PLOT_KEYS

    return [
        Action(method, "", tuple(keys.split(",")), short, words, method, reason=_MOVE, pane="plot")
        for keys, method, short, words in PLOT_KEYS
    ]


def command_of(screen: str) -> str:
    """The command that computes what a screen of pages shows; empty where none does."""
    return next((action.twin for action in ACTIONS if (action.screen, action.name) == (screen, "renew")), "")


_KEY_NAMES = {
    "plus": "+", "minus": "-", "equals_sign": "=", "right_square_bracket": "]", "left_square_bracket": "[",
    "escape": "Esc", "pagedown": "PgDn", "pageup": "PgUp", "question_mark": "?", "colon": ":", "asterisk": "*",
    "less_than_sign": "<", "greater_than_sign": ">", "apostrophe": "'", "left_curly_bracket": "{",
    "right_curly_bracket": "}",
}  # fmt: skip


def key_name(key: str) -> str:
    """A key as people call it."""
    if key in _KEY_NAMES:
        return _KEY_NAMES[key]
    if key.startswith("ctrl+"):
        return f"^{key[5:].upper()}"
    return key if len(key) == 1 else "+".join(part.capitalize() for part in key.split("+"))
