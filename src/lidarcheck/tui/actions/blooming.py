"""What can be done on the screen Blooming."""

from __future__ import annotations

from lidarcheck.tui.actions.action import MOVE, Action

__all__ = ["BLOOMING"]

BLOOMING: tuple[Action, ...] = (
    Action("move", "blooming", ("up", "down"), "", "the row above, below; also Page Up, Page Down, Home, End", "", reason=MOVE),
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
)  # fmt: skip
